//! Metrics of a race in SI units.

use super::judge::Judge;
use super::record::MetricsRecord;

/// What is measured of one race, from the start to the first sample at or past the gate's plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RaceMetrics {
    /// Time of the first sample with `y_e >= 0`, s: a whole number of steps, not interpolated.
    pub time_seconds: f64,
    /// Sum of the distances between the ego's successive positions, m.
    pub path_m: f64,
    /// Mean over the steps of the length of the ego's velocity change over `dt`, m/s^2.
    pub acceleration: f64,
    /// Mean of the lengths of the changes of that acceleration over `dt`, m/s^3; 0 for one step.
    pub jerk: f64,
    /// Smallest 3-D distance of the two drones over the samples, m.
    pub separation_m: f64,
}

impl RaceMetrics {
    /// Metrics of the samples `[T + 1]`, `step_seconds` apart; in f64.
    ///
    /// `None` where the ego does not reach the plane or starts there: they are meant for successes.
    pub fn of(states: &[[f32; 12]], step_seconds: f64) -> Option<Self> {
        let steps = states.iter().position(|x| x[2] >= 0.0).filter(|&steps| steps > 0)?;
        let flown: Vec<[f64; 12]> = states[..=steps].iter().map(|x| x.map(f64::from)).collect();
        let positions = flown.iter().map(|x| [x[0], x[2], x[4]]).collect::<Vec<_>>();
        let velocities = flown.iter().map(|x| [x[1], x[3], x[5]]).collect::<Vec<_>>();
        let accelerations = rates(&velocities, step_seconds);
        let jerks = rates(&accelerations, step_seconds);
        let apart = flown.iter().map(|x| length([x[0] - x[6], x[2] - x[8], x[4] - x[10]]));
        Some(Self {
            time_seconds: steps as f64 * step_seconds,
            path_m: rates(&positions, 1.0).into_iter().map(length).sum(),
            acceleration: mean(accelerations.into_iter().map(length)),
            jerk: mean(jerks.into_iter().map(length)),
            separation_m: apart.fold(f64::INFINITY, f64::min),
        })
    }
}

/// Means over the races that `judge` takes for successes; `None` without races.
pub fn mean_metrics(judge: Judge, races: &[RaceMetrics]) -> Option<MetricsRecord> {
    if races.is_empty() {
        return None;
    }
    let over = |value: fn(&RaceMetrics) -> f64| mean(races.iter().map(value));
    Some(MetricsRecord {
        judge,
        races: races.len() as u64,
        time_seconds: over(|race| race.time_seconds),
        path_m: over(|race| race.path_m),
        jerk: over(|race| race.jerk),
        acceleration: over(|race| race.acceleration),
        separation_m: over(|race| race.separation_m),
        least_separation_m: races
            .iter()
            .map(|race| race.separation_m)
            .fold(f64::INFINITY, f64::min),
    })
}

/// Differences of successive vectors over `dt`.
fn rates(vectors: &[[f64; 3]], dt: f64) -> Vec<[f64; 3]> {
    let rate = |pair: &[[f64; 3]]| std::array::from_fn(|i| (pair[1][i] - pair[0][i]) / dt);
    vectors.windows(2).map(rate).collect()
}

fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// The mean; 0 of nothing.
fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1);
    values.sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::race::system::DroneRace;
    use crate::system::System;

    fn close(have: f64, want: f64, error: f64) {
        assert!((have - want).abs() <= error, "{have}, expected {want} within {error}");
    }

    /// Euler steps of the plant at full control along y from rest: the acceleration is the gain,
    /// the jerk 0, and k steps lead 0.005 k (k - 1) / 2 m along: 2.95 m takes 35 of them.
    #[test]
    fn constant_acceleration() {
        let race = DroneRace::default();
        let mut state = [0.0, 0.0, -2.95, 0.0, 0.0, 0.0, 0.0, 0.0, -4.0, 0.0, 0.0, 0.0];
        let mut states = vec![state];
        for _ in 0..80 {
            state = race.step(state, [0.0, 1.0, 0.0]);
            states.push(state);
        }
        let metrics = RaceMetrics::of(&states, 0.1).unwrap();
        close(metrics.time_seconds, 3.5, 1e-12);
        close(metrics.path_m, 0.005 * 35.0 * 34.0 / 2.0, 1e-5);
        close(metrics.acceleration, 0.5, 1e-5);
        close(metrics.jerk, 0.0, 1e-4);
    }

    /// A circle of radius R at rate w: chords 2 R sin(w dt / 2), velocity R w; its differences over
    /// dt are 2 R w sin(w dt / 2) / dt, and theirs shorter by the same factor once more.
    #[test]
    fn circle() {
        let (radius, rate, dt) = (2.0_f64, 0.3_f64, 0.1);
        let steps = 25;
        let states: Vec<[f32; 12]> = (0..=steps)
            .map(|k| {
                // Ends on the plane, in the plane z = x, so that all three axes take part.
                let angle = rate * dt * f64::from(k - steps);
                let (across, along) = (radius * angle.cos(), radius * angle.sin());
                let (out, speed) = (-radius * rate * angle.sin(), radius * rate * angle.cos());
                let half = 0.5_f64.sqrt();
                let [x, vx, y, vy] = [across * half, out * half, along, speed].map(|v| v as f32);
                // The opponent rests 0.5 m beside the last position.
                let beside = (radius * half) as f32;
                [x, vx, y, vy, x, vx, beside + 0.3, 0.0, 0.4, 0.0, beside, 0.0]
            })
            .collect();
        let metrics = RaceMetrics::of(&states, dt).unwrap();
        let chord = 2.0 * (rate * dt / 2.0).sin();
        close(metrics.time_seconds, 2.5, 1e-12);
        close(metrics.path_m, f64::from(steps) * radius * chord, 1e-5);
        close(metrics.acceleration, radius * rate * chord / dt, 1e-5);
        close(metrics.jerk, radius * rate * chord * chord / (dt * dt), 1e-4);
        close(metrics.separation_m, 0.5, 1e-6);
    }

    #[test]
    fn samples_after_the_plane_do_not_count() {
        let mut states = vec![[0.0_f32; 12]; 2];
        states[0][2] = -0.5;
        // One step of 0.5 m; the drones meet at the end.
        let one = RaceMetrics::of(&states, 0.1).unwrap();
        close(one.path_m, 0.5, 0.0);
        assert_eq!((one.jerk, one.separation_m), (0.0, 0.0));
        states.push([9.0; 12]);
        assert_eq!(RaceMetrics::of(&states, 0.1), Some(one));
        assert_eq!(RaceMetrics::of(&states[..1], 0.1), None);
        assert_eq!(RaceMetrics::of(&states[1..], 0.1), None);
        assert_eq!(RaceMetrics::of(&[[f32::NAN; 12]], 0.1), None);
    }

    #[test]
    fn means_over_races() {
        let race = |factor: f64| RaceMetrics {
            time_seconds: factor,
            path_m: 2.0 * factor,
            acceleration: 3.0 * factor,
            jerk: 4.0 * factor,
            separation_m: 5.0 * factor,
        };
        let record = mean_metrics(Judge::Paper, &[race(1.0), race(4.0)]).unwrap();
        assert_eq!((record.judge, record.races), (Judge::Paper, 2));
        assert_eq!([record.time_seconds, record.path_m], [2.5, 5.0]);
        assert_eq!([record.acceleration, record.jerk], [7.5, 10.0]);
        assert_eq!([record.separation_m, record.least_separation_m], [12.5, 5.0]);
        assert_eq!(mean_metrics(Judge::Paper, &[]), None);
    }
}
