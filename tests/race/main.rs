//! Races: whole experiments, and their input.

mod experiment;
mod input;
