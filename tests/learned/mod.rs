//! A cart whose drag, grip, target and policy are networks inside formulas, as text; and the same in
//! f64, written from the mathematics.

#![allow(dead_code, reason = "each test file uses a part of it")]

pub(crate) mod batches;

use std::path::Path;

use reachcast::model::Plant;
use reachcast::model::text::read;
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::rollout::{PairControl, RolloutSpec, Tightening};

/// The plant; `LAW` is replaced by a policy.
const CART: &str = r#"
[model]
name = "learned-cart"
[model.states]
x = { unit = "m", box = [-1.0, 1.0] }
v = { unit = "m/s", box = [-1.0, 1.0] }
[model.controls]
force = { unit = "N", bounds = [-2.0, 2.0] }
[model.parameters]
mass = { unit = "kg", value = 1.5 }
[model.let]
drag = "net('drag.safetensors', v, x)[0]"
grip = "net('nets/grip.safetensors', drag, net('drag.safetensors', v, x)[1], t)[0]"
[model.flow]
x = "v + 0.3 * grip"
v = "force / mass - drag * v + 0.2 * sin(t)"
[model.time]
period = 0.1
integrator = "rk4"
substeps = 2
[model.task]
kind = "reach-avoid"
target = "net('inside.safetensors', x, v)[0] - 0.1"
constraint = "1.4 - abs(x) + 0.1 * grip"
[policy]
LAW
"#;

/// Who drives the cart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Law {
    /// A formula that calls a network.
    Formula,
    /// A network between formulas that call networks.
    Wrapped,
}

/// Both of them.
pub(crate) const LAWS: [Law; 2] = [Law::Formula, Law::Wrapped];

impl Law {
    fn text(self) -> &'static str {
        match self {
            Self::Formula => "formula = { force = \"net('pull.safetensors', x, v)[0] - v\" }",
            Self::Wrapped => {
                "observe = [\"x + 0.1 * t\", \"drag\"]\nfile = \"policy.safetensors\"\n\
                 act = { force = \"out[0] + 2 * net('pull.safetensors', out[1], v)[0]\" }"
            }
        }
    }

    /// The text of the cart that it drives.
    pub(crate) fn cart(self) -> String {
        CART.replace("LAW", self.text())
    }
}

/// The networks by the names that the text has for them.
pub(crate) fn networks() -> [(&'static str, Mlp); 5] {
    use Activation::{Identity, Relu, Silu, Tanh};
    [
        ("drag.safetensors", network(&[2, 9, 2], 1, Tanh, Identity)),
        ("nets/grip.safetensors", network(&[3, 5, 6, 1], 2, Relu, Tanh)),
        ("inside.safetensors", network(&[2, 7, 3], 3, Silu, Identity)),
        ("pull.safetensors", network(&[2, 11, 1], 4, Tanh, Tanh)),
        ("policy.safetensors", network(&[2, 6, 2], 5, Relu, Tanh)),
    ]
}

/// Weights of both signs, told from others by `seed`.
fn network(widths: &[usize], seed: u64, hidden: Activation, output: Activation) -> Mlp {
    let mut state = seed;
    let mut uniform = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let layer = |pair: &[usize]| {
        Layer::dense(
            (0..pair[0] * pair[1]).map(|_| uniform()).collect(),
            (0..pair[1]).map(|_| 0.3 * uniform()).collect(),
        )
    };
    let layers = widths.windows(2).map(layer).collect();
    Mlp::new(layers, hidden, output).expect("a whole network")
}

/// Writes the networks to `folder`.
pub(crate) fn write(folder: &Path) {
    std::fs::create_dir_all(folder.join("nets")).expect("a folder");
    for (name, network) in networks() {
        std::fs::write(folder.join(name), network.to_bytes()).expect("a file");
    }
}

/// The cart as a plant, read from a folder of its own.
pub(crate) fn plant(law: Law) -> Plant {
    plant_of(&law.cart())
}

/// The plant of `text`, with the networks of the cart.
pub(crate) fn plant_of(text: &str) -> Plant {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path());
    let described = read(text, "cart.toml", folder.path()).expect("a description");
    let model = described.model().expect("a model");
    Plant::new(model, described.controller().expect("a policy"))
}

/// The networks in f64.
struct Layers(Mlp);

