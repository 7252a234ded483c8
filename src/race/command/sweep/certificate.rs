//! A sweep of certificates.

use std::path::Path;

use super::arguments::SweepArguments;
use super::grid::{Grid, Target, Values};
use crate::backend::Backend;
use crate::cli::folder_of;
use crate::cli::inputs::{inputs, networks};
use crate::cli::options::Global;
use crate::cli::progress::Progress;
use crate::config::{Config, Overrides, PolicySource};
use crate::error::{Error, Result};
use crate::files::Existing;
use crate::model::Plant;
use crate::race::sweep::record::PointResult;
use crate::race::sweep::{
    Computed, Store, certificate_point, certificate_sha256, certificate_sweep,
};
use crate::scenario::bound::CountRule;
use crate::scenario::settings::Settings;
use crate::scenario::{Keys, check_settings};

/// Keys that `--count` sets.
const COUNTS: [&str; 2] = ["deviation.scenarios", "growth.scenarios"];

/// What every point has.
struct Sweep<'a> {
    config: &'a Path,
    base: Overrides,
    grid: &'a Grid,
    backend: &'a Backend,
}

/// Certifies every point that is not stored yet.
pub(super) fn run(
    global: &Global,
    asked: &SweepArguments,
    grid: &Grid,
    backend: &Backend,
    progress: &Progress,
    out: &Path,
) -> Result<Store> {
    let sweep = Sweep { config: &asked.config, base: global.overrides(), grid, backend };
    let points = grid.points();
    let (axes, total) = (grid.records(), points.len() as u64);
    let base = Config::load(&asked.config, &sweep.base)?;
    let policy = base.policy_source(folder_of(&asked.config))?;
    inputs(&asked.config, &policy, networks(&base)).spare_folder(out)?;
    let plant = base.plant(&policy)?;
    let program = backend.prepare(&plant)?;
    let record = certificate_sweep(&program, base.seed, base.to_json()?, axes, total);
    let hashes = points.iter().map(|values| sweep.checked(values)).collect::<Result<Vec<_>>>()?;
    let identity = serde_json::json!({
        "sweep_of": "certificates",
        "schema": record.schema,
        "provenance": record.provenance,
    });
    if global.existing == Existing::Replaced {
        Store::make_way(out, &identity, &record)?;
    }
    let mut store = Store::open(out, &identity, record)?;
    for (values, sha256) in points.into_iter().zip(hashes) {
        store.point(sha256, values.clone(), || {
            let result = sweep.certify(&values, progress)?;
            Ok(Computed { result, events: backend.events() })
        })?;
    }
    Ok(store)
}

impl Sweep<'_> {
    /// The configuration and policy of a point, and where its scenario counts come from.
    fn point(&self, values: &Values) -> Result<(Config, PolicySource, Option<CountRule>)> {
        let rule = match self.grid.value(values, &Target::Count) {
            Some("config") => None,
            Some("exact") => Some(CountRule::Exact),
            _ => Some(CountRule::Simple),
        };
        let mut overrides = self.grid.overrides(&self.base, values, None)?;
        let sets = |assignment: &&String| {
            COUNTS.contains(&assignment.split('=').next().unwrap_or_default().trim())
        };
        if let (Some(_), Some(set)) = (rule, overrides.set.iter().find(sets)) {
            let problem = "the counts follow from epsilon, beta and --count; give --count config \
                           to set them";
            return Err(Error::invalid(set.as_str(), problem));
        }
        if rule.is_none() {
            self.keep_counts(&mut overrides)?;
        }
        let config = Config::load(self.config, &overrides);
        let config = config.map_err(|error| self.grid.blamed(error, values))?;
        let policy = config.policy_source(folder_of(self.config))?;
        Ok((config, policy, rule))
    }

    /// Sets the counts of the configuration, which would follow from what the axes ask for, unless
    /// `overrides` set them.
    fn keep_counts(&self, overrides: &mut Overrides) -> Result<()> {
        let base = Config::load(self.config, &self.base)?;
        let counts = [base.deviation.scenarios, base.growth.scenarios];
        for (key, count) in COUNTS.iter().zip(counts) {
            if !overrides.set.iter().any(|set| set.trim_start().starts_with(key)) {
                overrides.set.push(format!("{key}={count}"));
            }
        }
        Ok(())
    }

    /// SHA-256 of a point that can be certified.
    fn checked(&self, values: &Values) -> Result<String> {
        let (config, policy, rule) = self.point(values)?;
        let blamed = |error| self.grid.blamed(error, values);
        let plant = config.plant(&policy).map_err(blamed)?;
        let (settings, stored) = counted(&config, &plant, rule).map_err(blamed)?;
        check_settings(&settings).map_err(|error| blamed(config.placed(error)))?;
        let program = self.backend.prepare(&plant)?;
        Ok(certificate_sha256(&program, settings.seed, stored))
    }

    /// Certifies a point.
    fn certify(&self, values: &Values, progress: &Progress) -> Result<PointResult> {
        let (config, policy, rule) = self.point(values)?;
        let plant = config.plant(&policy)?;
        let (settings, stored) = counted(&config, &plant, rule)?;
        let program = self.backend.prepare(&plant)?;
        let point = certificate_point(&program, &settings, stored, progress);
        let point = point.map_err(|error| self.grid.blamed(config.placed(error), values))?;
        Ok(PointResult::Certificate(point))
    }
}

/// The settings of a point and the configuration that has their counts.
fn counted(
    config: &Config,
    plant: &Plant,
    rule: Option<CountRule>,
) -> Result<(Settings, serde_json::Value)> {
    let axes = &plant.model.states;
    let mut config = config.clone();
    if let Some(rule) = rule {
        let counts = config.settings(axes)?.scenario_counts(rule)?;
        [config.deviation.scenarios, config.growth.scenarios] = counts;
    }
    // Points keep their samples, whatever varies between them.
    let settings = Settings { keys: Keys::Seed, ..config.settings(axes)? };
    Ok((settings, config.to_json()?))
}
