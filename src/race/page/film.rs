//! One race in time: a drawing that is stepped through, its controls, and words per moment.

use super::moment::{self, Scene};
use super::verdicts;
use crate::race::record::{FrameRecord, PictureRecord, RaceRecord};
use crate::report::figure::{Figure, Swatch, cross, diamond};
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::sheet::WIDTH;
use crate::report::span::Span;
use crate::report::text::{counted, escape, listed, ordinary};

/// Half the gate's width, m.
const GATE: f64 = 0.3;
/// Distance behind the gate at which the fences meet, m.
const FENCE: f64 = 0.05;
/// What the drawing shows at least, m.
const LEAST: [Span; 2] = [Span { low: -0.9, high: 0.9 }, Span { low: -1.2, high: 0.3 }];
/// What it shows at most: a drone that flies off must not shrink the race to a speck, m.
const MOST: [Span; 2] = [Span { low: -1.6, high: 1.6 }, Span { low: -3.4, high: 0.9 }];

/// The figure.
pub(super) fn figure(record: &RaceRecord) -> Figure {
    let picture = record.picture.as_ref().filter(|picture| !picture.frames.is_empty());
    Figure {
        id: "figure-race",
        title: "One race in time".to_owned(),
        drawing: picture.map_or_else(
            || Err("No race was recorded step by step.".to_owned()),
            |picture| Ok(drawing(record, picture)),
        ),
        legend: picture.map_or_else(Vec::new, legend),
        caption: picture.map_or_else(String::new, caption),
    }
}

fn caption(picture: &PictureRecord) -> String {
    let verdicts = picture.verdicts.iter().map(|(judge, verdict)| {
        let verdict = verdict
            .map_or_else(|| "won".to_owned(), |class| format!("lost ({})", verdicts::class(class)));
        format!("{verdict} under the {} judge", judge.name())
    });
    let verdicts: Vec<_> = verdicts.collect();
    let outcome = if verdicts.is_empty() {
        String::new()
    } else {
        format!(" Verdict: {}.", listed(&verdicts))
    };
    format!(
        "{} from start {} with noise seed {}, seen from above.{outcome} The disc around the \
         opponent is the cone of the constraint in its distance form, at the height of the ego. \
         The fences in height are not drawn.",
        picture.controller, picture.start, picture.noise_seed
    )
}

fn legend(picture: &PictureRecord) -> Vec<(Swatch, String)> {
    let any = |has: &dyn Fn(&FrameRecord) -> bool| picture.frames.iter().any(has);
    let ball =
        |verified: bool| any(&|frame| frame.ball.is_some_and(|ball| ball.verified == verified));
    let entries = [
        (true, Swatch::Marked("path-ego", diamond()), "ego and its path"),
        (
            true,
            Swatch::Marked("path-opponent", moment::OPPONENT.to_owned()),
            "opponent and its path",
        ),
        (true, Swatch::Area("cone"), "its cone"),
        (true, Swatch::Line("gate"), "gate"),
        (true, Swatch::Area("hatched constraint"), "behind the fences"),
        (
            any(&|frame| frame.certified.is_some()),
            Swatch::Area("certified"),
            "certified cells of the slice: V_check > 0",
        ),
        (ball(true), Swatch::Line("ball"), "ball of local growth, verified"),
        (ball(false), Swatch::Line("ball unverified"), "last ball tried, not verified"),
        (
            any(&|frame| frame.recovery.is_some()),
            Swatch::Mark(cross(4.0)),
            "point that the recovery steers toward",
        ),
        (any(&|frame| !frame.fan.is_empty()), Swatch::Line("fan-line"), "sampled plans"),
    ];
    let shown = entries.into_iter().filter(|(shown, ..)| *shown);
    shown.map(|(_, swatch, name)| (swatch, name.to_owned())).collect()
}

fn drawing(record: &RaceRecord, picture: &PictureRecord) -> String {
    let words: String =
        (0..picture.frames.len()).map(|index| moment::said(record, picture, index)).collect();
    format!(
        "<div class=\"screen\">{}{}</div><div class=\"moments\">{words}</div>",
        plot(picture),
        controls(record, picture)
    )
}

