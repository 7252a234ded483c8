//! The house: no engine file names a study, the study's own floors, one number for each purpose.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Words that name the study.
const STUDY: [&str; 4] = ["race", "races", "drone", "drones"];
/// Files outside of the study that may name it.
const REGISTRY: [&str; 2] = ["studies.rs", "lib.rs"];
/// The floors of the study; each imports only from those before it.
const FLOORS: [&str; 24] = [
    "system",
    "cost",
    "barrier",
    "judge",
    "settings",
    "controller",
    "flight",
    "log",
    "record",
    "metrics",
    "difference",
    "statistics",
    "timing",
    "weights",
    "summary",
    "folder",
    "picture",
    "run",
    "sweep",
    "page",
    "sweep_page",
    "bench",
    "defaults",
    "command",
];

fn rust_files(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the source folder") {
        let path = entry.expect("an entry of the source folder").path();
        if path.is_dir() {
            rust_files(&path, out);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            out.push(path);
        }
    }
}

/// Files of `src` as (path within it, code), without tests, comments and what stands in quotes.
fn sources() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("a source file");
        let name = path.strip_prefix(&root).expect("a file of src");
        (name.to_string_lossy().replace('\\', "/"), code(&text))
    };
    let files: Vec<_> = files.into_iter().map(read).collect();
    let tests = |name: &str| name.ends_with("tests.rs") || name.contains("/tests/");
    files.into_iter().filter(|(name, _)| !tests(name)).collect()
}

/// `text` up to its tests, without comments and what stands in quotes.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let (mut code, mut rest) = (String::new(), text);
    while let Some(c) = rest.chars().next() {
        let skipped = match c {
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '"' => quoted(rest),
            // A character in quotes, which may be one; a lifetime has no second one so near.
            '\'' if rest.starts_with("'\"'") => 3,
            _ => 0,
        };
        if skipped == 0 {
            code.push(c);
        }
        rest = &rest[skipped.max(c.len_utf8())..];
    }
    code
}

/// Length of the text in quotes that `rest` begins with.
fn quoted(rest: &str) -> usize {
    let mut escaped = false;
    let end = rest.char_indices().skip(1).find(|(_, c)| {
        let ends = *c == '"' && !escaped;
        escaped = *c == '\\' && !escaped;
        ends
    });
    end.map_or(rest.len(), |(at, _)| at + 1)
}

/// The words of the names in `code`: `AnyRace` and `any_race` are both any and race.
fn words(code: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut lower = false;
    for c in code.chars() {
        if !c.is_ascii_alphanumeric() || (c.is_ascii_uppercase() && lower) {
            words.push(String::new());
        }
        lower = c.is_ascii_lowercase();
        if c.is_ascii_alphanumeric() {
            words.last_mut().expect("a word").push(c.to_ascii_lowercase());
        }
    }
    words
}

/// The first parts of what follows each `prefix` in `code`.
fn after(code: &str, prefix: &str) -> Vec<String> {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let first = |rest: &str| rest.split(|c| !word(c)).next().unwrap_or_default().to_owned();
    code.split(prefix).skip(1).map(first).collect()
}

#[test]
fn names_fall_into_words_and_quotes_do_not_count() {
    let code = code("let x = \"a race\"; // race\nAnyRace::of('\"', any_drone(\"\\\"race\"))");
    assert!(!code.contains('"') && !code.contains("//"), "{code}");
    let words = words(&code);
    let found: Vec<_> = words.iter().filter(|word| STUDY.contains(&word.as_str())).collect();
    assert_eq!(found, ["race", "drone"]);
}

#[test]
fn no_engine_file_names_the_study() {
    let mut inside = 0;
    for (name, code) in sources() {
        let named = words(&code).into_iter().filter(|word| STUDY.contains(&word.as_str()));
        let named: Vec<String> = named.collect();
        match name.starts_with("race/") || REGISTRY.contains(&name.as_str()) {
            true => inside += named.len(),
            false => assert!(named.is_empty(), "{name} names the study: {named:?}"),
        }
    }
    assert!(inside > 100, "the search finds nothing, not even where it must");
}

#[test]
fn each_floor_of_the_study_imports_only_from_those_before_it() {
    let floor = |name: &str| FLOORS.iter().position(|floor| *floor == name);
    let mut seen = 0;
    for (name, code) in sources() {
        let Some(inside) = name.strip_prefix("race/") else { continue };
        let Some(own) = floor(inside.split(['/', '.']).next().unwrap_or_default()) else {
            assert_eq!(inside, "mod.rs", "{name} is on no floor");
            continue;
        };
        let mut imports = after(&code, "crate::race::");
        if !inside.contains('/') {
            imports.extend(after(&code, "super::"));
        }
        for import in imports {
            let theirs = floor(&import).unwrap_or_else(|| panic!("{name} imports {import}"));
            assert!(theirs <= own, "{name} imports {import}, which stands above it");
            seen += 1;
        }
    }
    assert!(seen > 50, "only {seen} imports seen");
}

#[test]
fn each_purpose_of_random_numbers_has_a_number_of_its_own() {
    let mut owners: BTreeMap<u8, String> = BTreeMap::new();
    for (name, code) in sources() {
        for number in ["Purpose::numbered(", "Self::numbered("].map(|of| after(&code, of)).concat()
        {
            let number: u8 = number.parse().unwrap_or_else(|_| panic!("{name}: {number}"));
            if let Some(other) = owners.insert(number, name.clone()) {
                panic!("{name} and {other} draw the same numbers: purpose {number}");
            }
        }
    }
    // Stored results say seeds and streams: the numbers are part of the format.
    assert_eq!(owners.into_keys().collect::<Vec<_>>(), (1..=38).collect::<Vec<u8>>());
}
