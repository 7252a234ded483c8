//! Trajectories of a few rollouts in the plane of the system's bodies.

use super::course::{self, only_state};
use super::plane::{GroundOf, slice_states};
use crate::model::Form;
use crate::report::figure::{Figure, Swatch};
use crate::report::places::entry;
use crate::report::plot::{Plot, Proportions};
use crate::report::slice::Grid;
use crate::report::span::Span;
use crate::report::text::{listed, shorten};
use crate::report::tracks::{self, NAMED, Run, Scene, Track};
use crate::report::words;
use crate::scenario::record::{GrowthOutcome, Record, RolloutRecord};

/// The figure.
pub(super) fn figure(record: &Record, grid: Option<&Grid>) -> Figure {
    let scene = scene(record);
    let tracks = scene.tracks();
    let ground = ground(record, &tracks, grid);
    let picture = Picture { record, scene, tracks, ground };
    let drawing = if record.picture.rollouts.is_empty() {
        Err("The record holds no rollouts.".to_owned())
    } else {
        picture.drawing()
    };
    Figure {
        id: "figure-paths",
        title: "Trajectories of a few rollouts".to_owned(),
        legend: if drawing.is_ok() { picture.legend() } else { Vec::new() },
        drawing,
        caption: picture.caption(),
    }
}

/// What the rollouts of the record make a picture of.
fn scene(record: &Record) -> Scene<'_> {
    Scene {
        states: &record.system.states,
        bodies: &record.system.bodies,
        plane: slice_states(record),
        drawn: record.picture.drawn.as_ref(),
        runs: record.picture.rollouts.iter().map(run).collect(),
    }
}

fn run(rollout: &RolloutRecord) -> Run<'_> {
    Run { states: &rollout.states, success: rollout.success }
}

/// What the paths are drawn over: margins of a ground of its own, or of the slice where that is the plane of
/// the first body.
fn ground<'a>(
    record: &'a Record,
    tracks: &[Track],
    slice: Option<&'a Grid<'a>>,
) -> Option<GroundOf<'a>> {
    if only_state(record).is_some() {
        return None;
    }
    let own = record.picture.drawn.as_ref().and_then(|drawn| drawn.ground.as_ref());
    if let Some(own) = own.and_then(|ground| GroundOf::picture(record, ground)) {
        return Some(own);
    }
    let first = tracks.first().and_then(|track| track.states);
    slice.filter(|_| first == Some(slice_states(record))).map(GroundOf::slice)
}

/// The picture with what is said of it.
struct Picture<'a> {
    record: &'a Record,
    scene: Scene<'a>,
    tracks: Vec<Track>,
    ground: Option<GroundOf<'a>>,
}

