//! The certificate as a whole: constants, deviation, certified set, slice, boundary, growth.

use std::collections::BTreeMap;
use std::time::Instant;

use super::boundary;
use super::ledger::{Entry, Ledger, Spend};
use super::lipschitz::{self, MarginBox};
use super::purpose;
use super::record::{
    ConstantRecord, ConstantsRecord, DeviationRecord, GrowthRecord, PictureRecord, Provenance,
    Record, RolloutRecord, SCHEMA, Spending, StateRecord, SystemRecord, Timing, decimal,
    finite_margin,
};
use super::settings::Settings;
use super::{Context, Watch, derived, deviation, global, growth};
use crate::backend::Program;
use crate::digest;
use crate::error::{Error, Result};
use crate::model::{Model, Plant};
use crate::policy::Mlp;
use crate::rollout::{GENERATOR, Query, Region, RolloutSpec, States, Stream, Tightening, replay};

/// Rollouts drawn in the picture: the state's, and that many starts of the growth.
const PICTURED: usize = 12;
/// Points whose gradients are sampled beside each computed constant.
const GRADIENT_SAMPLES: u32 = 4096;
/// How much wider a box is tried to see whether a constant depends on it.
const WIDER: f32 = 10.0;

/// Names and number of the coordinates that vary and of those that are frozen.
pub(super) fn coordinates(model: &Model, varies: &[bool]) -> (usize, Vec<String>) {
    let frozen = model.states.iter().zip(varies).filter(|(_, varies)| !**varies);
    let frozen: Vec<String> = frozen.map(|(axis, _)| axis.name.clone()).collect();
    (model.states.len() - frozen.len(), frozen)
}

/// Certifies the plant: every number of the [`Record`] but the threads of its timing.
///
/// `config` is stored as it is; it is what a later check starts from.
///
/// # Errors
/// [`Error::TooFewScenarios`] and [`Error::Invalid`] before any work; those of the backend;
/// [`Error::Interrupted`] if `watch` says so.
pub fn certify(
    program: &Program<'_>,
    settings: &Settings,
    config: serde_json::Value,
    watch: &dyn Watch,
) -> Result<Record> {
    let begun = Instant::now();
    let context = Context { program, watch };
    let (plant, backend) = (program.plant(), program.backend());
    check_settings(settings)?;
    let ledger = ledger(settings)?;
    let Tightened { constants, deviation, tightening } = tightened(context, settings)?;
    let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
    let global = global::conditional(context, settings, &tightening, purposes)?;
    let slice = global::slice(context, settings, &tightening, global.band)?;
    let boundary = boundary::search(context, settings, &tightening, &slice)?;
    let growth = growth::record(context, settings, boundary, global.band)?;
    let state = state(context, settings, &tightening, (&growth, global.band))?;
    let picture = picture(plant, settings, &growth);
    let mut statements = derived::statements(settings, &deviation, &global, &growth);
    statements.extend(derived::of_samples(plant, settings, &picture));
    let rollouts = 2 * (settings.deviation.scenarios + deviation.pilot + global.draws)
        + slice.check_margin.len() as u64
        + growth.rounds.iter().map(|round| round.scenarios).sum::<u64>();
    Ok(Record {
        schema: SCHEMA,
        digests: BTreeMap::new(),
        holds: derived::holds(&deviation, &global, &growth),
        statements,
        provenance: provenance(program, settings.seed, config),
        system: system_record(&plant.model, settings),
        horizon: settings.spec.horizon,
        gamma: decimal(settings.spec.gamma),
        constants,
        deviation,
        global,
        state,
        slice,
        growth,
        beta_total: ledger.total(),
        ledger: spendings(&ledger),
        picture,
        events: backend.events(),
        timing: Timing { wall_seconds: begun.elapsed().as_secs_f64(), threads: 0, rollouts },
    })
}

/// Names, boxes and bodies of the system, with the box of starts that `settings` ask for.
pub(super) fn system_record(model: &Model, settings: &Settings) -> SystemRecord {
    let mut states = model.states.clone();
    for (axis, (low, high)) in states.iter_mut().zip(settings.low.iter().zip(&settings.high)) {
        (axis.low, axis.high) = (*low, *high);
    }
    SystemRecord {
        name: model.name.clone(),
        states,
        controls: model.controls.clone(),
        bodies: model.bodies.clone(),
    }
}

