// What a cell of a map says: the cells of the map begin at `first`, there are `count` of them, and a
// number of a cell that is no number stays so. Twin: `at_cell` in cost/map.rs.

fn look(cell: f32, first: u32, count: u32) -> f32 {
    // Whatever number one that is not finite becomes, it is a cell.
    return unless_nan(cells[first + min(u32(cell), count - 1u)], size_of(cell));
}
