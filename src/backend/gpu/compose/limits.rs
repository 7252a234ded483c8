//! The text of the kernels that measure what an adapter can do.

use super::glue::{PARAMS, constants};
use super::kernels::Kernel;

const PEAK: &str = include_str!("../../../../shaders/peak.wgsl");
const COPY: &str = include_str!("../../../../shaders/copy.wgsl");

/// The WGSL module of `kernel`, one of [`Kernel::LIMITS`].
///
/// # Panics
/// For any other kernel.
pub fn limit_kernel(kernel: Kernel) -> String {
    let body = match kernel {
        Kernel::Peak => PEAK,
        Kernel::Copy => COPY,
        other => panic!("{other:?} measures no limit"),
    };
    [&constants(1, 1), PARAMS, body].join("\n")
}
