//! Dynamics against loops in f64 that are written from the mathematics, not from the recorder.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::model::Model;

use super::{CART, cart_with, described};

/// Seconds of a step of the cart, and its mass, as the text has them: rounded to f32.
const PERIOD: f64 = 0.1_f32 as f64;
const MASS: f64 = 2.0;

fn model(text: &str) -> Model {
    described(text)
        .and_then(|described| described.model())
        .unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// `[x, speed]` after a step of `model` from time `t` and step number `step`.
fn next(model: &Model, x: [f64; 2], u: f64, t: f64, step: f64) -> [f64; 2] {
    let values = model.step.eval(&[x[0], x[1], u, MASS, t, step]);
    [values[0], values[1]]
}

/// What a derivative is given: the state, the control, the time.
type Derivative = fn([f64; 2], f64, f64) -> [f64; 2];

/// The cart of the text: drag in a `let`, the force clipped to 2 N.
fn cart([_, speed]: [f64; 2], force: f64, _: f64) -> [f64; 2] {
    [speed, (force - f64::from(0.1_f32) * speed) / MASS]
}

/// A cart on a spring whose stiffness rises with time.
fn spring([x, speed]: [f64; 2], force: f64, t: f64) -> [f64; 2] {
    [speed + t, force / MASS - (1.0 + t * t) * x]
}

const SPRING: [&str; 2] = ["speed + t", "force / mass - (1 + t^2) * x"];

/// The text of `SPRING` with these lines under `[model.time]`.
fn spring_with(time: &str) -> String {
    cart_with("x = \"speed\"", &format!("x = \"{}\"", SPRING[0]))
        .replacen("pull / mass", SPRING[1], 1)
        .replacen("integrator = \"rk4\"\nsubsteps = 2\n", time, 1)
}

/// Adds `by` times `slope`.
fn moved(x: [f64; 2], by: f64, slope: [f64; 2]) -> [f64; 2] {
    [x[0] + by * slope[0], x[1] + by * slope[1]]
}

/// Explicit Euler over `substeps` parts of the period.
fn euler(f: Derivative, mut x: [f64; 2], u: f64, t: f64, substeps: u32) -> [f64; 2] {
    let h = PERIOD / f64::from(substeps);
    for i in 0..substeps {
        x = moved(x, h, f(x, u, t + f64::from(i) * h));
    }
    x
}

/// The classical Runge-Kutta rule over `substeps` parts of the period.
fn rk4(f: Derivative, mut x: [f64; 2], u: f64, t: f64, substeps: u32) -> [f64; 2] {
    let h = PERIOD / f64::from(substeps);
    for i in 0..substeps {
        let t = t + f64::from(i) * h;
        let a = f(x, u, t);
        let b = f(moved(x, h / 2.0, a), u, t + h / 2.0);
        let c = f(moved(x, h / 2.0, b), u, t + h / 2.0);
        let d = f(moved(x, h, c), u, t + h);
        for (x, weights) in x.iter_mut().zip([0, 1].map(|k| [a[k], b[k], c[k], d[k]])) {
            *x += h * (weights[0] + 2.0 * weights[1] + 2.0 * weights[2] + weights[3]) / 6.0;
        }
    }
    x
}

/// Requires `model` to step as `truth` does, the force clipped to 2 N.
#[track_caller]
fn assert_steps(model: &Model, truth: impl Fn([f64; 2], f64, f64) -> [f64; 2]) {
    let mut random = StdRng::seed_from_u64(7);
    for _ in 0..500 {
        let mut draw = |most: f64| random.random_range(-most..most);
        let (x, u, t) = ([draw(2.0), draw(2.0)], draw(4.0), draw(3.0));
        let (found, expected) = (next(model, x, u, t, 0.0), truth(x, u.clamp(-2.0, 2.0), t));
        for (found, expected) in found.iter().zip(expected) {
            // Literals such as a sixth of the period are f32: relative 6e-8 of what is added.
            assert!((found - expected).abs() < 3e-7, "{x:?} {u} {t}: {found}, not {expected}");
        }
    }
}

#[test]
fn runge_and_kutta() {
    assert_steps(&model(CART), |x, u, t| rk4(cart, x, u, t, 2));
    for substeps in [1, 3] {
        let text = spring_with(&format!("integrator = \"rk4\"\nsubsteps = {substeps}\n"));
        assert_steps(&model(&text), |x, u, t| rk4(spring, x, u, t, substeps));
    }
    assert_steps(&model(&spring_with("integrator = \"rk4\"\n")), |x, u, t| rk4(spring, x, u, t, 1));
}

#[test]
fn euler_of_old() {
    for substeps in [1, 2, 5] {
        let text = spring_with(&format!("integrator = \"euler\"\nsubsteps = {substeps}\n"));
        assert_steps(&model(&text), |x, u, t| euler(spring, x, u, t, substeps));
    }
}

/// The error of one step falls with the fifth power of its length, that of Euler with the second.
#[test]
fn order_of_the_rules() {
    // x'' = -x: the exact answer is a turn.
    let exact = |h: f64| [h.cos(), -h.sin()];
    let error = |rule: &str, period: f64| {
        let text = cart_with("pull / mass", "-x")
            .replacen("period = 0.1", &format!("period = {period}"), 1)
            .replacen("\"rk4\"\nsubsteps = 2", &format!("\"{rule}\""), 1);
        let found = next(&model(&text), [1.0, 0.0], 0.0, 0.0, 0.0);
        let exact = exact(f64::from(period as f32));
        (found[0] - exact[0]).hypot(found[1] - exact[1])
    };
    for (rule, order) in [("euler", 2.0), ("rk4", 5.0)] {
        let found = (error(rule, 1.0) / error(rule, 0.5)).log2();
        assert!((found - order).abs() < 0.3, "{rule}: {found}");
    }
}

/// The number of the step is what it is at every stage; the time moves within a step.
#[test]
fn step_and_time() {
    let text = spring_with("integrator = \"euler\"\nsubsteps = 4\n")
        .replacen("speed + t\"", "step\"", 1)
        .replacen(SPRING[1], "t", 1);
    let [x, speed] = next(&model(&text), [0.0, 0.0], 0.0, 10.0, 7.0);
    assert!((x - 7.0 * PERIOD).abs() < 1e-6, "{x}");
    // The mean time of four substeps from 10 s, each at its beginning.
    let mean = 10.0 + PERIOD * 1.5 / 4.0;
    assert!((speed - mean * PERIOD).abs() < 1e-6, "{speed}");
}

/// Next values are taken as they are, with and without a period.
#[test]
fn next_values() {
    let time = "period = 0.1\nintegrator = \"rk4\"\nsubsteps = 2\n";
    let text = cart_with("[model.flow]", "[model.next]").replacen("\"speed\"", "\"x + pull\"", 1);
    for (text, period) in [
        (text.replacen(time, "period = 0.1\n", 1), Some(0.1)),
        (text.replacen(time, "", 1).replacen(" + 0.01 * t", " + 0.01 * step", 1), None),
    ] {
        let model = model(&text);
        assert_eq!(model.period, period);
        let found = next(&model, [1.0, 0.5], 9.0, 0.0, 0.0);
        let pull = 2.0 - f64::from(0.1_f32) * 0.5;
        assert_eq!(found, [1.0 + pull, pull / MASS]);
    }
}

/// Bounds hold before anything else, and an infinite one leaves its side open.
#[test]
fn controls_are_clipped_first() {
    let clipped = |bounds: &str, u: f64| {
        let text = cart_with("[-2.0, 2.0]", bounds)
            .replacen("[model.flow]", "[model.next]", 1)
            .replacen("\"speed\"", "\"force^2\"", 1)
            .replacen("integrator = \"rk4\"\nsubsteps = 2\n", "", 1);
        next(&model(&text), [0.0, 0.0], u, 0.0, 0.0)[0]
    };
    for (bounds, below, above) in [
        ("[-2.0, 3.0]", 4.0, 9.0),
        ("[-inf, 3.0]", 100.0, 9.0),
        ("[-2.0, inf]", 4.0, 100.0),
        ("[-inf, inf]", 100.0, 100.0),
        ("[1.0, 1.0]", 1.0, 1.0),
    ] {
        assert_eq!((clipped(bounds, -10.0), clipped(bounds, 10.0)), (below, above), "{bounds}");
        assert!(clipped(bounds, f64::NAN).is_nan(), "{bounds}");
    }
}

/// Intermediate formulas hold at each stage, in whatever order they stand.
#[test]
fn intermediate_formulas_are_evaluated_after_what_they_use() {
    let lets = "pull = \"force - drag\"\ndrag = \"0.1 * speed\"";
    let turned = "drag = \"0.1 * speed\"\npull = \"force - drag\"";
    assert_eq!(model(CART), model(&cart_with(lets, turned)));
    let inlined = cart_with("pull / mass", "(force - 0.1 * speed) / mass");
    let (with, without) = (model(CART), model(&inlined));
    for x in [[0.3, -0.7], [1.0, 2.0]] {
        assert_eq!(next(&with, x, 1.5, 0.0, 0.0), next(&without, x, 1.5, 0.0, 0.0));
    }
    assert_eq!(with.step.nodes.len(), without.step.nodes.len());
}

/// Margins over time.
#[test]
fn margins() {
    let model = model(CART);
    let at = |t: f64| [0.4, -0.5, 0.0, MASS, t, 0.0];
    let tenth = f64::from(0.1_f32);
    assert_eq!(model.target.eval(&at(0.0)), [tenth - 0.4]);
    assert_eq!(model.constraint.eval(&at(3.0)), [0.5 + f64::from(0.01_f32) * 3.0]);
    assert_eq!(model.bodies[0].y, 1);
}
