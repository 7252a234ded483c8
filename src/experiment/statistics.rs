//! Comparison of controllers: intervals, and paired tests on the same starts.
