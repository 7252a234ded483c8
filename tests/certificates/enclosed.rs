//! Certified sets that rest on an enclosure and no sample: whose they are, on every backend, stored and refused.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::Path;

use crate::command::{Folder, document, done, reachcast, refused};
use crate::common::{backends, cpu};
use reachcast::backend::Backend;
use reachcast::model::{Plant, text};
use reachcast::rollout::{PairControl, Region, RolloutSpec, Starts, StateList, States};
use reachcast::scenario::deterministic::{Deterministic, Kind};
use reachcast::scenario::record::Record;
use reachcast::scenario::sequential_record::{SequentialOf, SequentialOutcome, SequentialSettings};
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{Unwatched, certify, check, purpose, query};
use reachcast::system::{BangBang, DoubleIntegrator};

/// A plant, how it is driven, and how balls around its starts are enclosed.
struct Case {
    plant: Plant,
    control: PairControl,
    kind: Kind,
    radius: f32,
}

fn bang_bang() -> Plant {
    Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 })
}

/// The double integrator as text, under the carried network.
fn learned() -> Plant {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let written = std::fs::read_to_string(configs.join("models/double_integrator.toml")).unwrap();
    let (model, _) = written.split_once("[policy]").unwrap();
    let network = "file = 'policies/double_integrator_policy.safetensors'";
    let written = format!("{model}[policy]\n{network}\n");
    text::read(&written, "learned.toml", &configs).unwrap().plant().unwrap()
}

fn cases() -> [Case; 3] {
    use PairControl::{ClosedLoop, Replay};
    let case = |plant, control, kind, radius| Case { plant, control, kind, radius };
    [
        case(bang_bang(), ClosedLoop, Kind::Tube, 0.03),
        case(bang_bang(), Replay, Kind::Pieces, 0.05),
        case(learned(), ClosedLoop, Kind::Tube, 0.03),
    ]
}

impl Case {
    fn settings(&self) -> Settings {
        let spec = RolloutSpec::new(30, 0.95).unwrap();
        let mut settings = Settings::new(&self.plant.model, [0.5, 0.0], spec).unwrap();
        settings.deviation.radius = self.radius;
        settings.deviation.control = self.control;
        settings.enclosed = Some(self.kind);
        settings.global.draws = 600;
        settings.growth.radius = 0.1;
        settings
    }

    fn certificate(&self, spec: RolloutSpec) -> Deterministic<'_> {
        Deterministic::new(&self.plant, spec, self.control, self.kind).unwrap()
    }

    fn certify(&self, backend: &Backend) -> Record {
        let program = backend.prepare(&self.plant).unwrap();
        certify(&program, &self.settings(), serde_json::Value::Null, &Unwatched).unwrap()
    }

    /// Margins of the verdicts on `states`.
    fn margins(&self, states: States<'_>) -> Vec<f64> {
        let settings = self.settings();
        let written: f64 = self.radius.to_string().parse().unwrap();
        let radius = written.max(self.radius.into());
        let verdicts = self.certificate(settings.spec).verdicts(states, radius);
        verdicts.iter().map(|verdict| verdict.margin).collect()
    }
}

/// The nominal starts of the conditional sample.
fn drawn(case: &Case) -> StateList {
    let settings = case.settings().keyed(&case.plant);
    let region = Region::new_box(&*settings.low, &*settings.high).unwrap();
    let stream = settings.stream(purpose::CONDITIONAL_NOMINAL, 0);
    let starts = Starts::Drawn { region, stream };
    StateList::new(2).with((0..settings.global.draws).map(|index| starts.start(index)))
}

/// States of the slice, row by row.
fn cells(record: &Record) -> StateList {
    let rows = record.slice.y.values.iter();
    let row = |y: &f32| record.slice.x.values.iter().map(|x| [*x, *y]).collect::<Vec<_>>();
    StateList::new(2).with(rows.flat_map(row))
}

