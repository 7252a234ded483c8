//! Blocks of parameters that the device itself narrows to the trajectories that are left.

/// Words from one block of parameters to the next: the largest alignment that an adapter may ask for.
pub(in super::super) const BLOCK_WORDS: usize = 64;
/// Word of a block that has the number of columns, as `Params` in `shaders/params.wgsl` has it.
pub(in super::super) const COLUMNS_WORD: usize = 10;
/// First of the words behind the parameters: workgroups in x, y and z, and the columns of each in x.
pub(in super::super) const GROUPS_WORD: usize = 32;

/// The constants of `shaders/narrow.wgsl`.
pub(super) fn block_constants() -> String {
    format!(
        "const BLOCK_WORDS: u32 = {BLOCK_WORDS}u;\n\
         const COLUMNS_WORD: u32 = {COLUMNS_WORD}u;\n\
         const GROUPS_WORD: u32 = {GROUPS_WORD}u;\n"
    )
}
