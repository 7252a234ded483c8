//! The random key of the streams that claims rest on: from the seed, and from what is claimed about.
//!
//! A policy that was tuned on what seed 1 draws is certified on other samples by seed 1: the policy is
//! part of the key. Backend, threads, paths and words are not, so that they change no number.

use std::fmt::Write;

use super::drops_settings::DropSettings;
use super::growth_plan::Around;
use super::key_source::Keys;
use super::origin::{Hashes, hashes};
use super::settings::{GrowthSettings, Settings};
use crate::digest::sha256;
use crate::model::Plant;
use crate::rollout::{Purpose, Stream};

impl Settings {
    /// The stream number `number` of a purpose that a claim rests on, of settings that are [`Self::keyed`].
    pub fn stream(&self, purpose: Purpose, number: u32) -> Stream {
        let seed = match self.keys {
            Keys::Derived(key) => key,
            Keys::Seed | Keys::Claim => self.seed,
        };
        Stream::new(seed, purpose, number)
    }

    /// The same settings with the key derived from `plant` and claims, where that is asked for.
    #[must_use]
    pub fn keyed(&self, plant: &Plant) -> Self {
        let keys = match self.keys {
            Keys::Claim => Keys::Derived(key(plant, self)),
            other => other,
        };
        Self { keys, ..self.clone() }
    }
}

/// The first 64 bits of a digest of the seed and of what is claimed about.
fn key(plant: &Plant, settings: &Settings) -> u64 {
    let digest = sha256([claimed(plant, settings).as_bytes()]);
    // Sixteen hexadecimal digits are 64 bits.
    u64::from_str_radix(&digest[..16], 16).unwrap_or(settings.seed)
}

/// What is claimed about, a line each. Later lines are for what was not asked for before, so that the key of
/// an older record stays.
fn claimed(plant: &Plant, settings: &Settings) -> String {
    let Hashes { physics_sha256, policy_sha256 } = hashes(plant);
    let Settings { seed, spec, low, high, constants, deviation, global, state, .. } = settings;
    let parameters = plant.model.values();
    let mut text = format!(
        "seed {seed}\nphysics {physics_sha256}\npolicy {policy_sha256}\nparameters {parameters:?}\n\
         horizon {}\ngamma {}\nbox {low:?} {high:?}\nstate {state:?}\n\
         constants {:?} {:?}\ndeviation {} {} {} {} {} {:?} {:?} {:?}\nglobal {} {}\n",
        spec.horizon,
        spec.gamma,
        constants.target,
        constants.constraint,
        deviation.radius,
        deviation.epsilon,
        deviation.beta,
        deviation.scenarios,
        deviation.pilot,
        deviation.joint,
        deviation.control,
        deviation.source,
        global.draws,
        global.beta,
    );
    growth(&mut text, &settings.growth);
    if let Some(asked) = &settings.whole_box {
        // A String takes whatever is written to it, here and below.
        let _ = writeln!(text, "box {asked:?}");
    }
    if let Some(asked) = &settings.drops {
        drops(&mut text, asked);
    }
    if let Some(kind) = settings.enclosed {
        let _ = writeln!(text, "enclosed {}", kind.name());
    }
    if let Some(asked) = &settings.deterministic {
        let _ = writeln!(text, "deterministic {asked:?}");
    }
    if let Some(asked) = &settings.sequential {
        let _ = writeln!(
            text,
            "sequential {:?} {} {} {} {} {}",
            asked.of, asked.epsilon, asked.beta, asked.most, asked.radius, asked.carried
        );
    }
    if let Some(attempt) = settings.attempt {
        let _ = writeln!(text, "attempt {attempt}");
    }
    text
}

/// The line of margin drops; whether its risk is a claim or what is looked for changes no sample.
fn drops(text: &mut String, asked: &DropSettings) {
    let DropSettings { pilot, sample, calibration, share_draws, .. } = asked;
    let risk = asked.risk_value();
    let _ = writeln!(
        text,
        "drops DropSettings {{ pilot: {pilot}, sample: {sample:?}, calibration: {calibration:?}, \
         risk: {risk:?}, share_draws: {share_draws} }}"
    );
}

/// The lines of growth; which cells its centre is looked for in first is not claimed.
fn growth(text: &mut String, asked: &GrowthSettings) {
    let plan = asked.plan;
    let _ = writeln!(
        text,
        "growth {} {} {} {} {} {} {:?} {:?}\nplan {:?} {:?} {} {}",
        asked.radius,
        asked.rounds,
        asked.scenarios,
        asked.epsilon,
        asked.beta,
        asked.split_beta,
        asked.varies,
        asked.boundary,
        plan.method,
        plan.shape,
        plan.factor,
        plan.pilot,
    );
    if plan.around == Around::Bound {
        let _ = writeln!(text, "around the bound");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::RolloutSpec;
    use crate::scenario::deterministic::Kind;
    use crate::system::{BangBang, DoubleIntegrator};

    fn plant(acceleration: f32) -> Plant {
        Plant::of(DoubleIntegrator::default(), BangBang { acceleration })
    }

    #[test]
    fn whatever_is_claimed_about_changes_the_key() {
        let plant_of_all = plant(1.0);
        let spec = RolloutSpec::new(10, 0.9).unwrap();
        let plain = Settings::new(&plant_of_all.model, [0.0; 2], spec).unwrap();
        let of = |settings: &Settings| key(&plant_of_all, settings);
        let mut found = vec![of(&plain), key(&plant(0.5), &plain)];
        let changes: [fn(&mut Settings); 9] = [
            |s| s.seed = 2,
            |s| s.spec.horizon = 11,
            |s| s.high[1] = 0.75,
            |s| s.deviation.epsilon = 0.2,
            |s| s.global.draws += 1,
            |s| s.growth.rounds += 1,
            |s| s.enclosed = Some(Kind::Tube),
            |s| s.enclosed = Some(Kind::Pieces),
            |s| *s = s.clone().as_attempt(2).unwrap(),
        ];
        for change in changes {
            let mut settings = plain.clone();
            change(&mut settings);
            found.push(of(&settings));
        }
        let count = found.len();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), count);
        // What is only shown changes nothing.
        let mut unsliced = plain.clone();
        unsliced.slice = None;
        assert_eq!(of(&unsliced), of(&plain));
        let old = Settings { keys: Keys::Seed, ..plain.clone() };
        assert_eq!(old.keyed(&plant_of_all), old);
        assert_eq!(Keys::of(Keys::Claim.generator()), Some(Keys::Claim));
        assert_eq!(Keys::of("Philox4x32-10"), Some(Keys::Seed));
        assert_eq!(Keys::of("another"), None);
    }
}
