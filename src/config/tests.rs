//! Tests of the configuration: profiles, layers, unknown keys, and values out of range.

use super::*;
use crate::race::barrier::{BarrierForm, Widening};
use crate::race::cost::{CenterlineCost, LaneCost, QuadraticCost, RaceCost, RecoveryCost};
use crate::race::judge::Judge;
use crate::race::settings::{FirstPlan, PlanSettings, RaceSettings, RecoveryPoint, SigmaSetting};
use crate::race::system::{Cone, DroneRace};
use crate::scenario::settings::{BoundarySearch, Joint, Settings};
use crate::system::{DoubleIntegrator, System};

const RACE: &str = "system.name = 'drone-race'\npolicy.file = 'race.safetensors'\n";
const LINE: &str = "system.name = 'double-integrator'\npolicy.formula = 'bang-bang'\n";

fn load(text: &str, set: &[&str]) -> Result<Config> {
    let overrides =
        Overrides { set: set.iter().map(ToString::to_string).collect(), ..Overrides::default() };
    Config::from_table(toml::from_str(text).unwrap(), "race.toml", &overrides)
}

fn race(set: &[&str]) -> Result<Settings> {
    load(RACE, set)?.settings(&DroneRace::default().states())
}

/// The refusal of the race with these overrides.
fn refusal(set: &[&str]) -> String {
    match race(set) {
        Ok(_) => panic!("{set:?} was accepted"),
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "{error}");
            error.to_string()
        }
    }
}

#[test]
fn rigorous_is_the_default_profile() {
    let config = load(RACE, &[]).unwrap();
    let Some(NamedSystem::Carried(SystemSection::DroneRace {
        cone,
        ego_gain,
        opponent_gain,
        speed_limit,
    })) = config.system
    else {
        panic!("{:?}", config.system)
    };
    assert_eq!((cone, ego_gain, opponent_gain), (Cone::Distance, 0.5, 1.0));
    assert!(!speed_limit);
    let settings = race(&[]).unwrap();
    assert_eq!((settings.seed, settings.spec.horizon), (1, 30));
    assert_eq!((settings.low[9], settings.high[9]), (0.1, 0.5));
    assert_eq!((settings.constants.target, settings.constants.constraint), (None, None));
    assert_eq!(settings.deviation.joint, Joint::FixedShape);
    assert_eq!((settings.deviation.scenarios, settings.growth.scenarios), (159, 159));
    assert!(settings.growth.split_beta && settings.growth.varies == [true; 12]);
    assert_eq!(settings.growth.boundary, BoundarySearch::Rays);
}

#[test]
fn study_and_paper_are_the_published_experiments() {
    let study = race(&["profile=study"]).unwrap();
    // 30 states.
    assert_eq!(study.spec.horizon, 29);
    assert_eq!((study.low[9], study.high[9]), (-1.0, 1.0));
    assert_eq!((study.constants.target, study.constants.constraint), (Some(10.0), Some(20.0)));
    assert_eq!(study.deviation.joint, Joint::Separate);
    assert_eq!((study.deviation.scenarios, study.growth.scenarios), (158, 158));
    let in_plane: Vec<bool> = (0..12).map(|i| i == 0 || i == 2).collect();
    assert!(!study.growth.split_beta && study.growth.varies == in_plane);
    assert_eq!(study.growth.boundary, BoundarySearch::Slice);
    assert_eq!(study.growth.heading, Some([0, 1, 2, 3]));

    let paper = race(&["profile=paper"]).unwrap();
    assert_eq!((paper.spec.horizon, paper.deviation.scenarios), (30, 159));
    assert_eq!(paper.growth.varies, [true; 12]);
    assert_eq!(paper.growth.boundary, BoundarySearch::Rays);
    let system = |profile: &str| load(RACE, &[profile]).unwrap().system;
    let race = |cone, ego_gain, speed_limit| {
        let opponent_gain = 1.0;
        NamedSystem::Carried(SystemSection::DroneRace {
            cone,
            ego_gain,
            opponent_gain,
            speed_limit,
        })
    };
    assert_eq!(system("profile=paper"), Some(race(Cone::Squared, 1.0, false)));
    assert_eq!(system("profile=study"), Some(race(Cone::Distance, 0.5, true)));
}

