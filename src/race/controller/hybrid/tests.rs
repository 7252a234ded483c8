//! The rules of the hybrid, at states that are put before it one by one.

use super::*;
use crate::control::tier::LocalGrowth;
use crate::race::tests::{Course, study_starts};
use crate::rollout::Ball;

/// A state of the ego at x, y with these velocities; the opponent far behind.
fn at(x: f32, y: f32, vx: f32, vy: f32) -> [f32; 12] {
    [x, vx, y, vy, 0.0, 0.0, -0.5, 0.0, -3.0, 0.3, 0.0, 0.0]
}

/// In the target: ahead, faster, in the corridor.
const INSIDE: [f32; 12] = [0.1, 0.5, -1.0, 0.6, 0.0, 0.0, -0.5, 0.0, -3.0, 0.3, 0.0, 0.0];
/// Neither in the target nor at the gate.
const OUTSIDE: [f32; 12] = [0.7, 0.0, -1.0, 0.6, 0.0, 0.0, -0.5, 0.0, -3.0, 0.3, 0.0, 0.0];

fn hybrid(course: &Course, races: usize) -> Hybrid<'_> {
    Hybrid::new(course.world(), races, Paths::None).unwrap()
}

fn race(place: usize, state: [f32; 12]) -> Active {
    Active { place, seed: 40 + place as u64, state }
}

/// What is decided at each of `states`, as the first step of races of their own.
fn first_step(course: &Course, states: &[[f32; 12]]) -> Vec<Decision> {
    let races: Vec<Active> = (0..).zip(states).map(|(place, x)| race(place, *x)).collect();
    hybrid(course, states.len()).decide(0, &races).unwrap()
}

fn count(decisions: &[Decision], tier: Tier) -> usize {
    decisions.iter().filter(|decision| decision.tier == Some(tier)).count()
}

#[test]
fn the_brake_acts_against_fast_velocity_across() {
    for vx in [0.0, 0.35, -0.35] {
        assert_eq!(brake(&at(0.1, -1.0, vx, 0.6)), [0.0; 3], "{vx}");
    }
    assert_eq!(brake(&at(0.1, -1.0, 0.36, 0.6)), [-1.0, -0.6, 0.0]);
    assert_eq!(brake(&at(0.1, -1.0, -0.36, 0.6)), [1.0, -0.6, 0.0]);
    assert_eq!(brake(&at(0.1, -1.0, 0.5, -0.6)), [-1.0, 0.6, 0.0]);
}

#[test]
fn near_is_a_tenth_of_a_metre_before_the_gate() {
    for (x, y, near) in [
        (0.0, -0.1, true),
        (0.3, -0.05, true),
        (-0.3, 0.1, true),
        (0.0, -0.11, false),
        (0.31, 0.0, false),
        (-0.31, -0.05, false),
    ] {
        assert_eq!(near_gate(&at(x, y, 0.0, 0.6)), near, "{x}, {y}");
    }
}

#[test]
fn the_nearest_point_of_a_disc() {
    let center = [0.2, -1.0];
    let inside = at(0.3, -1.1, 0.0, 0.0);
    assert_eq!(nearest_in_disc(&inside, center, 0.25), [0.3, -1.1]);
    // 0.3, 0.4, 0.5: the disc of radius 0.25 reaches half way.
    let [x, y] = nearest_in_disc(&at(0.5, -0.6, 0.0, 0.0), center, 0.25);
    assert!((x - 0.35).abs() < 1e-6 && (y + 0.8).abs() < 1e-6, "{x}, {y}");
    // No point of a grid over the disc is nearer.
    let far = at(-0.7, -1.9, 0.0, 0.0);
    let to = |p: [f32; 2]| (p[0] - far[0]).hypot(p[1] - far[2]);
    let found = to(nearest_in_disc(&far, center, 0.4));
    let grid = (-40..=40).flat_map(|i| (-40..=40).map(move |j| [i, j].map(|n| 0.01 * n as f32)));
    let disc = grid.filter(|[dx, dy]| dx.hypot(*dy) <= 0.4);
    let nearest = disc.map(|[dx, dy]| to([0.2 + dx, -1.0 + dy])).fold(f32::INFINITY, f32::min);
    assert!(found <= nearest + 1e-6 && found > nearest - 0.01, "{found}, {nearest}");
}

