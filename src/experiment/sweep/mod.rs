//! Sweeps: a grid of settings, raced or certified point by point.

pub mod record;
