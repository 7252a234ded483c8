//! Tests of the native CPU backend.