/// Each draw and each cell is certified exactly where the enclosure says so, whichever the backend, with its
/// margin rounded down; and no perturbed rollout of a certified draw fails.
#[test]
fn the_set_is_that_of_the_enclosure() {
    for case in cases() {
        let margins = case.margins(drawn(&case).view());
        let expected = margins.iter().filter(|margin| **margin > 0.0).count() as u64;
        // Neither nothing, nor what a rollout by itself says.
        let spec = case.settings().spec;
        let alone = case.certificate(spec).verdicts(drawn(&case).view(), 0.0);
        let alone = alone.iter().filter(|verdict| verdict.certified).count() as u64;
        assert!(expected > 100 && expected + 12 < alone, "{expected} of {alone}");
        for backend in backends() {
            let record = case.certify(&backend);
            println!("{:?}, {}: {expected} certified, {alone} succeed", case.kind, backend.name());
            assert_eq!(record.global.accepted, expected, "{}", backend.name());
            assert_eq!(record.global.claim.failures, 0);
            let cells = cells(&record);
            let margins = case.margins(cells.view());
            assert_eq!(margins.len(), record.slice.check_margin.len());
            for ((x, found), margin) in cells.iter().zip(&record.slice.check_margin).zip(margins) {
                assert_eq!(*found > 0.0, margin > 0.0, "{x:?}: {found} {margin}");
                let close = margin - f64::from(*found) <= 1e-6 * margin.abs();
                let below = f64::from(*found) <= margin;
                assert!(margin <= 0.0 || (below && close), "{x:?}: {found} {margin}");
            }
            certified_and_not(&case, &record);
        }
    }
}

/// The ball of growth is centred at a certified state, close to one that is not.
fn certified_and_not(case: &Case, record: &Record) {
    let center = record.growth.center.clone().expect("a boundary");
    let certified = |x: &[f32]| case.margins(States::one(x))[0] > 0.0;
    assert!(certified(&center), "{center:?}");
    let around = (0..64).map(|i| {
        let (sin, cos) = (std::f32::consts::TAU * i as f32 / 64.0).sin_cos();
        [center[0] + 0.02 * cos, center[1] + 0.02 * sin]
    });
    assert!(around.into_iter().any(|x| !certified(&x)), "{center:?}");
}

/// The words say that the set is deterministic, of which kind, radius and control; betas are spent on claims.
#[test]
fn words_and_ledger_say_what_rests_on_samples() {
    let [case, ..] = cases();
    let record = case.certify(&cpu(2));
    let found = record.enclosed.as_ref().expect("an enclosure");
    assert_eq!(
        (found.kind, found.control, found.radius),
        (Kind::Tube, PairControl::ClosedLoop, 0.03)
    );
    for words in ["deterministic", "within 0.03", "policy in feedback", "`tube`"] {
        assert!(found.statement.contains(words), "{words}: {}", found.statement);
    }
    assert!(record.statements.contains(&found.statement));
    let verdict = &record.whole_box.as_ref().expect("a box").verdict;
    assert!(verdict.contains("`tube`") && verdict.contains("0.03"), "{verdict}");
    let mut spent: Vec<&str> = record.ledger.iter().map(|line| line.claim.as_str()).collect();
    spent.dedup();
    assert_eq!(spent, ["deviation", "global", "box", "growth"]);
    assert!(record.drops.is_none() && record.global.claim.epsilon.is_none());
    assert!(record.statements.iter().all(|words| !words.contains("constant of")));
}

/// A stored certificate is checked, answers as the enclosure does, and is refused where it was changed.
#[test]
fn a_stored_set_is_checked_and_queried() {
    let case = &cases()[2];
    let backend = cpu(2);
    let program = backend.prepare(&case.plant).unwrap();
    let settings = case.settings();
    let sealed = case.certify(&backend).sealed().unwrap();
    let record = Record::read(&serde_json::to_string(&sealed).unwrap()).unwrap();
    assert_eq!(record, sealed);
    let report = check(&program, &record, &settings, 77, &Unwatched).unwrap();
    assert!(report.holds, "{report:?}");
    let states: Vec<[f32; 2]> =
        (0..60).map(|i| [-1.1 + 0.037 * i as f32, 1.4 - 0.047 * ((7 * i) % 60) as f32]).collect();
    let states = StateList::new(2).with(&states);
    let rows = query(&program, &record, &settings, states.view()).unwrap();
    let margins = case.margins(states.view());
    let certified = margins.iter().filter(|margin| **margin > 0.0).count();
    assert!(certified > 10 && certified < 55, "{certified}");
    for (row, margin) in rows.iter().zip(&margins) {
        assert_eq!(row.check_margin > 0.0, *margin > 0.0, "{row:?} {margin}");
    }
    let mut other = record.clone();
    other.enclosed.as_mut().unwrap().radius = 0.04;
    let error = query(&program, &other, &settings, states.view()).unwrap_err().to_string();
    assert!(error.contains("enclosed.radius"), "{error}");
    let asked = Settings { enclosed: None, ..settings };
    let error = query(&program, &record, &asked, states.view()).unwrap_err().to_string();
    assert!(error.contains("certify again"), "{error}");
}

