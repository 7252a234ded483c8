//! A network as a list of steps in f64, and the one place where it becomes a policy.

use super::front::{self, Moved, clip, cut};
use super::linear::Linear;
use super::map::Map;
use crate::policy::{Activation, Layer, Mlp, Norm, Rescale};

/// Layers of a network whose weights are not counted: layers may share their numbers, memory does not.
pub(super) const MOST_LAYERS: usize = 64;
/// Most weights of a network of more layers, and of layers that are made for an operation alone.
const MOST_WEIGHTS: usize = 1 << 24;
/// Most weights that are written for all operations together.
const MOST_WRITTEN: usize = 1 << 32;
/// Binary digits of a summand that are kept of what is left of it around a center: what f64 rounds is far below.
const KEPT: i32 = 40;
/// Most numbers between two layers that a layer of its own is made for.
const WIDEST: usize = 4096;

/// A step from the input to the output.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Step {
    /// A linear layer.
    Linear(Linear),
    /// A map of each number.
    Map(Map),
    /// Normalised to mean 0 and deviation 1, then a map.
    Norm { scale: Vec<f64>, shift: Vec<f64>, epsilon: f32 },
    /// An activation.
    Activation(Activation),
}

impl Step {
    /// Leaves these of its numbers, in this order; it is none that takes them together.
    fn select(&mut self, rows: &[usize]) {
        match self {
            Self::Linear(linear) => *linear = linear.selected(rows),
            Self::Map(map) => *map = map.selected(rows),
            Self::Norm { .. } | Self::Activation(_) => {}
        }
    }
}

/// A network on the way to a policy.
#[derive(Debug, Default)]
pub(super) struct Draft {
    /// Numbers that it takes, if there is no layer before one has to know.
    inputs: Option<usize>,
    /// The steps; linear ones in a row are one.
    steps: Vec<Step>,
    /// Whether they are a policy's own, and stay as many.
    as_is: bool,
    /// The activation of the hidden layers of a policy that has none.
    hidden: Option<Activation>,
    /// Weights that were written so far.
    written: usize,
}

/// A layer in f64 with what follows it.
struct Stage {
    linear: Linear,
    norm: Option<Norm>,
    activation: Activation,
    /// Whether it is there for an operation that no layer comes before.
    is_made: bool,
}

impl Draft {
    /// A network of `inputs` numbers, where that is known before its layers are.
    pub(super) fn of(inputs: Option<usize>) -> Self {
        Self { inputs, ..Self::default() }
    }

    /// The same of a policy that was written out, whose layers and maps stay what they are.
    pub(super) fn as_is(inputs: Option<usize>, hidden: Option<Activation>) -> Self {
        Self { as_is: true, hidden, ..Self::of(inputs) }
    }

    /// Adds a step at the end.
    ///
    /// # Errors
    /// A sentence about widths that do not fit.
    pub(super) fn push(&mut self, step: Step) -> Result<(), String> {
        self.fits(&step)?;
        let step = self.at_front(step);
        if let (Some(Step::Activation(last)), Step::Map(map)) = (self.steps.last_mut(), &step)
            && let Some(both) = front::cut_again(*last, map).filter(|_| !self.as_is)
        {
            *last = both;
            return Ok(());
        }
        let first = self.steps.len() == 1;
        let step = match self.moved(step)? {
            Some(step) => step,
            None => return Ok(()),
        };
        match (self.steps.last_mut(), step) {
            (_, Step::Map(map)) if map.is_identity() => {}
            (_, Step::Activation(Activation::Identity)) => {}
            (Some(Step::Map(last)), Step::Map(map)) => *last = last.then(&map),
            (_, step) if self.as_is => self.steps.push(step),
            (Some(Step::Linear(last)), Step::Linear(next)) => {
                let count = last.outputs() / 16 * next.weight.len();
                *last = last.then(&next)?;
                self.write(count)?;
            }
            (Some(Step::Linear(last)), Step::Map(map)) if map.is_affine() => last.scaled(&map)?,
            // A map before the first layer is the policy's own, unless nothing is rounded.
            (Some(Step::Map(map)), Step::Linear(mut next))
                if map.is_affine() && (!first || next.is_exact_after(map)) =>
            {
                next.after(map)?;
                self.steps.pop();
                return self.push(Step::Linear(next));
            }
            (_, step) => self.steps.push(step),
        }
        match self.steps.len() > 4 * MOST_LAYERS && self.weights() > MOST_WEIGHTS {
            true => Err(format!(
                "more than {MOST_LAYERS} layers with more than {MOST_WEIGHTS} weights together"
            )),
            false => Ok(()),
        }
    }

