//! From keys to numbers: a configuration as the checked settings of its system.

use super::keys::nearest;
use super::section::{Config, SliceAxisSection};
use super::value::{Constant, Coordinates, Named};
use crate::error::{Error, Result};
use crate::rollout::RolloutSpec;
use crate::scenario::settings::{
    ConstantSettings, DeviationSettings, GlobalSettings, GrowthSettings, Settings, SliceAxis,
};
use crate::system::Axis;

/// Most values of a slice axis: a finer step is a slip, and its picture could not be drawn.
const MOST_VALUES: f64 = 4096.0;
/// Most cells of a slice: states, margins and picture of more would not fit a small machine.
const MOST_CELLS: usize = 1 << 20;
/// Most rollouts or pairs of a sample: a fast GPU's work of a day.
const MOST_SAMPLES: u64 = 1_000_000_000_000;
/// Most rounds of growth: each has a random stream of its own.
const MOST_ROUNDS: u32 = 10_000;

impl Config {
    /// Length and discount of a rollout.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the horizon is 0 or too long, or gamma is outside (0, 1].
    pub fn spec(&self) -> Result<RolloutSpec> {
        let spec = RolloutSpec::new(self.rollout.horizon, self.rollout.gamma as f32);
        spec.map_err(|error| match error {
            Error::Invalid { place, problem } => {
                Error::invalid(format!("rollout.{place}"), problem)
            }
            other => other,
        })
    }

    /// The settings of a certificate for a system with the states `axes`.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key whose value is out of range, not finite or no name of a
    /// state. Whether the scenarios are enough is for [`crate::scenario::certify`] to say.
    pub fn settings(&self, axes: &[Axis]) -> Result<Settings> {
        let (low, high) = self.corners(axes)?;
        let constant = |key: &str, constant: Constant| match constant {
            Constant::Computed => Ok(None),
            Constant::Given(value) => positive(key, value).map(Some),
        };
        Ok(Settings {
            seed: self.seed,
            spec: self.spec()?,
            low,
            high,
            constants: ConstantSettings {
                target: constant("constants.target", self.constants.target)?,
                constraint: constant("constants.constraint", self.constants.constraint)?,
            },
            deviation: self.deviation_settings()?,
            global: GlobalSettings {
                draws: sample_size("global.draws", self.global.draws)?,
                beta: share("global.beta", self.global.beta)?,
            },
            slice: if axes.len() > 1 { Some(self.slice_axes(axes)?) } else { None },
            state: in_order("state", &self.state, axes, finite)?,
            growth: self.growth_settings(axes)?,
        })
    }

    /// Lower and upper corner of the box.
    pub(super) fn corners(&self, axes: &[Axis]) -> Result<(Vec<f32>, Vec<f32>)> {
        let intervals = in_order("box", &self.bounds, axes, finite_interval)?;
        let (low, high): (Vec<f32>, Vec<f32>) =
            intervals.into_iter().map(|[low, high]| (low, high)).unzip();
        if low == high {
            let problem = "empty: no interval has any length, so there is nothing to draw from";
            return Err(Error::invalid("box", problem));
        }
        Ok((low, high))
    }

    /// The deviation bound.
    pub(super) fn deviation_settings(&self) -> Result<DeviationSettings> {
        let asked = self.deviation;
        Ok(DeviationSettings {
            radius: positive_f32("deviation.radius", asked.radius)?,
            epsilon: share("deviation.epsilon", asked.epsilon)?,
            beta: share("deviation.beta", asked.beta)?,
            scenarios: sample_size("deviation.scenarios", asked.scenarios)?,
            pilot: sample_size("deviation.pilot", asked.pilot)?,
            joint: asked.joint,
            control: asked.control,
            source: asked.source,
        })
    }

    /// Local growth.
    fn growth_settings(&self, axes: &[Axis]) -> Result<GrowthSettings> {
        let asked = &self.growth;
        if !(1..=MOST_ROUNDS).contains(&asked.rounds) {
            let problem = format!("{} is not within 1..={MOST_ROUNDS}", asked.rounds);
            return Err(Error::invalid("growth.rounds", problem));
        }
        Ok(GrowthSettings {
            radius: positive_f32("growth.radius", asked.radius)?,
            rounds: asked.rounds,
            scenarios: sample_size("growth.scenarios", asked.scenarios)?,
            epsilon: share("growth.epsilon", asked.epsilon)?,
            beta: share("growth.beta", asked.beta)?,
            split_beta: asked.split_beta,
            varies: self.varies(axes)?,
            boundary: asked.boundary,
            heading: self.heading(axes)?,
        })
    }

    /// The coordinates of growth that vary.
    fn varies(&self, axes: &[Axis]) -> Result<Vec<bool>> {
        let place = "growth.coordinates";
        match &self.growth.coordinates {
            Coordinates::All => Ok(vec![true; axes.len()]),
            Coordinates::Named(names) if names.is_empty() => {
                let problem = "empty; name the states that vary, or say \"all\"";
                Err(Error::invalid(place, problem))
            }
            Coordinates::Named(names) => {
                let mut varies = vec![false; axes.len()];
                for name in names {
                    varies[state_index(place, name, axes)?] = true;
                }
                Ok(varies)
            }
        }
    }