/// Refuses settings whose claims could not be made, as far as that shows without work: scenarios
/// that are too few, claims that spend more than 1 together, an empty box.
///
/// # Errors
/// [`Error::TooFewScenarios`] and [`Error::Invalid`].
pub fn check_settings(settings: &Settings) -> Result<()> {
    growth::check_scenarios(&settings.growth)?;
    deviation::check_scenarios(&settings.deviation, settings.spec.horizon)?;
    ledger(settings)?;
    Region::new_box(&*settings.low, &*settings.high).map(|_| ())
}

/// What the margins lose with the constants used.
pub(super) fn tightening(
    bound: &[f64],
    constants: &ConstantsRecord,
    spec: &RolloutSpec,
) -> Tightening {
    deviation::tightening(bound, constants.target.used, constants.constraint.used, spec)
}

/// Constants and deviation bound that `settings` ask for, and what they take off the margins.
///
/// # Errors
/// [`Error::TooFewScenarios`] and [`Error::Invalid`] before any work; those of the backend.
pub fn tightened(context: Context<'_>, settings: &Settings) -> Result<Tightened> {
    Region::new_box(&*settings.low, &*settings.high)?;
    let constants = constants(context.model(), settings)?;
    let deviation = deviation::bound(context, settings)?;
    let tightening = tightening(&deviation.bound, &constants, &settings.spec);
    Ok(Tightened { constants, deviation, tightening })
}

/// What V_check is computed with.
#[derive(Clone, Debug)]
pub struct Tightened {
    /// Lipschitz constants.
    pub constants: ConstantsRecord,
    /// Deviation bound.
    pub deviation: DeviationRecord,
    /// What the margins lose.
    pub tightening: Tightening,
}

/// The Lipschitz constants, computed, sampled, and used as `settings` ask.
pub(super) fn constants(model: &Model, settings: &Settings) -> Result<ConstantsRecord> {
    let all = vec![true; model.states.len()];
    let horizon = settings.spec.horizon;
    let region = MarginBox { low: &settings.low, high: &settings.high, varies: &all, horizon };
    let inside = lipschitz::margins(model, region);
    let wider = |side: &[f32], sign: f32| -> Vec<f32> {
        let widths = settings.low.iter().zip(&settings.high).map(|(low, high)| high - low);
        side.iter().zip(widths).map(|(side, width)| side + sign * WIDER * width).collect()
    };
    let (low, high) = (wider(&settings.low, -1.0), wider(&settings.high, 1.0));
    let outside = lipschitz::margins(model, MarginBox { low: &low, high: &high, ..region });
    let sampled = lipschitz::sampled(model, region, GRADIENT_SAMPLES, settings.seed);
    let one = |name: &str, given: Option<f64>, computed: f64, beyond: f64, sampled: f64| {
        let used = given.unwrap_or(computed);
        if !(used.is_finite() && used >= 0.0) {
            let problem = format!(
                "no finite Lipschitz constant of the {name} margin over the box (computed \
                 {computed}); give a smaller box or the constant itself"
            );
            return Err(Error::invalid(format!("constants.{name}"), problem));
        }
        let source = match given {
            Some(_) => "given",
            None if beyond <= computed * (1.0 + 1e-9) => {
                "computed: gradient bound over the box, the same on a box 21 times as wide"
            }
            None => "computed: gradient bound over the box, not valid beyond it",
        };
        Ok(ConstantRecord { used, source: source.to_owned(), computed, sampled })
    };
    let given = settings.constants;
    Ok(ConstantsRecord {
        target: one(
            "target",
            given.target,
            inside.target.constant,
            outside.target.constant,
            sampled.target,
        )?,
        constraint: one(
            "constraint",
            given.constraint,
            inside.constraint.constant,
            outside.constraint.constant,
            sampled.constraint,
        )?,
    })
}

