//! Pictures of models as text: bodies at formulas, shapes, and a frame that holds them.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::page::{self, escaped, figure};
use crate::records;
use reachcast::model::{Outline, Shape, ShapeKind};
use reachcast::report::html;
use reachcast::scenario::drawn_record::{DrawnBody, DrawnRecord, GroundAxis, GroundRecord};
use reachcast::scenario::record::Record;

/// A record whose picture has a cart that goes to 40, a pole on it, a wall and a goal.
fn drawn() -> Record {
    let mut record = records::double_integrator();
    let rollouts = record.picture.rollouts.len();
    let body = |name: &str, up: f32, joined| DrawnBody {
        name: name.to_owned(),
        written: ["x < 1".to_owned(), "0".to_owned()],
        size: Some(0.5),
        joined,
        right: vec![vec![0.0, 20.0, 40.0]; rollouts],
        up: vec![vec![up, up, 2.0 * up]; rollouts],
    };
    let shape = |name: &str, outline, kind| Shape { name: name.to_owned(), outline, kind };
    record.picture.rollouts.iter_mut().for_each(|rollout| rollout.success = true);
    record.picture.drawn = Some(DrawnRecord {
        bodies: vec![body("cart & co", 0.0, None), body("pole", 3.0, Some(0))],
        shapes: vec![
            shape("wall <1>", Outline::Box([50.0, -1.0, 52.0, 9.0]), ShapeKind::Unsafe),
            shape("goal", Outline::Disc([40.0, 0.0, 2.0]), ShapeKind::Target),
        ],
        ground: None,
    });
    record
}

/// The numbers of the attribute `name` of the first tag that begins with `tag`.
fn number(drawing: &str, tag: &str, name: &str) -> f64 {
    let tag = drawing.split_once(tag).unwrap().1.split_once('>').unwrap().0;
    tag.split_once(&format!(" {name}=\"")).unwrap().1.split_once('"').unwrap().0.parse().unwrap()
}

#[test]
fn bodies_and_shapes_are_drawn_and_named() {
    let page = html(&drawn());
    page::assert_sound(&page, "drawn");
    let picture = figure(&page, "figure-paths");
    // At the first and the last state: a line between the two bodies, and both as large as they are.
    assert_eq!(picture.matches("class=\"body joint\"").count(), 2, "{picture}");
    assert_eq!(picture.matches("class=\"body extent\"").count(), 4);
    for name in ["wall <1>", "goal", "cart & co, from its start", "x < 1"] {
        assert!(picture.contains(&escaped(name)), "no {name}");
    }
    assert!(picture.contains("where the first rollout begins and where it ends"));
}

/// The wall ends at 52, beyond every path and the box of the states.
#[test]
fn the_frame_holds_paths_and_shapes() {
    let page = html(&drawn());
    let picture = figure(&page, "figure-paths");
    let (left, width) = (
        number(picture, "<rect class=\"frame\"", "x"),
        number(picture, "<rect class=\"frame\"", "width"),
    );
    let wall = picture.split_once("<path class=\"hatched constraint\" d=\"M").unwrap().1;
    let wall = wall.split_once('Z').unwrap().0;
    let across =
        wall.split('L').map(|point| point.split_once(' ').unwrap().0.parse::<f64>().unwrap());
    for across in across {
        assert!(across > left && across < left + width, "{across} in {left} + {width}");
    }
}

#[test]
fn a_ground_is_drawn_beyond_the_slice() {
    let mut record = records::double_integrator();
    let axis = |state, values: [f32; 3]| GroundAxis { state, values: values.to_vec() };
    let ground = GroundRecord {
        x: axis(0, [-9.0, 0.0, 9.0]),
        y: axis(1, [-9.0, 0.0, 9.0]),
        target_margin: vec![-1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0, 1.0],
        constraint_margin: vec![1.0; 9],
    };
    record.picture.drawn = Some(DrawnRecord { ground: Some(ground), ..DrawnRecord::default() });
    let page = html(&record);
    page::assert_sound(&page, "ground");
    let picture = figure(&page, "figure-paths");
    assert!(picture.contains("as they are at the first step"), "{picture}");
    assert!(
        picture.contains("The model has no bodies: the states position and velocity are drawn")
    );
    assert!(picture.contains("class=\"target-area\"") && !picture.contains("class=\"hatched\""));
    // What makes no grid is left out, and the slice is drawn in its place.
    let drawn = record.picture.drawn.as_mut().unwrap();
    drawn.ground.as_mut().unwrap().constraint_margin.pop();
    assert!(figure(&html(&record), "figure-paths").contains("drawn over the slice"));
}