/// The numbers of sections 4 and 5 of the study, and what `rigorous` mends of them.
#[test]
fn races_of_the_profiles() {
    let race = |profile: &str| {
        let race = load(RACE, &[&format!("profile={profile}")]).unwrap().study.unwrap();
        race.check(&DroneRace::default()).unwrap();
        race
    };
    let study = race("study");
    assert_eq!((study.steps, study.judge), (80, Judge::Study));
    let hybrid = &study.hybrid;
    assert!(hybrid.global && hybrid.local && hybrid.recovery_tier);
    assert!(hybrid.latch && hybrid.near_gate && hybrid.hold_opponent);
    let rules = (hybrid.first_plan, hybrid.recovery_point);
    assert_eq!(rules, (FirstPlan::Brake, RecoveryPoint::Verified));
    assert_eq!((hybrid.near_gate_speed, hybrid.plan_gain), (0.7, 2.0));
    assert_eq!((hybrid.value_weight, hybrid.value_threshold), (1e6, -0.02));
    // Horizon, reference speed, weight of the safety term.
    let expected = [
        (&hybrid.recovery, 20, 0.7, 5.0),
        (&hybrid.fast, 20, 0.5, 0.0),
        (&study.no_policy.recovery, 20, 0.7, 10.0),
        (&study.no_policy.fast, 20, 0.5, 5.0),
        (&study.mppi, 25, 0.7, 0.0),
        (&study.soft, 25, 0.7, 10.0),
        (&study.cbf, 20, 0.7, 0.0),
        (&study.warmstart, 25, 0.7, 0.0),
    ];
    for (number, (plan, horizon, speed, weight)) in expected.into_iter().enumerate() {
        assert_eq!((plan.samples, plan.temperature, plan.iterations), (500, 10.0, 1), "{number}");
        assert_eq!((plan.horizon, plan.speed), (horizon, speed), "{number}");
        let (RaceCost::Lane(LaneCost { safety, .. })
        | RaceCost::Centerline(CenterlineCost { safety, .. })
        | RaceCost::Recovery(RecoveryCost { safety, .. })
        | RaceCost::Quadratic(QuadraticCost { safety, .. })) = plan.cost;
        assert_eq!((safety.weight, safety.radius), (weight, 0.2), "{number}");
        assert_eq!(plan.sigma, SigmaSetting::Same(0.4), "{number}");
    }
    assert!(!study.warmstart_works);
    let forms = |race: &RaceSettings| (race.filter.form, race.filter.widening);
    assert_eq!(forms(&study), (BarrierForm::OneStep, Widening::Velocities));

    assert_eq!(RaceSettings { judge: Judge::Study, ..race("paper") }, study);
    let rigorous = race("rigorous");
    assert!(rigorous.warmstart_works);
    assert_eq!(forms(&rigorous), (BarrierForm::TwoStep, Widening::Heights));
    // The baselines differ only in what they are named for.
    assert_eq!(rigorous.cbf, rigorous.mppi);
    assert_eq!(rigorous.warmstart, rigorous.mppi);
    assert_eq!(PlanSettings { cost: rigorous.mppi.cost, ..rigorous.soft }, rigorous.mppi);
}

#[test]
fn slices_have_the_cells_of_the_study() {
    let [x, y] = race(&[]).unwrap().slice.unwrap();
    assert_eq!((x.state, x.values.len(), y.state, y.values.len()), (0, 18, 2, 26));
    assert_eq!((x.values[0], y.values[0]), (-0.9, -2.6));
    assert!((x.values[17] - 0.8).abs() < 1e-6 && (y.values[25] + 0.1).abs() < 1e-6);
}

