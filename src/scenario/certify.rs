//! The certificate as a whole: constants, deviation, certified set, slice, boundary, growth.

use std::collections::BTreeMap;
use std::time::Instant;

use super::boundary;
use super::ledger::{Entry, Ledger, Spend};
use super::record::{
    ConstantRecord, ConstantsRecord, DeviationRecord, GrowthRecord, PictureRecord, Provenance,
    Record, RolloutRecord, SCHEMA, Spending, StateRecord, SystemRecord, Timing, decimal,
};
use super::settings::Settings;
use super::{Context, Watch, derived, deviation, global, growth, lipschitz};
use crate::backend::{Backend, physics};
use crate::digest;
use crate::error::{Error, Result};
use crate::policy::Policy;
use crate::rollout::{
    GENERATOR, Plant, Purpose, Query, Region, RolloutSpec, Stream, Tightening, measure, trajectory,
};
use crate::system::System;

/// Rollouts drawn in the picture: the state's, and that many starts of the growth.
const PICTURED: usize = 12;
/// Points whose gradients are sampled beside each computed constant.
const GRADIENT_SAMPLES: u32 = 4096;
/// How much wider a box is tried to see whether a constant depends on it.
const WIDER: f32 = 10.0;

/// Names and number of the coordinates that vary and of those that are frozen.
pub(super) fn coordinates<S, const NX: usize, const NU: usize>(
    system: &S,
    varies: &[bool; NX],
) -> (usize, Vec<String>)
where
    S: System<NX, NU>,
{
    let frozen = system.states().into_iter().zip(varies).filter(|(_, varies)| !**varies);
    let frozen: Vec<String> = frozen.map(|(axis, _)| axis.name).collect();
    (NX - frozen.len(), frozen)
}

/// Certifies the plant: every number of the [`Record`] but the threads of its timing.
///
/// `config` is stored as it is; it is what a later check starts from.
///
/// # Errors
/// [`Error::TooFewScenarios`] and [`Error::Invalid`] before any work; those of the backend;
/// [`Error::Interrupted`] if `watch` says so.
pub fn certify<S, P, const NX: usize, const NU: usize>(
    backend: &Backend,
    plant: Plant<'_, S, P>,
    settings: &Settings<NX>,
    config: serde_json::Value,
    watch: &dyn Watch,
) -> Result<Record>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let begun = Instant::now();
    let context = Context { backend, plant, watch };
    check_settings(settings)?;
    let ledger = ledger(settings)?;
    let Tightened { constants, deviation, losses: tightening } = tightened(context, settings)?;
    let purposes = [Purpose::ConditionalNominal, Purpose::ConditionalPerturbation];
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
        provenance: provenance(backend, plant, settings.seed, config),
        system: system_record(plant.system, settings),
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
pub(super) fn system_record<S, const NX: usize, const NU: usize>(
    system: &S,
    settings: &Settings<NX>,
) -> SystemRecord
where
    S: System<NX, NU>,
{
    let mut states = system.states();
    for (axis, (low, high)) in states.iter_mut().zip(settings.low.into_iter().zip(settings.high)) {
        (axis.low, axis.high) = (low, high);
    }
    SystemRecord {
        name: system.name().to_owned(),
        states: states.to_vec(),
        controls: system.controls().to_vec(),
        bodies: system.bodies(),
    }
}

/// Refuses settings whose claims could not be made, as far as that shows without work: scenarios
/// that are too few, claims that spend more than 1 together, an empty box.
///
/// # Errors
/// [`Error::TooFewScenarios`] and [`Error::Invalid`].
pub fn check_settings<const NX: usize>(settings: &Settings<NX>) -> Result<()> {
    growth::check_scenarios(&settings.growth)?;
    deviation::check_scenarios(&settings.deviation, settings.spec.horizon)?;
    ledger(settings)?;
    Region::new_box(settings.low, settings.high).map(|_| ())
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
pub fn tightened<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    settings: &Settings<NX>,
) -> Result<Tightened>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    Region::new_box(settings.low, settings.high)?;
    let constants = constants(context.plant.system, settings)?;
    let deviation = deviation::bound(context, settings)?;
    let losses = tightening(&deviation.bound, &constants, &settings.spec);
    Ok(Tightened { constants, deviation, losses })
}