    /// The first linear step, if nothing but a map of the inputs came before it, and it only chooses some of them and
    /// maps each.
    fn choice(&self) -> Option<&Linear> {
        match self.steps.as_slice() {
            [Step::Linear(last)] | [Step::Map(_), Step::Linear(last)] => {
                Some(last).filter(|last| !self.as_is && last.is_choice())
            }
            _ => None,
        }
    }

    /// The step, and one before it whose width is known only now, as maps where they cut off numbers that no layer
    /// has taken: behind a layer of its own, a map of numbers far from 0 would lose their digits.
    fn at_front(&mut self, step: Step) -> Step {
        let Some(width) = self.width().filter(|_| !self.as_is) else { return step };
        if let [Step::Activation(activation)] = self.steps.as_slice()
            && let Some(map) = cut(*activation, width)
        {
            self.steps[0] = Step::Map(map);
        }
        let Step::Activation(activation) = step else { return step };
        let Some(map) = cut(activation, width) else { return step };
        let is_front = match self.choice() {
            Some(choice) => Moved::of(choice, &map).rest.is_none(),
            None => matches!(self.steps.as_slice(), [] | [Step::Map(_)]),
        };
        if is_front { Step::Map(map) } else { step }
    }

    /// Puts what a choice of the inputs does, with a map behind it, in front of it where numbers are far from 0,
    /// which keep their digits there; what is left of the step.
    fn moved(&mut self, step: Step) -> Result<Option<Step>, String> {
        let width = self.width().unwrap_or_default();
        let (map, next) = match step {
            Step::Map(map) => (map, None),
            Step::Linear(_) => (Map::nothing(width), Some(step)),
            step => return Ok(Some(step)),
        };
        let moved = self.choice().map(|choice| Moved::of(choice, &map));
        self.write(moved.as_ref().map_or(0, |moved| moved.choice.weight.len()))?;
        // Limits of each number by itself lie at the inputs or nowhere.
        let moves = |moved: &Moved| moved.is_far || !map.is_affine();
        let Some(Moved { front, choice, rest, .. }) = moved.filter(moves) else {
            return Ok(Some(next.unwrap_or(Step::Map(map))));
        };
        self.steps.pop();
        self.push(Step::Map(front))?;
        self.steps.push(Step::Linear(choice));
        self.steps.extend(rest.map(Step::Map));
        Ok(next)
    }

    /// Counts weights that are written, and refuses what writes them again and again, as a small file may ask for.
    fn write(&mut self, weights: usize) -> Result<(), String> {
        self.written = self.written.saturating_add(weights);
        match self.written > MOST_WRITTEN {
            true => Err(format!("operations that write more than {MOST_WRITTEN} weights")),
            false => Ok(()),
        }
    }

    /// Numbers of all steps.
    fn weights(&self) -> usize {
        let of = |step: &Step| match step {
            Step::Linear(linear) => linear.weight.len(),
            Step::Map(map) => 4 * map.width(),
            Step::Norm { scale, .. } => 2 * scale.len(),
            Step::Activation(_) => 0,
        };
        self.steps.iter().map(of).sum()
    }

    /// Numbers that come out of the last step, where that is known.
    pub(super) fn width(&self) -> Option<usize> {
        let of = |step: &Step| match step {
            Step::Linear(linear) => Some(linear.outputs()),
            Step::Map(map) => Some(map.width()),
            Step::Norm { scale, .. } => Some(scale.len()),
            Step::Activation(_) => None,
        };
        self.steps.iter().rev().find_map(of).or(self.inputs)
    }

