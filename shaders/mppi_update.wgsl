// One workgroup weighs `rounds` times WORKGROUP consecutive samples of one problem against the
// smallest cost among them, draws their noise again and sums up their weighted controls over the
// steps t = step .. step + steps - 1. Reads streams, plans and costs; writes a partial: least cost,
// its sample, sum of weights, of their squares, of the finite costs, number of costs that are not
// finite, then the sums of controls [H, NU]. Twin: backend/cpu/mppi_update.rs.

const NO_SAMPLE: u32 = 0xffffffffu;
// Rows of `terms` lie one number more than a workgroup apart, in different memory banks.
const TERM_PITCH: u32 = WORKGROUP + 1u;

// [problems, H, NU + NC]: nominal controls, then what the cost wants to know
@group(0) @binding(18) var<storage, read> plans: array<f32>;
@group(0) @binding(21) var<storage, read> totals: array<f32>;
// [groups, PARTIAL_HEADER + H * NU], f32 as bits
@group(0) @binding(26) var<storage, read_write> partials: array<u32>;

struct Best {
    cost: f32,
    sample: u32,
}

var<workgroup> bests: array<Best, WORKGROUP>;
// Weights, their squares, finite costs, costs that are not finite.
var<workgroup> shares: array<vec4<f32>, WORKGROUP>;
// Weighted controls of a tile of steps: [TILE_STEPS * NU, WORKGROUP].
var<workgroup> terms: array<f32, TILE_STEPS * NU * TERM_PITCH>;

fn counts(cost: f32) -> bool {
    return finite(cost) && cost < HUGE;
}

fn better(a: Best, b: Best) -> Best {
    if b.cost < a.cost || (b.cost == a.cost && b.sample < a.sample) {
        return b;
    }
    return a;
}

// The best of the workgroup's samples; those of a thread lie WORKGROUP apart, from `place` on.
fn best_of(lane: u32, place: u32, column: u32) -> Best {
    var mine = Best(HUGE, NO_SAMPLE);
    for (var round = 0u; round < params.rounds; round += 1u) {
        let ahead = round * WORKGROUP;
        let cost = totals[column + ahead];
        if place + ahead < params.samples && counts(cost) {
            mine = better(mine, Best(cost, params.first_low + place + ahead));
        }
    }
    bests[lane] = mine;
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            bests[lane] = better(bests[lane], bests[lane + half]);
        }
    }
    workgroupBarrier();
    return bests[0];
}

// Weight of the sample in a column; 0 for padding and where the cost is not finite.
fn weight_of(place: u32, column: u32, least: f32) -> f32 {
    let cost = totals[column];
    if place >= params.samples || !counts(cost) {
        return 0.0;
    }
    return exp_negative((least - cost) / params.temperature);
}

// Sums over the workgroup's samples, in `shares[0]` of the first thread.
fn share(lane: u32, place: u32, column: u32, least: f32) {
    var mine = vec4<f32>(0.0);
    for (var round = 0u; round < params.rounds; round += 1u) {
        let ahead = round * WORKGROUP;
        if place + ahead < params.samples {
            let weight = weight_of(place + ahead, column + ahead, least);
            let cost = totals[column + ahead];
            mine += vec4<f32>(weight, weight * weight, 0.0, 0.0);
            if counts(cost) {
                mine.z += cost;
            } else {
                mine.w += 1.0;
            }
        }
    }
    shares[lane] = mine;
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            shares[lane] += shares[lane + half];
        }
    }
}

fn write_header(at: u32, best: Best) {
    let sums = shares[0];
    partials[at] = bitcast<u32>(best.cost);
    partials[at + 1u] = best.sample;
    partials[at + 2u] = bitcast<u32>(sums.x);
    partials[at + 3u] = bitcast<u32>(sums.y);
    partials[at + 4u] = bitcast<u32>(sums.z);
    partials[at + 5u] = u32(sums.w);
}

// Adds a row of terms to a sum of the partial, which the first round begins.
fn add_row(at: u32, row: u32, round: u32) {
    var sum = 0.0;
    for (var lane = 0u; lane < WORKGROUP; lane += 1u) {
        sum += terms[row * TERM_PITCH + lane];
    }
    if round > 0u {
        sum += bitcast<f32>(partials[at]);
    }
    partials[at] = bitcast<u32>(sum);
}

@compute @workgroup_size(WORKGROUP)
fn mppi_update(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    let covered = params.rounds * WORKGROUP;
    let groups = params.width / covered;
    let problem = group.x / groups;
    let place = (group.x % groups) * covered + lane;
    let column = problem * params.width + place;
    let best = best_of(lane, place, column);
    share(lane, place, column, best.cost);
    let base = group.x * (PARTIAL_HEADER + params.horizon * NU);
    if lane == 0u {
        write_header(base, best);
    }
    let end = params.step + params.steps;
    for (var round = 0u; round < params.rounds; round += 1u) {
        let ahead = round * WORKGROUP;
        let weight = weight_of(place + ahead, column + ahead, best.cost);
        open_source(problem, params.first_low + place + ahead);
        resume_noise(column + ahead);
        for (var first = params.step; first < end; first += TILE_STEPS) {
            let steps = min(TILE_STEPS, end - first);
            for (var i = 0u; i < steps; i += 1u) {
                let nominal = plan_at(problem * params.horizon + first + i);
                put_terms(lane, i, weight, control_at(nominal, noise_at(first + i)));
            }
            workgroupBarrier();
            if lane < steps * NU {
                add_row(base + PARTIAL_HEADER + first * NU + lane, lane, round);
            }
            workgroupBarrier();
        }
        suspend_noise(column + ahead);
    }
}
