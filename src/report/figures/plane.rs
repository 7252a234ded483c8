//! What figures share: points, lines and areas in the plane of a slice.

use crate::report::contour::Field;
use crate::report::plot::Plot;
use crate::report::slice::Grid;
use crate::report::span::Span;
use crate::scenario::drawn_record::GroundRecord;
use crate::scenario::record::Record;

/// Said where there is one state alone, or where the arrays of a slice do not fit its axes.
pub(super) fn no_slice(record: &Record) -> Result<String, String> {
    let reason = match record.system.states.len() {
        1 => "A slice shows two states, and the system has one.",
        _ => "The record holds no slice that can be drawn.",
    };
    Err(reason.to_owned())
}

/// Path data of all zero lines of a field.
pub(super) fn lines(plot: &Plot, field: &Field) -> String {
    let lines = field.zero_lines();
    lines.into_iter().map(|line| plot.line(line)).collect()
}

/// Path data of the region where a field is positive.
pub(super) fn region(plot: &Plot, field: &Field) -> String {
    let polygons = field.region();
    polygons.into_iter().map(|polygon| plot.polygon(polygon)).collect()
}

/// The two states that the slice varies.
pub(super) fn slice_states(record: &Record) -> [usize; 2] {
    [record.slice.x.state, record.slice.y.state]
}

/// The target set of the slice as an area: under everything else.
pub(super) fn target_area(plot: &mut Plot, grid: &Grid) {
    area_of(plot, grid, &grid.record.slice.target_margin);
}

/// Where target margins are positive, as an area.
fn area_of(plot: &mut Plot, grid: &Grid, target: &[f32]) {
    let data = region(plot, &grid.field(target, 1.0));
    plot.path("target-area", &data);
}

/// Violated constraints hatched, and the zero levels of target and constraint margin.
pub(super) fn margins(plot: &mut Plot, grid: &Grid) {
    let slice = &grid.record.slice;
    margins_of(plot, grid, [&slice.target_margin, &slice.constraint_margin]);
}

/// The same of target and constraint margins on a grid.
fn margins_of(plot: &mut Plot, grid: &Grid, [target, constraint]: [&[f32]; 2]) {
    let violation = grid.field(constraint, -1.0);
    let data = region(plot, &violation);
    plot.path("hatched", &data);
    let data = lines(plot, &violation);
    plot.path("constraint", &data);
    let data = lines(plot, &grid.field(target, 1.0));
    plot.path("target", &data);
}

/// What of the margins on a grid a reader sees.
pub(super) struct Seen {
    /// Whether a target set is there.
    pub(super) target: bool,
    /// Whether the constraint is violated somewhere.
    pub(super) violated: bool,
}

/// What is seen of the margins of the slice.
pub(super) fn seen(grid: &Grid) -> Seen {
    let slice = &grid.record.slice;
    seen_of(grid, [&slice.target_margin, &slice.constraint_margin])
}

fn seen_of(grid: &Grid, [target, constraint]: [&[f32]; 2]) -> Seen {
    Seen {
        target: grid.field(target, 1.0).is_positive(),
        violated: grid.field(constraint, -1.0).is_positive(),
    }
}

/// Margins that paths are drawn over.
pub(super) enum GroundOf<'a> {
    /// Those of the slice.
    Slice(&'a Grid<'a>),
    /// Those of the picture itself.
    Picture(Grid<'a>, &'a GroundRecord),
}

impl<'a> GroundOf<'a> {
    /// The margins of the slice.
    pub(super) fn slice(grid: &'a Grid<'a>) -> Self {
        Self::Slice(grid)
    }

    /// The margins of the picture; none if its arrays do not make a grid.
    pub(super) fn picture(record: &'a Record, ground: &'a GroundRecord) -> Option<Self> {
        Some(Self::Picture(Grid::of_ground(record, ground)?, ground))
    }

    /// What they cover across and upwards.
    pub(super) fn spans(&self) -> [Span; 2] {
        match self {
            Self::Slice(grid) => grid.spans(),
            Self::Picture(grid, _) => grid.spans(),
        }
    }

    /// Draws them.
    pub(super) fn draw(&self, plot: &mut Plot) {
        plot.beyond(self.spans());
        match self {
            Self::Slice(grid) => {
                target_area(plot, grid);
                margins(plot, grid);
            }
            Self::Picture(grid, ground) => {
                area_of(plot, grid, &ground.target_margin);
                margins_of(plot, grid, [&ground.target_margin, &ground.constraint_margin]);
            }
        }
    }

    /// What is seen of them.
    pub(super) fn seen(&self) -> Seen {
        match self {
            Self::Slice(grid) => seen(grid),
            Self::Picture(grid, ground) => {
                seen_of(grid, [&ground.target_margin, &ground.constraint_margin])
            }
        }
    }

    /// How a caption begins to speak of them.
    pub(super) fn words(&self) -> &'static str {
        match self {
            Self::Slice(_) => " Target set and constraint are drawn over the slice",
            Self::Picture(..) => " The margins are drawn as they are at the first step",
        }
    }
}