    /// Leaves these of the numbers that come out, in this order.
    ///
    /// # Errors
    /// A sentence about numbers that there are not.
    pub(super) fn select(&mut self, rows: &[usize]) -> Result<(), String> {
        let width = self.width().ok_or("a part of an input of unknown width")?;
        if let Some(row) = rows.iter().find(|row| **row >= width) {
            return Err(format!("number {row} (from 0) of {width}"));
        }
        if rows.iter().copied().eq(0..width) {
            return Ok(());
        }
        self.write(rows.len() * width)?;
        let layer = self.steps.iter().rposition(|step| matches!(step, Step::Linear(_)));
        let each = |step: &Step| matches!(step, Step::Map(_) | Step::Activation(_));
        match layer.filter(|&layer| self.steps[layer + 1..].iter().all(each)) {
            Some(layer) => self.steps[layer..].iter_mut().for_each(|step| step.select(rows)),
            // The layer that comes next takes it in.
            None => return self.push(Step::Linear(Linear::selection(rows, width))),
        }
        Ok(())
    }

    /// Refuses a step of another width than what comes before it.
    fn fits(&mut self, step: &Step) -> Result<(), String> {
        let takes = match step {
            Step::Linear(linear) => linear.inputs,
            Step::Map(map) => map.width(),
            Step::Norm { scale, .. } => scale.len(),
            Step::Activation(_) => return Ok(()),
        };
        match self.width() {
            Some(have) if have != takes => {
                Err(format!("{have} numbers where the next operation takes {takes}"))
            }
            _ => {
                self.inputs.get_or_insert(takes);
                Ok(())
            }
        }
    }

    /// Makes a clip behind the last activation a map of the output: it needs no layer of its own.
    fn end_clip(&mut self) {
        let clip = match self.steps.as_slice() {
            [.., Step::Activation(_), Step::Activation(last)] if *last != Activation::Relu => *last,
            _ => return,
        };
        if let Some(map) = self.width().and_then(|width| cut(clip, width)) {
            self.steps.pop();
            self.steps.push(Step::Map(map));
        }
    }

    /// The policy.
    ///
    /// # Errors
    /// A sentence about what no policy file can say.
    pub(super) fn network(mut self) -> Result<Mlp, String> {
        self.end_clip();
        let input = match self.steps.first() {
            Some(Step::Map(_)) if self.steps.len() > 1 => Some(self.steps.remove(0)),
            _ => None,
        };
        let output = match self.steps.last() {
            Some(Step::Map(_)) if self.steps.len() > 1 => self.steps.pop(),
            _ => None,
        };
        let mut stages: Vec<Stage> = Vec::new();
        for step in std::mem::take(&mut self.steps) {
            stage(&mut stages, step, self.inputs)?;
        }
        if stages.is_empty() {
            return Err("no layer between input and output".to_owned());
        }
        let weights = stages[0].linear.steepest();
        let layers: Vec<Layer> = stages.into_iter().map(layer).collect();
        let mut network = match (layers.as_slice(), self.hidden) {
            ([only], Some(hidden)) => Mlp::new(vec![only.clone()], hidden, only.activation),
            _ => Mlp::from_layers(layers),
        };
        for (at_input, map) in [(true, input), (false, output)] {
            if let Some(Step::Map(map)) = map {
                let map = if at_input { centered(&map, &weights) } else { rescale(&map) };
                network = network.and_then(|network| match at_input {
                    true => network.with_input(map),
                    false => network.with_output(map),
                });
            }
        }
        network.map_err(|error| error.to_string())
    }
}

