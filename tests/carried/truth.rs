//! A plant in f64: its step, its rollouts, and the measure of its task by definition.

/// Numbers of states and controls.
pub(crate) type Formula = Box<dyn Fn(&[f64], &[f64]) -> Vec<f64>>;

/// How a state moves under controls that are within their bounds.
pub(crate) enum Dynamics {
    /// The derivative, by the classical rule of order 4.
    Rk4(Formula),
    /// The derivative, by explicit steps.
    Euler(Formula),
    /// The next state.
    Next(Formula),
}

/// What a rollout has to do; `by` is a step.
#[derive(Clone, Copy)]
pub(crate) enum Goal {
    ReachAvoid,
    Avoid,
    Reach,
    ReachStay { by: usize },
    AtEnd,
}

/// What a policy or a margin makes of a state and the time in seconds.
pub(crate) type Controls = Box<dyn Fn(&[f64], f64) -> Vec<f64>>;
pub(crate) type Margin = fn(&[f64], f64) -> f64;

/// A plant under `configs/models`, written from its mathematics.
pub(crate) struct Truth {
    /// Name of its file.
    pub(crate) file: &'static str,
    /// Seconds of a step.
    pub(crate) period: f32,
    pub(crate) dynamics: Dynamics,
    /// Of each control.
    pub(crate) bounds: Vec<[f64; 2]>,
    pub(crate) policy: Controls,
    pub(crate) target: Margin,
    pub(crate) constraint: Margin,
    pub(crate) goal: Goal,
}

/// The margin of a task that has none.
pub(crate) fn none(_: &[f64], _: f64) -> f64 {
    f64::INFINITY
}

/// `x` moved by `by` times `slope`.
fn moved(x: &[f64], by: f64, slope: &[f64]) -> Vec<f64> {
    x.iter().zip(slope).map(|(x, slope)| x + by * slope).collect()
}

impl Truth {
    /// Seconds since the start of a rollout.
    pub(crate) fn time(&self, step: usize) -> f64 {
        f64::from(self.period) * step as f64
    }

    /// The state a period after `x`, the controls `u` clipped to their bounds.
    pub(crate) fn next(&self, x: &[f64], u: &[f64]) -> Vec<f64> {
        let clipped = |(u, [low, high]): (&f64, &[f64; 2])| u.clamp(*low, *high);
        let u: Vec<f64> = u.iter().zip(&self.bounds).map(clipped).collect();
        let h = f64::from(self.period);
        match &self.dynamics {
            Dynamics::Next(next) => next(x, &u),
            Dynamics::Euler(slope) => moved(x, h, &slope(x, &u)),
            Dynamics::Rk4(slope) => {
                let a = slope(x, &u);
                let b = slope(&moved(x, h / 2.0, &a), &u);
                let c = slope(&moved(x, h / 2.0, &b), &u);
                let d = slope(&moved(x, h, &c), &u);
                let sum = |i: usize| a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i];
                moved(x, h / 6.0, &(0..x.len()).map(sum).collect::<Vec<f64>>())
            }
        }
    }

    /// The states of a rollout of `horizon` steps, `[horizon + 1, states]`.
    pub(crate) fn states(&self, start: &[f64], horizon: usize) -> Vec<Vec<f64>> {
        let mut all = vec![start.to_vec()];
        for step in 0..horizon {
            let u = (self.policy)(&all[step], self.time(step));
            all.push(self.next(&all[step], &u));
        }
        all
    }

    /// The measure of a rollout, without a discount.
    pub(crate) fn measure(&self, start: &[f64], horizon: usize) -> f64 {
        let states = self.states(start, horizon);
        let of = |margin: Margin| -> Vec<f64> {
            states.iter().enumerate().map(|(step, x)| margin(x, self.time(step))).collect()
        };
        let (r, c) = (of(self.target), of(self.constraint));
        let least = |margins: &[f64]| margins.iter().copied().fold(f64::INFINITY, f64::min);
        let best = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
        match self.goal {
            Goal::ReachAvoid => best(&mut (0..=horizon).map(|t| r[t].min(least(&c[..=t])))),
            Goal::Reach => best(&mut r.iter().copied()),
            Goal::Avoid => least(&c),
            Goal::ReachStay { by } => least(&c).min(least(&r[by..])),
            Goal::AtEnd => least(&c).min(r[horizon]),
        }
    }
}
