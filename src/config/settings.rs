//! From keys to numbers: a configuration as the checked settings of its system.

use super::keys::nearest;
use super::section::{Config, SliceAxisSection};
use super::value::{Constant, Coordinates, Named};
use crate::error::{Error, Result};
use crate::rollout::RolloutSpec;
use crate::scenario::growth_plan::GrowthPlan;
use crate::scenario::limits::{finite, not_negative, positive_f32};
use crate::scenario::settings::{
    ConstantSettings, DeviationSettings, GlobalSettings, GrowthSettings, Settings, SliceAxis,
};
use crate::scenario::{BoxSettings, Keys};
use crate::system::Axis;

/// Most values of a slice axis: a finer step is a slip, and its picture could not be drawn.
const MOST_VALUES: f64 = 4096.0;
/// Most cells of a slice: states, margins and picture of more would not fit a small machine.
const MOST_CELLS: usize = 1 << 20;

impl Config {
    /// Length and discount of a rollout.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the horizon is 0 or too long, or gamma is outside (0, 1].
    pub fn spec(&self) -> Result<RolloutSpec> {
        self.checked_spec().map_err(|error| self.placed(error))
    }

    fn checked_spec(&self) -> Result<RolloutSpec> {
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
        self.checked(axes).map_err(|error| self.placed(error))
    }

    fn checked(&self, axes: &[Axis]) -> Result<Settings> {
        let (low, high) = self.corners(axes)?;
        let constant = |key: &str, constant: Constant| match constant {
            Constant::Computed => Ok(None),
            Constant::Given(value) => not_negative(key, value).map(Some),
        };
        let settings = Settings {
            seed: self.seed,
            spec: self.checked_spec()?,
            low,
            high,
            constants: ConstantSettings {
                target: constant("constants.target", self.constants.target)?,
                constraint: constant("constants.constraint", self.constants.constraint)?,
                region: self.constants.region,
                assume: self.constants.assume.clone(),
            },
            deviation: self.deviation_settings()?,
            global: self.global_settings()?,
            whole_box: Some(self.box_settings()?),
            drops: self.drop_settings()?,
            enclosed: self.enclosed()?,
            deterministic: self.deterministic_settings()?,
            slice: self.slice(axes)?,
            state: in_order("state", &self.state, axes, finite)?,
            growth: self.growth_settings(axes)?,
            sequential: self.sequential.settings()?,
            attempt: None,
            keys: Keys::Claim,
        };
        self.attempt.map_or(Ok(settings.clone()), |attempt| settings.as_attempt(attempt))
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
        let settings = DeviationSettings {
            radius: positive_f32("deviation.radius", asked.radius)?,
            epsilon: asked.epsilon,
            beta: asked.beta,
            scenarios: asked.scenarios,
            pilot: asked.pilot,
            joint: asked.joint,
            control: asked.control,
            source: asked.source,
        };
        settings.check().map(|()| settings)
    }

    /// The certified set.
    fn global_settings(&self) -> Result<GlobalSettings> {
        let settings = GlobalSettings { draws: self.global.draws, beta: self.global.beta };
        settings.check().map(|()| settings)
    }

    /// The whole box.
    fn box_settings(&self) -> Result<BoxSettings> {
        let settings = BoxSettings { risk: self.global.box_risk, beta: self.global.beta };
        settings.check().map(|()| settings)
    }

    /// Local growth.
    fn growth_settings(&self, axes: &[Axis]) -> Result<GrowthSettings> {
        let asked = &self.growth;
        let settings = GrowthSettings {
            radius: positive_f32("growth.radius", asked.radius)?,
            rounds: asked.rounds,
            scenarios: asked.scenarios,
            epsilon: asked.epsilon,
            beta: asked.beta,
            split_beta: asked.split_beta,
            varies: self.varies(axes)?,
            boundary: asked.boundary,
            heading: self.heading(axes)?,
            plan: GrowthPlan {
                around: asked.around,
                method: asked.method,
                shape: asked.shape,
                factor: asked.factor,
                pilot: asked.pilot,
            },
        };
        settings.check().map(|()| settings)
    }

    /// The coordinates of growth that vary.
    fn varies(&self, axes: &[Axis]) -> Result<Vec<bool>> {
        let place = "growth.coordinates";
        match &self.growth.coordinates {
            // A state whose box has no width is frozen: nothing beside it is certified.
            Coordinates::All => {
                let (low, high) = self.corners(axes)?;
                Ok(low.iter().zip(&high).map(|(low, high)| low < high).collect())
            }
            Coordinates::Named(names) if names.is_empty() => {
                let problem = "empty; name the states that vary, or say \"all\"";
                Err(Error::invalid(place, problem))
            }
            Coordinates::Named(names) => {
                let mut varies = vec![false; axes.len()];
                for name in names {
                    let state = state_index(place, name, axes)?;
                    if varies[state] {
                        let problem = format!("`{name}` is there twice; name each state once");
                        return Err(Error::invalid(place, problem));
                    }
                    varies[state] = true;
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

    /// The slice; none of a single state, which has no second one to draw it against.
    fn slice(&self, axes: &[Axis]) -> Result<Option<[SliceAxis; 2]>> {
        match axes {
            [only] if self.sources.give("slice") => {
                let problem = format!(
                    "a slice shows two states, and there is one, `{}`: leave the section out",
                    only.name
                );
                Err(Error::invalid("slice", problem))
            }
            [_] => Ok(None),
            _ => self.slice_axes(axes).map(Some),
        }
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
        let problem = format!(
            "{} is lost in the rounding of values as large as {} and {}; take a larger step, or \
             coordinates relative to an origin nearby",
            section.step, section.from, section.to
        );
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
pub(super) fn in_order<T: Copy, U>(
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
