// Parameters of one dispatch; twin: `Params` in backend/gpu/params.rs, scalars only, so that the
// offsets are the same without padding rules.
struct Params {
    key_low: u32,
    key_high: u32,
    stream: u32,
    // 0 at run time, which no compiler knows: see `product`.
    zero: u32,
    pair_key_low: u32,
    pair_key_high: u32,
    pair_stream: u32,
    pair_radius: f32,
    first_low: u32,
    first_high: u32,
    columns: u32,
    stride: u32,
    step: u32,
    steps: u32,
    horizon: u32,
    region_kind: u32,
    paired: u32,
    closed_loop: u32,
    sign_only: u32,
    layer_offset: u32,
    layer_inputs: u32,
    layer_outputs: u32,
    layer_neurons: u32,
    segment_start: u32,
    iteration: u32,
    samples: u32,
    width: u32,
    rounds: u32,
    temperature: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
