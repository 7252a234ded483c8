//! Models from text: against the same plants in Rust, against loops in f64, and what is refused.

mod carried;
mod costs;
mod formulas;
mod integrators;
#[path = "../learned/mod.rs"]
mod learned;
mod networks;
mod pictures;
mod policies;
mod refused;

use std::path::Path;

use reachcast::model::text::{Description, read};
use reachcast::{Error, Result};

/// A cart with everything that a model may have today.
pub(crate) const CART: &str = r#"
[model]
name = "cart"
[model.states]
x = { unit = "m", box = [-1.0, 1.0] }
speed = { unit = "m/s", box = [-1.0, 1.0], angle = false }
[model.controls]
force = { unit = "N", bounds = [-2.0, 2.0] }
[model.parameters]
mass = { unit = "kg", value = 2.0 }
[model.let]
pull = "force - drag"
drag = "0.1 * speed"
[model.flow]
x = "speed"
speed = "pull / mass"
[model.time]
period = 0.1
integrator = "rk4"
substeps = 2
[model.task]
kind = "reach-avoid"
target = "0.1 - abs(x)"
constraint = "1 - abs(speed) + 0.01 * t"
[model.bodies]
cart = { at = ["x", "speed"] }
[policy]
formula = { force = "-2 * x - speed" }
"#;

/// What `text` describes, in a folder of this test.
pub(crate) fn described(text: &str) -> Result<Description> {
    read(text, "cart.toml", Path::new("configs/models"))
}

/// The cart with one part of its text replaced.
pub(crate) fn cart_with(from: &str, to: &str) -> String {
    assert!(CART.contains(from), "{from}");
    CART.replacen(from, to, 1)
}

/// Why the model or the policy of `text` is refused.
pub(crate) fn refusal(text: &str) -> String {
    let described = described(text).and_then(|description| {
        description.model()?;
        description.controller()
    });
    match described {
        Ok(_) => panic!("not refused:\n{text}"),
        Err(error @ (Error::Invalid { .. } | Error::File { .. })) => {
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        }
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn the_cart_is_a_model() {
    let description = described(CART).expect("a description");
    let model = description.model().expect("a model");
    assert_eq!((model.inputs(), model.period), (2 + 1 + 1 + 2, Some(0.1)));
    assert_eq!(model.values(), [2.0]);
    description.controller().expect("a policy");
}

/// The model of the page on models is one, and its errors are those that the page shows.
#[test]
fn the_page_on_models_is_true() {
    let page = std::fs::read_to_string("docs/models.md").expect("the page");
    let text = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next());
    let text = text.expect("a model on the page");
    let model = |text: &str| read(text, "dubins.toml", Path::new("."));
    model(text).and_then(|description| description.model()).expect("the model of the page");
    for (from, to) in [
        ("sin(heading) + wind", "sin(hedaing) + wind"),
        ("heading = \"turn\"\n", "\n"),
        ("bounds = [-1.0, 1.0]", "bounds = [1.0, -1.0]"),
    ] {
        let error = model(&text.replacen(from, to, 1)).expect_err(from).to_string();
        assert!(page.contains(&format!("    {error}\n")), "not on the page: {error}");
    }
}
