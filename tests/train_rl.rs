//! Reinforcement learning: backups against dynamic programming, games whose solution is known, runs
//! that are interrupted.
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod command;
mod common;
mod training;

use std::cell::Cell;
use std::path::Path;

use command::{Folder, document};
use common::cpu;
use reachcast::backend::Backend;
use reachcast::config::Config;
use reachcast::model::{Model, Plant};
use reachcast::policy::{Activation, Layer, Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::rollout::{RolloutSpec, States, Stream, reach_avoid};
use reachcast::scenario::record::Provenance;
use reachcast::scenario::{Unwatched, Watch};
use reachcast::system::{BangBang, DoubleIntegrator, System};
use reachcast::train::backup::Margins;
use reachcast::train::contest::{Contest, pushed};
use reachcast::train::ddpg::{Ddpg, Game};
use reachcast::train::device::Device;
use reachcast::train::environments::Environments;
use reachcast::train::gae::{Step, advantages};
use reachcast::train::ppo::{Lesson, Ppo};
use reachcast::train::purpose;
use reachcast::train::record::{Origin, TrainRecord};
use reachcast::train::replay::Replay;
use reachcast::train::reward::{Reward, Visited};
use reachcast::train::run::{Learner, Run};
use reachcast::train::score::{share, successes};
use reachcast::train::settings::TrainSettings;
use reachcast::{Error, Result};
use training::{config, intervals, settings, task};

/// The players of the double integrator and their critic.
fn players<'a>(system: &DoubleIntegrator, backend: &'a Backend, config: &Config) -> Ddpg<'a> {
    let game = Game {
        contest: config.contest(&Model::of(*system)).unwrap(),
        states: intervals(system),
        hidden: settings(config).hidden.clone(),
    };
    let task = task(system, backend, &Device::cpu(), config);
    Ddpg::new(task, game, settings(config).ddpg.clone()).unwrap()
}

/// The policy of the double integrator on its ordinary reward.
fn pupil<'a>(system: &DoubleIntegrator, backend: &'a Backend, config: &Config) -> Ppo<'a> {
    let TrainSettings { ppo, hidden, .. } = settings(config);
    let goal = config.goal(&system.states()).unwrap();
    let reward =
        Reward { task: reachcast::model::Task::default(), goal, weights: ppo.reward.clone() };
    let lesson = Lesson { reward, states: intervals(system), hidden: hidden.clone() };
    Ppo::new(task(system, backend, &Device::cpu(), config), lesson, ppo.clone())
}

/// Stops the work after so many updates.
struct Patience(Cell<u64>);

impl Watch for Patience {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, count: u64) -> Result<()> {
        let left = self.0.get().checked_sub(count).ok_or(Error::Interrupted)?;
        self.0.set(left);
        Ok(())
    }
}

/// A record, and the bytes of the files.
type Outcome = (TrainRecord, Vec<(String, Vec<u8>)>);

/// Trains `learner` in `folder` for `total` updates; the record, and the bytes of the files.
fn trained(
    learner: &mut dyn Learner,
    folder: &Path,
    config: &Config,
    total: u64,
    watch: &dyn Watch,
) -> Result<Outcome> {
    let provenance = Provenance {
        version: String::new(),
        seed: config.seed,
        generator: String::new(),
        config: config.to_train_json().unwrap(),
        policy: String::new(),
        policy_sha256: String::new(),
        physics_sha256: String::new(),
        backend: String::new(),
        device: String::new(),
        networks: None,
    };
    let TrainSettings { method, interval, patience, .. } = *settings(config);
    let origin = Origin { method, provenance };
    let trained = Run { folder, origin, total, interval, patience }.train(learner, watch)?;
    Ok((trained.record, trained.files))
}

