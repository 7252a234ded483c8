//! Metrics of a race in SI units.