impl Picture<'_> {
    fn legend(&self) -> Vec<(Swatch, String)> {
        let Self { record, scene, tracks, ground } = self;
        let task = &record.system.task;
        let mut legend = scene.legend(tracks, &task.short_words(Form::Past, record.horizon));
        // Of a single state the paths all begin at step 0, which needs no mark.
        if let (Some(_), Some(first)) = (only_state(record), legend.first_mut()) {
            first.0 = Swatch::Line("body first");
        }
        if let Some(seen) = ground.as_ref().map(GroundOf::seen) {
            let (target, violated) =
                ("target set at the state", "constraint violated at the state");
            let target = (Swatch::Area("target-area target"), target.to_owned());
            let violated = (Swatch::Area("hatched constraint"), violated.to_owned());
            legend.extend((task.has_target() && seen.target).then_some(target));
            legend.extend((task.has_constraint() && seen.violated).then_some(violated));
        }
        legend.extend(tracks::shape_legend(scene.shapes()));
        legend
    }

    fn caption(&self) -> String {
        let Self { record, scene, tracks, ground } = self;
        let rollouts = &scene.runs;
        let reached = rollouts.iter().filter(|run| run.success).count();
        let mut caption = format!(
            "{reached} of {} rollouts {}; an illustration, not a sample that a claim rests on.{}",
            rollouts.len(),
            record.system.task.words(Form::Past, record.horizon),
            begins(record)
        );
        if tracks.iter().any(|track| track.size.is_some() || track.joined.is_some()) {
            caption += " Bodies stand where the first rollout begins and where it ends.";
        }
        let bodiless = record.system.bodies.is_empty() && scene.drawn.is_some();
        if let ([Track { states: Some(states), .. }], true) = (&tracks[..], bodiless) {
            let [x, y] = states.map(|state| words::name(record, state));
            caption += &format!(" The model has no bodies: the states {x} and {y} are drawn.");
        }
        caption + &ground.as_ref().map_or_else(String::new, |ground| self.behind(ground))
    }

    /// What is said of the margins behind the paths.
    fn behind(&self, ground: &GroundOf<'_>) -> String {
        let Self { record, tracks, .. } = self;
        let mut words = ground.words().to_owned();
        if tracks.len() > 1 {
            let names = tracks[1..].iter().take(NAMED).map(|track| shorten(&track.name, 40));
            let names = names.collect::<Vec<_>>().join(", ");
            words += &format!(", with the {names} where the state has it; they move with it");
        } else if record.system.states.len() > 2 {
            words += ", with the other coordinates as in the state";
        }
        let grey = self.frame().is_some_and(|plot| plot.exceeds(ground.spans()));
        words + if grey { "; none was computed where it is grey." } else { "." }
    }

    /// The empty plot of what the picture covers.
    fn frame(&self) -> Option<Plot> {
        let Self { scene, tracks, ground, .. } = self;
        let span = |axis: usize| Some(scene.span(tracks, axis)?.widened(0.05));
        let (mut x, mut y) = (span(0)?, span(1)?);
        if let Some(ground) = ground {
            let [across, up] = ground.spans();
            (x, y) = (x.join(across), y.join(up));
        }
        let shape = match scene.one_scale(tracks) {
            true => Proportions::Equal,
            false => Proportions::Free(330.0),
        };
        Some(Plot::new("paths", x, y, shape))
    }

    fn drawing(&self) -> Result<String, String> {
        let Self { record, scene, tracks, ground } = self;
        let nothing = || "No state of the rollouts can be drawn.".to_owned();
        let description = format!("Trajectories. {}", self.caption());
        if let Some(state) = only_state(record) {
            let span = course_span(record, state).ok_or_else(nothing)?;
            return Ok(course::drawing(record, span, state, &description));
        }
        let mut plot = self.frame().ok_or_else(nothing)?;
        if let Some(ground) = ground {
            ground.draw(&mut plot);
        }
        Ok(scene.finish(plot, tracks, |_| description))
    }
}

/// Where the rollouts begin: the state, then starts of local growth, then draws of the box.
fn begins(record: &Record) -> String {
    let others = record.picture.rollouts.len().saturating_sub(1);
    let grown = others.min(record.growth.samples.len());
    let set = words::grown(record);
    let set = match record.growth.outcome {
        GrowthOutcome::Verified => format!("the verified {set}"),
        _ => format!("the last {set} tried"),
    };
    let from =
        |count: usize, of: &str| (count > 0).then(|| format!("{count} at starts drawn from {of}"));
    let first = "the first at the state".to_owned();
    let all = [Some(first), from(grown, &set), from(others - grown, "the box")];
    let all: Vec<String> = all.into_iter().flatten().collect();
    format!(" They begin: {}.", listed(&all))
}

/// What is drawn of a system with one state: its paths, as far as they stay near the box.
fn course_span(record: &Record, state: usize) -> Option<Span> {
    let rollouts = record.picture.rollouts.iter();
    let values = rollouts.flat_map(|rollout| &rollout.states);
    let values = values.filter_map(|x| entry(x, state));
    let axis = record.system.states.get(state)?;
    let [low, high] = [axis.low, axis.high].map(f64::from);
    let near = |value: f64| value.clamp(2.0 * low - high, 2.0 * high - low);
    Span::of(values.map(near)).map(|span| span.widened(0.05))
}