/// The double integrator whose acceleration is what a disturbance of `push` per step leaves of it:
/// against full acceleration toward the origin the worst push is away from it.
fn weakened(push: f32) -> DoubleIntegrator {
    DoubleIntegrator { acceleration: 1.0 - push / 0.1, ..DoubleIntegrator::default() }
}

/// The measure of full acceleration toward the origin in f64.
fn best_measure(system: &DoubleIntegrator, start: [f64; 2]) -> f64 {
    let spec = RolloutSpec::new(100, 0.95).unwrap();
    let policy = BangBang { acceleration: system.acceleration };
    let mut x = start.map(|x| f64::from(x as f32));
    let margins = (0..=spec.horizon).map(|_| {
        let margins = (system.target(x), system.constraint(x));
        x = system.step(x, policy.control(x));
        margins
    });
    reach_avoid(margins, f64::from(spec.gamma))
}

/// Values on a grid, bilinear between its points and constant beyond them.
struct Grid {
    values: Vec<f64>,
}

impl Grid {
    const POINTS: [usize; 2] = [121, 201];
    const REACH: [f64; 2] = [1.2, 2.0];

    fn place(i: usize, axis: usize) -> f64 {
        Self::REACH[axis] * (2.0 * i as f64 / (Self::POINTS[axis] - 1) as f64 - 1.0)
    }

    fn at(&self, x: [f64; 2]) -> f64 {
        let find = |axis: usize| {
            let last = (Self::POINTS[axis] - 1) as f64;
            let place = (0.5 * (x[axis] / Self::REACH[axis] + 1.0) * last).clamp(0.0, last);
            let cell = place.floor().min(last - 1.0);
            (cell as usize, place - cell)
        };
        let ((i, a), (j, b)) = (find(0), find(1));
        let value = |i: usize, j: usize| self.values[i * Self::POINTS[1] + j];
        let along = |i: usize| (1.0 - b) * value(i, j) + b * value(i, j + 1);
        (1.0 - a) * along(i) + a * along(i + 1)
    }
}

/// The fixed point of the backup that the critic learns, found on a grid, has the sign of the
/// reach-avoid set in closed form, also against a disturbance.
#[test]
fn the_backup_iterated_on_a_grid_is_the_reach_avoid_set() {
    let system = DoubleIntegrator::default();
    let margins =
        |x: [f64; 2]| Margins { target: system.target(x), constraint: system.constraint(x) };
    for push in [0.0_f32, 0.03] {
        let worth = |grid: &Grid, x: [f64; 2]| {
            let under = |u: f64, d: f64| {
                let mut next = system.step(x, [u]);
                pushed(&mut next, &[(1, push)], &[d]);
                margins(next).hold(grid.at(next))
            };
            let worst = |u: f64| under(u, -1.0).min(under(u, 1.0));
            let best = worst(-1.0).max(worst(0.0)).max(worst(1.0));
            margins(x).backup(0.95, best)
        };
        let points = || {
            let [rows, columns] = Grid::POINTS;
            (0..rows * columns)
                .map(move |k| [Grid::place(k / columns, 0), Grid::place(k % columns, 1)])
        };
        let mut grid = Grid { values: vec![-1.0; Grid::POINTS.iter().product()] };
        for _ in 0..150 {
            grid.values = points().map(|x| worth(&grid, x)).collect();
        }
        let (mut wrong, mut seen, mut inside) = (0, 0, 0);
        for x in points().filter(|x| x[1].abs() <= 1.5) {
            let exact = best_measure(&weakened(push), x);
            seen += 1;
            inside += u32::from(exact > 0.0);
            if (grid.at(x) > 0.0) != (exact > 0.0) {
                wrong += 1;
                // Interpolation blurs the boundary by a cell or two.
                let step = [-0.04, 0.0, 0.04];
                let near = step.iter().flat_map(|a| step.map(|b| [x[0] + a, x[1] + b]));
                let turns = near
                    .into_iter()
                    .any(|x| (best_measure(&weakened(push), x) > 0.0) != (exact > 0.0));
                assert!(turns, "{x:?}: {} and {exact}", grid.at(x));
            }
        }
        println!("push {push}: {inside} of {seen} points inside, {wrong} signs differ");
        assert!(f64::from(wrong) < 0.02 * f64::from(seen) && inside > seen / 4);
    }
}