fn plot(picture: &PictureRecord) -> String {
    let [x, y] = spans(picture);
    let mut plot = Plot::across_width("race", x, y, Proportions::Equal, WIDTH);
    fences(&mut plot, x, y);
    let scene = Scene::new(picture);
    for index in 0..picture.frames.len() {
        let group = scene.group(&plot, index);
        plot.fragment(&group);
    }
    let gate = plot.line([[-GATE, 0.0], [GATE, 0.0]]);
    plot.path("gate", &gate);
    let labels = Labels { x: "x (m)", y: "y (m)", whole: false };
    let description = format!("The race from above, {}.", moments(picture));
    plot.finish(&labels, &description)
}

fn moments(picture: &PictureRecord) -> String {
    counted(picture.frames.len(), "moment", "moments")
}

/// The slice and both drones at all times.
fn spans(picture: &PictureRecord) -> [Span; 2] {
    let slices = [&picture.slice_x, &picture.slice_y];
    std::array::from_fn(|axis| {
        let drones = picture
            .frames
            .iter()
            .flat_map(|frame| [2 * axis, 6 + 2 * axis].map(|entry| frame.x.get(entry).copied()));
        let values = drones.flatten().chain(slices[axis].iter().copied()).map(f64::from);
        let most = MOST[axis];
        let near = values.filter(|&value| ordinary(value));
        let near = Span::of(near.map(|value| value.clamp(most.low, most.high)));
        near.map_or(LEAST[axis], |span| span.join(LEAST[axis])).widened(0.03)
    })
}

/// Where `y > 0.05 - |x|`, which the fences forbid.
fn fences(plot: &mut Plot, x: Span, y: Span) {
    let fence = |x: f64| [x, FENCE - x.abs()];
    let line = [fence(x.low), fence(0.0), fence(x.high)];
    let area = plot.polygon([[x.low, y.high]].into_iter().chain(line).chain([[x.high, y.high]]));
    plot.path("hatched", &area);
    let line = plot.line(line);
    plot.path("constraint", &line);
}

fn controls(record: &RaceRecord, picture: &PictureRecord) -> String {
    let last = picture.frames.len() - 1;
    let pause = (1000.0 * record.step_seconds).clamp(40.0, 1000.0);
    let pause = if pause.is_nan() { 100.0 } else { pause };
    let first = escape(&moment::title(record, picture, 0));
    format!(
        "{strip}<input type=\"range\" id=\"moment\" min=\"0\" max=\"{last}\" value=\"0\" step=\"1\" \
         aria-label=\"Moment of the race\" aria-valuetext=\"{first}\" data-pause=\"{pause:.0}\" \
         disabled>\
         <div class=\"buttons\">\
         <button type=\"button\" id=\"previous\" disabled>Previous</button>\
         <button type=\"button\" id=\"play\" disabled>Play</button>\
         <button type=\"button\" id=\"next\" disabled>Next</button></div>\
         <p class=\"now\"><output for=\"moment\" id=\"now\">{first}</output></p>\
         <noscript><p class=\"hint\">Without JavaScript only the first moment is shown.</p>\
         </noscript>",
        strip = strip(picture)
    )
}

/// The tiers along the slider, as runs of one colour; nothing without tiers.
fn strip(picture: &PictureRecord) -> String {
    let mut runs: Vec<(Option<u8>, usize)> = Vec::new();
    for frame in &picture.frames {
        match runs.last_mut() {
            Some((tier, length)) if *tier == frame.tier => *length += 1,
            _ => runs.push((frame.tier, 1)),
        }
    }
    if runs.iter().all(|(tier, _)| tier.is_none()) {
        return String::new();
    }
    let mut at = 0;
    let mut areas = String::new();
    for (tier, length) in runs {
        if let Some(tier) = tier {
            let data = format!("M{at} 0H{}V6H{at}Z", at + length);
            areas += &format!("<path class=\"band tier-{}\" d=\"{data}\"/>", tier.min(3));
        }
        at += length;
    }
    format!(
        "<svg class=\"strip\" viewBox=\"0 0 {at} 6\" preserveAspectRatio=\"none\" \
         aria-hidden=\"true\">{areas}</svg>"
    )
}
