//! Claimed figures are rounded in one place: no other file writes numbers with so many decimals.

use std::fs;
use std::path::{Path, PathBuf};

/// Files that round figures which nobody claims, each with what they are.
const OTHERS: [(&str, &str); 11] = [
    ("rounding.rs", "the one place"),
    ("error.rs", "sizes of memory in errors"),
    ("report/plot.rs", "coordinates of drawings"),
    ("report/ticks.rs", "ticks of drawings, which are where they say"),
    ("race/page/film.rs", "times of an animation"),
    ("race/page/moment.rs", "coordinates of drawings"),
    ("race/sweep_page/heat.rs", "numbers in cells of a drawing"),
    ("race/weights.rs", "diagnoses of plans"),
    ("race/command/race.rs", "an estimate of work"),
    ("race/run.rs", "a count of work"),
    ("cli/bench.rs", "measured speeds"),
];

fn rust_files(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the source folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            rust_files(&path, out);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            out.push(path);
        }
    }
}

/// Whether `inside` of two braces is a number with a fixed count of digits: `x:.4`, `:>9.1e`, `:.*`.
fn fixes_digits(inside: &str) -> bool {
    let Some((name, spec)) = inside.split_once(':') else { return false };
    let plain = name.chars().all(|c| c.is_alphanumeric() || c == '_');
    let open = spec.starts_with([' ', ':', '?']);
    let digits = spec
        .split_once('.')
        .is_some_and(|(_, rest)| rest.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '*'));
    plain && !open && digits
}

/// The formats of `text` that fix digits, its tests left out.
fn formats(text: &str) -> Vec<&str> {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let after = code.split('{').skip(1);
    after
        .filter_map(|rest| rest.split_once('}'))
        .map(|(inside, _)| inside)
        .filter(|inside| fixes_digits(inside))
        .collect()
}

#[test]
fn no_figure_is_rounded_beside_the_one_place() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    assert!(files.len() > 300, "only {} files", files.len());
    let mut seen = Vec::new();
    for path in files {
        let name =
            path.strip_prefix(&root).expect("below src").to_string_lossy().replace('\\', "/");
        let text = fs::read_to_string(&path).expect("a source file");
        let found = formats(&text);
        if found.is_empty() || name.starts_with("bench/") || name.contains("/tests") {
            continue;
        }
        let other = OTHERS.iter().find(|(file, _)| *file == name);
        assert!(other.is_some(), "{name} rounds by itself, use `rounding`: {found:?}");
        seen.push(name);
    }
    for (file, what) in OTHERS {
        assert!(
            seen.iter().any(|name| name == file),
            "{file} ({what}) rounds nothing, take it out"
        );
    }
}

#[test]
fn formats_are_found() {
    let text =
        "f!(\"{x:.4} {:>9.1e} {value:.*} {:.DIGITS$e} {a:>8} {b:?} {}\"); S { a: 0.5, b: c::D }";
    assert_eq!(formats(text), ["x:.4", ":>9.1e", "value:.*", ":.DIGITS$e"]);
}
