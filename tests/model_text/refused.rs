//! Bad models: each refused with file, line, key and column, what was expected, the nearest name.

use std::time::{Duration, Instant};

use proptest::prelude::*;

use super::{CART, cart_with, described, refusal};

/// The line of the cart's text that begins with `start`.
fn line(start: &str) -> usize {
    1 + CART.lines().position(|line| line.starts_with(start)).expect(start)
}

/// Requires the cart with `from` replaced by `to` to be refused with all `parts`.
#[track_caller]
fn assert_refused(from: &str, to: &str, parts: &[&str]) {
    let problem = refusal(&cart_with(from, to));
    for part in parts {
        assert!(problem.contains(part), "no `{part}` in: {problem}");
    }
}

#[test]
fn a_formula_is_refused_with_file_line_key_and_column() {
    let place = format!("cart.toml:{}: model.flow.speed, column 8", line("speed = \"pull / mass"));
    assert_refused(
        "pull / mass",
        "pull / mas",
        &[&place, "unknown name `mas`", "nearest is `mass`"],
    );
    assert_refused("pull / mass", "pull * / 2", &["column 8", "expected a number", "found `/`"]);
    assert_refused("0.1 * speed", "0.1 * sped", &["model.let.drag, column 7", "`speed`"]);
    assert_refused(
        "1 - abs(speed)",
        "1 - abd(speed)",
        &["model.task.constraint, column 5", "`abs`"],
    );
    assert_refused("pull / mass", "log(-2) / mass", &["model.flow.speed, column 1", "`log` of -2"]);
    assert_refused("pull / mass", "pull^mass", &["column 6", "an exponent is a number"]);
    assert_refused("pull / mass", "hypot(pull)", &["`hypot` takes 2 arguments, found 1"]);
    assert_refused("-2 * x - speed", "-2 * x - velocity", &["policy.formula.force, column 10"]);
    assert_refused("\"pull / mass\"", "3", &["model.flow.speed", "a formula as text", "number 3"]);
    assert_refused("\"pull / mass\"", "\"\"", &["column 1", "found the end"]);
}

#[test]
fn names_are_refused() {
    let mass = |name: &str| format!("{name} = {{ unit = \"kg\"");
    for (name, part) in [
        ("sin", "name of a function"),
        ("t", "`t` is the time"),
        ("step", "`step` is the number"),
        ("pi", "`pi` is the number"),
        ("out", "`out` is the outputs"),
        ("speed", "two definitions: `speed` is a state already"),
        ("force", "two definitions: `force` is a control already"),
        ("\"my mass\"", "letters, digits"),
    ] {
        assert_refused("mass = { unit = \"kg\"", &mass(name), &["model.parameters", part]);
    }
    assert_refused("drag = \"0.1", "mass = \"0.1", &["model.let.mass", "is a parameter already"]);
    let place = format!("cart.toml:{}: model.parameters.out", line("mass = {"));
    assert_refused("mass = { unit = \"kg\"", &mass("out"), &[&place]);
}

#[test]
fn keys_are_refused_with_the_nearest() {
    assert_refused("name = \"cart\"", "nam = \"cart\"", &["model.nam", "nearest is `name`"]);
    assert_refused("[model.flow]", "[model.flwo]", &["unknown key `flwo`", "nearest is `flow`"]);
    assert_refused("box = [-1.0", "boxx = [-1.0", &["model.states.x.boxx", "nearest is `box`"]);
    assert_refused("bounds = ", "bound = ", &["model.controls.force.bound", "`bounds`"]);
    assert_refused("value = 2.0", "valeu = 2.0", &["model.parameters.mass.valeu", "`value`"]);
    assert_refused("substeps", "substep", &["model.time.substep", "nearest is `substeps`"]);
    assert_refused("constraint =", "constrain =", &["model.task.constrain", "`constraint`"]);
    assert_refused("formula = {", "formulas = {", &["policy.formulas", "`formula`"]);
    assert_refused("{ force = \"-2", "{ forse = \"-2", &["policy.formula.forse", "`force`"]);
    assert_refused("\"rk4\"", "\"rk5\"", &["unknown integrator `rk5`", "nearest is `rk4`"]);
    assert_refused("\"reach-avoid\"", "\"reech\"", &["unknown kind of task", "`reach`"]);
}

