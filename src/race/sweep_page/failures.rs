//! How races were lost along the first axis: a stacked bar per point.

use super::grid::Grid;
use super::lines::Layout;
use super::readings::{judged, race};
use crate::race::page::losses::{self, Row};
use crate::report::figure::Figure;
use crate::report::sheet::panels;

/// Most bars of a panel that stay readable.
const BARS: usize = 12;

/// The figure, where its bars stay readable; the table has every count.
pub(super) fn figure(grid: &Grid<'_>) -> Option<Figure> {
    let layout = Layout::new(grid, 2);
    if layout.length() > BARS {
        return None;
    }
    let drawn = layout.line_places().into_iter().filter_map(|line| panel(&layout, line));
    let drawn: Vec<_> = drawn.collect();
    Some(Figure {
        id: "figure-failures",
        title: "How the others were lost".to_owned(),
        drawing: match drawn.is_empty() {
            true => Err("No point was judged.".to_owned()),
            false => Ok(panels(&drawn)),
        },
        legend: losses::legend(),
        caption: format!(
            "Shares of all races of a point, over all noise seeds; the empty rest was won. A lost \
             race counts in one class.{}",
            layout.left_out()
        ),
    })
}

/// The bars of one value of the second axis, with its title; none without a point.
fn panel(layout: &Layout<'_, '_>, line: Option<usize>) -> Option<(String, String)> {
    let grid = layout.slice.grid;
    let row = |across: usize| {
        let point = layout.slice.at(&layout.places(across, line, None))?;
        let name = layout.across.map_or_else(String::new, |axis| grid.axes[axis].named(across));
        Some(Row { name, judged: judged(grid.record, point)?, races: race(point)?.races })
    };
    let rows: Vec<_> = (0..layout.length()).filter_map(row).collect();
    let title = layout.named(layout.lines.as_ref(), line);
    let description = format!("Failure classes, {title}");
    (!rows.is_empty()).then(|| (title, losses::panel(rows.into_iter(), &description)))
}
