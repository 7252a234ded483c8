// One thread evaluates a part of the formulas of one trajectory, between two networks that they call.
// Reads the state, what the networks before it said and what earlier parts kept; writes what the
// networks behind it are asked and what later parts need. Twin: backend/cpu/chained.rs.

@group(0) @binding(3) var<storage, read> state: array<vec4<f32>>;
@group(0) @binding(30) var<storage, read_write> kept: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn link(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    if column >= params.columns {
        return;
    }
    evaluate(column, load_state(column), params.step);
}