/// The game on the double integrator is known: the policy comes near the share that full
/// acceleration reaches, the disturbance near the share that is left under the worst one, and the
/// critic tells most signs.
#[test]
fn both_players_come_near_the_solution_of_the_game() {
    let push = 0.04_f32;
    let set = [
        "train.ddpg.iterations=2500",
        "train.ddpg.disturbance.velocity=0.04",
        "train.ddpg.actor.rate=1e-3",
        "train.ddpg.batch=128",
        "train.held_out=2048",
    ];
    let config = config("double-integrator", "ddpg", &set);
    let (system, backend) = (DoubleIntegrator::default(), cpu(2));
    let mut learner = players(&system, &backend, &config);
    let before = learner.scores().unwrap();
    for iteration in 0..2500 {
        learner.update(iteration).unwrap();
    }
    let after = learner.scores().unwrap();
    let starts = config.mixture(&system.states()).unwrap().draw(5, purpose::HELD_OUT, 0, 2048);
    let reached = |system: &DoubleIntegrator| {
        let plant = Plant::of(*system, BangBang { acceleration: system.acceleration });
        let spec = config.spec().unwrap();
        let found = successes(&backend, &plant, spec, starts.view()).unwrap();
        share(found.into_iter())
    };
    let [calm, worst] = [reached(&system), reached(&weakened(push))];
    println!("{before:.3?} to {after:.3?}; calm {calm:.3}, worst {worst:.3}");
    assert!(after[0] > 0.93 * calm && after[0] <= calm, "{after:?} of {calm}");
    // No policy does better against the worst disturbance; against a learned one it may, a little.
    assert!(after[1] > 0.9 * worst && after[1] < worst + 0.5 * (calm - worst), "{after:?} {worst}");
    assert!(after[2] > 0.85, "{after:?}");
}

/// Interrupted anywhere and resumed, on any number of threads: the same record and networks.
#[test]
fn a_game_that_was_interrupted_comes_to_the_same() {
    let set = [
        "train.ddpg.iterations=60",
        "train.ddpg.batch=32",
        "train.ddpg.replay=300",
        "train.interval=20",
        "train.held_out=256",
    ];
    let config = config("double-integrator", "ddpg", &set);
    let system = DoubleIntegrator::default();
    let run = |folder: &Path, threads: usize, watch: &dyn Watch| {
        let backend = cpu(threads);
        trained(&mut players(&system, &backend, &config), folder, &config, 60, watch)
    };
    let folder = tempfile::tempdir().unwrap();
    let whole = run(&folder.path().join("whole"), 1, &Unwatched).unwrap();
    let parts = folder.path().join("parts");
    for (updates, threads) in [(7, 1), (25, 2), (13, 1)] {
        let interrupted = run(&parts, threads, &Patience(Cell::new(updates)));
        assert!(matches!(interrupted, Err(Error::Interrupted)));
    }
    assert!(run(&parts, 2, &Unwatched).unwrap() == whole);
    let names: Vec<&str> = whole.1.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["critic.safetensors", "disturbance.safetensors", "policy.safetensors"]);
    let other = self::config("double-integrator", "ddpg", &[&set[..], &["seed=6"]].concat());
    let backend = cpu(1);
    let mut learner = players(&system, &backend, &other);
    let others = trained(&mut learner, &folder.path().join("other"), &other, 60, &Unwatched);
    assert!(others.unwrap().1 != whole.1);
}

