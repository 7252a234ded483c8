//! Kernels of which a line says something else, and a comparison that has to notice.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use reachcast::backend::Backend;

use crate::common::adapter;

/// Requires that `agree` notices kernels in which `old` is replaced by `new`.
pub(crate) fn noticed(
    agree: impl Fn(&Backend) -> Result<(), String>,
    old: &'static str,
    new: &'static str,
) {
    let Some(gpu) = adapter() else { return };
    let seen = Arc::new(AtomicBool::new(false));
    let found = Arc::clone(&seen);
    let gpu = gpu.with_shader_edit(move |text| {
        found.fetch_or(text.contains(old), Ordering::Relaxed);
        text.replace(old, new)
    });
    let problem = agree(&Backend::Gpu(gpu)).expect_err("a broken rule is noticed");
    assert!(seen.load(Ordering::Relaxed), "no kernel has `{old}`");
    println!("{problem}");
}

/// A test for each change of a kernel that the comparison has to notice.
macro_rules! mutants {
    ($agree:ident; $($name:ident: $old:expr => $new:expr;)*) => {
        $(
            #[test]
            fn $name() {
                $crate::mutants::noticed($agree, $old, $new);
            }
        )*
    };
}