impl Layers {
    /// The outputs at `x`: sums of products, then the activation, layer by layer.
    fn at(&self, x: &[f64]) -> Vec<f64> {
        let mut x = x.to_vec();
        for layer in self.0.layers() {
            let mut next = Vec::new();
            for row in 0..layer.outputs {
                let weights = &layer.weight[row * layer.inputs..][..layer.inputs];
                let products = weights.iter().zip(&x).map(|(w, x)| f64::from(*w) * x);
                let sum = products.sum::<f64>() + f64::from(layer.bias[row]);
                next.push(match layer.activation {
                    Activation::Identity => sum,
                    Activation::Tanh => sum.tanh(),
                    Activation::Relu => sum.max(0.0),
                    Activation::Silu => sum / (1.0 + (-sum).exp()),
                    other => unreachable!("no carried network has {other}"),
                });
            }
            x = next;
        }
        x
    }
}

/// The cart in f64.
pub(crate) struct Truth {
    law: Law,
    drag: Layers,
    grip: Layers,
    inside: Layers,
    pull: Layers,
    policy: Layers,
}

const PERIOD: f64 = 0.1_f32 as f64;
const MASS: f64 = 1.5;

fn number(literal: f32) -> f64 {
    f64::from(literal)
}

impl Truth {
    pub(crate) fn new(law: Law) -> Self {
        let [drag, grip, inside, pull, policy] = networks().map(|(_, network)| Layers(network));
        Self { law, drag, grip, inside, pull, policy }
    }

    fn grip_at(&self, [x, v]: [f64; 2], t: f64) -> f64 {
        let drag = self.drag.at(&[v, x]);
        self.grip.at(&[drag[0], drag[1], t])[0]
    }

    fn slope(&self, [x, v]: [f64; 2], force: f64, t: f64) -> [f64; 2] {
        let drag = self.drag.at(&[v, x])[0];
        let moves = v + number(0.3) * self.grip_at([x, v], t);
        [moves, force / MASS - drag * v + number(0.2) * t.sin()]
    }

    /// The force at step `number`, not clipped yet.
    pub(crate) fn force(&self, [x, v]: [f64; 2], step: u32) -> f64 {
        let t = PERIOD * f64::from(step);
        match self.law {
            Law::Formula => self.pull.at(&[x, v])[0] - v,
            Law::Wrapped => {
                let drag = self.drag.at(&[v, x])[0];
                let out = self.policy.at(&[x + number(0.1) * t, drag]);
                out[0] + 2.0 * self.pull.at(&[out[1], v])[0]
            }
        }
    }

    /// The state a period later: two substeps of the classical rule.
    pub(crate) fn next(&self, mut x: [f64; 2], force: f64, step: u32) -> [f64; 2] {
        let (u, h) = (force.clamp(-2.0, 2.0), PERIOD / 2.0);
        let moved = |x: [f64; 2], by: f64, k: [f64; 2]| [x[0] + by * k[0], x[1] + by * k[1]];
        for part in 0..2 {
            let t = PERIOD * f64::from(step) + h * f64::from(part);
            let a = self.slope(x, u, t);
            let b = self.slope(moved(x, h / 2.0, a), u, t + h / 2.0);
            let c = self.slope(moved(x, h / 2.0, b), u, t + h / 2.0);
            let d = self.slope(moved(x, h, c), u, t + h);
            for i in 0..2 {
                x[i] += h * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0;
            }
        }
        x
    }

    /// Target and constraint margin.
    pub(crate) fn margins(&self, [x, v]: [f64; 2], step: u32) -> [f64; 2] {
        let grip = self.grip_at([x, v], PERIOD * f64::from(step));
        let inside = self.inside.at(&[x, v])[0];
        [inside - number(0.1), number(1.4) - x.abs() + number(0.1) * grip]
    }

    /// Measures of a pair; the nominal one has tightened margins.
    pub(crate) fn pair(
        &self,
        mut both: [[f64; 2]; 2],
        spec: &RolloutSpec,
        tightening: &Tightening,
        control: PairControl,
    ) -> [f64; 2] {
        let mut safe = [f64::INFINITY; 2];
        let mut best = [f64::NEG_INFINITY; 2];
        for step in 0..=spec.horizon {
            let (at, discount) = (step as usize, f64::from(spec.gamma).powi(step as i32));
            let lost = [number(tightening.target[at]), number(tightening.constraint[at])];
            for side in 0..2 {
                let [r, c] = self.margins(both[side], step);
                let [lost_r, lost_c] = if side == 0 { lost } else { [0.0; 2] };
                safe[side] = safe[side].min(discount * (c - lost_c));
                best[side] = best[side].max(safe[side].min(discount * (r - lost_r)));
            }
            let force = self.force(both[0], step);
            let other = match control {
                PairControl::Replay => force,
                PairControl::ClosedLoop => self.force(both[1], step),
            };
            both = [self.next(both[0], force, step), self.next(both[1], other, step)];
        }
        best
    }
}