/// A ring gives back the rows that were written last, and no other.
#[test]
fn a_replay_holds_the_latest_rows() {
    let mut replay = Replay::new(8, 2);
    let stream = Stream::new(1, purpose::CHOICE, 0);
    for number in 0..11_u64 {
        // No row is zero, as those are that were not written.
        replay.write(number, &[number as f32 + 1.0, -(number as f32)]);
        let written = number + 1;
        let drawn: Vec<f32> = replay.draw(written, stream, 0, 400).map(|row| row[0]).collect();
        let held: Vec<f32> = (written.saturating_sub(8)..written).map(|n| n as f32 + 1.0).collect();
        assert!(held.iter().all(|n| drawn.contains(n)), "{number}");
        assert!(drawn.iter().all(|n| held.contains(n)), "{number}");
    }
}

/// Plants start again at the horizon, where they are told to, and where a state is not finite.
#[test]
fn plants_start_again_when_an_episode_is_over() {
    let config = config("double-integrator", "ddpg", &[]);
    let mixture = config.mixture(&DoubleIntegrator::default().states()).unwrap();
    let mut plants = Environments::new(mixture, 3, 4, 3);
    assert_eq!(plants.ages, [0.0, 1.0, 2.0]);
    let next = [[0.5, 7.0], [0.5, f32::NAN], [9.0, 0.0]];
    let over = |i: usize| next[i][0] > 1.0;
    assert_eq!(plants.advance(0, States::from(&next), over), [false, true, true]);
    assert_eq!(
        (plants.ages.as_slice(), plants.each().row(0)),
        (&[1.0, 0.0, 0.0][..], &next[0][..])
    );
    let inside = |x: &[f32]| x[0].abs() <= 1.2 && x[1].abs() <= 1.5;
    assert!(plants.each().iter().skip(1).all(inside));
    let next = [[0.0; 2]; 3];
    let ended: Vec<bool> =
        (1..4).map(|k| plants.advance(k, States::from(&next), |_| false)[0]).collect();
    assert_eq!(ended, [false, false, true]);
}

/// The disturbed race is the race, and then the push on the opponent's velocities.
#[test]
fn a_disturbed_system_is_pushed_after_its_step() {
    let weight: Vec<f32> = (0..36).map(|i| 0.1 * (i % 7) as f32 - 0.2).collect();
    let layer = Layer::dense(weight, vec![0.1, -0.2, 0.3]);
    let network = Mlp::new(vec![layer.clone()], Activation::Relu, Activation::Tanh).unwrap();
    let (system, entries) = (DroneRace::default(), [(7, 0.01_f32), (9, 0.02), (11, 0.03)]);
    let x: [f64; 12] = std::array::from_fn(|i| 0.1 * i as f64 - 0.4);
    let race = Model::of(system);
    let model = Contest::pushing(&race, &entries).disturbed(&race, &network.into());
    let found = model.next(&x, &[0.3, -2.0, 0.1], 0);
    let calm = system.step(x, [0.3, -2.0, 0.1]);
    for i in 0..12 {
        let push = entries.iter().position(|(state, _)| *state == i).map_or(0.0, |j| {
            let row = &layer.weight[12 * j..12 * (j + 1)];
            let sum: f64 = row.iter().zip(x).map(|(w, x)| f64::from(*w) * x).sum();
            f64::from(entries[j].1) * (sum + f64::from(layer.bias[j])).tanh()
        });
        assert!((found[i] - calm[i] - push).abs() < 1e-9, "{i}: {} {push}", found[i] - calm[i]);
    }
}

