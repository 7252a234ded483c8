// A stage charged with its own cost and that of the map's cell at its state; the cells lie in front
// of the contexts, CELLS of them. Twin: `map_cost` in backend/cpu/mppi_rollout.rs.

fn charge(total: f32, x: State, u: Control, context: Context, nominal: Control) -> f32 {
    // Whatever number a state that is not finite becomes, it is a cell.
    let cell = min(u32(cell_at(x)), CELLS - 1u);
    return charge_stage(total, x, u, context, nominal) + contexts[cell];
}
