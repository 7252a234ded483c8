//! Where the search for a boundary of the certified set ended at the end of what it looks at.

use super::record::GrowthRecord;
use super::settings::{BoundarySearch, Settings};
use crate::model::Model;

/// Share of a side within which a point lies at its end: the search halves a bracket twenty times.
const AT_END: f32 = 1e-4;

/// That the centre of the ball lies at a side of the box, or on the rim of the slice, where the search
/// ends whatever the set does.
pub(super) fn statement(
    model: &Model,
    settings: &Settings,
    growth: &GrowthRecord,
) -> Option<String> {
    let center = growth.center.as_ref()?;
    let ends = |state: usize, low: f32, high: f32| {
        let x = *center.get(state)?;
        let near = |end: f32| (x - end).abs() <= AT_END * (high - low);
        let end = [low, high].into_iter().find(|end| near(*end))?;
        (high > low).then_some(end)
    };
    let found = match growth.boundary {
        BoundarySearch::Rays => {
            (0..settings.low.len()).filter(|state| settings.growth.varies[*state]).find_map(
                |state| Some((state, ends(state, settings.low[state], settings.high[state])?)),
            )
        }
        BoundarySearch::Slice => settings.slice.iter().flatten().find_map(|axis| {
            let (first, last) = (axis.values.first()?, axis.values.last()?);
            Some((axis.state, ends(axis.state, *first, *last)?))
        }),
    };
    let (state, end) = found?;
    let (name, place) = (&model.states[state].name, place(growth.boundary));
    Some(format!(
        "The centre of local growth lies at the end of {place} ({name} = {end}), which the search takes \
         for the boundary of the certified set; the set may go on beyond it."
    ))
}

/// What the search looks at.
fn place(boundary: BoundarySearch) -> &'static str {
    match boundary {
        BoundarySearch::Rays => "the box",
        BoundarySearch::Slice => "the slice",
    }
}
