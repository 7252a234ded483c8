// One workgroup sets the parameters of one dispatch to the trajectories that are left: their number, and
// the workgroups that they take. Reads the survivors of the other set of columns; writes blocks of
// parameters, which later dispatches of the submission read, and empties the count of its own set. Twin:
// none, since the CPU counts its survivors on the host.

// Parameters of dispatches: those that kernels see, then workgroups in x, y and z and the columns of each.
@group(0) @binding(33) var<storage, read_write> blocks: array<u32>;
@group(0) @binding(34) var<storage, read> left: u32;
@group(0) @binding(13) var<storage, read_write> survivors: u32;

@compute @workgroup_size(1)
fn narrow(@builtin(workgroup_id) group: vec3<u32>) {
    let block = group.x * BLOCK_WORDS;
    let each = blocks[block + GROUPS_WORD + 3u];
    blocks[block + COLUMNS_WORD] = left;
    blocks[block + GROUPS_WORD] = (left + each - 1u) / each;
    if group.x == 0u {
        survivors = 0u;
    }
}
