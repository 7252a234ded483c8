//! The search for failures, the whole box, and counterexamples that are replayed.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::common;
use std::fs;
use std::path::Path;

use crate::command::{Folder, document, done, reachcast, refused};
use crate::common::{backends, cpu};
use reachcast::backend::Backend;
use reachcast::config::{Config, Overrides};
use reachcast::model::Plant;
use reachcast::model::text::{Description, read};
use reachcast::rollout::{
    Ball, Keep, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts, StateList, Stream,
    Tightening, replay,
};
use reachcast::scenario::falsify::{FalsifyRecord, FalsifySettings, falsify, roll_out};
use reachcast::scenario::{Unwatched, purpose};
use serde_json::Value;

/// Rollouts within which the failures of both plants are found.
const BUDGET: u64 = 40_000;
const TRAP: &str = "tests/fixtures/falsify/trap.toml";
const RIDGE: &str = "tests/fixtures/falsify/ridge.toml";

/// The plant of a file and its box, with a part of the text replaced, and its horizon.
fn plant(file: &str, [from, to]: [&str; 2]) -> (Plant, Region, RolloutSpec) {
    let text = fs::read_to_string(file).unwrap();
    assert!(text.contains(from), "{from}");
    let text = text.replace(from, to);
    let text = text.split("[rollout]").next().unwrap();
    let description: Description = read(text, file, Path::new(".")).unwrap();
    let model = description.model().unwrap();
    let side = |of: fn(&reachcast::system::Axis) -> f32| -> Vec<f32> {
        model.states.iter().map(of).collect()
    };
    let region = Region::new_box(side(|axis| axis.low), side(|axis| axis.high)).unwrap();
    let horizon = if file == RIDGE { 60 } else { 30 };
    let plant = Plant::new(model, description.controller().unwrap());
    (plant, region, RolloutSpec::new(horizon, 0.95).unwrap())
}

fn search(
    backend: &Backend,
    (plant, region, spec): &(Plant, Region, RolloutSpec),
    budget: u64,
    seed: u64,
) -> FalsifyRecord {
    let settings =
        FalsifySettings { region: region.clone(), pairs: None, spec: *spec, budget, seed };
    falsify(&backend.prepare(plant).unwrap(), &settings, &Unwatched).unwrap()
}

/// How many of so many uniform starts fail.
fn failures(
    backend: &Backend,
    (plant, region, spec): &(Plant, Region, RolloutSpec),
    draws: u64,
) -> u64 {
    let stream = Stream::new(5, Purpose::USER, 0);
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region: region.clone(), stream },
        range: 0..draws,
        spec: *spec,
        tightening: &Tightening::none(spec),
        query: Query::Sign,
    };
    let program = backend.prepare(plant).unwrap();
    program.tally(&task, Keep::Counts).unwrap().counts().failures()
}

const AS_IT_IS: [&str; 2] = ["[model]", "[model]"];

/// Two plants of whose boxes less than a hundred-thousandth fails: no uniform start finds it.
#[test]
fn failures_that_no_uniform_start_meets_are_found_on_every_backend() {
    for file in [TRAP, RIDGE] {
        let searched = plant(file, AS_IT_IS);
        assert_eq!(failures(&cpu(2), &searched, 100_000), 0, "{file}");
        assert!(failures(&cpu(2), &searched, 2_000_000) <= 12, "{file}");
        for backend in backends() {
            // A software adapter takes its time.
            let seeds = if backend.name() == "cpu" { 1..=8 } else { 1..=1 };
            for seed in seeds {
                let found = search(&backend, &searched, BUDGET, seed);
                println!("{file} {} seed {seed}: {} rollouts", backend.name(), found.rollouts);
                assert_found(&searched, &found, &format!("{file}, {}, {seed}", backend.name()));
            }
        }
    }
}

