//! Pairs in f64, many side by side: what [`super::replay`] gives one at a time, in the same bits.

use super::replay::{Margins, fold};
use super::spec::{PairControl, RolloutSpec, Tightening};
use crate::model::{Model, Moment, Plant, Role};
use crate::real::Wide;

/// Pairs of a group.
pub(crate) const GROUP: usize = 16;

/// Numbers of all pairs of a group.
type Lane = Wide<GROUP>;

/// The rollouts of at most [`GROUP`] pairs.
pub(crate) struct PairGroup {
    /// States of the nominal and of the perturbed rollouts that are looked at, `[2, looks, states]`.
    states: [Vec<Vec<Lane>>; 2],
    /// Parts of a period.
    points: u32,
    /// Pairs that there are.
    count: usize,
}

impl PairGroup {
    /// Rolls out `pairs`, each a nominal and a perturbed start.
    ///
    /// # Panics
    /// If there is no pair, or there are more than [`GROUP`].
    pub(crate) fn new(
        plant: &Plant,
        pairs: &[[Vec<f32>; 2]],
        horizon: u32,
        control: PairControl,
    ) -> Self {
        assert!((1..=GROUP).contains(&pairs.len()), "a group of 1 to {GROUP} pairs");
        // What lies beyond the pairs repeats the last one.
        let pair = |lane: usize| &pairs[lane.min(pairs.len() - 1)];
        let start = |side: usize| -> Vec<Lane> {
            let at = |i| Wide(std::array::from_fn(|lane| f64::from(pair(lane)[side][i])));
            (0..plant.model.states.len()).map(at).collect()
        };
        let mut states = [0, 1].map(|side| vec![start(side)]);
        for step in 0..horizon {
            let at = (step * plant.model.points) as usize;
            let [nominal, perturbed] = states.each_ref().map(|states| &states[at]);
            let control_at = |x: &[Lane]| plant.control(x, step);
            let driven = control_at(nominal);
            let feedback = (control == PairControl::ClosedLoop).then(|| control_at(perturbed));
            let next = plant.model.parts(nominal, &driven, step);
            let beside = plant.model.parts(perturbed, feedback.as_ref().unwrap_or(&driven), step);
            states[0].extend(next);
            states[1].extend(beside);
        }
        Self { states, points: plant.model.points, count: pairs.len() }
    }

    /// Pairs that there are.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Measures `[nominal, perturbed]` of each pair, as [`super::PairMeasure`] has them.
    pub(crate) fn measures(
        &self,
        model: &Model,
        spec: &RolloutSpec,
        tightening: &Tightening,
    ) -> Vec<[f64; 2]> {
        let plain = Tightening::none(spec);
        let [nominal, perturbed] = [(0, tightening), (1, &plain)].map(|(side, tightening)| {
            let states = &self.states[side];
            let margins = margins(model, states);
            let one = |lane: usize| {
                let looks = margins.iter().zip(states).map(|(margins, x)| margins.of(lane, x));
                fold(looks, spec, tightening)
            };
            (0..self.count).map(one).collect::<Vec<f64>>()
        });
        nominal
            .into_iter()
            .zip(perturbed)
            .map(|(nominal, perturbed)| [nominal, perturbed])
            .collect()
    }

    /// Euclidean distance of the rollouts of a pair at each step, the largest of its sample and of the points
    /// before it, `[T + 1]`; infinite where a state is not finite.
    pub(crate) fn distances(&self, pair: usize) -> Vec<f64> {
        let [nominal, perturbed] = &self.states;
        let length = |(a, b): (&Vec<Lane>, &Vec<Lane>)| {
            let square = |(a, b): (&Lane, &Lane)| (a.0[pair] - b.0[pair]).powi(2);
            let length = a.iter().zip(b).map(square).sum::<f64>().sqrt();
            if length.is_finite() { length } else { f64::INFINITY }
        };
        let lengths: Vec<f64> = nominal.iter().zip(perturbed).map(length).collect();
        let steps = lengths[1..].chunks(self.points as usize);
        let largest = |period: &[f64]| period.iter().copied().fold(0.0, f64::max);
        std::iter::once(lengths[0]).chain(steps.map(largest)).collect()
    }

