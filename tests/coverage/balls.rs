//! Starts in the nested balls of a growth, rolled out once and stored, radius by radius.

use crate::EPSILON;
use crate::common::{cpu, race_policy};
use crate::plants::{BangBangSteering, Dubins, Duffing, Saturated};
use rand::RngExt;
use rand::rngs::StdRng;
use reachcast::backend::Program;
use reachcast::model::Plant;
use reachcast::race::DroneRace;
use reachcast::rollout::{
    Ball, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::system::Axis;

/// Starts of each ball.
const STARTS: u64 = 20_000;
/// Starts of a ball whose radius is looked for.
const SEARCHED: u64 = 4000;
/// Centres of which one is chosen.
const CENTERS: u64 = 400;

/// A start of a ball.
#[derive(Clone, Copy)]
pub(crate) struct Start {
    pub(crate) distance: f64,
    pub(crate) failed: bool,
}

/// The starts of one ball.
pub(crate) struct Pool(pub(crate) Vec<Start>);

impl Pool {
    /// The true risk.
    pub(crate) fn risk(&self) -> f64 {
        self.0.iter().filter(|start| start.failed).count() as f64 / self.0.len() as f64
    }

    /// The true risk of the ball of that radius within.
    pub(crate) fn within(&self, radius: f64) -> f64 {
        let inside = || self.0.iter().filter(|start| start.distance <= radius);
        inside().filter(|start| start.failed).count() as f64 / inside().count() as f64
    }

    pub(crate) fn draw(&self, random: &mut StdRng) -> Start {
        self.0[random.random_range(0..self.0.len())]
    }

    /// Failures among `starts` draws.
    pub(crate) fn failures(&self, starts: u64, random: &mut StdRng) -> u64 {
        (0..starts).filter(|_| self.draw(random).failed).count() as u64
    }
}

/// A plant, prepared, with the centre of its balls.
pub(crate) struct Balls<'a> {
    program: Program<'a>,
    center: Vec<f32>,
    spec: RolloutSpec,
}

impl<'a> Balls<'a> {
    /// Balls around `center`.
    pub(crate) fn around(program: Program<'a>, center: Vec<f32>) -> Self {
        Self { program, center, spec: RolloutSpec::new(30, 0.95).expect("a horizon") }
    }

    /// Balls around a start of the plant's box that succeeds: the middle one of those that do, by measure.
    fn in_box(program: Program<'a>) -> Self {
        let axes = &program.plant().model.states;
        let ends = |end: fn(&Axis) -> f32| axes.iter().map(end).collect::<Vec<_>>();
        let region = Region::new_box(ends(|axis| axis.low), ends(|axis| axis.high)).expect("a box");
        let mut balls = Self::around(program, Vec::new());
        let starts = Starts::Drawn { region, stream: Stream::new(5, Purpose::USER, 30) };
        let measures = balls.measures(&starts, CENTERS);
        let mut safe: Vec<u64> = (0..CENTERS).filter(|i| measures[*i as usize] > 0.0).collect();
        safe.sort_by(|a, b| measures[*a as usize].total_cmp(&measures[*b as usize]));
        balls.center = starts.start(safe[safe.len() / 2]);
        balls
    }

    fn measures(&self, starts: &Starts<'_>, count: u64) -> Vec<f32> {
        let task = ReachAvoidTask {
            starts: starts.clone(),
            range: 0..count,
            spec: self.spec,
            tightening: &Tightening::none(&self.spec),
            query: Query::Measure,
        };
        let mut measures = Vec::new();
        let mut sink = |_, values: &[f32]| {
            measures.extend_from_slice(values);
            Ok(())
        };
        self.program.reach_avoid(&task, &mut sink).expect("a batch");
        measures
    }

    /// The ball of `radius`. All balls have the same starts, as far out in units of their radius.
    pub(crate) fn pool(&self, radius: f32) -> Pool {
        self.starts(radius, STARTS)
    }

    fn starts(&self, radius: f32, count: u64) -> Pool {
        let varies = vec![true; self.center.len()];
        let ball = Ball { center: self.center.clone(), radius, varies };
        let stream = Stream::new(5, Purpose::USER, 31);
        let starts = Starts::Drawn { region: Region::Ball(ball.clone()), stream };
        let measures = self.measures(&starts, count);
        let start = |(index, measure): (u64, f32)| Start {
            distance: ball.distance(&starts.start(index)),
            failed: measure.is_nan() || measure <= 0.0,
        };
        Pool((0..).zip(measures).map(start).collect())
    }

    /// The radius at which about a share [`EPSILON`] of the ball fails.
    pub(crate) fn critical(&self) -> f32 {
        let [mut low, mut high] = [0.0, 4.0];
        let fails = |radius| self.starts(radius, SEARCHED).risk() > EPSILON;
        assert!(fails(high), "the box is safe");
        for _ in 0..12 {
            let middle = 0.5 * (low + high);
            *(if fails(middle) { &mut high } else { &mut low }) = middle;
        }
        high
    }
}

/// Calls `test` with the balls of each of three plants.
pub(crate) fn of_each(test: impl Fn(&str, &Balls<'_>)) {
    let plants = [
        ("race", Plant::of(DroneRace::default(), race_policy())),
        ("duffing", Plant::of(Duffing, Saturated)),
        ("dubins", Plant::of(Dubins, BangBangSteering)),
    ];
    for (name, plant) in plants {
        let backend = cpu(2);
        test(name, &Balls::in_box(backend.prepare(&plant).expect("a program")));
    }
}
