//! Costs, references and maps that are refused, each with file, line, key and column.

use std::path::Path;

use reachcast::Error;
use reachcast::files::npy_bytes;
use reachcast::model::TermKind;
use reachcast::model::text::read;

use super::CART;

/// What the cart costs; its files are `goal.csv` and `ground.npy`.
const COSTS: &str = r#"
[model.costs]
stage.place = { weight = 1.0, formula = "(x - goal)^2" }
stage.floor = { weight = 2.0, formula = "ground(x, speed)" }
terminal.place = { weight = 10.0, formula = "(x - goal)^2" }
[model.references]
goal = { file = "goal.csv" }
hill = { formula = "sin(t)" }
[model.maps]
ground = { file = "ground.npy", origin = [-1.0, -1.0], cell = 0.5 }
"#;

/// The cart with its costs, one part of which is replaced; `files` are written beside it.
fn with_files(from: &str, to: &str, files: &[(&str, &[u8])]) -> reachcast::Result<usize> {
    let folder = tempfile::tempdir().expect("a folder");
    let ground = npy_bytes(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [2, 3]);
    for (name, bytes) in [("goal.csv", &b"goal\n0.5\n0.25\n"[..]), ("ground.npy", &ground)] {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    let text = format!("{CART}{COSTS}");
    assert!(text.contains(from), "{from}");
    let description = read(&text.replacen(from, to, 1), "cart.toml", folder.path())?;
    // A plant does not ask what its plans cost.
    description.model()?;
    Ok(description.costs()?.map_or(0, |costs| costs.terms.len()))
}

/// Requires the costs to be refused with all `parts`, with one of their parts replaced.
#[track_caller]
fn assert_refused(from: &str, to: &str, parts: &[&str]) {
    assert_files_refused(from, to, &[], parts);
}

/// The same with files beside the text.
#[track_caller]
fn assert_files_refused(from: &str, to: &str, files: &[(&str, &[u8])], parts: &[&str]) {
    let error = with_files(from, to, files).expect_err(to);
    assert!(matches!(error, Error::Invalid { .. }), "{error}");
    let problem = error.to_string();
    for part in parts {
        assert!(problem.contains(part), "no `{part}` in: {problem}");
    }
}

/// The line of the text that begins with `start`.
fn place(start: &str) -> String {
    let text = format!("{CART}{COSTS}");
    let line = text.lines().position(|line| line.starts_with(start)).expect(start);
    format!("cart.toml:{}: ", line + 1)
}

#[test]
fn the_cart_has_three_costs() {
    assert_eq!(with_files("goal", "goal", &[]).expect("costs"), 3);
    // A negative weight is a reward.
    assert_eq!(with_files("weight = 2.0", "weight = -2", &[]).expect("costs"), 3);
}

#[test]
fn formulas_of_costs_are_refused_with_their_column() {
    let stage = format!("{}model.costs.stage.place.formula, column 6", place("stage.place"));
    assert_refused(
        "(x - goal)",
        "(x - gaol)",
        &[&stage, "unknown name `gaol`; the nearest is `goal`"],
    );
    let end = format!("{}model.costs.terminal.place.formula, column ", place("terminal.place"));
    let terminal = "10.0, formula = \"(x - goal)^2";
    assert_refused(
        terminal,
        "10.0, formula = \"force^2",
        &[&end, "`force` is a control", "after the last control"],
    );
    assert_refused(
        terminal,
        "10.0, formula = \"pull^2",
        &[&end, "`pull` uses the control `force`"],
    );
    assert_refused("(x - goal)", "(x - place)", &["unknown name `place`"]);
    assert_refused("(x - goal)", "(x - out[0])", &["`out` stands in `act`"]);
    let map = format!("{}model.costs.stage.floor.formula, column 1", place("stage.floor"));
    assert_refused("ground(x, speed)", "ground(x)", &[&map, "takes 2 coordinates"]);
    assert_refused(
        "ground(x, speed)",
        "ground + 1",
        &[&map, "`ground` is a map: expected `ground(x, y)`"],
    );
    assert_refused("ground(x, speed)", "groud(x, 1)", &[&map, "nearest is `ground`"]);
    assert_refused("ground(x, speed)", "ground(ground(x, 0), 1)", &[&map, "asks a map itself"]);
}

#[test]
fn terms_are_refused_by_their_keys() {
    let costs = |key: &str| format!("{}model.costs.{key}", place("stage.place"));
    assert_refused("weight = 1.0, ", "", &[&costs("stage.place.weight"), "missing"]);
    assert_refused("weight = 1.0", "weight = inf", &[&costs("stage.place.weight"), "not a finite"]);
    assert_refused("weight = 1.0", "weight = \"x\"", &[&costs("stage.place.weight"), "a number"]);
    assert_refused(
        "weight = 1.0",
        "wait = 1.0",
        &["model.costs.stage.place.wait", "nearest is `weight`"],
    );
    assert_refused(
        ", formula = \"(x - goal)^2\" }\nstage.floor",
        " }\nstage.floor",
        &["place.formula", "missing"],
    );
    assert_refused(
        "stage.floor",
        "stage.\"my floor\"",
        &["model.costs.stage.my floor", "a name has letters"],
    );
    assert_refused("stage.floor", "stage.place", &["two definitions", "duplicate key"]);
    assert_refused(
        "stage.floor",
        "stag.floor",
        &["model.costs.stag", "unknown key", "nearest is `stage`"],
    );
    let none = with_files(COSTS, "[model.costs]\n", &[]).expect_err("none").to_string();
    assert!(none.contains("model.costs: 0 costs, expected 1 to 64"), "{none}");
    for section in ["[model.references]\ngoal = { value = 1.0 }", "[model.maps]\n"] {
        let alone = with_files(COSTS, section, &[]).expect_err(section).to_string();
        assert!(alone.contains("nothing reads it: it is for `model.costs`"), "{alone}");
    }
}

#[test]
fn references_are_refused_by_their_keys() {
    let goal = format!("{}model.references.goal", place("goal = "));
    let hill = format!("{}model.references.hill.formula, column 5", place("hill"));
    assert_refused(
        "sin(t)",
        "sin(x)",
        &[&hill, "it reads `x`; a reference knows `t` and `step` alone"],
    );
    assert_refused("sin(t)", "net('a.safetensors', t)[0]", &["it calls a network"]);
    let hill_first = format!("{}model.references.hill: ", place("hill"));
    assert_refused("sin(t)", "1 / t", &[&hill_first, "inf at step 0"]);
    assert_refused("sin(t)", "sin(goal)", &[&hill, "unknown name `goal`"]);
    assert_refused("file = \"goal.csv\"", "", &[&goal, "expected one of `value`"]);
    assert_refused(
        "file = \"goal.csv\"",
        "file = \"goal.csv\", value = 1.0",
        &[&goal, "expected one of"],
    );
    assert_refused("file = \"goal.csv\"", "value = nan", &[&goal, "not a finite"]);
    assert_refused("hill", "speed", &["model.references.speed", "`speed` is a state already"]);
    assert_refused("hill", "drag", &["model.references.drag", "an intermediate formula already"]);
    assert_refused("hill", "sin", &["model.references.sin", "name of a function"]);
    assert_refused(
        "target = \"0.1",
        "target = \"hill",
        &["model.task.target", "unknown name `hill`"],
    );
    let file = [&goal[..], ".file: "].concat();
    let refused = |bytes: &str, part: &str| {
        let files = [("goal.csv", bytes.as_bytes())];
        assert_files_refused("goal", "goal", &files, &[&file, "goal.csv", "has one column", part]);
    };
    refused("1.0,2.0\n", "line 1 has 2 numbers");
    refused("goal,speed\n1.0,2.0\n", "`speed` is no state");
    refused("goal\n1.0\ninf\n", "not a finite");
    refused("goal\n", "no state in it");
    assert_refused("\"goal.csv\"", "\"gaol.csv\"", &[&file, "gaol.csv"]);
    let wide = npy_bytes(&[1.0, 2.0], [1, 2]);
    assert_files_refused(
        "goal.csv",
        "goal.npy",
        &[("goal.npy", &wide)],
        &[&file, "expected [N, 1]"],
    );
}

#[test]
fn maps_are_refused_by_their_keys() {
    let ground = format!("{}model.maps.ground", place("ground = "));
    let refused = |from: &str, to: &str, part: &str| assert_refused(from, to, &[&ground, part]);
    refused("cell = 0.5", "cell = 0.0", ".cell: 0; expected a side above 0");
    refused("origin = [-1.0, -1.0], ", "", ".origin: missing");
    refused("origin = [-1.0, -1.0]", "origin = [-1.0]", "a list of two numbers");
    refused("origin = [-1.0, -1.0]", "origin = [-1.0, inf]", ".origin: [-1.0, inf] is not finite");
    refused("cell = 0.5", "cell = 0.5, outside = nan", ".outside: NaN is not a finite");
    refused("cell = 0.5", "cell = 0.5, inside = 1", "unknown key `inside`");
    refused("file = \"ground.npy\", ", "", ".file: missing");
    refused("\"ground.npy\"", "\"grund.npy\"", "grund.npy");
    assert_refused("ground = {", "floor = {", &["model.maps.floor", "name of a function"]);
    assert_refused("ground = {", "goal = {", &["model.maps.goal", "`goal` is a reference already"]);
    let broken = npy_bytes(&[0.0, f32::NAN], [1, 2]);
    let parts = [&ground[..], "ground.npy", "not finite"];
    assert_files_refused("goal", "goal", &[("ground.npy", &broken)], &parts);
    assert_files_refused(
        "goal",
        "goal",
        &[("ground.npy", b"text")],
        &[&ground, "not a whole .npy"],
    );
}

/// What a text may have at most is said with the figure.
#[test]
fn too_many_are_refused() {
    let many =
        |count: usize, line: &dyn Fn(usize) -> String| (0..count).map(line).collect::<String>();
    let costs = many(65, &|i| format!("stage.c{i} = {{ weight = 1.0, formula = \"x\" }}\n"));
    let refused = |text: String| {
        read(&format!("{CART}{text}"), "cart.toml", Path::new("."))
            .expect_err("too many")
            .to_string()
    };
    let found = refused(format!("[model.costs]\n{costs}"));
    assert!(found.contains("65 costs, expected 1 to 64"), "{found}");
    let one = "[model.costs]\nstage.c = { weight = 1.0, formula = \"x\" }\n";
    let references = many(65, &|i| format!("r{i} = {{ value = 1.0 }}\n"));
    let found = refused(format!("{one}[model.references]\n{references}"));
    assert!(found.contains("65 references, expected at most 64"), "{found}");
    let maps = many(9, &|i| format!("m{i} = {{ file = \"m.npy\", origin = [0, 0], cell = 1 }}\n"));
    let found = refused(format!("{one}[model.maps]\n{maps}"));
    assert!(found.contains("9 maps, expected at most 8"), "{found}");
}

/// What is paid once is told from what is paid at each stage, and both may have one name.
#[test]
fn terms_know_when_they_are_paid() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!(
        "{CART}[model.costs]\nterminal.a = {{ weight = 1.0, formula = \"x\" }}\n\
         stage.a = {{ weight = 1.0, formula = \"force\" }}\n"
    );
    let costs = read(&text, "cart.toml", folder.path()).expect("a text").costs();
    let costs = costs.expect("costs").expect("some");
    let kinds: Vec<TermKind> = costs.terms.iter().map(|term| term.kind).collect();
    assert_eq!(kinds, [TermKind::Stage, TermKind::Terminal]);
    assert_eq!(costs.shares(&[3.0, 0.0], &[2.0], 0), [2.0, 3.0]);
    assert!(costs.contexts(0, 5).is_empty());
}