    /// Looks at each pair before its nominal rollout fails its task, or the task is over.
    pub(crate) fn open_looks(&self, model: &Model) -> Vec<usize> {
        let [nominal, _] = &self.states;
        let margins = margins(model, nominal);
        let open = |pair: usize, look: usize| margins[look].of(pair, &nominal[look]).is_open();
        let looks = |pair| (0..nominal.len()).take_while(|look| open(pair, *look)).count();
        (0..self.count).map(looks).collect()
    }

    /// The states `[nominal, perturbed]` of a pair at look number `look`.
    pub(crate) fn states(&self, pair: usize, look: usize) -> [Vec<f64>; 2] {
        self.states.each_ref().map(|side| side[look].iter().map(|x| x.0[pair]).collect())
    }
}

/// The margins of all lanes at a look, and what it is to the task.
struct LaneMargins {
    moment: Moment,
    role: Role,
    /// Target and constraint margin.
    both: [Lane; 2],
}

impl LaneMargins {
    /// Those of one lane, whose state is among `x`.
    fn of(&self, lane: usize, x: &[Lane]) -> Margins {
        match x.iter().all(|x| x.0[lane].is_finite()) {
            true => Margins::of(self.moment, self.role, self.both.map(|margin| margin.0[lane])),
            false => Margins::lost(self.moment, self.role),
        }
    }
}

