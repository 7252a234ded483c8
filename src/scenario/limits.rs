//! What the numbers of settings may be, one rule for settings from a file and those made by hand.

use super::deterministic_settings::DeterministicSettings;
use super::drops_settings::DropSettings;
use super::sequential_record::SequentialSettings;
use super::settings::{
    ConstantSettings, DeviationSettings, GlobalSettings, GrowthSettings, Settings,
};
use super::spacing;
use crate::error::{Error, Result};

/// Most rollouts or pairs of a sample: a fast GPU's work of a day.
const MOST_SAMPLES: u64 = 1_000_000_000_000;
/// Most draws that are looked at one after the other: the evidence is summed anew after each start.
const MOST_SEQUENTIAL: u64 = 100_000;
/// Most rounds of growth: each has a random stream of its own.
const MOST_ROUNDS: u32 = 10_000;

/// `value` as an f32, finite.
///
/// # Errors
/// [`Error::Invalid`] naming `key`, as for all of these.
pub(crate) fn finite(key: &str, value: f64) -> Result<f32> {
    let single = value as f32;
    if single.is_finite() {
        return Ok(single);
    }
    Err(Error::invalid(key, format!("{value} is not a finite number")))
}

/// `value`, finite and above 0.
pub(crate) fn positive(key: &str, value: f64) -> Result<f64> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Error::invalid(key, format!("{value} is not a positive number")))
}

/// `value`, finite and at least 0.
pub(crate) fn not_negative(key: &str, value: f64) -> Result<f64> {
    if value.is_finite() && value >= 0.0 {
        return Ok(value);
    }
    Err(Error::invalid(key, format!("{value} is not 0 or a positive number")))
}

/// `value` as an f32, finite and above 0.
pub(crate) fn positive_f32(key: &str, value: f64) -> Result<f32> {
    let single = value as f32;
    positive(key, value)?;
    positive(key, f64::from(single))?;
    Ok(single)
}

/// `value`, strictly between 0 and 1.
fn share(key: &str, value: f64) -> Result<()> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    Err(Error::invalid(key, format!("{value} is not strictly between 0 and 1")))
}

/// `count`, at least 1 and no more than can be rolled out.
fn sample_size(key: &str, count: u64) -> Result<()> {
    if (1..=MOST_SAMPLES).contains(&count) {
        return Ok(());
    }
    Err(Error::invalid(key, format!("{count} is not within 1..={MOST_SAMPLES}")))
}

impl ConstantSettings {
    /// Refuses a constant that is given and below 0, or not finite; 0 is that of a constant margin.
    pub(crate) fn check(&self) -> Result<()> {
        for (key, given) in
            [("constants.target", self.target), ("constants.constraint", self.constraint)]
        {
            given.map_or(Ok(0.0), |value| not_negative(key, value))?;
        }
        Ok(())
    }
}

impl DeviationSettings {
    /// Refuses numbers out of range.
    pub(crate) fn check(&self) -> Result<()> {
        positive_f32("deviation.radius", self.radius.into())?;
        share("deviation.epsilon", self.epsilon)?;
        share("deviation.beta", self.beta)?;
        sample_size("deviation.scenarios", self.scenarios)?;
        sample_size("deviation.pilot", self.pilot)
    }
}

impl GlobalSettings {
    /// Refuses numbers out of range.
    pub(crate) fn check(&self) -> Result<()> {
        sample_size("global.draws", self.draws)?;
        share("global.beta", self.beta)
    }
}

impl DeterministicSettings {
    /// Refuses numbers out of range.
    pub(crate) fn check(&self) -> Result<()> {
        positive_f32("deterministic.radius", self.radius.into())?;
        sample_size("deterministic.starts", self.starts)?;
        share("deterministic.beta", self.beta)
    }
}

impl GrowthSettings {
    /// Refuses numbers out of range, and growth in no coordinate.
    pub(crate) fn check(&self) -> Result<()> {
        if !(1..=MOST_ROUNDS).contains(&self.rounds) {
            let problem = format!("{} is not within 1..={MOST_ROUNDS}", self.rounds);
            return Err(Error::invalid("growth.rounds", problem));
        }
        positive_f32("growth.radius", self.radius.into())?;
        sample_size("growth.scenarios", self.scenarios)?;
        share("growth.epsilon", self.epsilon)?;
        share("growth.beta", self.beta)?;
        sample_size("growth.pilot", self.plan.pilot)?;
        self.check_plan()?;
        if self.varies.contains(&true) {
            return Ok(());
        }
        Err(Error::invalid("growth.varies", "no coordinate varies; one at least has to"))
    }
}

impl SequentialSettings {
    /// Refuses numbers out of range.
    pub(crate) fn check(&self) -> Result<()> {
        share("sequential.epsilon", self.epsilon)?;
        share("sequential.beta", self.beta)?;
        if !(1..=MOST_SEQUENTIAL).contains(&self.most) {
            let problem = format!("{} is not within 1..={MOST_SEQUENTIAL}", self.most);
            return Err(Error::invalid("sequential.most", problem));
        }
        if !self.carried.is_finite() {
            let problem = format!("{} is not a finite number", self.carried);
            return Err(Error::invalid("sequential.carried", problem));
        }
        positive_f32("sequential.radius", self.radius.into()).map(drop)
    }
}