/// Advantages are the sums that define them, episode by episode; with no weight on later steps they
/// are temporal differences, with all of it what was earned less what was expected.
#[test]
fn advantages_are_their_sums() {
    let wave = |i: usize, rate: f32| (rate * i as f32 + 0.4).sin();
    let ends = [6, 7, 15, 19];
    let steps: Vec<Step> = (0..20)
        .map(|i| {
            let next_value = if i == 7 { 0.0 } else { wave(i + 1, 1.1) };
            Step { reward: wave(i, 0.7), value: wave(i, 1.1), next_value, last: ends.contains(&i) }
        })
        .collect();
    let gamma = 0.95_f64;
    let delta = |i: usize| {
        let Step { reward, value, next_value, .. } = steps[i];
        f64::from(reward) + gamma * f64::from(next_value) - f64::from(value)
    };
    for lambda in [0.0, 0.9, 1.0] {
        let found = advantages(&steps, gamma as f32, lambda as f32);
        for (i, found) in found.iter().enumerate() {
            let end = *ends.iter().find(|end| **end >= i).unwrap();
            let term = |k: usize| (gamma * lambda).powi((k - i) as i32) * delta(k);
            let expected: f64 = (i..=end).map(term).sum();
            assert!((f64::from(*found) - expected).abs() < 1e-5, "{i}: {found} {expected}");
            if lambda == 1.0 {
                let earned = |k: usize| gamma.powi((k - i) as i32) * f64::from(steps[k].reward);
                let rest = gamma.powi((end + 1 - i) as i32) * f64::from(steps[end].next_value);
                let whole = (i..=end).map(earned).sum::<f64>() + rest - f64::from(steps[i].value);
                assert!((whole - expected).abs() < 1e-5, "{i}: {whole} {expected}");
            }
        }
    }
}

/// Progress, the target and a violation are worth what they should, and a flight out of the target
/// through the gate costs what leaving the target does.
#[test]
fn a_step_earns_progress_and_the_target() {
    let config = config("drone-race", "ddpg", &[]);
    let system = DroneRace::default();
    let weights = settings(&config).ppo.reward.clone();
    let (target, violation) = (weights.target as f32, weights.violation as f32);
    let task = reachcast::model::Task::default();
    let reward = Reward { task, goal: config.goal(&system.states()).unwrap(), weights };
    let earned = |before: [f32; 12], after: [f32; 12]| {
        let [before, after] = [&before, &after].map(|x| {
            let margins = Margins { target: system.target(*x), constraint: system.constraint(*x) };
            Visited { state: x, margins }
        });
        reward.of(before, after)
    };
    let at = |x: f32, y: f32, vy: f32| [x, 0.0, y, vy, 0.0, 0.0, 0.0, 0.0, -1.0, 0.4, 0.0, 0.0];
    let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-5, "{found}");
    // Ahead on the centre line, but slower: half a metre nearer and nothing else.
    near(earned(at(0.0, -0.6, 0.2), at(0.0, -0.1, 0.2)), 0.5);
    // And now faster: in the target.
    near(earned(at(0.0, -0.6, 0.2), at(0.0, -0.1, 0.6)), 0.5 + target);
    near(earned(at(0.0, -0.6, 0.6), at(0.0, -0.1, 0.2)), 0.5 - target);
    // Through the gate from within the target; past it from without.
    near(earned(at(0.0, -0.05, 0.6), at(0.0, 0.1, 0.6)), 0.15);
    near(earned(at(0.0, -0.05, 0.2), at(0.0, 0.1, 0.2)), 0.15 - violation);
    // Aside of the gate, behind its plane.
    let aside = at(0.6, 0.7, 0.2);
    let nearer = 0.6_f32.hypot(0.7) - 0.6_f32.hypot(0.2);
    near(earned(at(0.6, -0.2, 0.2), aside), nearer - violation);
}

