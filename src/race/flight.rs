//! Races: all of a batch step together under one controller.

use rayon::prelude::*;

use super::controller::{Active, Controller, Decision};
use crate::error::Result;
use crate::race::system::DroneRace;
use crate::scenario::Watch;
use crate::system::System;

/// Duration of a control step, s.
pub const STEP_SECONDS: f64 = 0.1;

/// A race from its start to its end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    /// States, one more than decisions; the last is the first at or past the gate's plane, or that
    /// of the last step.
    pub states: Vec<[f32; 12]>,
    /// What was decided at each step.
    pub decisions: Vec<Decision>,
}

/// Flies a race from each of `starts`, at most `steps` steps; `seeds` are those of their random
/// numbers. What a race comes to does not depend on the others.
///
/// # Errors
/// Those of the controller, and [`crate::Error::Interrupted`].
pub fn fly(
    controller: &mut dyn Controller,
    system: &DroneRace,
    starts: &[[f32; 12]],
    seeds: &[u64],
    steps: u32,
    watch: &dyn Watch,
) -> Result<Vec<Flight>> {
    let begin = |start: &[f32; 12]| Flight { states: vec![*start], decisions: Vec::new() };
    let mut flights: Vec<Flight> = starts.iter().map(begin).collect();
    for step in 0..steps {
        let active: Vec<Active> = flights
            .iter()
            .zip(seeds)
            .enumerate()
            .filter_map(|(place, (flight, &seed))| {
                let state = *flight.states.last().filter(|state| under_way(state))?;
                Some(Active { place, seed, state })
            })
            .collect();
        // Races that are over count as done, so that the work is known beforehand.
        watch.advance((flights.len() - active.len()) as u64)?;
        if active.is_empty() {
            continue;
        }
        let decisions = controller.decide(step, &active)?;
        let moved =
            |(race, decision): (&Active, &Decision)| system.step(race.state, decision.control);
        let next: Vec<[f32; 12]> = active.par_iter().zip(&decisions).map(moved).collect();
        for ((race, decision), state) in active.iter().zip(decisions).zip(next) {
            flights[race.place].states.push(state);
            flights[race.place].decisions.push(decision);
        }
        watch.advance(active.len() as u64)?;
    }
    Ok(flights)
}

/// Whether a race goes on: short of the gate's plane, and finite.
fn under_way(state: &[f32; 12]) -> bool {
    state[2] < 0.0 && state.iter().all(|x| x.is_finite())
}

/// The seed of the random numbers of race `race` with noise seed `noise_seed`: two rounds of
/// SplitMix64, so that neighbouring races and seeds have unrelated streams.
pub fn race_seed(noise_seed: u64, race: u64) -> u64 {
    split_mix(split_mix(noise_seed) ^ race)
}

/// The output function of SplitMix64 (Steele, Lea and Flood 2014).
fn split_mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
