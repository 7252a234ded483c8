//! An adapter that does the worst that a driver is allowed: edits of the text of every kernel.
//!
//! `REACHCAST_PESSIMIST` names the edits, separated by commas, or says `all`; the helpers of the tests then
//! open every adapter with them. What a kernel promises must hold all the same.

#![allow(dead_code, reason = "each test file uses a part of it")]

mod rewrite;

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use reachcast::backend::gpu::Gpu;

/// What the operators of a kernel are turned into.
const DRIVER: &str = include_str!("driver.wgsl");

/// Something that a driver may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Edit {
    /// Quotients are up to 2 units of the last place off, roots up to 3.
    Miss,
    /// A product that is added to something is not rounded before.
    Contract,
    /// `(a + b) + c` is `a + (b + c)`.
    Reorder,
    /// Subnormal products and quotients are 0.
    Flush,
    /// There is no NaN: a comparison is the opposite of its opposite, so that one with a NaN is true,
    /// and a choice between two numbers is a maximum that drops it.
    Compare,
    /// `a - a` and `0 a` are 0 whatever `a` is, and `a / a` is 1.
    Cancel,
}

impl Edit {
    /// All of them: none excludes another.
    pub(crate) const ALL: [Self; 6] =
        [Self::Miss, Self::Contract, Self::Reorder, Self::Flush, Self::Compare, Self::Cancel];

    /// The name by which it is asked for.
    fn name(self) -> &'static str {
        match self {
            Self::Miss => "miss",
            Self::Contract => "contract",
            Self::Reorder => "reorder",
            Self::Flush => "flush",
            Self::Compare => "compare",
            Self::Cancel => "cancel",
        }
    }

    /// The edit of a name.
    fn named(name: &str) -> Self {
        let known = Self::ALL.into_iter().find(|edit| edit.name() == name);
        known.unwrap_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            panic!("REACHCAST_PESSIMIST names `{name}`; there are {names}, and all")
        })
    }
}

/// `gpu` as it is, or with the edits that `REACHCAST_PESSIMIST` names.
pub(crate) fn as_asked(gpu: Gpu) -> Gpu {
    match std::env::var("REACHCAST_PESSIMIST") {
        Err(_) => gpu,
        Ok(names) if names == "all" => pessimistic(gpu, &Edit::ALL),
        Ok(names) => {
            let edits: Vec<Edit> = names.split(',').map(Edit::named).collect();
            pessimistic(gpu, &edits)
        }
    }
}

/// `gpu` with `edits`.
pub(crate) fn pessimistic(gpu: Gpu, edits: &[Edit]) -> Gpu {
    let edits = edits.to_vec();
    gpu.with_shader_edit(move |text| edited(text, &edits))
}

/// `text` with every operation on f32 numbers as a driver that does `edits` may have it.
pub(crate) fn edited(text: &str, edits: &[Edit]) -> String {
    // A kernel without parameters moves whole numbers alone.
    if !text.contains("var<uniform> params") {
        return text.to_owned();
    }
    let (mut module, info) = parsed(text);
    rewrite::rewrite(&mut module, &info, edits);
    let info = validated(&module, "the edited kernel");
    let flags = naga::back::wgsl::WriterFlags::empty();
    let mut text = naga::back::wgsl::write_string(&module, &info, flags).expect("it is written");
    for (marker, function) in rewrite::MARKERS {
        text = renamed(&text, marker, function);
    }
    let has = |edit| edits.contains(&edit);
    let (flushes, misses) = (has(Edit::Flush), has(Edit::Miss));
    format!("{text}\nconst FLUSHES: bool = {flushes};\nconst MISSES: bool = {misses};\n{DRIVER}")
}

/// The module of a text, and what is known of it.
fn parsed(text: &str) -> (naga::Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(text)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(text)));
    let info = validated(&module, text);
    (module, info)
}

fn validated(module: &naga::Module, text: &str) -> ModuleInfo {
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    validator.validate(module).unwrap_or_else(|error| panic!("{}", error.emit_to_string(text)))
}

/// `text` with every call of the function `from` a call of `to`.
fn renamed(text: &str, from: &str, to: &str) -> String {
    let call = format!("{from}(");
    let mut parts = text.split(&call);
    let mut all = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let inside = all.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        all += if inside { from } else { to };
        all += "(";
        all += part;
    }
    all
}