/// What was found fails in f64, lies in the region and is within the budget.
fn assert_found(
    (plant, region, spec): &(Plant, Region, RolloutSpec),
    found: &FalsifyRecord,
    of: &str,
) {
    assert!(found.found && found.failures > 0 && !found.starts.is_empty(), "{of}: {found:?}");
    assert!(found.rollouts <= found.budget, "{of}: {found:?}");
    assert_eq!((found.uniform, found.uniform_failures), (found.budget / 4, 0), "{of}");
    for start in &found.starts {
        assert!(start.measure <= 0.0 && region.contains(&start.x), "{of}: {start:?}");
        let measure = replay::measure(plant, &start.x, spec, &Tightening::none(spec));
        assert!(measure <= 0.0, "{of}: {start:?} has {measure} in f64");
    }
}

/// Without the trap nothing fails: the budget is spent to the last rollout, and not one more.
#[test]
fn where_nothing_fails_it_says_what_was_tried() {
    let safe = plant(TRAP, ["value = 0.01", "value = -1.0"]);
    for budget in [1, 37, 3001, 20_000] {
        let tried = search(&cpu(2), &safe, budget, 1);
        assert!(!tried.found && tried.starts.is_empty() && tried.failures == 0, "{tried:?}");
        assert_eq!((tried.rollouts, tried.uniform), (budget, (budget / 4).max(1)), "{tried:?}");
        let best = tried.best.as_ref().unwrap();
        assert!(best.measure > 0.0 && best.index < budget && safe.1.contains(&best.x));
        assert!(budget < 1000 || tried.restarts > 1, "{tried:?}");
    }
    for budget in [0, u64::MAX] {
        let settings =
            FalsifySettings { region: safe.1.clone(), pairs: None, spec: safe.2, budget, seed: 1 };
        let backend = cpu(1);
        let program = backend.prepare(&safe.0).unwrap();
        assert!(falsify(&program, &settings, &Unwatched).is_err(), "{budget}");
    }
}

#[test]
fn the_same_seed_is_the_same_search_on_any_number_of_threads() {
    for (file, change) in [(TRAP, ["value = 0.01", "value = -1.0"]), (RIDGE, AS_IT_IS)] {
        let searched = plant(file, change);
        let one = search(&cpu(1), &searched, 9000, 3);
        assert_eq!(one, search(&cpu(3), &searched, 9000, 3));
        assert_ne!(one.best, search(&cpu(1), &searched, 9000, 4).best);
    }
}

/// A ball that has the trap near its rim, with both loads frozen but one.
#[test]
fn a_search_stays_within_its_ball() {
    let (plant, _, spec) = plant(TRAP, AS_IT_IS);
    let ball = Ball {
        center: vec![0.31, -0.2, 0.2, -0.4],
        radius: 0.345,
        varies: vec![true, true, true, false],
    };
    let searched = (plant, Region::Ball(ball), spec);
    let found = search(&cpu(2), &searched, BUDGET, 1);
    assert_found(&searched, &found, "ball");
    assert!(found.starts.iter().all(|start| start.x[3] == -0.4));
}

/// What only f32 takes for a failure is none.
#[test]
fn a_failure_in_f32_alone_does_not_count() {
    let wall = "min(1 - abs(position), apart - trap)";
    let lost = "0.001 + (position + 100000 - 100000 - position)";
    let tried = search(&cpu(2), &plant(TRAP, [wall, lost]), 2000, 1);
    assert!(!tried.found && tried.unconfirmed > 100 && tried.starts.is_empty(), "{tried:?}");
    assert!(tried.best.unwrap().measure > 0.0 && tried.rollouts == 2000);
}