    /// The states that say what is ahead.
    fn heading(&self, axes: &[Axis]) -> Result<Option<[usize; 4]>> {
        let place = "growth.heading";
        let indices = self.growth.heading.iter().map(|name| state_index(place, name, axes));
        let indices = indices.collect::<Result<Vec<_>>>()?;
        if indices.is_empty() {
            return Ok(None);
        }
        let four = <[usize; 4]>::try_from(indices.as_slice());
        four.map(Some).map_err(|_| {
            let problem = format!("{} states; expected 4, x, vx, y, vy, or none", indices.len());
            Error::invalid(place, problem)
        })
    }

    /// The two axes of the slice.
    fn slice_axes(&self, axes: &[Axis]) -> Result<[SliceAxis; 2]> {
        let [x, y] = [("slice.x", &self.slice.x), ("slice.y", &self.slice.y)]
            .map(|(place, section)| slice_axis(place, section, axes));
        let (x, y) = (x?, y?);
        if x.state == y.state {
            let problem = format!("`{}` is on both axes; name two states", self.slice.x.state);
            return Err(Error::invalid("slice", problem));
        }
        let [columns, rows] = [&x, &y].map(|axis: &SliceAxis| axis.values.len());
        if columns * rows > MOST_CELLS {
            let problem = format!(
                "{columns} x {rows} cells are {}; at most {MOST_CELLS}, change a `step`",
                columns * rows
            );
            return Err(Error::invalid("slice", problem));
        }
        Ok([x, y])
    }
}

/// One axis of the slice, values included.
fn slice_axis(place: &str, section: &SliceAxisSection, axes: &[Axis]) -> Result<SliceAxis> {
    let state = state_index(&format!("{place}.state"), &section.state, axes)?;
    let from = f64::from(finite(&format!("{place}.from"), section.from)?);
    let to = f64::from(finite(&format!("{place}.to"), section.to)?);
    positive_f32(&format!("{place}.step"), section.step)?;
    if from >= to {
        let problem = format!("empty: from {} is not below to {}", section.from, section.to);
        return Err(Error::invalid(place, problem));
    }
    // A millionth of a step is rounding, not one more value: -0.9, -0.8, ..., 0.8 below 0.9.
    let count = ((section.to - section.from) / section.step - 1e-6).ceil();
    if !(2.0..=MOST_VALUES).contains(&count) {
        let problem = format!("{count} values; expected 2 to {MOST_VALUES}, change `step`");
        return Err(Error::invalid(place, problem));
    }
    let value = |i: u32| (section.from + f64::from(i) * section.step) as f32;
    let values: Vec<f32> = (0..count as u32).map(value).collect();
    if values.windows(2).any(|pair| pair[0] >= pair[1]) {
        let problem = format!("{} is lost in the rounding of the values", section.step);
        return Err(Error::invalid(format!("{place}.step"), problem));
    }
    Ok(SliceAxis { state, values })
}

/// Both ends of an interval, the low one not above the other.
pub(super) fn finite_interval(key: &str, [low, high]: [f64; 2]) -> Result<[f32; 2]> {
    let ends = [finite(key, low)?, finite(key, high)?];
    if low > high {
        let problem = format!("empty interval: its low end {low} is above {high}");
        return Err(Error::invalid(key, problem));
    }
    Ok(ends)
}

/// Index of the state `name`.
pub(super) fn state_index(place: &str, name: &str, axes: &[Axis]) -> Result<usize> {
    let names: Vec<String> = axes.iter().map(|axis| axis.name.clone()).collect();
    names.iter().position(|known| known == name).ok_or_else(|| {
        let problem = format!(
            "no state `{name}`; the nearest is `{}` of {}",
            nearest(name, &names),
            names.join(", ")
        );
        Error::invalid(place, problem)
    })
}

/// The values of all states in order, each checked with its key.
fn in_order<T: Copy, U>(
    section: &str,
    values: &Named<T>,
    axes: &[Axis],
    check: impl Fn(&str, T) -> Result<U>,
) -> Result<Vec<U>> {
    let value = |axis: &Axis| {
        let key = format!("{section}.{}", axis.name);
        let entry = values.0.iter().find(|(name, _)| *name == axis.name);
        let &(_, value) = entry.ok_or_else(|| Error::invalid(&key, "missing"))?;
        check(&key, value)
    };
    axes.iter().map(value).collect()
}

/// `value` as an f32, finite.
fn finite(key: &str, value: f64) -> Result<f32> {
    let single = value as f32;
    if single.is_finite() {
        return Ok(single);
    }
    Err(Error::invalid(key, format!("{value} is not a finite number")))
}

/// `value`, finite and above 0.
fn positive(key: &str, value: f64) -> Result<f64> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Error::invalid(key, format!("{value} is not a positive number")))
}

/// `value` as an f32, finite and above 0.
pub(crate) fn positive_f32(key: &str, value: f64) -> Result<f32> {
    let single = value as f32;
    positive(key, value)?;
    positive(key, f64::from(single))?;
    Ok(single)
}

/// `value`, strictly between 0 and 1.
fn share(key: &str, value: f64) -> Result<f64> {
    if value > 0.0 && value < 1.0 {
        return Ok(value);
    }
    Err(Error::invalid(key, format!("{value} is not strictly between 0 and 1")))
}

/// `count`, at least 1 and no more than can be rolled out.
fn sample_size(key: &str, count: u64) -> Result<u64> {
    if (1..=MOST_SAMPLES).contains(&count) {
        return Ok(count);
    }
    Err(Error::invalid(key, format!("{count} is not within 1..={MOST_SAMPLES}")))
}
