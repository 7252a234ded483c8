//! The paths of plans in closed loop: of the bodies of the model, or in a plane over the margins there.

use super::contour::Field;
use super::figure::{Figure, Swatch};
use super::plan_runs::{PlanPage, drawn, shown};
use super::plot::{Plot, Proportions};
use super::span::Span;
use super::tracks::{self, Run, Scene, Track};
use crate::model::Form;
use crate::plan::Plane;

/// The figure; none of a model with a single state and no bodies.
pub(super) fn figure(page: &PlanPage<'_>) -> Option<Figure> {
    if page.plane.is_none() && page.drawn.bodies.is_empty() {
        return None;
    }
    let picture = Picture::new(page);
    Some(Figure {
        id: "paths",
        title: "Paths".to_owned(),
        drawing: picture.drawing(),
        legend: picture.legend(),
        caption: picture.caption(),
    })
}

/// The margins behind the paths, positive in the target and where the constraint is violated.
struct Ground {
    target: Option<Field>,
    violated: Option<Field>,
    spans: [Span; 2],
}

impl Ground {
    /// Those of `plane` that the task asks for; none without a span.
    fn new(page: &PlanPage<'_>, plane: &Plane) -> Option<Self> {
        let task = &page.record.system.task;
        let field = |values: &[f64], sign: f64| Field {
            x: plane.values[0].clone(),
            y: plane.values[1].clone(),
            values: values.iter().map(|value| sign * value).collect(),
        };
        let span = |axis: usize| Span::of(plane.values[axis].iter().copied());
        Some(Self {
            target: task.has_target().then(|| field(&plane.target, 1.0)),
            violated: task.has_constraint().then(|| field(&plane.constraint, -1.0)),
            spans: [span(0)?, span(1)?],
        })
    }

    /// The target as an area, violated constraints hatched, and the zero levels of both margins.
    fn draw(&self, plot: &mut Plot) {
        plot.beyond(self.spans);
        let classes = [("target-area", "target"), ("hatched", "constraint")];
        for (field, (area, edge)) in [&self.target, &self.violated].into_iter().zip(classes) {
            let Some(field) = field else { continue };
            let region: String =
                field.region().into_iter().map(|part| plot.polygon(part)).collect();
            plot.path(area, &region);
            let lines: String =
                field.zero_lines().into_iter().map(|line| plot.line(line)).collect();
            plot.path(edge, &lines);
        }
    }

    fn has_target(&self) -> bool {
        self.target.as_ref().is_some_and(Field::is_positive)
    }

    fn is_violated(&self) -> bool {
        self.violated.as_ref().is_some_and(Field::is_positive)
    }
}

/// The picture with what is said of it.
struct Picture<'a> {
    page: &'a PlanPage<'a>,
    scene: Scene<'a>,
    tracks: Vec<Track>,
    ground: Option<Ground>,
}

impl<'a> Picture<'a> {
    fn new(page: &'a PlanPage<'a>) -> Self {
        let system = &page.record.system;
        let runs = drawn(page);
        let scene = Scene {
            states: &system.states,
            bodies: &system.bodies,
            plane: page.plane.map_or([0, 1], |plane| plane.states),
            drawn: Some(page.drawn),
            runs: runs
                .map(|(run, judged)| Run { states: &run.states, success: judged.success() })
                .collect(),
        };
        let tracks = scene.tracks();
        // Margins are known over the plane of two states, and bodies may stand elsewhere.
        let first = tracks.first().and_then(|track| track.states);
        let plane = page.plane.filter(|plane| first == Some(plane.states));
        let ground = plane.and_then(|plane| Ground::new(page, plane));
        Self { page, scene, tracks, ground }
    }

    fn legend(&self) -> Vec<(Swatch, String)> {
        let record = self.page.record;
        let deed = record.system.task.short_words(Form::Past, record.steps);
        let mut legend = self.scene.legend(&self.tracks, &deed);
        if let Some(ground) = &self.ground {
            let target = (Swatch::Area("target-area target"), "target".to_owned());
            let violated = (Swatch::Area("hatched constraint"), "constraint violated".to_owned());
            legend.extend(ground.has_target().then_some(target));
            legend.extend(ground.is_violated().then_some(violated));
        }
        legend.extend(tracks::shape_legend(self.scene.shapes()));
        legend
    }

    fn caption(&self) -> String {
        let record = self.page.record;
        let words = record.system.task.words(Form::One, record.steps);
        let mut caption = format!("{} A run succeeds if it {words}.", shown(record));
        if self.tracks.iter().any(|track| track.size.is_some() || track.joined.is_some()) {
            caption += " Bodies stand where the first run begins and where it ends.";
        }
        caption + &self.ground.as_ref().map_or_else(String::new, |ground| self.behind(ground))
    }

    /// What is said of the margins behind the paths.
    fn behind(&self, ground: &Ground) -> String {
        let mut words =
            " Target and constraint are those of step 0 with the other states as at the first \
                         start"
                .to_owned();
        if self.frame().is_some_and(|plot| plot.exceeds(ground.spans)) {
            words += ", and none was computed where it is grey";
        }
        words += ".";
        if ground.target.is_some() && !ground.has_target() {
            words += " There is no target in this plane: with these other states no place of it is in the \
                      target.";
        }
        words
    }

    /// The empty plot of what the picture covers.
    fn frame(&self) -> Option<Plot> {
        let span = |axis: usize| Some(self.scene.span(&self.tracks, axis)?.widened(0.05));
        let spans = match &self.ground {
            Some(ground) => [0, 1].map(|axis| {
                let shapes = self.scene.shape_span(axis).unwrap_or(ground.spans[axis]);
                ground.spans[axis].join(shapes)
            }),
            None => [span(0)?, span(1)?],
        };
        let shape = match self.scene.one_scale(&self.tracks) {
            true => Proportions::Equal,
            false => Proportions::Free(330.0),
        };
        Some(Plot::new("paths-plane", spans[0], spans[1], shape))
    }

    fn drawing(&self) -> Result<String, String> {
        let Self { scene, tracks, ground, .. } = self;
        let mut plot = self.frame().ok_or("No state of the runs can be drawn.")?;
        if let Some(ground) = ground {
            ground.draw(&mut plot);
        }
        Ok(scene.finish(plot, tracks, |[x, y]| format!("Paths of the runs: {y} against {x}")))
    }
}
