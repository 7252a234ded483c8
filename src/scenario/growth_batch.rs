//! Local growth of many balls at once: a round of all that are open is one batch.

use std::ops::Range;

use rayon::prelude::*;

use super::Context;
use super::growth::{Growth, check_scenarios, next_ball};
use super::growth_plan::GrowthMethod;
use super::purpose;
use super::settings::{GrowthSettings, Settings};
use super::walk::Walk;
use crate::error::Result;
use crate::real::Lanes;
use crate::rollout::{Ball, Region, Starts, States, Stream};

/// Starts that are drawn side by side.
const GROUP: usize = 16;
/// Most starts that are held at a time; few in tests, so that their rounds are cut.
const LISTED: usize = if cfg!(test) { 100 } else { 1 << 20 };

/// A ball to be grown: where, and with which random numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Centre, and the values of the coordinates that do not vary.
    pub center: Vec<f32>,
    /// Seed of the starts.
    pub seed: u64,
    /// Number of the call under that seed: none reuses another's samples.
    pub call: u32,
}

/// What came of a ball.
#[derive(Clone, Debug, PartialEq)]
pub struct Grown {
    /// The outcome.
    pub outcome: Growth,
    /// Rounds taken.
    pub rounds: u32,
    /// Starts that were run again in f64.
    pub f64_reruns: u64,
}

/// A ball under way.
struct Open {
    ball: Ball,
    /// The request that it answers.
    request: usize,
    rounds: u32,
    f64_reruns: u64,
    /// Upward: the largest radius that was accepted.
    verified: Option<f32>,
}

/// What a round showed of a ball.
#[derive(Clone, Copy, Default)]
struct Seen {
    /// Distance of the nearest failure from the centre.
    nearest: Option<f64>,
    failures: u64,
}

/// Grows a ball for each request, for at most M rounds of N fresh starts each, by Algorithm 1 as
/// [`super::growth::grow`] does one, or upward; a measure within `band` of zero is that of f64.
///
/// # Errors
/// [`crate::Error::TooFewScenarios`], and those of the backend.
pub fn grow_each(
    context: Context<'_>,
    settings: &Settings,
    requests: &[Request],
    band: f64,
) -> Result<Vec<Grown>> {
    let asked = &settings.growth;
    check_scenarios(asked)?;
    let open = |(request, center): (usize, Vec<f32>)| Open {
        ball: Ball { center, radius: asked.first_radius(), varies: asked.varies.clone() },
        request,
        rounds: 0,
        f64_reruns: 0,
        verified: None,
    };
    let centers = requests.iter().map(|request| request.center.clone()).enumerate();
    let mut balls: Vec<Open> = centers.map(open).collect();
    let mut grown: Vec<Option<Grown>> = vec![None; requests.len()];
    for number in 0..asked.rounds {
        round(context, settings, requests, &mut balls, band)?
            .into_iter()
            .zip(std::mem::take(&mut balls))
            .for_each(|(seen, mut open)| match next(asked, &mut open, number, seen) {
                Some(ball) => {
                    open.ball = ball;
                    balls.push(open);
                }
                None => {
                    let request = open.request;
                    grown[request] = Some(finished(open));
                }
            });
    }
    Ok(grown.into_iter().flatten().collect())
}

/// The ball of the round after `number`, which showed `seen`; none where it was the last. Notes the
/// radius of a round that passed.
fn next(asked: &GrowthSettings, open: &mut Open, number: u32, seen: Seen) -> Option<Ball> {
    let allowed = match asked.plan.method {
        GrowthMethod::Shrinking => 0,
        GrowthMethod::Upward => asked.allowed_failures().unwrap_or(0),
    };
    let passed = seen.failures <= allowed;
    if passed {
        open.verified = Some(open.ball.radius);
    }
    match asked.plan.method {
        GrowthMethod::Shrinking => {
            seen.nearest.and_then(|far| next_ball(asked, number, &open.ball, far))
        }
        GrowthMethod::Upward => {
            let radius = asked.radii().get(number as usize + 1).copied().filter(|_| passed)?;
            Some(Ball { radius, ..open.ball.clone() })
        }
    }
}

/// The ball as it ended.
fn finished(open: Open) -> Grown {
    let Open { ball, rounds, f64_reruns, verified, .. } = open;
    let outcome = match verified {
        Some(radius) => Growth::Verified(Ball { radius, ..ball }),
        None => Growth::Exhausted { last_radius: ball.radius },
    };
    Grown { outcome, rounds, f64_reruns }
}

/// One round of all balls: what each showed.
fn round(
    context: Context<'_>,
    settings: &Settings,
    requests: &[Request],
    balls: &mut [Open],
    band: f64,
) -> Result<Vec<Seen>> {
    if balls.is_empty() {
        return Ok(Vec::new());
    }
    let count = settings.growth.scenarios;
    let total = count * balls.len() as u64;
    let mut seen = vec![Seen::default(); balls.len()];
    for first in (0..total).step_by(LISTED) {
        let range = first..total.min(first + LISTED as u64);
        piece(context, settings, requests, balls, range, &mut seen, band)?;
    }
    balls.iter_mut().for_each(|open| open.rounds += 1);
    Ok(seen)
}

