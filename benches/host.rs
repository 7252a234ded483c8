//! The host's own time of a call on an adapter, without what the driver takes to submit and to wait:
//! asserted, at most 30 us and 1 us for each dispatch beyond ten, for 158 rollouts and for a plan.
//!
//! `cargo bench --bench host`

use std::process::ExitCode;
use std::time::Instant;

use reachcast::backend::gpu::{Choice, Gpu, NetworkKernels};
use reachcast::backend::{Backend, Program};
use reachcast::model::Plant;
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::race::DroneRace;
use reachcast::race::bench::data;
use reachcast::rollout::{
    CostQuery, DeviationTask, Keep, MppiTask, PairControl, Pairs, Planning, Query, ReachAvoidTask,
    Region, RolloutSpec, Starts, States, Stream, Tightening,
};
use reachcast::{bench, system::System};

/// Calls before the first that counts.
const WARM_UP: usize = 50;
/// Calls that count.
const CALLS: usize = 400;
/// Starts of a batch.
const STARTS: u64 = 158;
/// Most own time of a call of ten dispatches, s.
const MOST_SECONDS: f64 = 30e-6;
/// What each dispatch more may take, s.
const DISPATCH_SECONDS: f64 = 1e-6;

/// A network from 12 states to 3 controls, three hidden layers of 64.
fn network() -> Mlp {
    let layer = |pair: &[usize]| Layer::dense(vec![0.01; pair[0] * pair[1]], vec![0.0; pair[1]]);
    let layers = [12, 64, 64, 64, 3].windows(2).map(layer).collect();
    Mlp::new(layers, Activation::Relu, Activation::Tanh).expect("a whole network")
}

/// An adapter whose rollouts run networks as `networks` says.
fn opened(networks: NetworkKernels) -> Option<Backend> {
    let gpu = Gpu::open(&Choice::Any).ok()?;
    Some(Backend::Gpu(gpu.with_networks(networks)))
}

/// Starts of the race's own box, `[starts, 12]`.
fn starts() -> Vec<f32> {
    let axes = DroneRace::default().states();
    let low = axes.each_ref().map(|axis| axis.low);
    let region = Region::new_box(low, axes.map(|axis| axis.high));
    let stream = Stream::new(1, bench::PURPOSE, 0);
    let drawn = Starts::Drawn { region: region.expect("a box"), stream };
    (0..STARTS).flat_map(|index| drawn.start(index)).collect()
}

/// What a call took.
struct Cost {
    /// In all, the median, s.
    whole: f64,
    /// Without submissions and waits, the median, s.
    own: f64,
    /// The same of the quickest tenth of the calls: those that nobody else on the machine held up, s.
    undisturbed: f64,
}

/// What the calls of `call` took, of which each is given its number.
fn timed(backend: &Backend, mut call: impl FnMut(usize)) -> Cost {
    let Backend::Gpu(gpu) = backend else { unreachable!("it was opened as one") };
    (0..WARM_UP).for_each(&mut call);
    let calls = (0..CALLS).map(|number| {
        let (before, begun) = (gpu.driver_time(), Instant::now());
        call(WARM_UP + number);
        let whole = begun.elapsed().as_secs_f64();
        (whole, whole - (gpu.driver_time() - before).as_secs_f64())
    });
    let (mut whole, mut own): (Vec<f64>, Vec<f64>) = calls.unzip();
    [&mut whole, &mut own].into_iter().for_each(|times| times.sort_by(f64::total_cmp));
    Cost { whole: whole[CALLS / 2], own: own[CALLS / 2], undisturbed: own[CALLS / 10] }
}

/// Whether the own time keeps to what `dispatches` dispatches may take; `None` where nothing is asked.
fn report(name: &str, Cost { whole, own, undisturbed }: Cost, dispatches: Option<u64>) -> bool {
    let micro = |seconds: f64| 1e6 * seconds;
    let [whole, own, least] = [whole, own, undisturbed].map(micro);
    print!("{name:32} call {whole:8.1} us, own {own:6.1} us, undisturbed {least:6.1} us");
    let Some(dispatches) = dispatches else {
        println!();
        return true;
    };
    let most = MOST_SECONDS + DISPATCH_SECONDS * dispatches.saturating_sub(10) as f64;
    println!(" of at most {:.0} us for {dispatches} dispatches", micro(most));
    undisturbed <= most
}

/// What rollouts are of.
fn task<'a>(
    starts: &'a Starts<'a>,
    tightening: &'a Tightening,
    query: Query,
) -> ReachAvoidTask<'a> {
    let spec = data::rollout_spec().expect("a horizon");
    ReachAvoidTask { starts: starts.clone(), range: 0..STARTS, spec, tightening, query }
}

/// Measures, signs, counts and pairs of `STARTS` starts under a network.
fn rollouts(networks: NetworkKernels, dispatches: Option<u64>) -> bool {
    let Some(backend) = opened(networks) else { return true };
    let plant = Plant::of(DroneRace::default(), network());
    let program = backend.prepare(&plant).expect("it fits");
    let list = starts();
    let listed = Starts::Listed(States::new(&list, 12).expect("a list"));
    let spec = data::rollout_spec().expect("a horizon");
    let tightening = Tightening::none(&spec);
    let mut right = true;
    for query in [Query::Measure, Query::Sign] {
        let asked = dispatches.filter(|_| query == Query::Measure);
        let task = task(&listed, &tightening, query);
        let cost = timed(&backend, |_| sent(&program, &task));
        right &= report(&format!("{networks:?} {query:?}"), cost, asked);
        let cost = timed(&backend, |_| drop(program.tally(&task, Keep::Counts).expect("it runs")));
        right &= report(&format!("{networks:?} {query:?}, counts"), cost, asked);
    }
    right & pairs(&program, &backend, &listed, networks)
}

fn sent(program: &Program<'_>, task: &ReachAvoidTask<'_>) {
    program.reach_avoid(task, &mut |_, _| Ok(())).expect("it runs");
}

fn pairs(
    program: &Program<'_>,
    backend: &Backend,
    listed: &Starts<'_>,
    networks: NetworkKernels,
) -> bool {
    let spec: RolloutSpec = data::rollout_spec().expect("a horizon");
    let task = DeviationTask {
        pairs: Pairs {
            nominal: listed.clone(),
            radius: 0.1,
            stream: Stream::new(2, bench::PURPOSE, 0),
        },
        range: 0..STARTS,
        spec,
        tightening: &Tightening::none(&spec),
        control: PairControl::Replay,
    };
    let cost = timed(backend, |_| {
        program.deviation(&task, &mut |_, _| Ok(())).expect("it runs");
    });
    report(&format!("{networks:?} pairs"), cost, None)
}

/// A plan of the race, a new iteration in each call.
fn plans() -> bool {
    let Some(backend) = opened(NetworkKernels::Chosen) else { return true };
    let spec = data::mppi_spec(1024).expect("settings");
    let planning = Planning::of(&DroneRace::default(), data::lane(), spec);
    let program = backend.prepare_plans(&planning).expect("it fits");
    let problems = [data::mppi_problem(1, 0)];
    let cost = timed(&backend, |number| {
        let task =
            MppiTask { problems: &problems, iteration: number as u32, costs: CostQuery::Summary };
        drop(program.improve(&task).expect("it runs"));
    });
    report("plan of the race, 1,024 samples", cost, Some(3))
}

fn main() -> ExitCode {
    let right = [
        rollouts(NetworkKernels::Fused, Some(2)),
        rollouts(NetworkKernels::Layered, None),
        plans(),
    ];
    if right.iter().all(|right| *right) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
