//! A point of a sweep as races: success, plans, and the latency of a control step.

use super::record::{AxisRecord, LatencyRecord, RacePoint, SWEEP_SCHEMA, SweepRecord};
use crate::digest;
use crate::error::{Error, Result};
use crate::race::controller::plan::Paths;
use crate::race::controller::roster::{absent, controller, settings};
use crate::race::controller::{Name, World};
use crate::race::flight::{fly, race_seed};
use crate::race::run::{BATCH, Experiment, flown};
use crate::race::summary::Summary;
use crate::race::timing::{mean_seconds, quantile};
use crate::scenario::{Unwatched, Watch, provenance};

/// Control steps that are timed, if they fit into [`LATENCY_BUDGET`].
const TIMED_STEPS: u32 = 200;
/// Time for them, s.
const LATENCY_BUDGET: f64 = 2.0;

impl Experiment<'_> {
    /// The sweep over `axes` with `total` points, none of which is done; this experiment is what
    /// every point starts from.
    pub fn sweep(&self, axes: Vec<AxisRecord>, total: u64) -> SweepRecord {
        let World { program, race, certificates, .. } = self.world;
        SweepRecord {
            schema: SWEEP_SCHEMA,
            provenance: provenance(program, certificates.seed, self.config.clone()),
            starts: Some(self.starts_record()),
            noise_seeds: self.noise_seeds.clone(),
            judge: Some(race.judge),
            axes,
            total,
            points: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Everything that the points of a sweep share.
    pub fn sweep_identity(&self) -> serde_json::Value {
        serde_json::json!({
            "sweep_of": "races",
            "manifest": self.manifest(),
            "noise_seeds": self.noise_seeds,
        })
    }

    /// SHA-256 over everything that the races of the controller `name` depend on.
    pub fn point_sha256(&self, name: Name) -> String {
        let point = serde_json::json!({
            "manifest": self.manifest(),
            "controller": name.text(),
            "noise_seeds": self.noise_seeds,
        });
        digest::sha256([point.to_string().as_bytes()])
    }

    /// Refuses what the controller `name` could not race with, as far as that shows without racing.
    ///
    /// # Errors
    /// [`Error::Invalid`] for settings out of range, or a network that is missing.
    pub fn check_point(&self, name: Name) -> Result<()> {
        self.world.race.check(self.world.system)?;
        let refused = |reason| Err(Error::invalid(name.text(), reason));
        absent(name, &self.world).map_or(Ok(()), refused)
    }

    /// Flies all races of the controller `name` and times its control step.
    ///
    /// # Errors
    /// Those of the controller, before any race; those of the backend; [`Error::Interrupted`].
    pub fn point(&self, name: Name, watch: &dyn Watch) -> Result<RacePoint> {
        self.check_point(name)?;
        self.check(&[name])?;
        let race = settings(name, self.world.race);
        let world = World { race: &race, ..self.world };
        let mut summary = Summary::new(name, race.judge, race.steps, [0.0; 2]);
        for &noise_seed in &self.noise_seeds {
            summary.next_seed();
            for (batch, starts) in self.starts.chunks(BATCH).enumerate() {
                let seeds = self.seeds(noise_seed, batch * BATCH, starts.len());
                summary.add(&flown(name, world, starts, &seeds, watch)?);
            }
        }
        let mut record = summary.record(None);
        // These are settings of the sweep, not those that were published.
        record.judged.iter_mut().for_each(|judged| judged.published = None);
        let [effective_samples, best_cost] = summary.plan_means();
        Ok(RacePoint {
            races: (self.starts.len() * self.noise_seeds.len()) as u64,
            judged: record.judged,
            effective_samples,
            best_cost,
            non_finite_samples: record.non_finite_samples,
            latency: self.latency(name, world)?,
            batch_seconds: mean_seconds(&summary.seconds),
        })
    }

    /// Times the control steps of races that fly one at a time, from the first start on.
    fn latency(&self, name: Name, world: World<'_>) -> Result<LatencyRecord> {
        let mut seconds = Vec::new();
        let mut most = TIMED_STEPS;
        // The first race is two steps long: one warms up, the other says how many there is time for.
        for (race, start) in std::iter::once(&self.starts[0]).chain(&self.starts).enumerate() {
            let left = most.saturating_sub(seconds.len() as u32);
            let steps = if race == 0 { 2 } else { left }.min(world.race.steps);
            if left == 0 {
                break;
            }
            let mut controller = controller(name, world, 1, Paths::None)?;
            let seed = [race_seed(self.noise_seeds[0], race.saturating_sub(1) as u64)];
            let one = std::slice::from_ref(start);
            let flights = fly(controller.as_mut(), world.system, one, &seed, steps, &Unwatched)?;
            let mut timed = flights[0].decisions.iter().map(|decision| decision.seconds as f32);
            if race > 0 {
                seconds.extend(timed);
            } else if let Some(second) = timed.next_back() {
                most =
                    (LATENCY_BUDGET / f64::from(second)).clamp(1.0, f64::from(TIMED_STEPS)) as u32;
            }
        }
        seconds.sort_by(f32::total_cmp);
        let [median_seconds, p95_seconds, p99_seconds] =
            [0.5, 0.95, 0.99].map(|share| quantile(&seconds, share));
        let steps = seconds.len() as u64;
        Ok(LatencyRecord { steps, median_seconds, p95_seconds, p99_seconds })
    }
}
