//! Points inside a period through the commands: certificates that name them and hold, rollouts, and what asks for
//! the next sample alone.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command::{Folder, done, reachcast};
use serde_json::Value;

/// A mass on a spring that turns half around in eight steps.
const SPRING: &str = r#"
[model]
name = "spring"
[model.states]
x = { unit = "m", box = [-1.0, 1.0] }
v = { unit = "m/s", box = [-1.0, 1.0] }
[model.controls]
force = { unit = "N", bounds = [-1.0, 1.0] }
[model.flow]
x = "v"
v = "force - x"
[model.time]
period = 0.4
integrator = "rk4"
substeps = 4
[policy]
formula = { force = "-0.6 * v" }
[model.task]
kind = "reach-stay"
by = "3.2 s"
target = "0.7 - abs(x)"
constraint = "1.2 - abs(x)"
"#;
/// What makes a certificate small.
const SMALL: [&str; 8] = [
    "deviation.radius=0.02",
    "deviation.pilot=100",
    "global.draws=2000",
    "growth.radius=0.1",
    "rollout.horizon=12",
    "slice.x.step=0.3",
    "slice.y.step=0.3",
    "state.x=0.1",
];

/// The certificate of the spring with `lines` in its task, in `out`, with `set` over it.
fn certificate(folder: &Folder, lines: &str, set: &[&str], out: &str) -> Value {
    let config = folder.path("spring.toml");
    std::fs::write(&config, format!("{SPRING}{lines}")).unwrap();
    let mut arguments = vec!["certify", &config, "--backend", "cpu", "--out", out, "-q"];
    SMALL.iter().chain(set).for_each(|set| arguments.extend(["--set", set]));
    let (code, _, message) = reachcast(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{message}");
    let text = std::fs::read_to_string(format!("{out}/certificate.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn certificates_name_their_points_and_hold() {
    let folder = Folder::new();
    for (name, set) in [
        ("scenario", vec!["deterministic.kind=\"tube\"", "drops.epsilon=0.1"]),
        ("exact", vec!["deviation.source=\"exact\"", "deterministic.kind=\"pieces\""]),
    ] {
        let out = folder.path(name);
        let record = certificate(&folder, "between = 3\n", &set, &out);
        assert_eq!(record["system"]["between"], 3);
        let statements = record["statements"].to_string();
        let words = "at the samples and at 3 further points of each period";
        assert!(statements.contains(words), "no `{words}` in: {statements}");
        assert!(record["global"]["accepted"].as_u64().unwrap() > 100, "{}", record["global"]);
        assert!(record["deterministic"]["certified"].as_u64().unwrap() > 10, "{name}");
        let deviation = &record["deviation"];
        let (exact, largest) = (numbers(&deviation["exact"]), numbers(&deviation["largest"]));
        assert_eq!(exact.len(), 13);
        for (t, (exact, largest)) in exact.iter().zip(&largest).enumerate() {
            assert!(largest <= &(exact + 1e-6), "step {t}: {largest} above {exact}");
            assert!(largest >= &(0.8 * exact), "step {t}: {largest} far below {exact}");
        }
        assert!(done(&["check", &out, "--backend", "cpu"]).contains("the certificate holds"));
    }
}

/// The bound of a step is that of its sample and of the points before it: nowhere below that of samples alone,
/// and above it where distances fall again inside a period.
#[test]
fn exact_distances_include_the_points() {
    let folder = Folder::new();
    let exact = |lines: &str, name: &str| {
        let record = certificate(&folder, lines, &[], &folder.path(name));
        assert_eq!(record["system"].get("between").is_some(), !lines.is_empty());
        numbers(&record["deviation"]["exact"])
    };
    let [samples, points] = [exact("", "samples"), exact("between = 3\n", "points")];
    assert_eq!(samples[0], points[0]);
    let below = samples.iter().zip(&points).filter(|(sample, point)| **sample > **point + 1e-9);
    assert_eq!(below.count(), 0, "{samples:?} and {points:?}");
    // The rule of integration damps the spring a little: the point behind a sample is farther than the next one.
    let above = samples.iter().zip(&points).skip(1).filter(|(sample, point)| point > sample);
    assert_eq!(above.count(), samples.len() - 1, "{samples:?} and {points:?}");
}

#[test]
fn rollouts_say_where_they_are_looked_at() {
    let folder = Folder::new();
    let config = folder.path("spring.toml");
    std::fs::write(&config, format!("{SPRING}between = 1\n")).unwrap();
    std::fs::write(folder.path("starts.csv"), "x,v\n0,0\n1.0,1.0\n").unwrap();
    let (starts, out) = (folder.path("starts.csv"), folder.path("measures.npy"));
    let set = ["--set", "rollout.horizon=12", "--backend", "cpu"];
    let arguments = ["rollout", &config, "--starts", &starts, "--measures", &out];
    let said = done(&[&arguments[..], &set].concat());
    assert!(said.contains("at 1 further point of each period"), "{said}");
}
