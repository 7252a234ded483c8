//! The layers: a file imports from its own and from those below, and no two import each other in a circle.

mod modules;

use std::path::Path;

use modules::circles::{Circle, circles};
use modules::{Import, Modules};

/// Layer of each top-level module; a file may name its own layer and those below it.
///
/// The study goes through all of them; its parts that stand elsewhere than with the experiments are named.
const LAYERS: [(&str, u32); 29] = [
    ("real", 1),
    ("error", 1),
    ("digest", 1),
    ("files", 1),
    ("rounding", 1),
    ("system", 2),
    ("policy", 2),
    ("cost", 2),
    ("formula", 2),
    ("tile", 2),
    ("model", 2),
    ("rollout", 3),
    ("tube", 4),
    ("backend", 4),
    ("scenario", 5),
    ("control", 5),
    ("plan", 6),
    ("race", 8),
    ("race::system", 2),
    ("race::cost", 2),
    ("race::defaults", 9),
    ("race::command", 9),
    ("bench", 7),
    ("train", 7),
    ("report", 8),
    ("studies", 9),
    ("certificate", 9),
    ("cli", 9),
    ("config", 9),
    ("lib", 9),
];

/// Circles that stand, by folder and parts, each with the reason. The list gets shorter, never longer:
/// a circle that is smaller than its entry is a failure too.
const STANDING: [(&str, &[&str]); 3] = [
    // The elementary functions are default methods of the scalar trait and are written in its operations.
    ("real", &["approx", "mod"]),
    // The command line and configurations ask the registry of studies, and the parts of a study that stand
    // there are written with their options and sections.
    ("", &["cli", "config", "race::command", "race::defaults", "studies"]),
    // To be taken apart: what the parts share moves down.
    ("race/sweep_page", &["chart", "curves", "rows"]),
];

fn modules() -> Modules {
    Modules::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"))
}

/// The part of the crate that `place` is in, as [`LAYERS`] name it.
fn part(place: &[String]) -> String {
    let whole = place.iter().take(2).cloned().collect::<Vec<_>>().join("::");
    let named = LAYERS.iter().any(|(name, _)| *name == whole);
    let first = place.first().map_or("lib", String::as_str);
    if named { whole } else { first.to_owned() }
}

fn layer(place: &[String]) -> u32 {
    let part = part(place);
    let found = LAYERS.iter().find(|(name, _)| *name == part);
    found.unwrap_or_else(|| panic!("{part} belongs to no layer")).1
}

/// Every circle of every folder.
fn all_circles(modules: &Modules) -> Vec<Circle> {
    let imports = modules.imports();
    let inner = |place: &[String]| place.first().map_or("mod", String::as_str).to_owned();
    let of = |folder: Vec<String>| match folder.is_empty() {
        true => circles(&folder, &imports, part),
        false => circles(&folder, &imports, inner),
    };
    modules.folders().into_iter().flat_map(of).collect()
}

#[test]
fn a_file_imports_only_from_its_layer_and_those_below() {
    let imports = modules().imports();
    assert!(imports.len() > 500, "only {} imports seen", imports.len());
    // What `lib.rs` defines itself is nothing; it hands on.
    for Import { from, to, path } in imports.iter().filter(|import| !import.to.is_empty()) {
        let (own, theirs) = (layer(from), layer(to));
        assert!(theirs <= own, "{} (layer {own}) imports {path} ({theirs})", from.join("/"));
    }
}

#[test]
fn no_files_of_a_folder_import_each_other_in_a_circle() {
    let found = all_circles(&modules());
    let stands = |circle: &&Circle| {
        STANDING
            .iter()
            .any(|(folder, parts)| *folder == circle.folder && circle.parts.iter().eq(parts.iter()))
    };
    let words =
        |circle: &Circle| format!("in src/{}:\n  {}", circle.folder, circle.imports.join("\n  "));
    let new: Vec<String> = found.iter().filter(|circle| !stands(circle)).map(words).collect();
    let new = new.join("\n");
    assert!(new.is_empty(), "these import each other; move what they share down:\n{new}");
    assert_eq!(found.len(), STANDING.len(), "an entry of STANDING is no longer needed");
}

