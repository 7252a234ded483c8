//! Floating-point operations of the workloads, counted from their shapes and recorded formulas.
//!
//! A sum, difference, product, quotient, root, sign, absolute value, floor or comparison with its choice
//! is one operation, so a multiply-add is two. Not counted: integer work, such as the generator's,
//! and the activations of networks.

use crate::formula::{Graph, Node, record};
use crate::model::{Controller, Law, Model, Plant};
use crate::policy::Mlp;
use crate::real::Real;
use crate::rollout::{Planning, normal_pair};

/// Of a state's part in the fold: what both margins lose, then two products with the discount and
/// the discount's own, two minima and a maximum.
const FOLD: f64 = 8.0;
/// Of the uniforms of a pair of normal numbers: two mantissas less 1, and 1 less one of them.
const UNIFORMS: f64 = 3.0;
/// Of a sample's part in the softmin but for exponential and controls: excess, scale, minimum, and
/// the sums of weights, squares and costs.
const WEIGHT: f64 = 7.0;

/// Of a recorded formula and the networks that it calls, its functions as polynomials; a clip or a sign
/// is two comparisons.
pub fn formula(graph: &Graph) -> f64 {
    let operations = |node: &Node| match node {
        Node::Input(_) | Node::Literal(_) | Node::Said(..) => 0.0,
        Node::Clamp(..) | Node::Sign(_) => 2.0,
        _ => 1.0,
    };
    let calls: f64 = graph.calls.iter().map(|call| network(&call.network)).sum();
    graph.expanded().nodes.iter().map(operations).sum::<f64>() + calls
}

/// Of a network's layers: two for each weight.
pub fn network(network: &Mlp) -> f64 {
    network.layers().iter().map(|layer| 2.0 * layer.weight.len() as f64).sum()
}

/// Of a controller at one state.
pub fn control(controller: &Controller) -> f64 {
    match &controller.law {
        Law::Formula(graph) => formula(graph),
        Law::Network { observe, network: layers, act } => {
            let beside = [observe, act].into_iter().flatten().map(formula);
            network(layers) + beside.sum::<f64>()
        }
    }
}

/// Of both margins of a state and its part in the measure.
pub fn scored(model: &Model) -> f64 {
    formula(&Graph::joined(&[&model.target, &model.constraint])) + FOLD
}

/// Of the measure of a rollout of `steps` steps, which may be a mean.
pub fn rollout(plant: &Plant, steps: f64) -> f64 {
    let Plant { model, controller } = plant;
    let looks = steps * f64::from(model.points);
    steps * control(controller) + looks * formula(&model.step) + (looks + 1.0) * scored(model)
}

/// Of a pair whose perturbed rollout takes the controls of the nominal one; drawing it apart.
pub fn replayed_pair(plant: &Plant, steps: f64) -> f64 {
    let model = &plant.model;
    // Per state a difference, a square and a sum; then the root.
    let distance = 3.0 * model.states.len() as f64 + 1.0;
    let looks = steps * f64::from(model.points);
    let perturbed = looks * formula(&model.step) + (looks + 1.0) * scored(model);
    rollout(plant, steps) + perturbed + (looks + 1.0) * distance
}

/// Of an MPPI sample without networks, its noise independent over steps and controls, and of its part
/// in the new plan.
pub fn sample(planning: &Planning) -> f64 {
    let Planning { model, cost, spec, .. } = &planning.sampled();
    let horizon = spec.horizon();
    let stage = record(cost.stage.inputs, |inputs| {
        let own = &inputs[..model.inputs()];
        let mut outputs = model.step.recorded_at(own);
        outputs.extend(cost.stage.recorded_at(inputs));
        outputs.extend(cost.map.iter().flat_map(|map| map.cell.recorded_at(own)));
        outputs
    });
    let normals = record(2, |uniforms| normal_pair(uniforms[0], uniforms[1]).to_vec());
    let exponential = record(1, |x| vec![x[0].exp_negative()]);
    let controls = (spec.controls() * horizon) as f64;
    // Normals come in blocks of four, two pairs.
    let pairs = 2.0 * (controls / 4.0).ceil();
    let noise = pairs * (UNIFORMS + formula(&normals));
    // Each control: scaled, added to the plan, clipped at both ends; weighted and summed.
    let shaped = 6.0 * controls;
    let costs = horizon as f64 * (formula(&stage) + 1.0);
    noise + shaped + costs + formula(&exponential) + WEIGHT
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::{Activation, Layer};
    use crate::race::system::DroneRace;
    use crate::system::{BangBang, DoubleIntegrator};

    /// The step of the race by hand: six positions of 2; three velocities of the ego of 4 (clip
    /// twice, scale, add); two of the opponent of 4, and one of 3; five products that make factors
    /// of the two parameters.
    #[test]
    fn steps_of_the_race() {
        let model = Model::of(DroneRace::default());
        assert_eq!(formula(&model.step), 6.0 * 2.0 + 3.0 * 4.0 + 2.0 * 4.0 + 3.0 + 5.0);
    }

    /// Its margins by hand. Target: 2 differences, 1 minimum; twice a sum, a difference, a
    /// minimum; 2 minima and the factor. Constraint: a difference (the other one is the target's)
    /// and the length (2 products, a sum, a root), the cone (difference, maximum, sum, product)
    /// taken off; the fences' room, four sums and three minima; a minimum and the factor.
    #[test]
    fn margins_of_the_race() {
        let target = 3.0 + 6.0 + 3.0;
        let constraint = 5.0 + 5.0 + 8.0 + 2.0;
        assert_eq!(scored(&Model::of(DroneRace::default())), target + constraint + FOLD);
    }

    #[test]
    fn a_network_counts_two_per_weight() {
        let layer = |inputs: usize, outputs: usize| {
            Layer::dense(vec![0.5; inputs * outputs], vec![0.0; outputs])
        };
        let layers = vec![layer(12, 64), layer(64, 64), layer(64, 64), layer(64, 3)];
        let mlp = Mlp::new(layers, Activation::Relu, Activation::Tanh).unwrap();
        assert_eq!(network(&mlp), 2.0 * (768.0 + 4096.0 + 4096.0 + 192.0));
        let plant = &Plant::of(DroneRace::default(), mlp);
        assert_eq!(rollout(plant, 30.0), 30.0 * (18_304.0 + 40.0) + 31.0 * 40.0);
        let pair = replayed_pair(plant, 30.0) - rollout(plant, 30.0);
        assert_eq!(pair, 30.0 * 40.0 + 31.0 * (40.0 + 37.0));
    }

    #[test]
    fn a_formula_policy_counts_its_operations() {
        // A comparison with its choice between two literals.
        let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
        assert_eq!(control(&plant.controller), 1.0);
        assert!(formula(&plant.model.step) > 0.0);
    }
}
