//! Bodies and shapes of pictures: what is read, what is refused, and that nothing is computed with them.

use crate::{cart_with, described, refusal};

/// The cart with these bodies, and more sections behind them.
fn with_bodies(bodies: &str) -> String {
    cart_with("cart = { at = [\"x\", \"speed\"] }", bodies)
}

#[test]
fn bodies_stand_at_formulas_and_are_joined() {
    let text = with_bodies(
        "cart = { at = [\"x\", \"0\"], size = 0.5 }\n\
         pole = { at = [\"x + mass * sin(speed)\", \"cos(t)\"], joined = \"cart\" }",
    );
    let model = described(&text).unwrap().model().unwrap();
    assert!(model.bodies.is_empty(), "none stands at two states");
    let [cart, pole] = &model.picture.bodies[..] else { panic!("two bodies") };
    assert_eq!((cart.size, cart.joined, pole.size, pole.joined), (Some(0.5), None, None, Some(0)));
    // Position, speed, force, mass, time, step.
    let at = pole.at.eval(&[0.3_f64, -0.8, 9.0, 2.0, 1.5, 15.0]);
    assert!((at[0] - (0.3 + 2.0 * (-0.8_f64).sin())).abs() < 1e-6, "{at:?}");
    assert!((at[1] - 1.5_f64.cos()).abs() < 1e-6, "{at:?}");
    let plain = described(&with_bodies("cart = { at = [\"x\", \"speed\"] }")).unwrap();
    let plain = plain.model().unwrap();
    assert!(plain.picture.bodies.is_empty() && plain.bodies.len() == 1);
}

#[test]
fn hashes_know_nothing_of_pictures() {
    let hash = |text: &str| described(text).unwrap().plant().unwrap().text();
    let bare = with_bodies("");
    let drawn = with_bodies(
        "cart = { at = [\"2 * x\", \"0\"], size = 0.5 }\n[model.shapes]\n\
         wall = { box = [0, 0, 1, 2], kind = \"unsafe\" }\nhole = { disc = [0, 0, 1] }",
    );
    assert_eq!(hash(&bare), hash(&drawn));
    let model = described(&drawn).unwrap().model().unwrap();
    let extents = model.picture.shapes.iter().map(|shape| shape.outline.extent());
    assert_eq!(extents.collect::<Vec<_>>(), [[0.0, 0.0, 1.0, 2.0], [-1.0, -1.0, 1.0, 1.0]]);
    assert!(model != described(&bare).unwrap().model().unwrap(), "what is drawn differs");
}

#[test]
fn what_cannot_be_drawn_is_refused_by_name() {
    for (bodies, parts) in [
        ("cart = { at = [\"x\", \"force\"] }", ["model.bodies.cart.at", "`force` is a control"]),
        ("cart = { at = [\"x\", \"x\"], size = 0 }", ["model.bodies.cart.size", "above 0"]),
        (
            "cart = { at = [\"x\", \"x\"], joined = \"cart\" }",
            ["cart.joined", "unknown other body"],
        ),
        (
            "cart = { at = [\"x\", \"x\"] }\npole = { at = [\"x\", \"x\"], joined = \"card\" }",
            ["pole.joined", "the nearest is `cart`"],
        ),
        ("[model.shapes]\nwall = { box = [0, 0, 1] }", ["model.shapes.wall.box", "four numbers"]),
        ("[model.shapes]\nwall = { box = [0, 0, 0, 1] }", ["model.shapes.wall.box", "empty"]),
        ("[model.shapes]\nwall = { disc = [0, 0, -1] }", ["model.shapes.wall.disc", "above 0"]),
        ("[model.shapes]\nwall = { disc = [0, 0, inf] }", ["wall.disc", "three numbers"]),
        ("[model.shapes]\nwall = {}", ["model.shapes.wall", "`box` or `disc`"]),
        (
            "[model.shapes]\nwall = { disc = [0, 0, 1], kind = \"unsave\" }",
            ["wall.kind", "the nearest is `unsafe`"],
        ),
        (
            "[model.shapes]\nwall = { disc = [0, 0, 1], box = [0, 0, 1, 1] }",
            ["model.shapes.wall.box", "keep one of them"],
        ),
    ] {
        let problem = refusal(&with_bodies(bodies));
        for part in parts {
            assert!(problem.contains(part), "no `{part}` in: {problem}");
        }
    }
}