impl Settings {
    /// Refuses numbers that no settings have, whoever made them: a horizon or discount out of range,
    /// a box or state that is not finite, a radius, risk, beta or count out of range.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the setting as a file does, with its value.
    pub fn check(&self) -> Result<()> {
        self.spec.check()?;
        for (key, values) in [("box", &self.low), ("box", &self.high), ("state", &self.state)] {
            values.iter().try_for_each(|value| finite(key, (*value).into()).map(drop))?;
        }
        for (axis, key) in self.slice.iter().flatten().zip(["slice.x", "slice.y"]) {
            let ascends = axis.values.windows(2).all(|pair| pair[0] < pair[1]);
            if axis.values.is_empty() || !ascends {
                return Err(Error::invalid(
                    key,
                    "its values have to ascend; one at least is needed",
                ));
            }
            axis.values.iter().try_for_each(|value| finite(key, (*value).into()).map(drop))?;
        }
        self.constants.check()?;
        self.deviation.check()?;
        self.global.check()?;
        self.deterministic.as_ref().map_or(Ok(()), DeterministicSettings::check)?;
        self.whole_box.map_or(Ok(()), |asked| asked.check())?;
        self.drops.as_ref().map_or(Ok(()), DropSettings::check)?;
        if self.drops.is_some() && self.enclosed.is_some() {
            let problem = "margin drops and an enclosure both say what is certified; ask for one";
            return Err(Error::invalid("global.tightening", problem));
        }
        self.sequential.iter().try_for_each(SequentialSettings::check)?;
        self.growth.check()?;
        spacing::check(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::{PairControl, RolloutSpec};
    use crate::scenario::Keys;
    use crate::scenario::growth_plan::GrowthPlan;
    use crate::scenario::settings::{BoundarySearch, DeviationSource, Joint, SliceAxis};

    /// Sound settings of two states.
    fn sound() -> Settings {
        let axis = |state| SliceAxis { state, values: vec![-1.0, 0.0, 1.0] };
        Settings {
            seed: 1,
            spec: RolloutSpec::new(10, 0.9).expect("a horizon"),
            low: vec![-1.0; 2],
            high: vec![1.0; 2],
            constants: ConstantSettings::default(),
            deviation: DeviationSettings {
                radius: 0.1,
                epsilon: 0.1,
                beta: 1e-3,
                scenarios: 159,
                pilot: 159,
                joint: Joint::FixedShape,
                control: PairControl::Replay,
                source: DeviationSource::Scenario,
            },
            global: GlobalSettings { draws: 100, beta: 1e-3 },
            whole_box: None,
            drops: None,
            enclosed: None,
            deterministic: None,
            slice: Some([axis(0), axis(1)]),
            state: vec![0.0; 2],
            growth: GrowthSettings {
                radius: 0.5,
                rounds: 10,
                scenarios: 159,
                epsilon: 0.1,
                beta: 1e-3,
                split_beta: true,
                varies: vec![true, false],
                boundary: BoundarySearch::Rays,
                heading: None,
                plan: GrowthPlan::SHRINKING,
            },
            sequential: None,
            attempt: None,
            keys: Keys::Seed,
        }
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        sound().check().expect("sound settings");
        let refused = |words: &str, change: &dyn Fn(&mut Settings)| {
            let mut settings = sound();
            change(&mut settings);
            let found = settings.check().expect_err(words).to_string();
            assert!(found.starts_with(words), "no `{words}` in: {found}");
        };
        refused("horizon: 0 is not", &|s| s.spec.horizon = 0);
        refused("horizon: 10001 is not", &|s| s.spec.horizon = 10_001);
        refused("gamma: NaN is outside", &|s| s.spec.gamma = f32::NAN);
        refused("box: inf is not", &|s| s.high[1] = f32::INFINITY);
        refused("box: NaN is not", &|s| s.low[0] = f32::NAN);
        refused("state: NaN is not", &|s| s.state[0] = f32::NAN);
        refused("slice.y: its values", &|s| {
            s.slice.iter_mut().for_each(|axes| axes[1].values.clear());
        });
        refused("constants.target: -1 is not", &|s| s.constants.target = Some(-1.0));
        refused("constants.constraint: NaN", &|s| s.constants.constraint = Some(f64::NAN));
        refused("deviation.radius: 0 is not", &|s| s.deviation.radius = 0.0);
        refused("deviation.radius: NaN is not", &|s| s.deviation.radius = f32::NAN);
        refused("deviation.epsilon: 1 is not", &|s| s.deviation.epsilon = 1.0);
        refused("deviation.beta: 0 is not", &|s| s.deviation.beta = 0.0);
        refused("deviation.scenarios: 0 is not", &|s| s.deviation.scenarios = 0);
        refused("deviation.pilot: 0 is not", &|s| s.deviation.pilot = 0);
        refused("global.draws: 0 is not", &|s| s.global.draws = 0);
        refused("global.beta: -1 is not", &|s| s.global.beta = -1.0);
        refused("growth.rounds: 0 is not", &|s| s.growth.rounds = 0);
        refused("growth.radius: -1 is not", &|s| s.growth.radius = -1.0);
        refused("growth.scenarios: 0 is not", &|s| s.growth.scenarios = 0);
        refused("growth.epsilon: NaN is not", &|s| s.growth.epsilon = f64::NAN);
        refused("growth.beta: 2 is not", &|s| s.growth.beta = 2.0);
        refused("deviation.radius: 0.0001 is below 0.0004769", &|s| s.deviation.radius = 1e-4);
        refused("growth.radius: 0.0001 is below 0.0004769", &|s| s.growth.radius = 1e-4);
        refused("growth.varies: no coordinate", &|s| s.growth.varies = vec![false; 2]);
    }
}
