//! Where a state stands in a plane: its entries as places, their names and units.

use super::text::ordinary;
use crate::system::Axis;

/// Entry `index` of a state, if it is a number.
pub(super) fn entry(state: &[f32], index: usize) -> Option<f64> {
    let value = state.get(index).map(|&value| f64::from(value))?;
    ordinary(value).then_some(value)
}

/// Two entries of a state, if both are numbers.
pub(super) fn point(state: &[f32], [x, y]: [usize; 2]) -> Option<[f64; 2]> {
    Some([entry(state, x)?, entry(state, y)?])
}

/// Whether two states have the same unit, so that one scale fits both.
pub(super) fn same_unit(states: &[Axis], [x, y]: [usize; 2]) -> bool {
    let unit = |state: usize| states.get(state).map(|axis| axis.unit.as_str());
    unit(x).is_some() && unit(x) == unit(y)
}

/// Name and unit of a state, as `ego_x (m)`.
pub(super) fn titled(states: &[Axis], state: usize) -> String {
    let of = |axis: &Axis| with_unit(&axis.name, &axis.unit);
    states.get(state).map_or_else(|| format!("state {state}"), of)
}

/// A name with its unit, if it has one.
pub(super) fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") }
}

/// The unit of a formula that adds and subtracts states of one unit; of any other nothing is known.
pub(super) fn unit_of<'a>(states: &'a [Axis], formula: &str) -> Option<&'a str> {
    if formula.contains(['*', '/', '^', '(']) {
        return None;
    }
    let part = |letter: char| !(letter.is_alphanumeric() || letter == '_');
    let words = formula.split(part);
    let mut units = words.filter_map(|word| states.iter().find(|axis| axis.name == word));
    let first = units.next()?.unit.as_str();
    (!first.is_empty() && units.all(|axis| axis.unit == first)).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::unit_of;
    use crate::system::Axis;

    #[test]
    fn a_formula_has_the_unit_that_its_states_share() {
        let axis = |name: &str, unit: &str| Axis {
            name: name.to_owned(),
            unit: unit.to_owned(),
            low: 0.0,
            high: 1.0,
        };
        let states = [axis("x", "m"), axis("gap_2", "m"), axis("angle", "rad"), axis("n", "")];
        assert_eq!(unit_of(&states, "-gap_2"), Some("m"));
        assert_eq!(unit_of(&states, "x - gap_2 + 0.5"), Some("m"));
        for formula in ["x + length * sin(angle)", "sin(angle)", "x * gap_2", "x + angle"] {
            assert_eq!(unit_of(&states, formula), None);
        }
        assert_eq!(unit_of(&states, "gap"), None);
        assert_eq!(unit_of(&states, "0"), None);
        assert_eq!(unit_of(&states, "n"), None);
    }
}
