//! What is said of points, what is refused, and a wall that is jumped without them.

use reachcast::model::Plant;
use reachcast::rollout::{RolloutSpec, States, Tightening, replay};
use reachcast::scenario::sampling;
use reachcast::train::settings::Method;

use crate::common::backends;
use crate::mathematics::{CONSTRAINT, ELLIPSE, POLICY, plant};

/// A body that goes 1 m/s, and a wall of 0.1 m across its way.
fn walled(task: &str) -> Plant {
    let text = format!(
        r#"
[model]
name = "wall"
[model.states]
x = {{ unit = "m", box = [0.0, 0.1] }}
y = {{ unit = "m", box = [0.0, 1.0] }}
[model.controls]
push = {{ unit = "m/s", bounds = [-1.0, 1.0] }}
[model.flow]
x = "push"
y = "0"
[model.time]
period = 0.5
integrator = "euler"
substeps = 10
[model.task]
kind = "avoid"
constraint = "abs(x - 0.25) - 0.05"
{task}
[policy]
formula = {{ push = "1" }}
"#
    );
    plant(&text).expect("a plant")
}

#[test]
fn a_thin_wall_is_jumped_without_points_and_seen_with_them() {
    let starts = [[0.06_f32, 0.0], [0.08, 0.5]];
    let spec = RolloutSpec::new(2, 1.0).expect("a specification");
    for (task, succeeds) in [("", true), ("between = 4", false), ("between = 1", true)] {
        let plant = walled(task);
        for backend in backends() {
            let program = backend.prepare(&plant).expect("prepared");
            let measures = program.measures(&starts, &spec).expect("run");
            for (x, measure) in starts.iter().zip(measures) {
                assert_eq!(measure > 0.0, succeeds, "{x:?}, `{task}`: {measure}");
                let in_f64 = replay::measure(&plant, x, &spec, &Tightening::none(&spec));
                assert_eq!(in_f64 > 0.0, succeeds, "{x:?}, `{task}`: {in_f64}");
            }
        }
        let words = sampling::sampling(&plant, States::from(&starts), 2).join(" ");
        let expected = match task {
            "" => ["only at the samples,", "moves up to 0.5001 m in a step"],
            "between = 1" => ["at 1 further point of each period,", "moves up to 0.25"],
            _ => ["at 4 further points of each period,", "m from one to the next"],
        };
        for part in expected {
            assert!(words.contains(part), "no `{part}` in: {words}");
        }
    }
}

#[test]
fn points_that_there_cannot_be_are_refused() {
    let with = |lines: &str| {
        let text =
            format!("{ELLIPSE}[model.task]\nkind = \"avoid\"\n{lines}\n{CONSTRAINT}{POLICY}");
        plant(&text).map(|plant| plant.model.points)
    };
    assert_eq!(with("between = 7").expect("all substeps"), 8);
    for (lines, words) in [
        ("between = 0", "model.task.between: 0; expected a number of points"),
        ("between = -1", "model.task.between: -1; expected a number of points"),
        ("between = 2", "cut a period into 3 parts, and 8 substeps cannot be shared evenly"),
        ("between = 15", "take a multiple of 16 for `model.time.substeps`"),
        ("between = 4294967295", "4294967295; expected a number of points"),
        ("between = 1.5", "expected a whole number"),
    ] {
        let found = with(lines).expect_err(words).to_string();
        assert!(found.contains(words), "no `{words}` in: {found}");
    }
    let next = ELLIPSE
        .replace("[model.flow]", "[model.next]")
        .replace("integrator = \"euler\"\nsubsteps = 8\n", "");
    let text = format!("{next}[model.task]\nkind = \"avoid\"\nbetween = 1\n{CONSTRAINT}{POLICY}");
    let found = plant(&text).expect_err("refused").to_string();
    assert!(
        found.contains("model.task.between: points inside a period need `model.flow`"),
        "{found}"
    );
}

/// A method that looks at samples alone refuses points by name.
#[test]
fn methods_that_look_at_samples_alone_refuse_points() {
    for method in [Method::Ddpg, Method::Ppo] {
        method.check_points(1).expect("samples");
        let found = method.check_points(4).expect_err("refused").to_string();
        let words = ["train.method", method.name(), "at 3 points", "`analytic`"];
        words.iter().for_each(|word| assert!(found.contains(word), "no `{word}` in: {found}"));
    }
    for method in [Method::Analytic, Method::Value, Method::ActionValue] {
        method.check_points(4).expect("any model");
    }
}

/// Whoever looks at other points has another text, and so other samples.
#[test]
fn points_are_part_of_what_a_certificate_hashes() {
    let text = |between: &str| walled(between).text();
    assert!(!text("").contains("between"));
    assert!(text("between = 4").contains("// between 4\n"));
    assert_ne!(text("between = 4"), text("between = 9"));
}