#[test]
fn recovery_steers_to_ball_then_cell_then_gate() {
    let mut course = Course::new();
    let x = at(0.7, -1.55, 0.0, 0.6);
    let cells = slice_through(&course.certificates, &x);
    let ball = |verified| {
        let varies = course.certificates.growth.varies.clone();
        let ball = Ball { center: at(0.2, -1.55, 0.0, 0.6).to_vec(), radius: 0.3, varies };
        LocalGrowth { ball, verified, rounds: 2, f64_reruns: 0 }
    };
    let [verified, failed] = [true, false].map(ball);
    // Two certified cells; by hand, the nearer is at x = 0.5, y = -1.2 or what is left of it.
    let marked = |x: &[f32]| {
        let near = |a: f32, b: f32| (a - b).abs() < 1e-3;
        (near(x[0], 0.5) && near(x[2], -1.2)) || (near(x[0], -0.9) && near(x[2], -1.6))
    };
    let certified: Vec<bool> = cells.iter().map(marked).collect();
    assert_eq!(certified.iter().filter(|marked| **marked).count(), 2);
    let standing = |growth, certified| Standing {
        tier: Tier::Recovery,
        check_margin: -1.0,
        certified,
        growth,
        refused: false,
    };
    let none = vec![false; cells.len()];
    let planned = [x, at(0.11, -0.7, 0.0, 0.6)];
    let close = |hybrid: &Hybrid<'_>, standing: &Standing, expected: [f32; 3]| {
        let point = hybrid.recovery_point(&x, standing, &planned);
        let off = point.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-5, "{point:?}, expected {expected:?}");
    };
    let pilot = hybrid(&course, 1);
    close(&pilot, &standing(Some(verified.clone()), certified.clone()), [0.5, -1.55, 0.0]);
    close(&pilot, &standing(Some(failed.clone()), certified.clone()), [0.5, -1.2, 0.0]);
    close(&pilot, &standing(None, certified.clone()), [0.5, -1.2, 0.0]);
    close(&pilot, &standing(Some(failed), none), [0.0; 3]);
    drop(pilot);
    course.race.hybrid.recovery_point = RecoveryPoint::Gate;
    close(&hybrid(&course, 1), &standing(Some(verified.clone()), certified.clone()), [0.0; 3]);
    course.race.hybrid.recovery_point = RecoveryPoint::Policy;
    close(&hybrid(&course, 1), &standing(Some(verified), certified), [0.11, -0.7, 0.0]);
}

#[test]
fn the_target_is_held_once_it_was_reached() {
    let mut course = Course::new();
    let target = |x: [f32; 12]| course.system.target(x);
    assert!(target(INSIDE) > 0.0 && target(OUTSIDE) < 0.0);
    for latch in [true, false] {
        course.race.hybrid.latch = latch;
        let mut pilot = hybrid(&course, 2);
        let tiers = |pilot: &mut Hybrid<'_>, step, states: [[f32; 12]; 2]| {
            let races = [race(0, states[0]), race(1, states[1])];
            let decided = pilot.decide(step, &races).unwrap();
            [0, 1].map(|i| decided[i].tier == Some(Tier::Target))
        };
        assert_eq!(tiers(&mut pilot, 0, [OUTSIDE, INSIDE]), [false, true]);
        // The second race has been there, the first has not.
        assert_eq!(tiers(&mut pilot, 1, [OUTSIDE, OUTSIDE]), [false, latch]);
        assert_eq!(tiers(&mut pilot, 2, [INSIDE, OUTSIDE]), [true, latch]);
        assert_eq!(tiers(&mut pilot, 3, [OUTSIDE, OUTSIDE]), [latch, latch]);
    }
}

#[test]
fn the_gate_is_flown_fast_where_that_counts() {
    let mut course = Course::new();
    // At the gate, slower than the opponent: not in the target.
    let mut gate = at(0.1, -0.05, 0.0, 0.2);
    gate[9] = 0.3;
    assert!(course.system.target(gate) < 0.0);
    let speed = |pilot: &Hybrid<'_>, x| pilot.fast_problem(0, &race(0, x)).context[0][6];
    assert_eq!(first_step(&course, &[gate])[0].tier, Some(Tier::Target));
    let pilot = hybrid(&course, 1);
    assert_eq!([speed(&pilot, gate), speed(&pilot, INSIDE)], [0.7, 0.5]);
    drop(pilot);
    course.race.hybrid.near_gate = false;
    assert_ne!(first_step(&course, &[gate])[0].tier, Some(Tier::Target));
    assert_eq!(speed(&hybrid(&course, 1), gate), 0.5);
}

#[test]
fn the_first_plan_in_the_target_and_the_next() {
    let mut course = Course::new();
    let plan = |course: &Course| hybrid(course, 1).fast_problem(0, &race(0, INSIDE)).plan;
    assert_eq!(plan(&course), [[-1.0, -0.6, 0.0]; 10]);
    course.race.hybrid.first_plan = FirstPlan::Zero;
    assert_eq!(plan(&course), [[0.0; 3]; 10]);
    course.race.hybrid.first_plan = FirstPlan::Policy;
    // The model of the plan: another gain, and an opponent that does not move.
    let model = DroneRace { ego_gain: 2.0, ..course.system };
    let mut x = INSIDE;
    for (t, u) in plan(&course).into_iter().enumerate() {
        assert_eq!(course.policy.control(x).map(|u: f32| u.clamp(-1.0, 1.0)), u, "step {t}");
        x = model.step(x, u);
        x[6..].copy_from_slice(&INSIDE[6..]);
    }
    let mut pilot = hybrid(&course, 1);
    let control = pilot.decide(0, &[race(0, INSIDE)]).unwrap()[0].control;
    let kept = pilot.races[0].plan.clone().unwrap();
    assert_eq!(kept[0], control);
    let next = pilot.fast_problem(1, &race(0, INSIDE)).plan;
    assert_eq!((&next[..9], next[9]), (&kept[1..], [0.0; 3]));
}

