//! The tree of files, as the files say themselves: `docs/tree.md` holds the first sentence of each.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders whose files are listed.
const FOLDERS: [&str; 4] = ["src", "shaders", "benches", "tests"];
/// What stands above the list.
const HEAD: &str = "# Tree\n\nEvery source file with its own first sentence. \
    `REACHCAST_WRITE_TREE=1 cargo test --release --test tree` writes this page anew.\n";

/// Files of `folder` in order of their names, those of a module before its folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort_by_key(|path| (path.is_dir(), path.clone()));
    let listed = |path: PathBuf| if path.is_dir() { files(&path) } else { vec![path] };
    entries.into_iter().flat_map(listed).collect()
}

/// The first sentence of a file: of its `//!` lines, or of the comment that a shader begins with.
fn caption(text: &str) -> Option<String> {
    let marks = ["//!", "//"];
    let mark = marks.into_iter().find(|mark| text.starts_with(mark))?;
    let lines = text.lines().map_while(|line| line.strip_prefix(mark).map(str::trim));
    let lines: Vec<&str> = lines.take_while(|line| !line.is_empty()).collect();
    let whole = lines.join(" ");
    let end = whole.find(". ").map_or(whole.len(), |at| at + 1);
    Some(whole[..end].to_owned())
}

/// The page.
fn page() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut page = HEAD.to_owned();
    for folder in FOLDERS {
        write!(page, "\n## {folder}\n\n").unwrap();
        for path in files(&root.join(folder)) {
            let name = path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
            let source = name.ends_with(".rs") || name.ends_with(".wgsl");
            if !source || name.contains("fixtures/") {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            let caption =
                caption(&text).unwrap_or_else(|| panic!("{name} begins with no sentence"));
            writeln!(page, "* `{name}`: {caption}").unwrap();
        }
    }
    page
}

#[test]
fn the_tree_is_what_the_files_say() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tree.md");
    let page = page();
    if std::env::var_os("REACHCAST_WRITE_TREE").is_some_and(|value| value == "1") {
        fs::write(&path, &page).unwrap();
    }
    let found = fs::read_to_string(&path).unwrap_or_default();
    let differs = page.lines().zip(found.lines()).find(|(is, was)| is != was);
    assert!(found == page, "docs/tree.md is not what the files say: {differs:?}");
}