#[test]
fn what_is_missing_is_named() {
    let place = format!("cart.toml:{}: model.flow", line("[model.flow]"));
    assert_refused("speed = \"pull / mass\"", "", &[&place, "no derivative of `speed`"]);
    assert_refused("x = \"speed\"", "z = \"speed\"", &["model.flow.z", "unknown state `z`", "`x`"]);
    assert_refused("name = \"cart\"", "", &["model.name", "missing"]);
    let next = cart_with("[model.flow]", "[model.next]").replacen("period = 0.1", "", 1);
    let next = next.replacen("integrator = \"rk4\"\nsubsteps = 2\n", "", 1);
    assert!(refusal(&next).contains("`t`, the time in seconds, needs `period`"));
    assert_refused("period = 0.1", "", &["model.time.period: missing; expected the seconds"]);
    assert_refused("integrator = \"rk4\"", "", &["model.time.integrator", "\"euler\" or \"rk4\""]);
    assert_refused("target = \"0.1 - abs(x)\"", "", &["model.task.target", "missing", "a margin"]);
    assert_refused("kind = \"reach-avoid\"", "", &["model.task.kind", "\"reach-avoid\""]);
    assert_refused("box = [-1.0, 1.0], angle", "angle", &["model.states.speed.box", "missing"]);
    assert_refused("[model.states]", "[modle.states]", &["model.states", "missing"]);
    assert_refused("{ force = \"-2 * x - speed\" }", "{}", &["no formula for the control `force`"]);
    assert_refused("formula = {", "# {", &["policy", "expected `file`, a network, or `formula`"]);
    let without = CART.split("[policy]").next().expect("a part");
    assert!(refusal(without).contains("policy: missing"));
    assert!(refusal("[policy]").contains("model: missing"));
    let no_flow = cart_with("[model.flow]\nx = \"speed\"\nspeed = \"pull / mass\"\n", "");
    assert!(refusal(&no_flow).contains("no dynamics; expected a section `model.flow`"));
}

#[test]
fn two_definitions_are_refused() {
    let twice = "x = \"speed\"\nx = \"2\"";
    let place = format!("cart.toml:{}:1: two definitions", line("x = \"speed\"") + 1);
    assert_refused("x = \"speed\"", twice, &[&place, "duplicate key", "`x`"]);
    let next = "[model.next]\nx = \"x\"\nspeed = \"0\"\n[model.time]";
    assert_refused("[model.time]", next, &["model.next", "`next` and `flow` are both given"]);
    let both = "file = \"a.safetensors\"\nformula = {";
    assert_refused("formula = {", both, &["policy", "`file` and `formula` are both given"]);
}

#[test]
fn next_values_are_not_integrated() {
    let text = cart_with("[model.flow]", "[model.next]");
    assert!(refusal(&text).contains("model.time.integrator: belongs to `model.flow`"));
    let text = text.replacen("integrator = \"rk4\"\n", "", 1);
    assert!(refusal(&text).contains("model.time.substeps: belongs to `model.flow`"));
    let text = text.replacen("substeps = 2\n", "", 1);
    described(&text).expect("a description").model().expect("a model");
}

#[test]
fn cycles_are_named() {
    let drag = "drag = \"0.1 * ";
    assert_refused(
        &format!("{drag}speed"),
        &format!("{drag}pull"),
        &["model.let.drag, column 7", "a cycle: `pull` uses `drag` uses `pull`"],
    );
    assert_refused(&format!("{drag}speed"), &format!("{drag}drag"), &["`drag` uses `drag`"]);
    // A cycle of 10,000 is found as well, and named in short.
    let chain: String =
        (0..10_000).map(|i| format!("c{i} = \"c{}\"\n", (i + 1) % 10_000)).collect();
    let begin = Instant::now();
    let problem = refusal(&cart_with("[model.let]\n", &format!("[model.let]\n{chain}")));
    assert!(problem.contains("a cycle: `c0` uses `c1`") && problem.contains("..."), "{problem}");
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
}