/// The tensors of training are handed an adapter's handles, in one file.
#[test]
fn only_the_gpu_backend_names_wgpu() {
    let imports = modules::texts(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    let mut inside = 0;
    for (name, text) in imports {
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        let count = code.filter(|line| line.contains("wgpu")).count();
        match name.starts_with("backend/gpu/") {
            true => inside += count,
            false if name == "train/device.rs" => {}
            false => assert_eq!(count, 0, "{name} names the GPU library"),
        }
    }
    assert!(inside > 0, "the search finds nothing, not even where it must");
}

/// Elsewhere a pipe would be waited for, and a device read until memory ends.
#[test]
fn only_one_file_reads_files() {
    let ways =
        ["fs::read(", "fs::read)", "fs::{read", "read_to_string", "File::open", "OpenOptions"];
    let mut inside = 0;
    for (name, text) in modules::texts(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src")) {
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let found: Vec<_> = ways.iter().filter(|way| code.contains(**way)).collect();
        if name == "files/plain.rs" {
            inside += found.len();
        } else if !name.contains("tests") {
            assert!(found.is_empty(), "{name} reads files by {found:?}; `files/plain.rs` does");
        }
    }
    assert!(inside > 0, "the search finds nothing, not even where it must");
}

/// A crate of a few files.
fn made_up(files: &[(&str, &str)]) -> Modules {
    Modules::of(files.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())))
}

/// Its circles, by folder and parts.
fn found(files: &[(&str, &str)]) -> Vec<(String, String)> {
    let imports = made_up(files).imports();
    let inner = |place: &[String]| place.first().map_or("mod", String::as_str).to_owned();
    let of = |folder: Vec<String>| circles(&folder, &imports, inner);
    let all = made_up(files).folders().into_iter().flat_map(of);
    all.map(|circle| (circle.folder, circle.parts.join(" "))).collect()
}

#[test]
fn paths_are_followed_to_the_file_that_defines_what_they_name() {
    let files = [
        ("lib.rs", "pub mod a; pub mod b; pub use a::Error;"),
        ("a/mod.rs", "mod deep; pub use deep::{Inner as Outer, Other}; pub struct Error;"),
        ("a/deep.rs", "use super::Error; pub struct Inner; pub struct Other;"),
        (
            "b.rs",
            "use crate::{a::{self, Outer}, Error}; fn f() { let x = vec![a::Other]; crate::a::deep::g(); }
             #[cfg(test)] mod tests { use crate::nowhere::Nothing; }",
        ),
    ];
    let imports = made_up(&files).imports();
    let shown: Vec<String> = imports
        .iter()
        .map(|Import { from, to, path }| format!("{} {} {path}", from.join("/"), to.join("/")))
        .collect();
    assert_eq!(
        shown,
        [
            "a/deep a super::Error",
            "b a crate::Error",
            "b a crate::a",
            "b a/deep a::Other",
            "b a/deep crate::a::Outer",
            "b a/deep crate::a::deep::g",
        ]
    );
}

#[test]
fn circles_are_seen_in_files_folders_and_the_file_of_a_folder() {
    let two = [
        ("x/mod.rs", ""),
        ("x/a.rs", "use super::b::B;"),
        ("x/b.rs", "fn f() { crate::x::a::g() }"),
    ];
    assert_eq!(found(&two), [("x".to_owned(), "a b".to_owned())]);
    let three = [
        ("x/mod.rs", "pub use c::C;"),
        ("x/a.rs", "use super::b::B;"),
        ("x/b.rs", "use super::C;"),
        ("x/c/mod.rs", "mod d; pub use d::C;"),
        ("x/c/d.rs", "use crate::x::{a::A};"),
        ("x/e.rs", "use super::a::A;"),
    ];
    assert_eq!(found(&three), [("x".to_owned(), "a b c".to_owned())]);
    let parent =
        [("x/mod.rs", "mod a; pub struct S; fn f() { a::g() }"), ("x/a.rs", "use super::S;")];
    assert_eq!(found(&parent), [("x".to_owned(), "a mod".to_owned())]);
}

#[test]
fn what_a_folder_hands_on_is_no_import_of_it() {
    let files = [
        ("x/mod.rs", "mod a; mod b; pub use a::A; pub(crate) use b::B; pub struct S;"),
        ("x/a.rs", "use super::B; pub struct A;"),
        ("x/b.rs", "use super::S; pub struct B;"),
    ];
    assert_eq!(found(&files), []);
    let used = [("x/mod.rs", "use a::A; pub struct S(A);"), ("x/a.rs", "use super::S;")];
    assert_eq!(found(&used), [("x".to_owned(), "a mod".to_owned())]);
}
