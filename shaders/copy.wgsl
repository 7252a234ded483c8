// One thread copies one vector per round, a stride from the last: neighbours copy neighbours. Reads
// the source, writes the sink. Its bytes are counted in backend/gpu/limits.rs.

@group(0) @binding(15) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(16) var<storage, read_write> sink: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP)
fn copy(@builtin(global_invocation_id) id: vec3<u32>) {
    for (var round = 0u; round < params.rounds; round += 1u) {
        let at = round * params.stride + id.x;
        sink[at] = source[at];
    }
}