#[test]
fn values_are_refused() {
    assert_refused(
        "box = [-1.0, 1.0]",
        "box = [1.0, -1.0]",
        &["model.states.x.box", "turned round"],
    );
    assert_refused("[-2.0, 2.0]", "[2.0, -2.0]", &["model.controls.force.bounds", "turned round"]);
    assert_refused("[-2.0, 2.0]", "[inf, inf]", &["holds no finite number"]);
    assert_refused("[-2.0, 2.0]", "[nan, 2.0]", &["no number"]);
    assert_refused("box = [-1.0, 1.0]", "box = [-inf, 1.0]", &["not finite"]);
    assert_refused("box = [-1.0, 1.0]", "box = [-1.0]", &["a list of two numbers", "a list of 1"]);
    assert_refused("box = [-1.0, 1.0]", "box = \"wide\"", &["found the text \"wide\""]);
    assert_refused("unit = \"m\",", "unit = 3,", &["model.states.x.unit", "found the number 3"]);
    assert_refused("angle = false", "angle = 1", &["expected true or false"]);
    assert_refused("value = 2.0", "value = \"2\"", &["expected a number", "the text \"2\""]);
    assert_refused("value = 2.0", "value = 1e40", &["1e40 is not a finite number"]);
    assert_refused("period = 0.1", "period = -0.1", &["model.time.period", "seconds above 0"]);
    assert_refused("period = 0.1", "period = 0", &["seconds above 0"]);
    assert_refused("substeps = 2", "substeps = 0", &["model.time.substeps", "1 or more"]);
    assert_refused("substeps = 2", "substeps = 2.5", &["a whole number"]);
    assert_refused("name = \"cart\"", "name = \"a cart\"", &["model.name", "letters, digits"]);
    assert_refused("x = { unit = \"m\", box = [-1.0, 1.0] }", "x = 3", &["expected a section"]);
    assert_refused(
        "[model.let]",
        "[model.let",
        &[&format!("cart.toml:{}:11: ", line("[model.let]"))],
    );
    assert_refused(
        "at = [\"x\", \"speed\"]",
        "at = [\"x\"]",
        &["model.bodies.cart.at", "two formulas"],
    );
}

#[test]
fn what_does_not_work_yet_is_refused_by_name() {
    assert_refused(
        "value = 2.0",
        "draw = \"uniform\"",
        &["model.parameters.mass.draw", "not work yet"],
    );
    let (text, place) = ("[model.noise]\n[model.time]", "model.noise: ");
    assert_refused("[model.time]", text, &[place, "not work yet; leave the section out"]);
}

#[test]
fn a_task_has_the_margins_and_times_of_its_kind_alone() {
    let unused = |kind: &str, key: &str, line: &str| {
        let place = format!("model.task.{key}: a task of the kind \"{kind}\" has no use for it");
        let task = format!("{line}kind = \"{kind}\"");
        assert_refused("kind = \"reach-avoid\"", &task, &[&place]);
    };
    unused("avoid", "target", "");
    unused("reach", "constraint", "");
    unused("reach-stay", "from", "from = 3\n");
    unused("at-end", "by", "by = 3\n");
    unused("reach-avoid", "by", "by = 3\n");
    let cart = cart_with("target = \"0.1 - abs(x)\"", "");
    let missing = refusal(&cart.replacen("\"reach-avoid\"", "\"reach-stay\"", 1));
    assert!(missing.contains("model.task.target: missing; expected a margin"), "{missing}");
}

/// The period of the cart is 0.1 s.
#[test]
fn times_of_a_task_are_steps_or_seconds() {
    let refused = |time: &str, parts: &[&str]| {
        assert_refused(
            "kind",
            &format!("to = {time}\nkind"),
            &[&["model.task.to"], parts].concat(),
        );
    };
    refused("-1", &["-1; expected a number of steps, or seconds as text, \"1.5 s\""]);
    refused("1.5", &["expected a number of steps", "found the number 1.5"]);
    refused("\"1.5\"", &["expected a number of steps", "found the text \"1.5\""]);
    refused("\"15 ms\"", &["expected a number of steps", "found the text \"15 ms\""]);
    refused("\"-0.1 s\"", &["-0.1 s; expected a number of steps"]);
    refused("\"0.25 s\"", &["0.25 s is no multiple of the period, 0.1 s"]);
    refused("\"inf s\"", &["no multiple of the period"]);
    refused("\"1e12 s\"", &["expected a number of steps"]);
    let seconds = |time: &str| {
        let text = cart_with("kind", &format!("to = {time}\nkind"));
        described(&text).expect("a text").model().expect("a model").task.last(1000)
    };
    assert_eq!(["\"0.3 s\"", "\"99.9s\"", "\"0 s\"", "7"].map(seconds), [3, 999, 0, 7]);
}

#[test]
fn formulas_know_what_their_place_allows() {
    assert_refused(
        "0.1 - abs(x)",
        "0.1 - force",
        &["model.task.target, column 7", "`force` is a control; a margin knows"],
    );
    assert_refused("0.1 - abs(x)", "0.1 - pull", &["`pull` uses the control `force`"]);
    assert_refused("-2 * x - speed", "-2 * force", &["column 6", "a policy knows"]);
    assert_refused("pull / mass", "out[0] / mass", &["column 1", "`out` stands in `act`"]);
    assert_refused("-2 * x - speed", "out[0]", &["`out` stands in `act`"]);
    assert_refused("at = [\"x\"", "at = [\"force\"", &["`force` is a control"]);
}

