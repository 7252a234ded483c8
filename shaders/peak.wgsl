// One thread multiplies and adds in registers: 16 independent chains of x * factor + 1 that start
// at 0 to 15, 4 links of each per round. With a factor of 1, which no compiler knows, each chain
// counts its links. Writes the sum of the chains, so that none can be left out. Its operations are
// counted in backend/gpu/limits.rs.

@group(0) @binding(16) var<storage, read_write> sink: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn peak(@builtin(global_invocation_id) id: vec3<u32>) {
    let factor = params.temperature;
    var a = vec4<f32>(0.0, 1.0, 2.0, 3.0);
    var b = a + 4.0;
    var c = a + 8.0;
    var d = a + 12.0;
    for (var round = 0u; round < params.rounds; round += 1u) {
        a = a * factor + 1.0;
        b = b * factor + 1.0;
        c = c * factor + 1.0;
        d = d * factor + 1.0;
        a = a * factor + 1.0;
        b = b * factor + 1.0;
        c = c * factor + 1.0;
        d = d * factor + 1.0;
        a = a * factor + 1.0;
        b = b * factor + 1.0;
        c = c * factor + 1.0;
        d = d * factor + 1.0;
        a = a * factor + 1.0;
        b = b * factor + 1.0;
        c = c * factor + 1.0;
        d = d * factor + 1.0;
    }
    sink[id.x] = dot(a + b + c + d, vec4<f32>(1.0));
}