#[test]
fn tiers_that_are_left_out() {
    let mut course = Course::new();
    course.race.hybrid.near_gate = false;
    let states = study_starts(40);
    let policy = |x: [f32; 12]| course.policy.control(x).map(|u: f32| u.clamp(-1.0, 1.0));
    let whole = first_step(&course, &states);
    let counts = [Tier::Target, Tier::Global, Tier::Local, Tier::Recovery];
    let counts = counts.map(|tier| count(&whole, tier));
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
    for (x, decision) in states.iter().zip(&whole) {
        let certified = decision.check_margin.is_some_and(|margin| margin > 0.0);
        match decision.tier.unwrap() {
            Tier::Target => assert!(course.system.target(*x) > 0.0),
            Tier::Global => assert!(certified && decision.growth.is_none()),
            Tier::Local | Tier::Recovery => assert!(!certified),
        }
        let by_policy = matches!(decision.tier, Some(Tier::Global | Tier::Local));
        assert_eq!(by_policy, decision.control == policy(*x));
        assert_eq!(decision.recovery.is_some(), decision.tier == Some(Tier::Recovery));
    }

    let without = |change: fn(&mut HybridSettings)| {
        let mut other = Course::new();
        other.race = course.race.clone();
        change(&mut other.race.hybrid);
        first_step(&other, &states)
    };
    let no_global = without(|hybrid| hybrid.global = false);
    assert_eq!((count(&no_global, Tier::Global), count(&no_global, Tier::Target)), (0, counts[0]));
    let no_local = without(|hybrid| hybrid.local = false);
    assert_eq!((count(&no_local, Tier::Local), count(&no_local, Tier::Global)), (0, counts[1]));
    assert!(no_local.iter().all(|decision| decision.growth.is_none() && decision.beta == 0.0));
    let no_recovery = without(|hybrid| hybrid.recovery_tier = false);
    assert_eq!(count(&no_recovery, Tier::Recovery), counts[3]);
    for (x, decision) in states.iter().zip(&no_recovery) {
        if decision.tier != Some(Tier::Target) {
            assert_eq!((decision.control, decision.recovery), (policy(*x), None));
        }
    }
}

#[test]
fn tier_two_is_inside_a_verified_ball() {
    let course = Course::new();
    let states = study_starts(80);
    let (mut inside, mut outside) = (0, 0);
    for (x, decision) in states.iter().zip(first_step(&course, &states)) {
        let Some(growth) = &decision.growth else {
            assert_ne!(decision.tier, Some(Tier::Local));
            continue;
        };
        let center = &growth.ball.center;
        let distance = f64::from(x[0] - center[0]).hypot(f64::from(x[2] - center[2]));
        // Rounding aside, which no state of these needs.
        let within = growth.verified && distance <= f64::from(growth.ball.radius);
        assert_eq!(decision.tier == Some(Tier::Local), within, "{distance} {growth:?}");
        assert_eq!(decision.beta, 1e-3);
        inside += usize::from(within);
        outside += usize::from(growth.verified && !within);
    }
    assert!(inside > 0 && outside > 0, "{inside} inside, {outside} outside");
}

#[test]
fn growth_stops_when_beta_is_spent() {
    let mut course = Course::new();
    // Two calls and a half.
    course.race.beta = 2.5e-3;
    let states = study_starts(40);
    let grown = first_step(&course, &states);
    let place = grown.iter().position(|decision| decision.growth.is_some()).unwrap();
    let mut pilot = hybrid(&course, 2);
    let mut spent = [0.0; 2];
    for step in 0..5 {
        // The second race is there at the last two steps only: its ledger is its own.
        let races = [race(0, states[place]), race(1, states[place])];
        let decided = pilot.decide(step, if step < 3 { &races[..1] } else { &races }).unwrap();
        for (decision, spent) in decided.iter().zip(&mut spent) {
            *spent += decision.beta;
            assert_eq!(decision.growth.is_some(), decision.beta > 0.0);
        }
        let expected = [u8::from(step < 2), 1];
        for (decision, expected) in decided.iter().zip(expected) {
            assert_eq!(decision.beta, 1e-3 * f64::from(expected), "step {step}");
        }
    }
    assert!(spent.iter().all(|spent| (spent - 2e-3).abs() < 1e-15), "{spent:?}");
}