/// What V_check is computed with.
#[derive(Clone, Debug)]
pub struct Tightened {
    /// Lipschitz constants.
    pub constants: ConstantsRecord,
    /// Deviation bound.
    pub deviation: DeviationRecord,
    /// What the margins lose.
    pub losses: Tightening,
}

/// The Lipschitz constants, computed, sampled, and used as `settings` ask.
pub(super) fn constants<S, const NX: usize, const NU: usize>(
    system: &S,
    settings: &Settings<NX>,
) -> Result<ConstantsRecord>
where
    S: System<NX, NU>,
{
    let all = [true; NX];
    let inside = lipschitz::margins(system, settings.low, settings.high, all);
    let wider = |side: &[f32; NX], sign: f32| -> [f32; NX] {
        std::array::from_fn(|i| side[i] + sign * WIDER * (settings.high[i] - settings.low[i]))
    };
    let (low, high) = (wider(&settings.low, -1.0), wider(&settings.high, 1.0));
    let outside = lipschitz::margins(system, low, high, all);
    let (samples, seed) = (GRADIENT_SAMPLES, settings.seed);
    let sampled = lipschitz::sampled(system, settings.low, settings.high, all, samples, seed);
    let one = |name: &str, given: Option<f64>, computed: f64, beyond: f64, sampled: f64| {
        let used = given.unwrap_or(computed);
        if !(used.is_finite() && used > 0.0) {
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
pub(super) fn ledger<const NX: usize>(settings: &Settings<NX>) -> Result<Ledger> {
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
pub(crate) fn provenance<S, P, const NX: usize, const NU: usize>(
    backend: &Backend,
    plant: Plant<'_, S, P>,
    seed: u64,
    config: serde_json::Value,
) -> Provenance
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let (physics_sha256, policy_sha256) = hashes(plant);
    Provenance {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        generator: GENERATOR.to_owned(),
        config,
        policy: plant.policy.name(),
        policy_sha256,
        physics_sha256,
        backend: backend.name().to_owned(),
        device: backend.device(),
    }
}

/// SHA-256 of the recorded physics and of the policy.
pub fn hashes<S, P, const NX: usize, const NU: usize>(plant: Plant<'_, S, P>) -> (String, String)
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let text = physics(plant);
    let physics = digest::sha256([text.as_bytes()]);
    // A formula is part of the recorded text.
    let policy = plant.policy.network().map_or_else(|| physics.clone(), |mlp| mlp.digest());
    (physics, policy)
}

/// Tier and margins of the state.
fn state<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    settings: &Settings<NX>,
    tightening: &Tightening,
    (growth, band): (&GrowthRecord, f64),
) -> Result<StateRecord>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let x = settings.state;
    let query = Query::Measure;
    let margins = global::check_margins(context, &settings.spec, tightening, &[x], query, band)?;
    let check_margin = decimal(margins[0]);
    let target_margin = decimal(context.plant.system.target(x));
    let tier = super::verify::tier(target_margin, check_margin, growth, &x);
    let constraint_margin = decimal(context.plant.system.constraint(x));
    Ok(StateRecord { x: x.to_vec(), tier, check_margin, target_margin, constraint_margin })
}

/// A few rollouts: the state's, then starts of the growth's last round.
fn picture<S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    settings: &Settings<NX>,
    growth: &GrowthRecord,
) -> PictureRecord
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let region = Region::Box { low: settings.low, high: settings.high };
    let stream = Stream::new(settings.seed, Purpose::Picture, 0);
    let sampled = growth.samples.iter().take(PICTURED).map(|sample| sample.x.clone());
    let mut starts: Vec<Vec<f32>> =
        std::iter::once(settings.state.to_vec()).chain(sampled).collect();
    let missing = (PICTURED + 1).saturating_sub(starts.len()) as u64;
    for index in 0..missing {
        starts.push(region.sample::<1>(stream, index).map(|lane| lane.0[0]).to_vec());
    }
    let none = Tightening::none(&settings.spec);
    let rollouts = starts.into_iter().map(|start| {
        let start: [f32; NX] = std::array::from_fn(|i| start[i]);
        let states = trajectory::<f32, S, P, NX, NU>(plant, start, settings.spec.horizon);
        RolloutRecord {
            states: states.into_iter().map(|x| x.to_vec()).collect(),
            success: measure(plant, start, &settings.spec, &none) > 0.0,
        }
    });
    PictureRecord { rollouts: rollouts.collect() }
}
