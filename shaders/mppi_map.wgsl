// The cost of the map's cell at a state; there are CELLS of them. Twin: `cell_cost` in tile/stages.rs.

fn map_cost(x: array<f32, NX>, t: u32) -> f32 {
    // Whatever number a state that is not finite becomes, it is a cell.
    return cells[min(u32(cell_at(x, t)), CELLS - 1u)];
}