/// The starts `range` of a round, N for each ball after the other.
fn piece(
    context: Context<'_>,
    settings: &Settings,
    requests: &[Request],
    balls: &mut [Open],
    range: Range<u64>,
    seen: &mut [Seen],
    band: f64,
) -> Result<()> {
    let count = settings.growth.scenarios;
    let draw = |(place, open): (usize, &Open)| {
        let Request { seed, call, .. } = &requests[open.request];
        let use_number = call * settings.growth.rounds + open.rounds;
        let purpose = match settings.growth.plan.method {
            GrowthMethod::Shrinking => purpose::GROWTH,
            GrowthMethod::Upward => purpose::GROWTH_UPWARD,
        };
        let stream = Stream::new(*seed, purpose, use_number);
        let own = |index: u64| index.saturating_sub(place as u64 * count).min(count);
        drawn(&Region::Ball(open.ball.clone()), stream, own(range.start)..own(range.end))
    };
    let drawn: Vec<Vec<f32>> = balls.par_iter().enumerate().map(draw).collect();
    let (starts, size) = (drawn.concat(), settings.state.len());
    let starts = States::new(&starts, size)?;
    let (all, range_of_all) = (Starts::Listed(starts), 0..starts.len() as u64);
    Walk { starts: all, range: range_of_all, spec: settings.spec, band }.each(context, |rolled| {
        let place = ((range.start + rolled.index) / count) as usize;
        balls[place].f64_reruns += rolled.reruns();
        if rolled.failed() {
            let distance = balls[place].ball.distance(starts.row(rolled.index as usize));
            let Seen { nearest, failures } = &mut seen[place];
            *nearest = Some(nearest.map_or(distance, |near| near.min(distance)));
            *failures += 1;
        }
    })
}

/// The starts `range` of `stream` in `region`.
fn drawn(region: &Region, stream: Stream, range: Range<u64>) -> Vec<f32> {
    let mut starts = Vec::with_capacity((range.end - range.start) as usize * region.size());
    let mut lanes = vec![Lanes([0.0; GROUP]); region.size()];
    for first in range.clone().step_by(GROUP) {
        region.sample(stream, first, &mut lanes);
        let live = GROUP.min((range.end - first) as usize);
        starts.extend((0..live).flat_map(|i| lanes.iter().map(move |lane| lane.0[i])));
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::Backend;
    use crate::backend::cpu::Cpu;
    use crate::model::{Model, Plant};
    use crate::rollout::RolloutSpec;
    use crate::scenario::Unwatched;
    use crate::scenario::boundary::Boundary;
    use crate::scenario::growth::{GrowthRun, grow};
    use crate::scenario::record::RoundRecord;
    use crate::system::{BangBang, DoubleIntegrator};

    /// Around these no ball fails, some do at first, and all do.
    const CENTERS: [[f32; 2]; 6] =
        [[0.0, 0.0], [0.85, 0.3], [-0.8, -0.5], [1.15, 0.1], [0.5, -0.9], [0.99, 0.35]];

    fn requests() -> Vec<Request> {
        let request = |(i, center): (usize, [f32; 2])| Request {
            center: center.to_vec(),
            seed: 5 + i as u64 % 2,
            call: [3, 0, 7][i % 3],
        };
        CENTERS.into_iter().enumerate().map(request).collect()
    }

    fn settings(model: &Model) -> Settings {
        let spec = RolloutSpec::new(30, 0.95).unwrap();
        let mut settings = Settings::new(model, [0.0; 2], spec).unwrap();
        (settings.growth.radius, settings.growth.rounds) = (0.4, 4);
        // No multiple of the starts that are drawn side by side.
        settings.growth.scenarios = 83;
        settings
    }

    #[test]
    fn a_batch_grows_what_each_call_grows_alone() {
        let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
        let backend = Backend::Cpu(Cpu::new(Some(2)).unwrap());
        let program = backend.prepare(&plant).unwrap();
        let context = Context { program: &program, watch: &Unwatched };
        let asked = settings(&plant.model);
        // A band so wide that some starts are run again.
        let band = 0.02;
        let grown = grow_each(context, &asked, &requests(), band).unwrap();
        assert_eq!(grown.len(), CENTERS.len());
        for (request, grown) in requests().into_iter().zip(&grown) {
            let settings = Settings { seed: request.seed, ..asked.clone() };
            let boundary = Boundary { point: request.center.clone(), distance: 0.0 };
            let GrowthRun { outcome, rounds, .. } =
                grow(context, &settings, &boundary, band, request.call).unwrap();
            let reruns = |round: &RoundRecord| round.f64_reruns;
            assert_eq!(grown.outcome, outcome, "{request:?}");
            assert_eq!(grown.rounds as usize, rounds.len(), "{request:?}");
            assert_eq!(grown.f64_reruns, rounds.iter().map(reruns).sum::<u64>(), "{request:?}");
        }
        let verified = grown.iter().filter(|g| matches!(g.outcome, Growth::Verified(_)));
        let took = |rounds: u32| grown.iter().any(|grown| grown.rounds == rounds);
        assert!((1..CENTERS.len()).contains(&verified.count()), "{grown:?}");
        assert!(took(1) && grown.iter().any(|g| g.rounds > 1 && g.rounds < 4), "{grown:?}");
        assert!(grown.iter().any(|grown| grown.f64_reruns > 0), "{grown:?}");
    }

    #[test]
    fn nothing_asked_is_nothing_grown() {
        let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
        let backend = Backend::Cpu(Cpu::new(Some(1)).unwrap());
        let program = backend.prepare(&plant).unwrap();
        let context = Context { program: &program, watch: &Unwatched };
        let mut asked = settings(&plant.model);
        assert_eq!(grow_each(context, &asked, &[], 0.0).unwrap(), []);
        // 0.1 and 1e-3 over four rounds need 79.
        asked.growth.scenarios = 20;
        let error = grow_each(context, &asked, &requests(), 0.0).unwrap_err().to_string();
        assert!(error.contains("20 scenarios") && error.contains("at least 79"), "{error}");
    }
}