/// A network in a formula: its file, its width and its output are looked at before it is refused.
#[test]
fn networks_in_formulas_are_looked_at() {
    let file = "../policies/double_integrator_policy.safetensors";
    let net = |call: &str| format!("pull / mass + net('{file}'{call}");
    let fits = cart_with("pull / mass", &net(", x, speed)[0]"));
    described(&fits).and_then(|description| description.model()).expect("a network that fits");
    assert_refused(
        "pull / mass",
        &net(", x)[0]"),
        &["cart.toml:16: model.flow.speed, column 15", "takes 2 inputs, found 1"],
    );
    assert_refused("pull / mass", &net(", x, speed)[1]"), &["has the outputs 0 to 0, found [1]"]);
    assert_refused("pull / mass", "net('none.safetensors', x)[0]", &["none.safetensors"]);
    assert_refused("pull / mass", "net('dubins.toml', x)[0]", &["column 1", "safetensors file"]);
    assert_refused("pull / mass", "net(x, speed)[0]", &["the file of a network between quotes"]);
    assert_refused("pull / mass", &net(", x, speed)"), &["expected `[`"]);
    assert_refused(
        "drag = \"0.1",
        &format!("lift = \"{}\"\ndrag = \"0.1", net(")[0]")),
        &["model.let.lift", "found 0"],
    );
    let policy = format!("net('{file}', x)[0]");
    assert_refused("-2 * x - speed", &policy, &["policy.formula.force", "takes 2 inputs"]);
    let margin = format!("net('{file}', x, force)[0]");
    assert_refused("0.1 - abs(x)", &margin, &["model.task.target", "`force` is a control"]);
}

#[test]
fn counts_beyond_the_limits_are_refused_with_the_figure() {
    let states: String = (0..63).map(|i| format!("s{i} = {{ box = [0, 1] }}\n")).collect();
    assert_refused(
        "[model.states]\n",
        &format!("[model.states]\n{states}"),
        &["65 states", "1 to 64"],
    );
    let controls: String = (0..16).map(|i| format!("c{i} = {{ bounds = [0, 1] }}\n")).collect();
    let controls = format!("[model.controls]\n{controls}");
    assert_refused("[model.controls]\n", &controls, &["17 controls", "1 to 16"]);
    let parameters: String = (0..256).map(|i| format!("p{i} = {{ value = 1 }}\n")).collect();
    let parameters = format!("[model.parameters]\n{parameters}");
    assert_refused("[model.parameters]\n", &parameters, &["257 parameters", "0 to 256"]);
}

#[test]
fn size_is_refused_in_no_time() {
    let begin = Instant::now();
    let long = format!("{CART}# {}", "x".repeat(10 << 20));
    assert!(refusal(&long).contains("bytes, at most 1048576 are read"), "{}", refusal(&long));
    let brackets = format!("{}x{}", "(".repeat(10_000), ")".repeat(10_000));
    assert_refused("pull / mass", &brackets, &["model.flow.speed, column 257", "deeper than 256"]);
    assert_refused(
        "substeps = 2",
        "substeps = 4000000000",
        &["model.time.substeps", "at most 65536"],
    );
    let sums = vec!["x"; 10_000].join("+");
    assert_refused("pull / mass", &sums, &["model.flow", "operations in all, at most 65536"]);
    // Each doubles the one before: nodes are shared, nothing grows.
    let doubled: String =
        (1..2000).map(|i| format!("d{i} = \"d{} + d{}\"\n", i - 1, i - 1)).collect();
    let text = cart_with("[model.let]\n", &format!("[model.let]\nd0 = \"x\"\n{doubled}"));
    let text = text.replacen("pull / mass", "pull / mass + d1999", 1);
    described(&text).expect("a description").model().expect("a model");
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}

/// Pieces of models, put together at random.
fn texts() -> impl Strategy<Value = String> {
    let pieces: Vec<String> = CART.lines().map(str::to_owned).collect();
    let other =
        ["[model]", "[model.next]", "x = 3", "t = \"x\"", "[policy]", "file = \"a\"", "act = {}"];
    let pieces: Vec<String> =
        pieces.into_iter().chain(other.map(str::to_owned)).map(|line| line + "\n").collect();
    let shuffled = proptest::collection::vec(proptest::sample::select(pieces), 0..40);
    let cut = (0..CART.len(), 0..CART.len(), ".{0,8}").prop_map(|(from, to, new)| {
        let (from, to) = (from.min(to), from.max(to));
        format!("{}{new}{}", &CART[..from], &CART[to..])
    });
    prop_oneof![shuffled.prop_map(|lines| lines.concat()), cut, ".{0,200}"]
}

proptest! {
    /// No text panics: it is a model, or refused.
    #[test]
    fn no_text_panics(text in texts()) {
        if let Ok(description) = described(&text) {
            let _ = description.model();
            let _ = description.controller();
        }
    }
}