/// Adds a step to the layers so far.
fn stage(stages: &mut Vec<Stage>, step: Step, inputs: Option<usize>) -> Result<(), String> {
    match step {
        Step::Linear(linear) => {
            let activation = Activation::Identity;
            stages.push(Stage { linear, norm: None, activation, is_made: false });
        }
        Step::Norm { scale, shift, epsilon } => {
            let narrow = |values: Vec<f64>| values.into_iter().map(|value| value as f32).collect();
            let stage = open(stages, inputs, |stage| stage.norm.is_none())?;
            stage.norm = Some(Norm { scale: narrow(scale), shift: narrow(shift), epsilon });
        }
        Step::Activation(activation) => open(stages, inputs, |_| true)?.activation = activation,
        Step::Map(map) => {
            let (affine, limits) = map.parts();
            let limits =
                limits.ok_or("limits between layers that are not the same for all neurons")?;
            let stage = open(stages, Some(map.width()), |stage| stage.norm.is_none())?;
            stage.linear.scaled(&affine)?;
            stage.activation = clip(limits)?;
        }
    }
    Ok(())
}

/// The last layer if nothing closes it, or a new one that changes nothing.
fn open(
    stages: &mut Vec<Stage>,
    inputs: Option<usize>,
    is_open: fn(&Stage) -> bool,
) -> Result<&mut Stage, String> {
    let last = stages.last();
    let takes_more =
        last.is_some_and(|last| last.activation == Activation::Identity && is_open(last));
    if !takes_more {
        let width = last.map(|last| last.linear.outputs()).or(inputs);
        let width = width.filter(|width| *width <= WIDEST);
        let width = width.ok_or(
            "an operation before the first layer, of which nobody says how many numbers it takes",
        )?;
        let made = stages.iter().filter(|stage| stage.is_made);
        let made: usize = made.map(|stage| stage.linear.weight.len()).sum();
        if made + width * width > MOST_WEIGHTS {
            return Err(format!(
                "operations between layers that need layers of more than {MOST_WEIGHTS} weights"
            ));
        }
        let linear = Linear::diagonal(&Map::nothing(width))?;
        let activation = Activation::Identity;
        stages.push(Stage { linear, norm: None, activation, is_made: true });
    }
    stages.last_mut().ok_or_else(|| "no layer".to_owned())
}

/// The layer in f32, each number rounded once.
fn layer(stage: Stage) -> Layer {
    let Stage { linear: Linear { weight, bias, .. }, norm, activation, .. } = stage;
    let narrow = |values: Vec<f64>| values.into_iter().map(|value| value as f32).collect();
    Layer { norm, activation, ..Layer::dense(narrow(weight), narrow(bias)) }
}

/// The map in f32.
fn rescale(map: &Map) -> Rescale {
    // Nothing added is 0, whatever its sign was on the way.
    let narrow = |values: &[f64]| values.iter().map(|&value| value as f32 + 0.0).collect();
    let Map { scale, shift, low, high } = map;
    let affine = Rescale::affine(narrow(scale), narrow(shift));
    let mut found = Rescale { low: narrow(low), high: narrow(high), ..affine };
    for i in 0..found.scale.len() {
        // Limits without room between them leave one number.
        if found.low[i] == found.high[i] {
            (found.scale[i], found.shift[i]) = (0.0, found.low[i]);
            (found.low[i], found.high[i]) = (f32::NEG_INFINITY, f32::INFINITY);
        }
    }
    found
}

/// The map of inputs in f32: where products and summands far above 1 nearly cancel, as those of observations far from 0
/// do, or the largest of the `weights` behind them makes much of the rest, the difference from the nearest f32 number
/// comes first, and what is left is added then.
fn centered(map: &Map, weights: &[f64]) -> Rescale {
    let mut plain = rescale(map);
    for (i, (&scale, &shift)) in map.scale.iter().zip(&map.shift).enumerate() {
        let center = (-shift / scale) as f32;
        let is_far = shift.abs() > front::FAR || shift.abs() * weights[i] > front::STEEP;
        if is_far && plain.scale[i] != 0.0 && center.is_finite() {
            // A multiple of it comes out again where the map is written, read and put together anew.
            let unit = 2_f64.powi(shift.abs().log2().floor() as i32 - KEPT);
            let rest = ((scale * f64::from(center) + shift) / unit).round() * unit;
            (plain.center[i], plain.shift[i]) = (center, rest as f32);
        }
    }
    plain
}