/// The ledger of all claims; growth books every round it may take.
pub(super) fn ledger(settings: &Settings) -> Result<Ledger> {
    let growth = &settings.growth;
    let rounds = f64::from(growth.rounds);
    let global = settings.global.beta;
    let budget = settings.deviation.beta + 2.0 * global + rounds * growth.round_beta();
    let mut ledger = Ledger::new(budget.min(1.0 - f64::EPSILON))?;
    let claims = [
        ("deviation", "bound", settings.deviation.beta),
        ("global", "conditional failure", global),
        ("global", "interval of the certified share", global),
    ];
    let rounds = (0..growth.rounds).map(|round| ("growth", "round", round, growth.round_beta()));
    let once = claims.into_iter().map(|(claim, purpose, beta)| (claim, purpose, 0, beta));
    for (claim, purpose, round, beta) in once.chain(rounds) {
        let entry =
            Entry { claim: claim.to_owned(), purpose: purpose.to_owned(), call: 0, round, beta };
        if let Spend::Refused { left } = ledger.spend(entry) {
            let problem = format!("the claims together spend more than 1 ({left} left)");
            return Err(Error::invalid("beta", problem));
        }
    }
    Ok(ledger)
}

/// The ledger's lines as records.
pub(super) fn spendings(ledger: &Ledger) -> Vec<Spending> {
    let line = |entry: &Entry| Spending {
        claim: entry.claim.clone(),
        item: match entry.purpose.as_str() {
            "round" => format!("round {}", entry.round + 1),
            other => other.to_owned(),
        },
        beta: entry.beta,
    };
    ledger.entries().iter().map(line).collect()
}

/// Who computed what from which input.
pub(crate) fn provenance(
    program: &Program<'_>,
    seed: u64,
    config: serde_json::Value,
) -> Provenance {
    let (plant, backend) = (program.plant(), program.backend());
    let (physics_sha256, policy_sha256) = hashes(plant);
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        generator: GENERATOR.to_owned(),
        config,
        policy: plant.controller.name.clone(),
        policy_sha256,
        physics_sha256,
        backend: backend.name().to_owned(),
        device: backend.device(),
    }
}

/// SHA-256 of the recorded physics and of the policy.
pub fn hashes(plant: &Plant) -> (String, String) {
    let physics = digest::sha256([plant.text().as_bytes()]);
    // A formula is part of the recorded text.
    let policy = plant.controller.network().map_or_else(|| physics.clone(), Mlp::digest);
    (physics, policy)
}

/// Tier and margins of the state.
fn state(
    context: Context<'_>,
    settings: &Settings,
    tightening: &Tightening,
    (growth, band): (&GrowthRecord, f64),
) -> Result<StateRecord> {
    let (x, query) = (&*settings.state, Query::Measure);
    let states = States::one(x);
    let margins = global::check_margins(context, &settings.spec, tightening, states, query, band)?;
    let check_margin = decimal(margins[0]);
    let target_margin = decimal(finite_margin(context.model().target_at(x, 0)));
    let tier = super::verify::tier(target_margin, check_margin, growth, x).number();
    let constraint_margin = decimal(finite_margin(context.model().constraint_at(x, 0)));
    Ok(StateRecord { x: x.to_vec(), tier, check_margin, target_margin, constraint_margin })
}

/// A few rollouts: the state's, then starts of the growth's last round.
fn picture(plant: &Plant, settings: &Settings, growth: &GrowthRecord) -> PictureRecord {
    let region = Region::Box { low: settings.low.to_vec(), high: settings.high.to_vec() };
    let stream = Stream::new(settings.seed, purpose::PICTURE, 0);
    let sampled = growth.samples.iter().take(PICTURED).map(|sample| sample.x.clone());
    let mut starts: Vec<Vec<f32>> =
        std::iter::once(settings.state.to_vec()).chain(sampled).collect();
    let missing = (PICTURED + 1).saturating_sub(starts.len()) as u64;
    for index in 0..missing {
        starts.push(region.point(stream, index));
    }
    let none = Tightening::none(&settings.spec);
    let rollouts = starts.into_iter().map(|start| RolloutRecord {
        states: replay::states(plant, &start, settings.spec.horizon),
        success: replay::measure(plant, &start, &settings.spec, &none) > 0.0,
    });
    PictureRecord { rollouts: rollouts.collect() }
}