/// A sequential claim about the certified set looks at the draws that the enclosure certifies.
#[test]
fn a_sequential_claim_is_about_the_same_set() {
    let [case, ..] = cases();
    let mut settings = case.settings();
    settings.sequential = Some(SequentialSettings {
        of: SequentialOf::Set,
        epsilon: 0.05,
        beta: 1e-3,
        most: 600,
        radius: 0.1,
        carried: 0.0,
    });
    let backend = cpu(2);
    let program = backend.prepare(&case.plant).unwrap();
    let record = certify(&program, &settings, serde_json::Value::Null, &Unwatched).unwrap();
    let found = record.sequential.expect("a sequential claim");
    assert_eq!(found.outcome, SequentialOutcome::Certified);
    let settings = settings.keyed(&case.plant);
    let region = Region::new_box(&*settings.low, &*settings.high).unwrap();
    let starts = Starts::Drawn { region, stream: settings.stream(purpose::SEQUENTIAL, 0) };
    let starts = StateList::new(2).with((0..found.draws).map(|index| starts.start(index)));
    let certified = case.margins(starts.view()).iter().filter(|margin| **margin > 0.0).count();
    assert_eq!(found.claim.scenarios, certified as u64);
}

#[test]
fn what_the_kind_is_not_for_is_refused_before_any_work() {
    let backend = cpu(1);
    let refusal = |case: &Case, change: fn(&mut Settings)| {
        let program = backend.prepare(&case.plant).unwrap();
        let mut settings = case.settings();
        change(&mut settings);
        let error = certify(&program, &settings, serde_json::Value::Null, &Unwatched).unwrap_err();
        error.to_string()
    };
    let [looped, replayed, _] = cases();
    let error = refusal(&looped, |settings| settings.enclosed = Some(Kind::Pieces));
    assert!(error.contains("global.tightening") && error.contains("replay"), "{error}");
    let drops = |settings: &mut Settings| {
        settings.drops =
            Some(reachcast::scenario::drops_settings::DropSettings::rigorous().unwrap());
    };
    let error = refusal(&replayed, drops);
    assert!(error.contains("global.tightening") && error.contains("drops"), "{error}");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/models/dubins.toml");
    let written = std::fs::read_to_string(file).unwrap();
    let plant = text::read(&written, "dubins.toml", Path::new(".")).unwrap().plant().unwrap();
    let program = backend.prepare(&plant).unwrap();
    let spec = RolloutSpec::new(30, 0.95).unwrap();
    let middle = |axis: &reachcast::system::Axis| 0.5 * (axis.low + axis.high);
    let state: Vec<f32> = plant.model.states.iter().map(middle).collect();
    let mut settings = Settings::new(&plant.model, state, spec).unwrap();
    settings.enclosed = Some(Kind::Pieces);
    let error = certify(&program, &settings, serde_json::Value::Null, &Unwatched).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("global.tightening") && error.contains("linear"), "{error}");
}

/// From the command line: certified, checked, queried, its page and its document; what has no use is refused.
#[test]
fn the_program_certifies_checks_and_queries() {
    let folder = Folder::new();
    let out = folder.path("line");
    let config = "configs/double_integrator.toml";
    let sets = [
        "global.tightening=tube",
        "deviation.control=closed-loop",
        "global.draws=2000",
        "slice.x.step=0.2",
        "slice.y.step=0.2",
    ];
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", *set]).collect();
    let (code, text, error) =
        reachcast(&[&["certify", config, "--out", &*out][..], &sets].concat());
    assert_eq!(code, Some(0), "{text} {error}");
    assert!(text.contains("enclosed ") && text.contains("policy in feedback"), "{text}");
    let page = std::fs::read_to_string(Path::new(&out).join("report.html")).unwrap();
    assert!(page.contains("Certified set without samples") && page.contains("Deterministic:"));
    let checked = document(&["check", &out]);
    assert_eq!(checked["holds"], true, "{checked}");
    let states = folder.path("states.csv");
    std::fs::write(&states, "0.5,0.0\n0.9,1.0\n").unwrap();
    let rows = document(&["query", &out, "--states", &states])["rows"].clone();
    assert_eq!([&rows[0]["tier"], &rows[1]["tier"]], [1, 3], "{rows}");
    assert!(rows[0]["check_margin"].as_f64().unwrap() > 0.0, "{rows}");
    let certified = ["falsify", "--around", &out, "--within", "certified", "--budget", "100"];
    refused(&certified, &["enclosed", "--within box"]);
    refused(
        &[
            "certify",
            config,
            "--set",
            "global.tightening=pieces",
            "--set",
            "deviation.control=closed-loop",
        ],
        &["global.tightening", "replay"],
    );
    let race = ["race", "configs/race.toml", "--set", "global.tightening=tube"];
    refused(&race, &["global.tightening", "drops"]);
    done(&["check", &out, "--quiet"]);
}