#[test]
fn flags_override_keys_and_keys_override_profiles() {
    let text = format!("profile = 'study'\nseed = 3\nrollout.horizon = 40\n{RACE}");
    let overrides = Overrides {
        registry: Registry::default(),
        profile: Some(Profile::Paper),
        seed: Some(u64::MAX),
        set: vec!["rollout.gamma=0.9".into(), "slice.x.step=0.2".into()],
    };
    let table = toml::from_str(&text).unwrap();
    let config = Config::from_table(table, "race.toml", &overrides).unwrap();
    assert_eq!((config.profile, config.seed), (Profile::Paper, u64::MAX));
    // From the file, from --set, and from the flag's profile.
    assert_eq!((config.rollout.horizon, config.rollout.gamma), (40, 0.9));
    assert_eq!((config.slice.x.step, config.slice.x.from), (0.2, -0.9));
    assert_eq!(config.constants.target, Constant::Given(10.0));
}

#[test]
fn set_takes_toml_and_plain_words() {
    let config = load(
        RACE,
        &[
            "deviation.joint=bonferroni",
            "growth.coordinates=['ego_x', 'ego_vx']",
            "growth.heading=[]",
            "constants.target=15",
            "box.ego_z = [-0.5, 0.5]",
        ],
    )
    .unwrap();
    assert_eq!(config.deviation.joint, Joint::Bonferroni);
    let named = ["ego_x", "ego_vx"].map(str::to_owned).to_vec();
    assert_eq!(config.growth.coordinates, Coordinates::Named(named));
    assert_eq!(config.constants.target, Constant::Given(15.0));
    let settings = config.settings(&DroneRace::default().states()).unwrap();
    assert_eq!((settings.low[4], settings.high[4]), (-0.5, 0.5));
    assert_eq!(settings.growth.heading, None);
    // A line break is part of a word, never a second key.
    assert!(refusal(&["growth.boundary='rays'\nseed=2"]).contains("growth.boundary"));
    assert!(refusal(&["horizon"]).contains("expected section.key=value"));
    assert!(refusal(&["rollout.=3"]).contains("expected section.key=value"));
}

#[test]
fn unknown_keys_name_the_nearest() {
    let near = |text: &str, set: &[&str]| load(text, set).unwrap_err().to_string();
    let typo = near(&format!("rollout.horizn = 3\n{RACE}"), &[]);
    assert_eq!(
        typo,
        "race.toml: unknown key `rollout.horizn`; the nearest valid key is `rollout.horizon`"
    );
    let misplaced = near(&format!("scenarios = 3\n{RACE}"), &[]);
    assert!(misplaced.contains("`deviation.scenarios`"), "{misplaced}");
    let state = near(RACE, &["state.ego_q=1"]);
    assert!(state.contains("--set state.ego_q=1") && state.contains("`state.ego_"), "{state}");
    // A key of the other system is unknown too.
    assert!(near(LINE, &["system.cone=root"]).contains("unknown key `system.cone`"));
    assert!(near(RACE, &["policy.fiel=x"]).contains("`policy.file`"));
    assert!(near(RACE, &["rollout=3"]).contains("`rollout` is a section"));
}

#[test]
fn values_of_the_wrong_kind_name_their_key() {
    let wrong = |set: &str| load(RACE, &[set]).unwrap_err().to_string();
    for set in [
        "rollout.horizon=soon",
        "rollout.horizon=-1",
        "deviation.joint=sometimes",
        "constants.target=guessed",
        "growth.coordinates=some",
        "box.ego_x=[1]",
        "system.ego_gain=fast",
        "system.speed_limit=1",
        "growth.split_beta=1",
    ] {
        let (key, _) = set.split_once('=').unwrap();
        let message = wrong(set);
        assert!(message.contains(key), "{set}: {message}");
    }
    let cone = wrong("system.cone=round");
    assert!(cone.contains("`round`") && cone.contains("`squared`"), "{cone}");
    assert_eq!(load(RACE, &["system.ego_gain=1"]).unwrap().rollout.horizon, 30);
    assert!(wrong("system.name=drone").contains("\"drone-race\" or \"double-integrator\""));
    assert!(wrong("profile=strict").contains("rigorous"));
    assert!(wrong("policy.formula=bang-bang").contains("both `file` and `formula`"));
    let none = load("system.name = 'drone-race'", &[]).unwrap_err().to_string();
    assert!(none.contains("no policy"), "{none}");
    let empty = load("", &[]).unwrap_err().to_string();
    assert!(empty.contains("system.name: missing"), "{empty}");
}

