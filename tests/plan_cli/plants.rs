//! Models with costs as text, runs of `plan` on them, and their tables read back.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::command::{Folder, document};

/// A number on a line that a control moves anywhere in one step; a plan of one step pays for its end.
pub(crate) const LINE: &str = r#"
[model]
name = "line"
[model.states]
x = { unit = "m", box = [-0.5, 0.5] }
[model.controls]
u = { unit = "m", bounds = [-4.0, 4.0] }
[model.next]
x = "x + u"
[model.task]
kind = "reach"
target = "0.2 - abs(x - 1)"
[model.costs]
terminal.place = { weight = 1.0, formula = "(x - 1)^2" }
[plan]
samples = 4096
horizon = 1
temperature = 0.01
sigma = 1.0
steps = 4
[rollout]
horizon = 10
gamma = 1.0
"#;

/// A pendulum that hangs at angle 0: to be swung to 1 rad and held there.
pub(crate) const PENDULUM: &str = r#"
[model]
name = "pendulum"
[model.states]
angle = { unit = "rad", box = [-0.3, 0.3] }
rate = { unit = "rad/s", box = [-0.3, 0.3] }
[model.controls]
torque = { unit = "N m", bounds = [-12.0, 12.0] }
[model.parameters]
damping = { value = 0.2 }
[model.flow]
angle = "rate"
rate = "torque - 9.81 * sin(angle) - damping * rate"
[model.time]
period = 0.05
integrator = "euler"
[model.task]
kind = "reach-avoid"
target = "0.15 - hypot(angle - 1, 0.2 * rate)"
constraint = "2 - abs(angle)"
[model.costs]
stage.place = { weight = 10.0, formula = "(angle - goal)^2" }
stage.rate = { weight = 0.2, formula = "rate^2" }
stage.effort = { weight = 0.002, formula = "torque^2" }
terminal.place = { weight = 50.0, formula = "(angle - goal)^2" }
[model.references]
goal = { value = 1.0 }
[policy]
formula = { torque = "8.3 + 20 * (1 - angle) - 6 * rate" }
[plan]
samples = 512
horizon = 15
temperature = 0.5
[rollout]
horizon = 40
gamma = 0.95
"#;

/// A run of `plan`: its record and its table.
pub(crate) struct Planned {
    /// What `--json` printed.
    pub(crate) record: Value,
    /// The columns of `steps.csv`; what is no number is NaN.
    pub(crate) columns: BTreeMap<String, Vec<f64>>,
    /// `trajectories.npz` as it is.
    pub(crate) bytes: Vec<u8>,
    /// `report.html`.
    pub(crate) page: String,
}

/// Writes `text` to a configuration in `folder`; its path.
pub(crate) fn written(folder: &Folder, text: &str) -> String {
    let path = folder.path("model.toml");
    std::fs::write(&path, text).unwrap();
    path
}

/// Plans `text` with `more` options, in a folder of its own.
pub(crate) fn planned(text: &str, more: &[&str]) -> Planned {
    let folder = Folder::new();
    read(&written(&folder, text), more)
}

/// Plans the configuration at `config` with `more` options.
pub(crate) fn read(config: &str, more: &[&str]) -> Planned {
    let folder = Folder::new();
    let out = folder.path("out");
    let arguments = [&["plan", config, "--out", &out], more].concat();
    let record = document(&arguments);
    let read = |name: &str| std::fs::read(format!("{out}/{name}")).unwrap();
    let stored: Value = serde_json::from_slice(&read("plan.json")).unwrap();
    assert_eq!(stored, record, "the record is what is printed");
    Planned {
        record,
        columns: columns(&String::from_utf8(read("steps.csv")).unwrap()),
        bytes: read("trajectories.npz"),
        page: String::from_utf8(read("report.html")).unwrap(),
    }
}

/// The columns of a table without quotes.
fn columns(text: &str) -> BTreeMap<String, Vec<f64>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut columns: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells.len(), names.len(), "{line}");
        for (name, cell) in names.iter().zip(cells) {
            let number = if cell.is_empty() { f64::NAN } else { cell.parse().unwrap() };
            columns.entry((*name).to_owned()).or_default().push(number);
        }
    }
    columns
}

impl Planned {
    /// The column `name`.
    pub(crate) fn column(&self, name: &str) -> &[f64] {
        self.columns.get(name).unwrap_or_else(|| panic!("no `{name}` in {:?}", self.columns.keys()))
    }

    /// The rows of the run number `run`.
    pub(crate) fn rows(&self, run: usize) -> Vec<usize> {
        let runs = self.column("run");
        (0..runs.len()).filter(|&row| runs[row] == run as f64).collect()
    }

    /// The number at `pointer` of the record.
    pub(crate) fn number(&self, pointer: &str) -> f64 {
        self.record.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}"))
    }

    /// The notes, one after the other.
    pub(crate) fn notes(&self) -> String {
        self.record["notes"].to_string()
    }
}
