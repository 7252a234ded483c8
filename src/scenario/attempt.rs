//! Which attempt at its claims a certificate is, and what that costs.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use crate::error::{Error, Result};

/// Most attempts: what they leave of beta supports no claim.
const MOST_ATTEMPTS: u32 = 1_000_000;

/// A numbered attempt, as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttemptRecord {
    /// Its number, from 1.
    pub number: u32,
    /// The share of every beta asked for that it books.
    #[serde(with = "crate::files::number")]
    pub share: f64,
}

/// The share of beta that attempt number `attempt` books, `6 / (pi^2 k^2)`: all attempts from 1 on
/// together book no more than beta.
///
/// ```
/// use reachcast::scenario::attempt_share;
/// let booked: f64 = (1..10_000).map(attempt_share).sum();
/// assert!(booked < 1.0 && booked > 0.9999);
/// ```
pub fn attempt_share(attempt: u32) -> f64 {
    6.0 / (PI * f64::from(attempt)).powi(2)
}

impl Settings {
    /// The same claims as attempt number `attempt`: every beta is the share of it that this attempt books.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a number that no attempt has.
    pub fn as_attempt(mut self, attempt: u32) -> Result<Self> {
        if !(1..=MOST_ATTEMPTS).contains(&attempt) {
            let problem = format!("{attempt} is not within 1..={MOST_ATTEMPTS}");
            return Err(Error::invalid("attempt", problem));
        }
        let share = attempt_share(attempt);
        self.attempt = Some(attempt);
        self.deviation.beta *= share;
        self.global.beta *= share;
        self.growth.beta *= share;
        self.sequential.iter_mut().for_each(|asked| asked.beta *= share);
        self.whole_box.iter_mut().for_each(|asked| asked.beta *= share);
        self.deterministic.iter_mut().for_each(|asked| asked.beta *= share);
        if let Some(drops) = &mut self.drops {
            drops.sample.beta *= share;
            drops.calibration.iter_mut().for_each(|asked| asked.beta *= share);
        }
        Ok(self)
    }

    /// What the record says of the attempt.
    pub(super) fn attempt_record(&self) -> Option<AttemptRecord> {
        self.attempt.map(|number| AttemptRecord { number, share: attempt_share(number) })
    }
}
