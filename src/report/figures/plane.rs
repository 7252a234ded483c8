//! What figures share: points, lines and areas in the plane of a slice.

use crate::report::contour::Field;
use crate::report::plot::Plot;
use crate::report::slice::Grid;
use crate::report::text::ordinary;
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

/// Entry `index` of a state, if it is a number.
pub(super) fn entry(state: &[f32], index: usize) -> Option<f64> {
    let value = state.get(index).map(|&value| f64::from(value))?;
    ordinary(value).then_some(value)
}

/// Two entries of a state, if both are numbers.
pub(super) fn point(state: &[f32], [x, y]: [usize; 2]) -> Option<[f64; 2]> {
    Some([entry(state, x)?, entry(state, y)?])
}

/// Whether two states of the system have the same unit, so that one scale fits both.
pub(super) fn same_unit(record: &Record, [x, y]: [usize; 2]) -> bool {
    let unit = |state: usize| record.system.states.get(state).map(|axis| axis.unit.as_str());
    unit(x).is_some() && unit(x) == unit(y)
}

/// The two states that the slice varies.
pub(super) fn slice_states(record: &Record) -> [usize; 2] {
    [record.slice.x.state, record.slice.y.state]
}

/// The target set of the slice as an area: under everything else.
pub(super) fn target_area(plot: &mut Plot, grid: &Grid) {
    let target = grid.field(&grid.record.slice.target_margin, 1.0);
    let data = region(plot, &target);
    plot.path("target-area", &data);
}

/// Violated constraints hatched, and the zero levels of target and constraint margin.
pub(super) fn margins(plot: &mut Plot, grid: &Grid) {
    let slice = &grid.record.slice;
    let violation = grid.field(&slice.constraint_margin, -1.0);
    let data = region(plot, &violation);
    plot.path("hatched", &data);
    let data = lines(plot, &violation);
    plot.path("constraint", &data);
    let data = lines(plot, &grid.field(&slice.target_margin, 1.0));
    plot.path("target", &data);
}
