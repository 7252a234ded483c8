//! What runs are said to have come to: the task folded again by its definition, intervals, adapters.

use crate::plants::{PENDULUM, planned};

/// Target and constraint margin of [`PENDULUM`].
fn margins(angle: f64, rate: f64) -> [f64; 2] {
    [f64::from(0.15_f32) - (angle - 1.0).hypot(f64::from(0.2_f32) * rate), 2.0 - angle.abs()]
}

/// `max over t of min(gamma^t r_t, min over s <= t of gamma^s c_s)`, by that definition.
#[test]
fn measures_are_those_of_the_task() {
    let options = ["--set", "plan.runs=6", "--set", "plan.steps=12", "--backend", "cpu"];
    let planned = planned(PENDULUM, &options);
    let (angle, rate) = (planned.column("x.angle"), planned.column("x.rate"));
    let gamma = f64::from(0.95_f32);
    let mut successes = 0;
    for run in 0..6 {
        let (mut safe, mut best, mut reached) = (f64::INFINITY, f64::NEG_INFINITY, None);
        for (step, row) in planned.rows(run).into_iter().enumerate() {
            let [target, constraint] = margins(angle[row], rate[row]);
            assert!((planned.column("target_margin")[row] - target).abs() < 1e-6);
            assert!((planned.column("constraint_margin")[row] - constraint).abs() < 1e-6);
            let discount = gamma.powi(step as i32);
            safe = f64::min(safe, discount * constraint);
            best = f64::max(best, f64::min(safe, discount * target));
            reached = reached.or((best > 0.0).then_some(step));
        }
        let found = planned.number(&format!("/runs/{run}/measure"));
        assert!((found - best).abs() < 1e-6, "run {run}: {found} {best}");
        let said = &planned.record["runs"][run];
        assert_eq!(said["success"], best > 0.0);
        assert_eq!(said["reached"].as_u64(), reached.map(|step| step as u64));
        successes += u64::from(best > 0.0);
    }
    assert_eq!(planned.record["success"]["successes"], successes);
}

/// Five of five: the interval of Clopper and Pearson has its closed form there, and both backends get
/// there at about the same cost.
#[test]
fn both_backends_swing_it_up() {
    let mean = ["cpu", "gpu"].map(|backend| {
        let planned = planned(PENDULUM, &["--set", "plan.runs=5", "--backend", backend]);
        assert_eq!(planned.record["success"]["successes"], 5, "{backend}");
        let low = planned.number("/success/interval/0");
        assert!((low - 0.025_f64.powf(0.2)).abs() < 1e-6, "{low}");
        assert_eq!(planned.number("/success/interval/1"), 1.0);
        assert_eq!(planned.record["provenance"]["backend"], backend);
        planned.number("/cost/mean")
    });
    let [cpu, gpu] = mean;
    assert!((cpu - gpu).abs() < 0.05 * cpu, "{cpu} {gpu}");
}

/// Times and effective samples are there and make sense.
#[test]
fn figures_of_the_steps_are_there() {
    let planned = planned(PENDULUM, &["--backend", "cpu"]);
    let [median, p95, most] =
        ["median", "p95", "most"].map(|figure| planned.number(&format!("/latency/{figure}")));
    assert!(0.0 < median && median <= p95 && p95 <= most, "{median} {p95} {most}");
    let times = planned.column("milliseconds");
    assert_eq!(times.iter().filter(|time| **time > 0.0).count(), 40);
    assert_eq!(times.iter().copied().filter(|time| !time.is_nan()).fold(0.0, f64::max), most);
    let effective = planned.column("effective_samples");
    assert!(effective[..40].iter().all(|count| (1.0..=512.0).contains(count)), "{effective:?}");
    let least = effective[..40].iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(planned.number("/effective/least"), least);
    for words in ["terminal.place", "torque (N m)", "angle (rad)", "1 of 1", "A control step"] {
        assert!(planned.page.contains(words), "no `{words}` on the page");
    }
}