/// Nor among the starts of a file: a measure near zero is that of f64.
#[test]
fn starts_of_a_file_near_zero_are_decided_in_f64() {
    let wall = "min(1 - abs(position), apart - trap)";
    // In f32 the last term is off by up to 0.004; the margins stay within the band by the factor.
    let lost = "0.000001 * (0.001 + (position + 100000 - 100000 - position))";
    let (plant, region, spec) = plant(TRAP, [wall, lost]);
    let stream = Stream::new(1, Purpose::USER, 0);
    let list = StateList::new(4).with((0..500).map(|index| region.point(stream, index)));
    let backend = cpu(2);
    let program = backend.prepare(&plant).unwrap();
    let single = program.measures(&list, &spec).unwrap();
    let found = roll_out(&program, spec, list.view(), &Unwatched).unwrap();
    assert!(single.iter().filter(|measure| **measure <= 0.0).count() > 100);
    assert_eq!((found.starts, found.failures, found.worst.len()), (500, 0, 0));
}

/// The worst start of a ball lies at its rim, where rounding may put it outside.
#[test]
fn the_rim_of_a_ball_is_not_left() {
    let (plant, _, spec) = plant(TRAP, ["value = 0.01", "value = -1.0"]);
    for seed in 1..=10 {
        let center = vec![0.4, 0.2, 0.1, 0.7];
        let ball = Ball { center, radius: 0.1, varies: vec![true; 4] };
        let searched = (plant.clone(), Region::Ball(ball.clone()), spec);
        let x = search(&cpu(2), &searched, 4000, seed).best.unwrap().x;
        assert!(ball.contains(&x) && ball.distance(&x) > 0.0999, "{seed}: {x:?}");
    }
}

/// The columns of a table by their names.
fn table(path: &str) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let row = |fields: Vec<String>| {
        assert_eq!(fields.len(), names.len());
        let fields = fields.into_iter().map(|field| Value::from(field.parse::<f64>().unwrap()));
        Value::Object(names.iter().cloned().zip(fields).collect())
    };
    lines.map(row).collect()
}

/// The measures that `rollout` gives of the starts in a table.
fn rolled_out(
    config: &str,
    starts: &str,
    backend: &str,
    set: &[&str],
    folder: &Folder,
) -> Vec<f64> {
    let measures = folder.path("measures.csv");
    let mut arguments = vec!["rollout", config, "--starts", starts, "--measures", &measures];
    arguments.extend(["--backend", backend, "--overwrite"]);
    set.iter().for_each(|set| arguments.extend(["--set", set]));
    done(&arguments);
    let text = fs::read_to_string(&measures).unwrap();
    text.lines().skip(1).map(|line| line.parse::<f64>().unwrap()).collect()
}

/// Whether both are the same f32.
fn same(listed: &Value, measure: f64) -> bool {
    listed.as_f64().unwrap() as f32 == measure as f32
}