/// The margins at each of `states`, `[looks]`.
fn margins(model: &Model, states: &[Vec<Lane>]) -> Vec<LaneMargins> {
    let horizon = (states.len() as u32 - 1) / model.points;
    let at = |(look, x): (usize, &Vec<Lane>)| {
        let moment = model.moment(look);
        LaneMargins {
            moment,
            role: model.task.role_at(moment, horizon),
            both: [model.target_at(x, moment), model.constraint_at(x, moment)],
        }
    };
    states.iter().enumerate().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::{Activation, Layer, Mlp};
    use crate::race::system::DroneRace;
    use crate::rollout::replay::{looks, pair_measures, states};

    /// A network with weights that are no round numbers.
    fn network() -> Mlp {
        let layer = |inputs: usize, outputs: usize| {
            Layer::dense(
                (0..inputs * outputs).map(|i| (0.7 * i as f32).sin() * 0.4).collect(),
                (0..outputs).map(|i| (0.3 * i as f32).cos() * 0.1).collect(),
            )
        };
        let layers = vec![layer(12, 20), layer(20, 20), layer(20, 3)];
        Mlp::new(layers, Activation::Silu, Activation::Tanh).unwrap()
    }

    #[test]
    fn side_by_side_has_the_bits_of_one_at_a_time() {
        let plant = Plant::under(&std::sync::Arc::new(Model::of(DroneRace::default())), network());
        let spec = RolloutSpec::new(30, 0.95).unwrap();
        let tightening = Tightening {
            target: vec![0.1; 31],
            constraint: vec![0.2; 31],
            ..Tightening::default()
        };
        let coordinate = |pair: usize, i: usize| (1.3 * (pair * 12 + i) as f32).sin();
        let pairs: Vec<[Vec<f32>; 2]> = (0..GROUP - 3)
            .map(|pair| {
                let nominal: Vec<f32> = (0..12).map(|i| coordinate(pair, i)).collect();
                let perturbed = nominal.iter().map(|x| x + 0.05 * (7.0 * x).sin()).collect();
                [nominal, perturbed]
            })
            .collect();
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            let group = PairGroup::new(&plant, &pairs, spec.horizon, control);
            let measures = group.measures(&plant.model, &spec, &tightening);
            assert_eq!(measures.len(), pairs.len());
            for (i, pair) in pairs.iter().enumerate() {
                let both = [&*pair[0], &*pair[1]];
                let (nominal, perturbed) = pair_measures(&plant, both, &spec, &tightening, control);
                assert_eq!(measures[i], [nominal, perturbed], "pair {i}, {control:?}");
                let alone = states::<f64>(&plant, &pair[0], spec.horizon);
                assert_eq!(group.states(i, 30)[0], alone[30], "pair {i}, {control:?}");
            }
        }
    }

    /// A pendulum that is looked at three times inside each period.
    fn pendulum() -> Plant {
        let text = r#"
            [model]
            name = "pendulum"
            [model.states]
            angle = { unit = "rad", box = [-1.0, 1.0] }
            rate = { unit = "rad/s", box = [-1.0, 1.0] }
            [model.controls]
            torque = { unit = "N m", bounds = [-1.0, 1.0] }
            [model.flow]
            angle = "2 * rate"
            rate = "-9 * sin(angle) + torque + 0.5 * cos(3 * t)"
            [model.time]
            period = 0.25
            integrator = "rk4"
            substeps = 4
            [model.task]
            kind = "avoid"
            between = 3
            constraint = "1.2 - abs(angle)"
            [policy]
            formula = { torque = "-0.5 * rate" }
        "#;
        let place = std::path::Path::new(".");
        crate::model::text::read(text, "pendulum.toml", place).unwrap().plant().unwrap()
    }

    #[test]
    fn points_have_the_bits_of_one_at_a_time_and_count_at_the_sample_after_them() {
        let (plant, spec) = (pendulum(), RolloutSpec::new(8, 0.95).unwrap());
        let losses: Vec<f32> = (0..9).map(|t| 0.01 * t as f32).collect();
        let tightening = Tightening::losing(losses.clone(), losses);
        let pairs = [[vec![0.6, 0.2], vec![0.65, 0.2]], [vec![-0.2, 2.7], vec![-0.2, 2.8]]];
        let control = PairControl::ClosedLoop;
        let group = PairGroup::new(&plant, &pairs, spec.horizon, control);
        let measures = group.measures(&plant.model, &spec, &tightening);
        let mut inside = 0;
        for (i, pair) in pairs.iter().enumerate() {
            let both = [&*pair[0], &*pair[1]];
            let (nominal, perturbed) = pair_measures(&plant, both, &spec, &tightening, control);
            assert_eq!(measures[i], [nominal, perturbed], "pair {i}");
            let [x, y] = both.map(|start| looks::<f64>(&plant, start, spec.horizon));
            let apart = |look: usize| {
                let squares = x[look].iter().zip(&y[look]).map(|(a, b)| (a - b).powi(2));
                squares.sum::<f64>().sqrt()
            };
            let found = group.distances(i);
            assert_eq!((found.len(), found[0]), (9, apart(0)));
            for (t, found) in found.iter().enumerate().skip(1) {
                let most = (4 * t - 3..=4 * t).map(apart).fold(0.0, f64::max);
                assert_eq!(*found, most, "pair {i}, step {t}");
                inside += u64::from(most > apart(4 * t));
            }
            assert_eq!(group.states(i, 31), [x[31].clone(), y[31].clone()]);
        }
        assert!(inside > 3, "{inside}");
        // The first pair stays away from the limit, the second one crosses it inside a period.
        assert_eq!(group.open_looks(&plant.model)[0], 33);
        let open = group.open_looks(&plant.model)[1];
        assert!(open < 33 && !open.is_multiple_of(4), "{open}");
    }

    #[test]
    fn a_state_that_is_not_finite_fails_its_pair_alone() {
        let plant = Plant::under(&std::sync::Arc::new(Model::of(DroneRace::default())), network());
        let spec = RolloutSpec::new(3, 0.95).unwrap();
        let mut far = vec![0.0; 12];
        far[1] = f32::INFINITY;
        let pairs = [[vec![0.0; 12], vec![0.0; 12]], [vec![0.0; 12], far]];
        let group = PairGroup::new(&plant, &pairs, 3, PairControl::Replay);
        assert!(group.distances(0).iter().all(|distance| *distance == 0.0));
        assert_eq!(group.distances(1)[0], f64::INFINITY);
        let measures = group.measures(&plant.model, &spec, &Tightening::none(&spec));
        assert_eq!(measures[1][1], f64::from(crate::rollout::NON_FINITE));
        assert_ne!(measures[0][1], measures[1][1]);
    }
}
