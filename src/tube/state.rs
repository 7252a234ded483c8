//! The set of states at one step: a form for each coordinate, with few symbols.

use super::affine::{Affine, Symbols, upward};

/// Symbols kept beside one for each coordinate, per coordinate.
const KEPT: usize = 4;
/// Symbols kept at least.
const FEWEST: usize = 16;
/// The same of a single trajectory, whose symbols stand for roundings: as many as coordinates.
const KEPT_OF_ONE: usize = 1;

/// All states that trajectories may be in at a step.
#[derive(Clone, Debug)]
pub(super) struct Set {
    /// A form per coordinate.
    pub(super) forms: Vec<Affine>,
    /// The symbols that these are made of.
    pub(super) symbols: Symbols,
}

impl Set {
    /// The Euclidean ball of `radius` around `center`, finite.
    pub(super) fn ball(center: &[f64], radius: f64) -> Self {
        let form = |(i, x): (usize, &f64)| {
            let mut ball = vec![0.0; if radius > 0.0 { i + 1 } else { 0 }];
            ball.iter_mut().skip(i).for_each(|side| *side = radius);
            Affine::new(*x, ball, Vec::new(), 0.0)
        };
        Self { forms: center.iter().enumerate().map(form).collect(), symbols: Symbols::default() }
    }

    /// The set of `forms` with its symbols reduced to a fixed number, none of its states left out.
    ///
    /// The symbols that reach farthest along more than one coordinate stay. The others, and what each
    /// form leaves open by itself, become one symbol per coordinate: a box around them.
    pub(super) fn reduced(mut forms: Vec<Affine>) -> Self {
        let alone = forms.iter().all(|form| form.ball.is_empty());
        let most = if alone { KEPT_OF_ONE * forms.len() } else { (KEPT * forms.len()).max(FEWEST) };
        let kept = kept(&forms, most);
        let count = kept.len();
        for (i, form) in forms.iter_mut().enumerate() {
            if !form.known() {
                continue;
            }
            let (mut spread, mut open, mut added) = (vec![0.0; count], form.rest, 1);
            for (symbol, size) in form.spread.iter().enumerate() {
                match kept.binary_search(&symbol) {
                    Ok(place) => spread[place] = *size,
                    Err(_) => (open, added) = (open + size.abs(), added + 1),
                }
            }
            spread.resize(count + i, 0.0);
            spread.push(upward(open, added));
            let range = form.range;
            let ball = std::mem::take(&mut form.ball);
            *form = Affine::new(form.center, ball, spread, 0.0).ranged(range);
        }
        let symbols = Symbols::after(count + forms.len());
        Self { forms, symbols }
    }

    /// Whether something is known of every coordinate.
    pub(super) fn known(&self) -> bool {
        self.forms.iter().all(Affine::known)
    }
}

/// The `most` symbols that a box around would lose most by, ascending.
fn kept(forms: &[Affine], most: usize) -> Vec<usize> {
    let symbols = forms.iter().map(|form| form.spread.len()).max().unwrap_or(0);
    let loss = |symbol: usize| {
        let sizes = forms.iter().filter_map(|form| form.spread.get(symbol)).map(|x| x.abs());
        let (sum, largest) =
            sizes.fold((0.0, 0.0), |(sum, largest): (f64, f64), x| (sum + x, largest.max(x)));
        sum - largest
    };
    let mut losses: Vec<(f64, usize)> =
        (0..symbols).map(|symbol| (loss(symbol), symbol)).filter(|(loss, _)| *loss > 0.0).collect();
    losses.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    losses.truncate(most);
    let mut kept: Vec<usize> = losses.into_iter().map(|(_, symbol)| symbol).collect();
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every support of the set is at least what it was, in many directions.
    #[test]
    fn reduction_leaves_no_state_out() {
        let mut random = 0.21_f64;
        let mut next = || {
            random = (random * 997.0 + 0.123).fract();
            2.0 * random - 1.0
        };
        let mut form = || Affine::new(next(), vec![next()], (0..60).map(|_| next()).collect(), 0.1);
        let forms: Vec<Affine> = (0..3).map(|_| form()).collect();
        let set = Set::reduced(forms.clone());
        assert!(set.forms.iter().all(|form| form.spread.len() <= FEWEST + 3 && form.rest == 0.0));
        for _ in 0..500 {
            let direction: Vec<f64> = (0..3).map(|_| next()).collect();
            let support = |forms: &[Affine]| {
                let terms: Vec<_> = direction.iter().copied().zip(forms).collect();
                Affine::combination(&terms, 0.0).radius()
            };
            assert!(support(&set.forms) >= support(&forms) * (1.0 - 1e-14));
        }
    }
}