/// On the double integrator the ordinary reward leads to the target: PPO finds most of what there
/// is to reach in a few seconds.
#[test]
fn ppo_learns_to_reach() {
    let set = ["train.ppo.iterations=60", "train.held_out=2048"];
    let config = config("double-integrator", "ddpg", &set);
    let (system, backend) = (DoubleIntegrator::default(), cpu(2));
    let mut learner = pupil(&system, &backend, &config);
    let before = learner.scores().unwrap()[0];
    for iteration in 0..60 {
        learner.update(iteration).unwrap();
    }
    let after = learner.scores().unwrap()[0];
    let starts = config.mixture(&system.states()).unwrap().draw(5, purpose::HELD_OUT, 0, 2048);
    let best = Plant::of(system, BangBang { acceleration: 1.0 });
    let found = successes(&backend, &best, config.spec().unwrap(), starts.view()).unwrap();
    let ceiling = share(found.into_iter());
    println!("{before:.3} to {after:.3} of {ceiling:.3}");
    assert!(after > before + 0.1 && after > 0.9 * ceiling && after <= ceiling);
}

/// The same for PPO: interrupted anywhere and resumed, the same record and policy.
#[test]
fn ppo_that_was_interrupted_comes_to_the_same() {
    let set = ["train.method=ppo", "train.ppo.environments=8", "train.ppo.batch=50"];
    let more = ["train.ppo.iterations=8", "train.interval=3", "train.held_out=256"];
    let config = config("double-integrator", "ddpg", &[&set[..], &more].concat());
    let system = DoubleIntegrator::default();
    let run = |folder: &Path, threads: usize, watch: &dyn Watch| {
        let backend = cpu(threads);
        trained(&mut pupil(&system, &backend, &config), folder, &config, 8, watch)
    };
    let folder = tempfile::tempdir().unwrap();
    let whole = run(&folder.path().join("whole"), 1, &Unwatched).unwrap();
    let parts = folder.path().join("parts");
    for (updates, threads) in [(2, 1), (4, 2)] {
        let interrupted = run(&parts, threads, &Patience(Cell::new(updates)));
        assert!(matches!(interrupted, Err(Error::Interrupted)));
    }
    assert!(run(&parts, 2, &Unwatched).unwrap() == whole);
}

/// Takes the keys out of `now` that `then` does not have.
fn only_keys_of(then: &serde_json::Value, now: &mut serde_json::Value) {
    if let (Some(then), Some(now)) = (then.as_object(), now.as_object_mut()) {
        now.retain(|key, _| then.contains_key(key));
        now.iter_mut().for_each(|(key, value)| only_keys_of(&then[key], value));
    }
}

/// A run in which version 0.1 was stopped goes on: what it asks for is asked for in the same
/// words, its scores stay, and it comes to where an undisturbed run comes.
#[test]
fn a_run_of_an_earlier_program_goes_on() {
    let fixture = |name: &str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/training");
        std::fs::read(folder.join(name)).unwrap()
    };
    let folder = Folder::new();
    let [whole, resumed] = ["whole", "resumed"].map(|name| folder.path(name));
    let run = |out: &str| {
        let config = "tests/fixtures/training/ppo.toml";
        document(&["train", config, "--out", out, "--backend", "cpu"])
    };
    let expected = run(&whole);
    // The folder of another processor is another experiment: all but its name is as it was.
    let asked = std::fs::read(format!("{whole}/experiment.json")).unwrap();
    let [mut now, mut then] = [&asked, &fixture("experiment.json")]
        .map(|bytes| serde_json::from_slice::<serde_json::Value>(bytes).unwrap());
    // Parameters are inputs of formulas since version 0.2: the hash is of another text.
    for asked in [&mut now, &mut then] {
        for key in ["device", "version", "physics_sha256"] {
            asked["provenance"][key].take();
        }
        // Nor does the default of a claim's rounds say anything of a training.
        asked["provenance"]["config"]["growth"]["rounds"].take();
    }
    // Keys that certificates have had since then say nothing of a training.
    only_keys_of(&then, &mut now);
    assert_eq!(now, then);
    std::fs::create_dir(&resumed).unwrap();
    std::fs::write(format!("{resumed}/experiment.json"), asked).unwrap();
    let checkpoint = fixture("checkpoint.safetensors");
    std::fs::write(format!("{resumed}/checkpoint.safetensors"), &checkpoint).unwrap();
    let found = run(&resumed);
    let curve = |record: &serde_json::Value| record["curve"].as_array().unwrap().clone();
    let (found, expected) = (curve(&found), curve(&expected));
    let stored = String::from_utf8_lossy(&checkpoint).matches("iteration").count() - 1;
    assert_eq!((found.len(), expected.len()), (31, 31));
    assert!((5..25).contains(&stored), "{stored}");
    for (found, expected) in found.iter().zip(&expected) {
        let apart = |of: [&serde_json::Value; 2]| {
            let [a, b] = of.map(|number| number.as_f64().unwrap_or_default());
            (a - b).abs()
        };
        // Another processor sums in another order.
        assert!(apart([&found["loss"], &expected["loss"]]) < 0.02, "{found} {expected}");
        assert!(apart([&found["scores"][0], &expected["scores"][0]]) < 0.05, "{found} {expected}");
    }
}

