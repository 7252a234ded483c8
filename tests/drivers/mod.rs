//! Whether a module is what strict drivers take: one type for each shape, and translations that hold.

use std::path::Path;
use std::process::Command;

use naga::back::{hlsl, msl, spv};
use naga::valid::ModuleInfo;
use naga::{Module, TypeInner};

/// Two types of one shape are one to WGSL and two to SPIR-V, where one may not be passed for the other.
pub(crate) fn assert_types_differ(name: &str, module: &Module) {
    let shapes: Vec<&TypeInner> = module.types.iter().map(|(_, one)| &one.inner).collect();
    for (i, shape) in shapes.iter().enumerate() {
        assert!(!shapes[..i].contains(shape), "{name} has two types of the shape {shape:?}");
    }
}

/// The texts for Metal and for Direct3D; the panic says what has none.
pub(crate) fn translate(name: &str, module: &Module, info: &ModuleInfo) -> [String; 2] {
    let (options, pipeline) = (msl::Options::default(), msl::PipelineOptions::default());
    let metal = msl::write_string(module, info, &options, &pipeline);
    let (metal, _) = metal.unwrap_or_else(|error| panic!("{name} has no MSL: {error}"));
    let (options, pipeline) = (hlsl::Options::default(), hlsl::PipelineOptions::default());
    let mut direct = String::new();
    hlsl::Writer::new(&mut direct, &options, &pipeline)
        .write(module, info, None)
        .unwrap_or_else(|error| panic!("{name} has no HLSL: {error}"));
    [metal, direct]
}

/// What `spirv-val` finds wrong with a module as the program hands it to Vulkan; nothing if it is valid.
pub(crate) fn complaint(module: &Module, info: &ModuleInfo, folder: &Path) -> Option<String> {
    let options = spv::Options {
        lang_version: (1, 3),
        bounds_check_policies: naga::proc::BoundsCheckPolicies::default(),
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        ..spv::Options::default()
    };
    let words = spv::write_vec(module, info, &options, None).expect("SPIR-V is written");
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let path = folder.join("kernel.spv");
    std::fs::write(&path, bytes).expect("a file in a folder of our own");
    let ran = Command::new("spirv-val").args(["--target-env", "vulkan1.1"]).arg(&path).output();
    let output = ran.expect("spirv-val ran before");
    (!output.status.success()).then(|| String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Whether `spirv-val` is there; where it is not this is said, and is a failure if
/// `REACHCAST_REQUIRE_SPIRV_VAL` is 1.
pub(crate) fn validator_is_there() -> bool {
    let there = Command::new("spirv-val").arg("--version").output().is_ok();
    let required = std::env::var("REACHCAST_REQUIRE_SPIRV_VAL").is_ok_and(|value| value == "1");
    assert!(there || !required, "REACHCAST_REQUIRE_SPIRV_VAL is 1, and there is no spirv-val");
    if !there {
        println!("SKIPPED: no spirv-val (Debian has it in spirv-tools)");
    }
    there
}
