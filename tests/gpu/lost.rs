//! What has no value on the CPU has none on an adapter, whatever its driver simplifies.

use std::path::Path;

use reachcast::backend::Backend;
use reachcast::model::Plant;
use reachcast::model::text::read;
use reachcast::rollout::{NON_FINITE, RolloutSpec};

use crate::common::cpu;
use crate::gpu;

/// Formulas that have no value, or only an infinite one on the way, at some of the starts: domains that
/// are left, 0/0, infinities that cancel; and behind them all that may hide it.
const FORMULAS: [&str; 46] = [
    "0*sqrt(x)",
    "sqrt(x)*0",
    "0*log(x)",
    "0*asin(x*4)",
    "0*acos(x*4)",
    "sqrt(x)-sqrt(x)",
    "sqrt(x)/sqrt(x)",
    "0/sqrt(x)",
    "(x-x)/(x-x)",
    "x/z*0",
    "1/z - 1/z",
    "(1/z)/(1/z)",
    "sin(1/z)*0",
    "wrap(1/z)*0",
    "1e39*(x-x)",
    "min(sqrt(x),1)*0",
    "min(sqrt(x),1)-min(sqrt(x),1)",
    "max(sqrt(x),1)",
    "clamp(1,0,sqrt(x))",
    "0*floor(sqrt(x))",
    "0*sign(sqrt(x))",
    "abs(sqrt(x))*0",
    "if(sqrt(x) < 5, 1, 1)",
    "0*if(x < 0, sqrt(x), 1)",
    "if(x < 0, 1, 0*sqrt(x))",
    "if(0 < x, 1, 0*log(-z))",
    "sqrt(x)^2",
    "sqrt(x)^0",
    "hypot(sqrt(x),1e30)",
    "atan2(0,sqrt(x))*0",
    "tanh(sqrt(x))*0",
    "sigmoid(log(x))*0",
    "exp(-1e30*sqrt(x))",
    "cos(0*log(x))",
    "-(0*sqrt(x))",
    "p*0*sqrt(x)",
    "(p-p)*sqrt(x)",
    "z*sqrt(x)",
    "0*x^1.5",
    "x^0.5*0",
    "log(y)-log(y)",
    "sqrt(y*y+z) - sqrt(y*y+z)",
    "0*exp(400*abs(y))",
    "exp(400*abs(y))-exp(400*abs(y))",
    "exp(400*abs(y))/exp(400*abs(y))",
    "0*sin(exp(400*abs(y)))",
];

/// Where a formula stands: both margins, the dynamics, the policy.
fn models(formula: &str) -> [String; 4] {
    let text = |step: &str, target: &str, constraint: &str, policy: &str| {
        format!(
            "[model]\nname = 'lost'\n[model.time]\nperiod = 1.0\n\
             [model.states]\nx = {{ box = [-1, 1] }}\ny = {{ box = [-1, 1] }}\nz = {{ box = [-1, 1] }}\n\
             [model.controls]\nu = {{ bounds = [-9, 9] }}\n[model.parameters]\np = {{ value = 0.5 }}\n\
             [model.next]\nx = '{step}'\ny = 'y'\nz = 'z'\n\
             [model.task]\nkind = 'reach-avoid'\ntarget = '{target}'\nconstraint = '{constraint}'\n\
             [policy.formula]\nu = '{policy}'\n"
        )
    };
    let late = "if(step < 1, -1, 0.5)";
    [
        text("x", &format!("0.5 + 0.01*abs({formula})"), "1", "0"),
        text("x", late, &format!("1 + 0.01*abs({formula})"), "0"),
        text(&format!("x + ({formula})"), late, "1", "0"),
        text("x + u", late, "1", formula),
    ]
}

const STARTS: [[f32; 3]; 4] = [[-0.5, 0.3, 0.0], [0.5, -0.25, 0.0], [0.25, 0.5, 0.5], [0.0; 3]];

/// Which starts fail for what is no number.
fn failed(backend: &Backend, plant: &Plant) -> Vec<bool> {
    let spec = RolloutSpec::new(2, 1.0).expect("a short horizon");
    let measures = backend.prepare(plant).and_then(|program| program.measures(&STARTS, &spec));
    measures.expect("it runs").into_iter().map(|measure| measure <= NON_FINITE).collect()
}

#[test]
fn no_nan_of_a_formula_is_lost() {
    let Some(gpu) = gpu() else { return };
    let (gpu, cpu) = (Backend::Gpu(gpu), cpu(1));
    let (mut lost, mut seen) = (Vec::new(), 0);
    for formula in FORMULAS {
        for text in models(formula) {
            let description = read(&text, "lost.toml", Path::new(""));
            let description = description.unwrap_or_else(|error| panic!("{formula}: {error}"));
            let model = description.model().expect("a model");
            let plant = Plant::new(model, description.controller().expect("a policy"));
            let [expected, found] = [&cpu, &gpu].map(|backend| failed(backend, &plant));
            seen += expected.iter().filter(|failed| **failed).count();
            if found != expected {
                lost.push(format!("{formula}: {found:?}, not {expected:?}\n{text}"));
            }
        }
    }
    assert!(lost.is_empty(), "{} lost:\n{}", lost.len(), lost.join("\n"));
    assert!(seen > 200, "{seen} rollouts without a number");
}