#[test]
fn the_command_tells_by_its_exit_code_and_its_table_is_replayed() {
    let folder = Folder::new();
    let out = folder.path("search");
    let asked = ["falsify", RIDGE, "--budget", "40000", "--out", &out, "--backend", "cpu"];
    let (code, output, message) = reachcast(&asked);
    assert_eq!(code, Some(3), "{message}{output}");
    for words in ["a start of the box fails", "of 40000 rollouts", "10000 uniform draws"] {
        assert!(output.contains(words), "no `{words}` in {output}");
    }
    let starts = format!("{out}/counterexamples.csv");
    let (rows, measures) = (table(&starts), rolled_out(RIDGE, &starts, "cpu", &[], &folder));
    assert!(!rows.is_empty() && rows.len() == measures.len());
    assert!(rows.iter().zip(measures).all(|(row, m)| same(&row["measure:policy"], m) && m <= 0.0));
    let safe = folder.path("safe");
    let set = "model.parameters.trap.value=-1.0";
    let asked = ["falsify", TRAP, "--set", set, "--budget", "2000", "--backend", "cpu"];
    let said = document(&[&asked[..], &["--out", &safe]].concat());
    assert_eq!((&said["found"], &said["rollouts"]), (&false.into(), &2000.into()));
    assert_eq!(said["schema"], 1);
    let stored = fs::read_to_string(format!("{safe}/falsify.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&stored).unwrap(), said);
    assert!(!Path::new(&format!("{safe}/counterexamples.csv")).exists());
    refused(&["falsify", TRAP, "--budget", "0", "--out", &folder.path("none")], &["budget"]);
    refused(&["falsify", TRAP, "--out", &safe, "--backend", "cpu"], &["another --out"]);
    refused(&["falsify", "--around", &safe, "--backend", "cpu"], &["certificate.json"]);
}

/// What makes a certificate small.
const SMALL: [&str; 5] = [
    "global.draws=4000",
    "deviation.pilot=100",
    "growth.radius=0.3",
    "slice.x.step=0.5",
    "slice.y.step=0.5",
];

fn certify(config: &str, set: &[&str], out: &str, backend: &str) -> (Option<i32>, Value) {
    let mut arguments = vec!["certify", config, "--out", out, "--backend", backend, "-q"];
    SMALL.iter().chain(set).for_each(|set| arguments.extend(["--set", set]));
    let (code, _, message) = reachcast(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{message}");
    let text = fs::read_to_string(format!("{out}/certificate.json")).unwrap();
    (code, serde_json::from_str(&text).unwrap())
}

/// A certificate of which a ball is verified, tried by a search.
#[test]
fn a_certificate_is_compared_and_not_declared_false() {
    let folder = Folder::new();
    let out = folder.path("c");
    let (_, record) =
        certify("configs/models/double_integrator.toml", &["state.position=0.6"], &out, "cpu");
    assert_eq!(record["growth"]["outcome"], "verified", "{}", record["statements"]);
    for (within, claim) in [("ball", "growth"), ("box", "box")] {
        let to = folder.path(within);
        let asked = ["falsify", "--around", &out, "--within", within, "--budget", "4000", "--json"];
        let (code, said, message) =
            reachcast(&[&asked[..], &["--out", &to, "--backend", "cpu"]].concat());
        assert!(matches!(code, Some(0 | 3)), "{message}");
        let said: Value = serde_json::from_str(&said).unwrap();
        let against = &said["against"];
        assert_eq!(
            (&against["claim"], &against["refuted"]),
            (&claim.into(), &false.into()),
            "{said}"
        );
        assert_eq!(code == Some(3), said["found"] == true);
        assert!(against["words"].as_str().unwrap().contains("not contradict"), "{against}");
    }
    let set = ["falsify", "--around", &out, "--set", "global.draws=3", "--backend", "cpu"];
    refused(&set, &["cannot be used with"]);
}

/// The whole box of a certificate against starts that are counted here.
#[test]
fn the_whole_box_stands_beside_the_certified_set() {
    let folder = Folder::new();
    let config = "configs/models/double_integrator.toml";
    for backend in ["cpu", "gpu"] {
        if backend == "gpu" && common::adapter().is_none() {
            return;
        }
        let out = folder.path(backend);
        let (code, record) = certify(config, &["state.position=0.6"], &out, backend);
        let found = &record["whole_box"];
        let count = |field: &str| found[field].as_f64().unwrap();
        // A third of the box fails, counted with other starts to within five standard deviations.
        let share = count("failures") / count("draws");
        assert_eq!(count("draws"), 4000.0);
        assert!((share - 0.3212).abs() < 5.0 * (0.218_f64 / 4000.0).sqrt(), "{share}");
        let [low, high] = [0, 1].map(|i| found["risk_interval"][i].as_f64().unwrap());
        assert!(low < share && share < high && found["claim"]["certified_risk"] == high);
        let verdict = found["verdict"].as_str().unwrap();
        assert!(verdict.starts_with("certified is ") && verdict.contains("over the whole box"));
        let spent = record["ledger"].as_array().unwrap();
        assert!(spent.iter().any(|line| line["claim"] == "box" && line["beta"] == 0.001));
        assert_eq!(code, Some(0), "no risk of the whole box was asked for");
        let page = fs::read_to_string(format!("{out}/report.html")).unwrap();
        assert!(page.contains(verdict), "{verdict}");
        let (starts, path) =
            (found["starts"].as_array().unwrap(), format!("{out}/counterexamples.csv"));
        let (rows, measures) = (table(&path), rolled_out(config, &path, backend, &[], &folder));
        assert_eq!([starts.len(), rows.len(), measures.len()], [20; 3]);
        for ((row, start), measure) in rows.iter().zip(starts).zip(&measures) {
            assert!(
                same(&row["measure:policy"], *measure) && same(&start["measure"], *measure),
                "{row}"
            );
            assert_eq!(row["parameter:target"], 0.25);
        }
        assert!(measures.is_sorted() && measures[0] < 0.0, "{measures:?}");
        if backend == "cpu" {
            let (failed, worst) = box_by_hand(config, &["state.position=0.6"]);
            assert_eq!(count("failures"), failed as f64);
            assert!(worst.iter().zip(&measures).all(|(a, b)| *a == *b as f32), "{worst:?}");
        }
        assert!(done(&["check", &out, "--backend", backend]).contains("the certificate holds"));
    }
}

/// How many of the 4000 nominal starts fail, and their smallest measures, counted here.
fn box_by_hand(config: &str, set: &[&str]) -> (usize, Vec<f32>) {
    let (plant, region, spec) = plant(config, AS_IT_IS);
    let set = set.iter().chain(&SMALL).map(|set| (*set).to_owned()).collect();
    let overrides = Overrides { set, ..Overrides::default() };
    let config = Config::load(Path::new(config), &overrides).unwrap();
    let settings = config.settings(&plant.model.states).unwrap().keyed(&plant);
    let stream = settings.stream(purpose::CONDITIONAL_NOMINAL, 0);
    let starts: Vec<Vec<f32>> = (0..4000).map(|index| region.point(stream, index)).collect();
    let list = StateList::new(2).with(&starts);
    let backend = cpu(1);
    let mut measures = backend.prepare(&plant).unwrap().measures(&list, &spec).unwrap();
    measures.sort_by(f32::total_cmp);
    let failed = measures.iter().filter(|measure| **measure <= 0.0).count();
    measures.truncate(20);
    (failed, measures)
}

#[test]
fn a_risk_of_the_whole_box_that_is_asked_for_is_a_claim() {
    let folder = Folder::new();
    let config = "configs/models/double_integrator.toml";
    for (risk, expected) in [("0.5", 0), ("0.2", 3)] {
        let out = folder.path(risk);
        let set = ["state.position=0.6", &format!("global.box_risk={risk}")];
        let (code, record) = certify(config, &set, &out, "cpu");
        assert_eq!((code, record["holds"] == true), (Some(expected), expected == 0), "{risk}");
        assert_eq!(record["whole_box"]["claim"]["epsilon"], risk.parse::<f64>().unwrap());
        assert!(done(&["check", &out, "--backend", "cpu"]).contains("the certificate holds"));
    }
    let bad = ["certify", config, "--set", "global.box_risk=1.5", "--out", &folder.path("bad")];
    refused(&bad, &["global.box_risk", "1.5"]);
}

/// The perturbed starts of a certified set that is too large, under either control, and of a sound one.
#[test]
fn the_certified_set_is_searched_by_pairs() {
    let folder = Folder::new();
    let config = "configs/models/dubins.toml";
    let wrong = ["constants.target=0.001", "constants.constraint=0.001", "deviation.radius=0.3"];
    for (name, control, set) in
        [("r", "replay", &wrong[..]), ("c", "closed-loop", &wrong[..]), ("s", "replay", &[])]
    {
        let (out, to) = (folder.path(name), folder.path(&format!("{name}-search")));
        let control = format!("deviation.control={control}");
        // By constants: a set by drops has a risk, and pairs that fail.
        let by_constants = [control.as_str(), "global.tightening=lipschitz"];
        certify(config, &[set, &by_constants].concat(), &out, "cpu");
        let asked = ["falsify", "--around", &out, "--within", "certified", "--budget", "20000"];
        let asked = [&asked[..], &["--out", &to, "--backend", "cpu", "--json"]].concat();
        let (code, said, message) = reachcast(&asked);
        let said: Value = serde_json::from_str(&said).expect(&message);
        assert_eq!(code, Some(if set.is_empty() { 0 } else { 3 }), "{name}: {said}");
        assert!(said["rollouts"].as_u64().unwrap() <= 20_000 && said["uniform"].as_u64() > Some(0));
        assert_eq!(said["against"]["claim"], "global");
        if set.is_empty() {
            continue;
        }
        let path = format!("{to}/counterexamples_replayed.csv");
        let (rows, measures) = (table(&path), rolled_out(config, &path, "cpu", &[], &folder));
        assert!(!rows.is_empty() && rows.len() == measures.len());
        for (row, measure) in rows.iter().zip(measures) {
            assert!(measure <= 0.0 && same(&row["measure:replay"], measure), "{row}");
        }
    }
}

/// Constants that are far too small certify pairs that fail: they are listed and replayed.
#[test]
fn failing_pairs_are_replayed_under_their_controls() {
    let folder = Folder::new();
    let config = "configs/models/dubins.toml";
    let set = [
        "constants.target=0.001",
        "constants.constraint=0.001",
        "deviation.radius=0.3",
        "global.tightening=lipschitz",
    ];
    let out = folder.path("c");
    let (_, record) = certify(config, &set, &out, "cpu");
    let pairs = record["whole_box"]["pairs"].as_array().unwrap();
    assert!(!pairs.is_empty(), "{}", record["global"]["claim"]);
    let path = format!("{out}/counterexamples_replayed.csv");
    let (rows, (dubins, ..)) = (table(&path), plant(config, AS_IT_IS));
    for backend in ["cpu", "gpu"] {
        let measures = rolled_out(config, &path, backend, &[], &folder);
        assert_eq!([pairs.len(), rows.len()], [measures.len(); 2]);
        for ((row, pair), measure) in rows.iter().zip(pairs).zip(measures) {
            assert!(measure <= 0.0 && same(&row["measure:replay"], measure), "{row}");
            assert!(same(&pair["measure"], measure));
            let away = ["x", "y", "heading"].map(|name| {
                let of = |name: &str| row[name].as_f64().unwrap();
                (of(name) - of(&format!("nominal:{name}"))).powi(2)
            });
            assert!(away.iter().sum::<f64>().sqrt() <= 0.300_001, "{row}");
            let nominal = ["x", "y", "heading"].map(|name| &row[format!("nominal:{name}")]);
            let nominal = nominal.map(|value| f64::from(value.as_f64().unwrap() as f32));
            let first = dubins.control(&nominal, 0)[0] as f32;
            assert_eq!(row["control:0:turn_rate"].as_f64().unwrap() as f32, first, "{row}");
        }
    }
    let checked = done(&["check", &out, "--backend", "cpu"]);
    assert!(checked.contains("ok    counterexamples_replayed.csv"), "{checked}");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("control:59:turn_rate", "control:59:turn", 1)).unwrap();
    let (code, output, _) = reachcast(&["check", &out, "--backend", "cpu"]);
    assert!(code == Some(3) && output.contains("FAILS counterexamples_replayed.csv"), "{output}");
    let measures = folder.path("none.csv");
    let asked = ["rollout", config, "--starts", &path, "--measures", &measures];
    refused(&asked, &["control:59:turn_rate", "which a replay needs"]);
}

/// Everywhere that the search looks is the ball or the box around the state that was asked for.
#[test]
fn a_search_around_a_state_stays_there() {
    let folder = Folder::new();
    let set =
        ["--set", "state.front=0.5", "--set", "growth.coordinates=[\"position\", \"velocity\"]"];
    for (option, words, most) in [
        ("--radius", "the ball of radius 0.1 around the state", 0.1),
        ("--half-width", "the box of half-width 0.1 around the state", 0.1 * 2.0_f64.sqrt()),
    ] {
        let out = folder.path(&option[2..]);
        let asked = ["falsify", TRAP, "--budget", "3000", "--backend", "cpu", option, "0.1"];
        let said = document(&[&asked[..], &set, &["--out", &out]].concat());
        assert_eq!((&said["within"], &said["found"]), (&words.into(), &false.into()));
        assert_eq!(said["fixed"][0], "parameters trap = 0.01");
        assert_eq!(said["fixed"][1], "coordinates front, rear");
        let x = said["best"]["x"].as_array().unwrap();
        let x: Vec<f64> = x.iter().map(|x| x.as_f64().unwrap()).collect();
        assert!(x[0].hypot(x[1]) <= most + 1e-6 && x[0].hypot(x[1]) > 0.0, "{x:?}");
        assert_eq!(x[2..], [0.5, 0.0]);
        let best = said["improvements"].as_array().unwrap();
        let measures: Vec<f64> = best.iter().map(|one| one["measure"].as_f64().unwrap()).collect();
        assert!(measures.windows(2).all(|pair| pair[1] < pair[0]) && measures.len() > 1);
        assert_eq!(measures.last().copied(), said["best"]["measure"].as_f64());
    }
    let bad = ["falsify", TRAP, "--radius", "0", "--out", &folder.path("none"), "--backend", "cpu"];
    refused(&bad, &["--radius", "0"]);
    refused(&["falsify", TRAP, "--radius", "1", "--half-width", "1"], &["cannot be used with"]);
}

/// A file of starts is a count: each of its starts is rolled out.
#[test]
fn a_file_of_starts_is_counted() {
    let folder = Folder::new();
    let (starts, out) = (folder.path("starts.csv"), folder.path("out"));
    let safe = "0,0,0,0\n0.2,0,0,0\n-0.2,0,0,0\n";
    // In the trap.
    fs::write(&starts, format!("{safe}0.31,-0.2,0.55,-0.4\n")).unwrap();
    let asked = ["falsify", TRAP, "--radius", "0.05", "--budget", "500", "--backend", "cpu"];
    let asked = [&asked[..], &["--starts", &starts, "--out", &out]].concat();
    let (code, text, message) = reachcast(&asked);
    assert_eq!(code, Some(3), "{text}{message}");
    for words in [
        "no failing start of the ball",
        "all 4 starts",
        "1 fail",
        "N = 4, k = 1",
        "0.006309 to 0.8",
    ] {
        assert!(text.contains(words), "no `{words}` in {text}");
    }
    let text = fs::read_to_string(format!("{out}/falsify.json")).unwrap();
    let said: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&said["file"]["starts"], &said["file"]["failures"]), (&4.into(), &1.into()));
    assert_eq!(said["file"]["worst"][0]["index"], 3);
    let page = fs::read_to_string(format!("{out}/report.html")).unwrap();
    for words in
        ["1 of 4 fail", "none was found", "no proof", "Smallest measure so far", "trap = 0.01"]
    {
        assert!(page.contains(words), "no `{words}` on the page");
    }
    assert!(!page.contains("NaN") && !page.contains("://"));
    // Another file is another search.
    fs::write(&starts, safe).unwrap();
    refused(&asked, &["another --out"]);
    let other = folder.path("other");
    let asked = [&asked[..asked.len() - 1], &[&*other]].concat();
    let (code, text, _) = reachcast(&asked);
    assert!(code == Some(0) && text.contains("all 3 starts") && text.contains("0 fail"), "{text}");
}
