//! Whether the names and widths of layers leave one order in which they are applied, or several.

use super::dense::Dense;
use super::names::{is_head, numbered, split};

/// Keys that a first layer goes by.
const FIRST: [&str; 6] = ["in", "input", "input_layer", "fc_in", "linear_in", "first"];
/// Most steps of the search: a file whose layers take more of them is in doubt.
const MOST_STEPS: usize = 100_000;
/// Orders that are told apart from one.
const SEVERAL: usize = 2;

/// Refuses layers that go together in another order as well as in theirs.
///
/// # Errors
/// A sentence with two orders, and the remedy.
pub(super) fn check(layers: &[Dense<'_>]) -> Result<(), String> {
    let search = Search::of(layers);
    match search.found.as_slice() {
        _ if search.steps >= MOST_STEPS => Err(format!(
            "the names of {} layers do not say in which order they are applied; --network names them in theirs",
            layers.len()
        )),
        [only] if only.iter().copied().eq(0..layers.len()) => Ok(()),
        [one, ..] => Err(format!(
            "the names of the layers do not say in which order they are applied, and their widths fit in another one \
             than the file's: {}; --network names them in their order, as in --network {}",
            listed(layers, one),
            listed(layers, &(0..layers.len()).collect::<Vec<_>>())
        )),
        [] => Ok(()),
    }
}

/// What to do where layers do not follow on one another in the order that they have.
pub(super) fn remedy(layers: &[Dense<'_>]) -> String {
    match Search::of(layers).found.as_slice() {
        [only] => format!(
            "; the layers follow on one another in this order: --network {}",
            listed(layers, only)
        ),
        [] => "; they follow on one another in no order: they are more than one network, or have something else \
               between them. --network names the layers of one in their order, and an ONNX export keeps what lies between \
               them"
            .to_owned(),
        [one, ..] => format!(
            "; several orders fit, --network {} among them: --network names the layers in theirs",
            listed(layers, one)
        ),
    }
}

/// Names of the layers in this order.
fn listed(layers: &[Dense<'_>], order: &[usize]) -> String {
    order.iter().map(|&i| layers[i].name).collect::<Vec<_>>().join(",")
}

/// A search for the first orders that widths and names allow, those that differ from the file's before it.
struct Search<'s, 'a> {
    layers: &'s [Dense<'a>],
    placed: Vec<usize>,
    found: Vec<Vec<usize>>,
    steps: usize,
}

impl<'s, 'a> Search<'s, 'a> {
    /// The search among `layers`, at its end.
    fn of(layers: &'s [Dense<'a>]) -> Self {
        let mut search = Self { layers, placed: Vec::new(), found: Vec::new(), steps: 0 };
        search.go();
        search
    }

    /// Adds the orders that begin with the layers placed. The last layers of a file are tried first, so that its own
    /// order is the last one found.
    fn go(&mut self) {
        self.steps += 1;
        if self.placed.len() == self.layers.len() {
            self.found.push(self.placed.clone());
            return;
        }
        for next in (0..self.layers.len()).rev() {
            if self.found.len() < SEVERAL && self.steps < MOST_STEPS && self.may_follow(next) {
                self.placed.push(next);
                self.go();
                self.placed.pop();
            }
        }
    }

    /// Whether layer `next` takes what the last one placed gives, and none has to come before it.
    fn may_follow(&self, next: usize) -> bool {
        let layer = &self.layers[next];
        let gives = self.placed.last().map(|&last| self.layers[last].outputs());
        let is_placed = |i: usize| self.placed.contains(&i);
        let mut others = (0..self.layers.len()).filter(|&i| i != next && !is_placed(i));
        !is_placed(next)
            && gives.is_none_or(|gives| gives == layer.inputs())
            && !others.any(|other| comes_before(&self.layers[other], layer))
    }
}

/// Whether the names say that `one` comes before `other`: by their numbers, or as a first or a last layer.
fn comes_before(one: &Dense<'_>, other: &Dense<'_>) -> bool {
    let is_first = |layer: &Dense<'_>| FIRST.contains(&split(layer.name).1);
    let counted = match (numbered(one.name), numbered(other.name)) {
        (Some((stem, i)), Some((same, j))) => stem == same && i < j,
        _ => false,
    };
    let ends = is_head(other.name) && !is_head(one.name);
    counted || ends || (is_first(one) && !is_first(other))
}
