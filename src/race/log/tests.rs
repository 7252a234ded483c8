//! Races through a file and back: what is padded, and what stands for "none".

use super::*;
use crate::files::{npz_bytes, read_npz};

/// A step with a number of its own in each place.
fn full(number: u8, status: FilterStatus, verified: bool) -> StepLog {
    let n = f32::from(number);
    StepLog {
        control: [n, -n, 0.5 * n],
        tier: Some(number % 4),
        check_margin: Some(-0.25 * n),
        ball: Some(BallLog {
            center: [n + 0.25, n + 0.5],
            radius: 0.1 * n,
            verified,
            rounds: 3 + u32::from(number),
            f64_reruns: 70_000 + u32::from(number),
        }),
        effective_samples: Some(10.0 * n),
        best_cost: Some(3.0 - n),
        non_finite: 5 * u32::from(number),
        refused: verified,
        filter: Some((status, 0.125 * n, !verified)),
        beta: 1e-3 * f64::from(number),
        seconds: 1e-4 * n,
    }
}

/// A step where nothing is known but the control; the time is 0.
fn bare() -> StepLog {
    StepLog { control: [0.25; 3], ..StepLog::default() }
}

fn race(first: f32, steps: Vec<StepLog>) -> RaceLog {
    let state = |t: usize| std::array::from_fn(|i| first + t as f32 + 0.0625 * i as f32);
    RaceLog { states: (0..=steps.len()).map(state).collect(), steps }
}

/// A long race, a short one, one without a step: every status, and "none" everywhere.
fn all() -> Vec<RaceLog> {
    use FilterStatus::{Failed, Inaccurate, Infeasible, Solved};
    let long = vec![full(1, Solved, true), bare(), full(2, Inaccurate, false)];
    let short = vec![full(3, Infeasible, true), full(4, Failed, false)];
    vec![race(-3.0, long), race(-9.0, short), race(5.0, Vec::new()), race(7.0, vec![bare()])]
}

/// `arrays` written to a file and read.
fn stored(arrays: &[(&'static str, Array)]) -> BTreeMap<String, Array> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), npz_bytes(arrays).unwrap()).unwrap();
    read_npz(file.path()).unwrap()
}

#[test]
fn races_come_back() {
    for most in [3, 5] {
        let expected = StoredRaces { races: all(), most };
        assert_eq!(races(&stored(&arrays(&all(), most))).unwrap(), expected);
    }
    let none = StoredRaces { races: Vec::new(), most: 0 };
    assert_eq!(races(&stored(&arrays(&[], 5))).unwrap(), none);
}

#[test]
fn what_is_over_is_padded() {
    let stored = stored(&arrays(&all(), 4));
    let shape = |name: &str| stored[name].shape.clone();
    assert_eq!((shape("states"), shape("controls")), (vec![4, 5, 12], vec![4, 4, 3]));
    assert_eq!((shape("steps"), shape("tier")), (vec![4], vec![4, 4]));
    assert_eq!(stored["steps"].data.as_u32().unwrap(), [3, 2, 0, 1]);
    let none = u8::MAX;
    let tiers = [[1, none, 2, none], [3, 0, none, none], [none; 4], [none; 4]];
    assert_eq!(stored["tier"].data.as_u8().unwrap(), tiers.concat());
    // The second race has 3 of 5 states: from number 3 on there is nothing.
    let states = stored["states"].data.as_f32().unwrap();
    let second = &states[5 * 12..10 * 12];
    assert_eq!((second[0], second[12], second[24]), (-9.0, -8.0, -7.0));
    assert!(second[36..].iter().all(|x| x.is_nan()) && second[..36].iter().all(|x| !x.is_nan()));
    let controls = stored["controls"].data.as_f32().unwrap();
    assert!(controls[3 * 4..][..6].iter().all(|u| !u.is_nan()));
    assert!(controls[3 * 4..][6..12].iter().all(|u| u.is_nan()));
    let (beta, rounds) = (&stored["beta"].data, &stored["growth_rounds"].data);
    assert_eq!(beta.as_f64().unwrap()[..5], [1e-3, 0.0, 2e-3, 0.0, 3e-3]);
    assert_eq!(rounds.as_u32().unwrap()[..5], [4, 0, 5, 0, 6]);
    assert!(stored["ball_radius"].data.as_f32().unwrap()[1].is_nan());
    assert_eq!(stored["filter_status"].data.as_u8().unwrap()[..5], [0, none, 1, none, 2]);
}

#[test]
fn arrays_that_do_not_fit_are_named() {
    let problem = |change: &dyn Fn(&mut BTreeMap<String, Array>)| {
        let mut arrays = stored(&arrays(&all(), 3));
        change(&mut arrays);
        races(&arrays).unwrap_err()
    };
    let names: Vec<String> = stored(&arrays(&all(), 3)).into_keys().collect();
    assert_eq!(names.len(), 20);
    for name in names {
        let gone = problem(&|arrays| drop(arrays.remove(&name)));
        assert_eq!(gone, format!("no array `{name}`"));
        let other = Array { shape: vec![1], data: Data::U64(vec![1]) };
        let other = problem(&|arrays| drop(arrays.insert(name.clone(), other.clone())));
        assert_eq!(other, format!("`{name}` has numbers of another type"));
    }
    let short = Array { shape: vec![2], data: Data::F32(vec![0.0; 2]) };
    let short = problem(&|arrays| drop(arrays.insert("seconds".to_owned(), short.clone())));
    assert_eq!(short, "`seconds` has 2 numbers, expected 12");
    let long = Array { shape: vec![4], data: Data::U32(vec![3, 2, 4, 1]) };
    let long = problem(&|arrays| drop(arrays.insert("steps".to_owned(), long.clone())));
    assert_eq!(long, "`steps` of race 2 is 4, at most 3 are stored");
}