/// The command writes the networks of both methods, and a second run has nothing left to do.
#[test]
fn the_command_writes_what_was_trained() {
    let folder = Folder::new();
    for (method, files) in
        [("ddpg", &["critic", "disturbance", "policy"][..]), ("ppo", &["policy"])]
    {
        let out = folder.path(method);
        let few = format!("train.{method}.iterations=4");
        let config = format!("configs/train/race_{method}.toml");
        let run = ["train", &config, "--out", &out, "--set", &few, "--set", "train.held_out=64"];
        let record = document(&run);
        assert_eq!(record["origin"]["method"], method);
        let networks = record["networks"].as_array().unwrap();
        let names: Vec<String> = files.iter().map(|name| format!("{name}.safetensors")).collect();
        assert!(networks.iter().map(|network| &network["file"]).eq(&names), "{networks:?}");
        for (network, name) in networks.iter().zip(&names) {
            let inspected = document(&["policy", "inspect", &format!("{out}/{name}")]);
            assert_eq!(inspected["digest"], network["sha256"]);
        }
        assert_eq!(document(&run), record);
    }
}

/// Numbers out of range are refused by key.
#[test]
fn wrong_settings_name_their_key() {
    for (set, words) in [
        ("train.ddpg.batch=0", "train.ddpg.batch: 0 is not within"),
        ("train.ddpg.environments=0", "train.ddpg.environments: 0 is not within"),
        ("train.ddpg.replay=0", "train.ddpg.replay: 0 is not within"),
        ("train.ddpg.noise=-1", "train.ddpg.noise: -1"),
        ("train.ddpg.random=2", "train.ddpg.random: 2 is not within 0 to 1"),
        ("train.ddpg.polyak=2", "train.ddpg.polyak: 2 is not within 0 to 1"),
        ("train.ddpg.disturbance.velocity=-1", "train.ddpg.disturbance.velocity: -1"),
        ("train.ddpg.critic.rate=0", "train.ddpg.critic.rate: 0"),
        ("train.ppo.steps=0", "train.ppo.steps: 0 is not within"),
        ("train.ppo.clip=2", "train.ppo.clip: 2 is not within 0 to 1"),
        ("train.ppo.spread=0", "train.ppo.spread: 0 is not a positive"),
        ("train.ppo.reward.violation=-1", "train.ppo.reward.violation: -1"),
        ("train.ppo.optimiser.rate=0", "train.ppo.optimiser.rate: 0"),
    ] {
        let config = config("double-integrator", "ddpg", &[set]);
        let refused = config.train_settings().map(|_| ()).unwrap_err();
        assert_eq!(refused.exit_code(), 2);
        let (refused, (key, problem)) = (refused.to_string(), words.split_once(": ").unwrap());
        let said = refused.rsplit_once(&format!("--set {set}: "));
        assert!(
            set.starts_with(key) && said.is_some_and(|(_, said)| said.starts_with(problem)),
            "{refused}"
        );
    }
}