#[test]
fn values_out_of_range_name_their_key() {
    for (set, words) in [
        ("rollout.horizon=0", "rollout.horizon: 0 is not within"),
        ("rollout.gamma=1.5", "rollout.gamma: 1.5"),
        ("deviation.epsilon=1", "deviation.epsilon: 1 is not strictly between"),
        ("deviation.beta=0", "deviation.beta: 0 is not"),
        ("global.beta=nan", "global.beta: NaN is not"),
        ("growth.epsilon=-0.1", "growth.epsilon: -0.1"),
        ("deviation.radius=0", "deviation.radius: 0 is not a positive"),
        ("deviation.radius=1e-60", "deviation.radius"),
        ("growth.radius=inf", "growth.radius: inf"),
        ("growth.rounds=0", "growth.rounds: 0"),
        ("global.draws=0", "global.draws: 0"),
        ("constants.target=-1", "constants.target: -1"),
        ("box.ego_x=[1, -1]", "box.ego_x: empty interval"),
        ("box.ego_x=[nan, 1]", "box.ego_x: NaN is not a finite"),
        ("state.opp_z=inf", "state.opp_z: inf is not a finite"),
        ("state.opp_z=1e39", "state.opp_z"),
        ("slice.x.state=ego_w", "no state `ego_w`; the nearest is `ego_"),
        ("slice.x.state=ego_y", "`ego_y` is on both axes"),
        ("slice.x.step=0", "slice.x.step: 0 is not a positive"),
        ("slice.x.step=-0.1", "slice.x.step: -0.1"),
        ("slice.x.step=1e-9", "slice.x: "),
        ("slice.y.to=-3", "slice.y: empty"),
        ("growth.coordinates=[]", "growth.coordinates: empty"),
        ("growth.coordinates=['ego_w']", "growth.coordinates: no state `ego_w`"),
        ("growth.heading=['ego_x']", "growth.heading: 1 states"),
    ] {
        let message = refusal(&[set]);
        assert!(message.starts_with(&format!("--set {set}: ")), "{set}: {message}");
        assert!(words.split(": ").all(|word| message.contains(word)), "{set}: {message}");
    }
    let point = |name: &str| format!("box.{name}=[0, 0]");
    let frozen = ["position", "velocity"].map(point);
    let line = load(LINE, &frozen.each_ref().map(String::as_str)).unwrap();
    let empty = line.settings(&DoubleIntegrator::default().states()).unwrap_err();
    assert!(empty.to_string().contains("box: empty"), "{empty}");
}

#[test]
fn stored_configurations_are_read_back() {
    for text in [RACE, LINE] {
        for profile in ["paper", "study", "rigorous"] {
            let set = format!("profile={profile}");
            let config = load(text, &[&set]).unwrap();
            let json = config.to_json().unwrap();
            let stored = Config { train: None, plan: None, ..config };
            assert_eq!(Config::from_json(&json).unwrap(), stored);
            let mut damaged = json.clone();
            damaged["rollout"]["pace"] = 1.into();
            let refused = Config::from_json(&damaged).unwrap_err().to_string();
            assert!(refused.contains("pace"), "{refused}");
        }
    }
}

#[test]
fn shipped_configurations_are_complete() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    for (file, draws) in [("race.toml", 20_000), ("smoke.toml", 2000)] {
        let config = Config::load(&folder.join(file), &Overrides::default()).unwrap();
        let settings = config.settings(&DroneRace::default().states()).unwrap();
        assert_eq!(settings.global.draws, draws, "{file}");
    }
    let path = folder.join("double_integrator.toml");
    let config = Config::load(&path, &Overrides::default()).unwrap();
    let settings = config.settings(&DoubleIntegrator::default().states()).unwrap();
    assert_eq!((settings.deviation.radius, settings.growth.radius), (0.02, 0.1));
    // The race's file says what the defaults say.
    let shipped = Config::load(&folder.join("race.toml"), &Overrides::default()).unwrap();
    let networks = [
        "policy.file=policies/race_policy.safetensors",
        "race.networks.ppo=policies/race_ppo_policy.safetensors",
    ];
    let plain = load(RACE, &networks).unwrap();
    assert_eq!(shipped, plain);
}
