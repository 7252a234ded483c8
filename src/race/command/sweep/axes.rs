//! From the options of `sweep` to its axes.

use super::arguments::{CertificateAxes, Of, RaceAxes, SweepArguments};
use super::grid::{Axis, Grid, Kind, Target, varied};
use crate::error::{Error, Result};
use crate::race::command::input::names;

/// The deviation bounds of `--bound`.
const BOUNDS: &[&str] = &["fixed-shape", "variables", "bonferroni", "separate", "exact"];
/// Where scenario counts come from, of `--count`.
const COUNTS: &[&str] = &["simple", "exact", "config"];
/// Keys whose values every point shares.
const SHARED: [&str; 3] = ["seed", "race.starts", "race.start_box"];

/// An option with a list.
struct Listed<'a> {
    /// Name of the axis, and of the option after its dashes.
    name: &'static str,
    /// What was given.
    text: &'a Option<String>,
    /// What its values change.
    target: Target,
    /// What they are written as.
    kind: Kind,
}

impl<'a> Listed<'a> {
    fn new(name: &'static str, text: &'a Option<String>, target: Target, kind: Kind) -> Self {
        Self { name, text, target, kind }
    }

    /// The option as it is written.
    fn option(&self) -> String {
        format!("--{}", self.name)
    }

    /// Its axis, if it was given.
    fn axis(&self) -> Option<Result<Axis>> {
        let (option, target) = (self.option(), self.target.clone());
        let text = self.text.as_ref()?;
        Some(Axis::new(&option, self.name, target, self.kind, text))
    }
}

/// The grid that was asked for.
///
/// # Errors
/// [`Error::Invalid`] for an option of the other kind of sweep, a list that is empty or has a value
/// of the wrong kind, and an empty grid.
pub(super) fn grid(asked: &SweepArguments) -> Result<Grid> {
    let (axes, hint) = match asked.of {
        Of::Race => {
            refuse(&certificate_axes(&asked.certificate), "--of certificate")?;
            let mut axes = vec![controllers(&asked.race)?];
            axes.extend(listed(&race_axes(&asked.race, &asked.horizon))?);
            (axes, "--samples 64,256,1024, or another axis")
        }
        Of::Certificate => {
            refuse_race(&asked.race)?;
            let mut options = certificate_axes(&asked.certificate);
            options.push(rollout_horizon(&asked.horizon));
            (listed(&options)?, "--epsilon 0.05,0.1,0.2, or another axis")
        }
    };
    let varied = asked.vary.iter().map(|text| vary(text)).collect::<Result<Vec<_>>>()?;
    Grid::new(axes.into_iter().chain(varied).collect(), hint)
}

/// The axis of `--vary`.
fn vary(text: &str) -> Result<Axis> {
    let axis = varied(text)?;
    if SHARED.contains(&axis.name.as_str()) {
        let problem = "every point has the same starts and seeds; use --set, --seed or --starts";
        return Err(Error::invalid(axis.option, problem));
    }
    Ok(axis)
}

/// The axis of the controllers: `mppi` alone unless others are asked for.
fn controllers(asked: &RaceAxes) -> Result<Axis> {
    let list = asked.controllers.as_deref().unwrap_or("mppi");
    let option = "--controllers";
    let axis = Axis::new(option, "controller", Target::Controller, Kind::Any, list)?;
    let values = names(&axis.values)?.iter().map(|name| name.text().to_owned()).collect();
    Ok(Axis { values, ..axis })
}

/// The axes that were given.
fn listed(options: &[Listed<'_>]) -> Result<Vec<Axis>> {
    options.iter().filter_map(Listed::axis).collect()
}

/// Refuses an option that only sweeps `of` have.
fn refuse(options: &[Listed<'_>], of: &str) -> Result<()> {
    match options.iter().find(|option| option.text.is_some()) {
        Some(option) => Err(other_kind(&option.option(), of)),
        None => Ok(()),
    }
}

/// Refuses the options of races.
fn refuse_race(asked: &RaceAxes) -> Result<()> {
    let of = "--of race";
    let given = [
        ("--controllers", asked.controllers.is_some()),
        ("--starts", asked.starts.is_some()),
        ("--noise-seeds", asked.noise_seeds.is_some()),
    ];
    if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
        return Err(other_kind(option, of));
    }
    refuse(&race_axes(asked, &None), of)
}

/// The refusal of `option`, which belongs to the sweeps `of`.
fn other_kind(option: &str, of: &str) -> Error {
    Error::invalid(option, format!("belongs to {of}; leave it out, or give {of}"))
}

/// The axes of plans.
fn race_axes<'a>(asked: &'a RaceAxes, horizon: &'a Option<String>) -> Vec<Listed<'a>> {
    let plan = |key, text, kind| Listed::new(key, text, Target::Plan(key), kind);
    vec![
        plan("samples", &asked.samples, Kind::Whole),
        plan("horizon", horizon, Kind::Whole),
        plan("temperature", &asked.temperature, Kind::Number),
        plan("sigma", &asked.sigma, Kind::Numbers),
        plan("noise", &asked.noise, Kind::Noise),
        plan("iterations", &asked.iterations, Kind::Whole),
    ]
}

/// The axes of certificates but the horizon.
fn certificate_axes(asked: &CertificateAxes) -> Vec<Listed<'_>> {
    let keys = |keys: &[&str]| Target::Keys(keys.iter().map(|key| (*key).to_owned()).collect());
    let epsilon = keys(&["deviation.epsilon", "growth.epsilon"]);
    let beta = keys(&["deviation.beta", "global.beta", "growth.beta"]);
    vec![
        Listed::new("epsilon", &asked.epsilon, epsilon, Kind::Number),
        Listed::new("beta", &asked.beta, beta, Kind::Number),
        Listed::new("radius", &asked.radius, keys(&["deviation.radius"]), Kind::Number),
        Listed::new("bound", &asked.bound, Target::Bound, Kind::Word(BOUNDS)),
        Listed::new("count", &asked.count, Target::Count, Kind::Word(COUNTS)),
    ]
}

/// The axis of the rollouts' length.
fn rollout_horizon(text: &Option<String>) -> Listed<'_> {
    let target = Target::Keys(vec!["rollout.horizon".to_owned()]);
    Listed::new("horizon", text, target, Kind::Whole)
}
