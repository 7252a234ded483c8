//! Names from hostile files: text in every page, harmless on a terminal, and no way out of a folder.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod checkpoint;
mod chromium;
mod command;
mod page;
mod races;
mod records;
mod sweeps;

use std::fs;

use chromium::live::Live;
use chromium::{Scheme, browser, visit};
use command::{Folder, reachcast};
use page::assert_sound;
use reachcast::Error;
use reachcast::files::Staged;
use reachcast::race::record::RaceRecord;
use reachcast::race::sweep::record::SweepRecord;
use reachcast::race::{race_html, sweep_html};
use reachcast::report::html;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Ways out of text, out of attributes of either kind, out of a script and out of a drawing, with what
/// steers a terminal. Where one of them works, a `mark` element or a `data-mark` attribute arises.
const HOSTILE: [&str; 7] = [
    "<script>console.log('ran')</script><mark>",
    "\" data-mark=\"1\" onload=\"console.log('ran')",
    "' data-mark='1' onload='console.log(1)",
    "</title></text></svg></style></script><mark>&mark;",
    "]]><mark>--><mark>",
    "</td></tr></table>\n<mark>\r\n<img src=x onerror=console.log(1)>",
    "\u{1b}[31m\u{1b}]0;title\u{7}\u{9b}2J\u{0}<mark>",
];

/// Every record that differs from `record` in one text, by a hostile one in its place: values and,
/// where nothing fixes them, keys.
fn one_by_one<T: Serialize + DeserializeOwned>(record: &T, hostile: &str) -> Vec<T> {
    let document = serde_json::to_value(record).unwrap();
    let mut found = Vec::new();
    let mut open = vec![String::new()];
    while let Some(path) = open.pop() {
        let value = document.pointer(&path).unwrap();
        let mut changed = document.clone();
        let place = changed.pointer_mut(&path).unwrap();
        match value {
            Value::String(_) => *place = hostile.into(),
            Value::Object(fields) => {
                let key = |key: &String| key.replace('~', "~0").replace('/', "~1");
                open.extend(fields.keys().map(|name| format!("{path}/{}", key(name))));
                let mut renamed: Map<String, Value> = fields.clone();
                let first = renamed.keys().next().cloned();
                if let Some(value) = first.and_then(|first| renamed.shift_remove(&first)) {
                    renamed.insert(hostile.to_owned(), value);
                }
                *place = Value::Object(renamed);
            }
            Value::Array(items) => {
                // Of long lists, the first few are like the others.
                let some = 0..items.len().min(4);
                open.extend(some.map(|i| format!("{path}/{i}")));
                continue;
            }
            _ => continue,
        }
        // Words of enumerations and names of fields have to stay.
        found.extend(serde_json::from_value(changed).ok());
    }
    found
}

/// The record with a hostile text in every place that takes one, each in turn.
fn everywhere<T: Serialize + DeserializeOwned>(record: &T) -> T {
    fn walk(value: &mut Value, next: &mut impl FnMut(&Value) -> Value) {
        match value {
            Value::Array(items) => items.iter_mut().for_each(|item| walk(item, next)),
            Value::Object(map) => map.values_mut().for_each(|item| walk(item, next)),
            other => *other = next(other),
        }
    }
    let document = serde_json::to_value(record).unwrap();
    let mut free = Vec::new();
    // Which texts are free is found out by changing one at a time.
    let texts = |document: &Value| {
        let mut count = 0;
        walk(&mut document.clone(), &mut |value| {
            count += usize::from(value.is_string());
            value.clone()
        });
        count
    };
    let change = |document: &Value, which: &dyn Fn(usize) -> bool| {
        let (mut changed, mut at) = (document.clone(), 0);
        walk(&mut changed, &mut |value| {
            if !value.is_string() {
                return value.clone();
            }
            at += 1;
            if which(at - 1) { HOSTILE[at % HOSTILE.len()].into() } else { value.clone() }
        });
        changed
    };
    for i in 0..texts(&document) {
        free.push(serde_json::from_value::<T>(change(&document, &|at| at == i)).is_ok());
    }
    serde_json::from_value(change(&document, &|at| free[at])).unwrap()
}

/// No element, attribute, reference or control character of a hostile text has come through.
fn assert_harmless(page: &str, case: &str) {
    let body = page.replace("<script>", "<script >");
    for mark in
        ["<mark", "\" data-mark", "' data-mark", "&mark;", "<img", "</title></text", "\u{1b}"]
    {
        assert!(!page.contains(mark), "{case}: {mark:?}");
    }
    let controls = |c: char| c.is_control() && !c.is_whitespace();
    assert!(!page.contains(controls), "{case}: a control character");
    assert!(body.matches("<script").count() <= 1, "{case}: a second script");
}

#[test]
fn names_are_text_on_every_page() {
    let (mut count, hostile) = (0, HOSTILE.concat());
    for record in one_by_one(&records::race(), &hostile) {
        let page = html(&record);
        assert_sound(&page, "a certificate");
        assert_harmless(&page, "a certificate");
        count += 1;
    }
    for record in one_by_one(&races::full(), &hostile) {
        assert_harmless(&race_html(&record), "races");
        count += 1;
    }
    for record in [sweeps::races(), sweeps::certificates()] {
        for record in one_by_one(&record, &hostile) {
            assert_harmless(&sweep_html(&record), "a sweep");
            count += 1;
        }
    }
    println!("{count} pages");
    assert!(count > 140, "{count} pages");
    pages().iter().for_each(|page| assert_harmless(page, "all at once"));
}

/// The three pages, hostile throughout.
fn pages() -> [String; 4] {
    let sweep = |record: SweepRecord| sweep_html(&everywhere(&record));
    let race: RaceRecord = everywhere(&races::full());
    [
        html(&everywhere(&records::race())),
        race_html(&race),
        sweep(sweeps::races()),
        sweep(sweeps::certificates()),
    ]
}

/// A browser makes no element or attribute of them either, and runs nothing.
#[test]
fn a_browser_sees_text() {
    if !browser() {
        return;
    }
    for (i, page) in pages().iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("page.html"), page).unwrap();
        let visit = visit(folder.path(), "page.html", Scheme::Light);
        assert!(visit.console.is_empty(), "page {i}: {:?}", visit.console);
        let mut live = Live::open(page, [1600, 900]);
        let arisen = "mark, img, [onload], [onerror], [data-mark]";
        let count = live.value(&format!("document.querySelectorAll({arisen:?}).length"));
        assert_eq!(count, 0, "page {i}");
        // The selector finds what is there.
        assert_ne!(live.value("document.querySelectorAll('svg, [id]').length"), 0);
    }
}

/// What is said about files with such names, and about names in files, steers no terminal.
#[test]
fn names_steer_no_terminal() {
    let folder = Folder::new();
    let steer = "\u{1b}[31m\u{9b}2J\u{202e}";
    let expect = |arguments: &[&str], words: &[&str]| {
        let (code, output, message) = reachcast(arguments);
        assert_ne!(code, Some(0), "{output}");
        let said = output + &message;
        let steers = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!said.contains(steers), "{said:?}");
        for word in words {
            assert!(said.contains(word), "no `{word}` in: {said:?}");
        }
    };
    let config = folder.path(&format!("{steer}.toml"));
    expect(&["certify", &config], &["[31m", ".toml", "No such file"]);
    fs::write(&config, format!("\"{}\" = 1\n[system]\nname = \"drone-race\"\n", "\\u001b[31m"))
        .unwrap();
    expect(&["certify", &config], &["unknown key"]);
    fs::write(&config, "[system]\nname = \"\\u001b[31mx\"\n").unwrap();
    expect(&["certify", &config], &["system.name"]);
    let states = folder.path(&format!("{steer}.csv"));
    fs::write(&states, format!("{steer},b\n")).unwrap();
    let measures = folder.path("measures.csv");
    let rollout = ["rollout", "configs/smoke.toml", "--starts", &states, "--measures", &measures];
    expect(&rollout, &["expected the states"]);
    let pth = folder.path("x.pth");
    let pickle =
        checkpoint::replaced(&checkpoint::pickle("sequential.pth"), b"0.weight", b"\x1b[31mvy1");
    fs::write(&pth, checkpoint::with_pickle("sequential.pth", &pickle)).unwrap();
    let out = folder.path("policy.safetensors");
    expect(&["policy", "import", &pth, "--out", &out], &["[31mvy1"]);
    expect(&["race", "configs/smoke.toml", "--controllers", steer], &["[31m"]);
}

/// Results have names of their own, whoever names the folder.
#[test]
fn no_result_leaves_its_folder() {
    let folder = Folder::new();
    let inner = folder.path("inner");
    let mut staged = Staged::new(std::path::Path::new(&inner)).unwrap();
    for name in ["../out", "/tmp/out", "a/b", "a/../../out", "..", ".", ""] {
        let refused = staged.add(name, b"x").unwrap_err();
        assert!(matches!(refused, Error::Invalid { .. }), "{name}: {refused}");
    }
    assert!(staged.add("a\0b", b"x").is_ok_and(|()| staged.publish().is_err()));
    // Nothing was put into the folder that was made for them.
    assert!(folder.entries().is_empty(), "{:?}", folder.entries());
    // Controllers and values of a sweep name files or columns, never places.
    let out = folder.path("out");
    for name in ["../x", "/x", "mppi/../../x", "mppi\n"] {
        for command in ["race", "sweep"] {
            let arguments = [
                command,
                "configs/smoke.toml",
                "--starts",
                "2",
                "--controllers",
                name,
                "--out",
                &out,
            ];
            assert_eq!(reachcast(&arguments).0, Some(2), "{command} {name}");
        }
    }
    let vary = ["--vary", "policy.file=../x,/x", "--set", "race.steps=4"];
    let sweep = ["sweep", "configs/smoke.toml", "--starts", "2", "--out", &out];
    assert_eq!(reachcast(&[&sweep[..], &vary[..]].concat()).0, Some(2));
    let left: Vec<String> = folder.entries().into_iter().filter(|name| name != "out").collect();
    assert!(left.is_empty(), "{left:?}");
}

/// Nor does a network: its name in a checkpoint is no path.
#[test]
fn names_of_networks_are_no_paths() {
    let folder = Folder::new();
    let pth = folder.path("x.pth");
    let pickle = checkpoint::pickle("tianshou.pth");
    // As long as `actor1_old`, whose tensors carry the name.
    let pickle = replaced_all(&pickle, b"actor1_old", b"../../../a");
    fs::write(&pth, checkpoint::with_pickle("tianshou.pth", &pickle)).unwrap();
    let out = folder.path("inner/policy.safetensors");
    // A slash within a name is a point, as in names of Haiku.
    let arguments = ["policy", "import", &pth, "--network", ".........a", "--out", &out];
    let (code, _, message) = reachcast(&arguments);
    assert_eq!(code, Some(0), "{message}");
    assert_eq!(fs::read_dir(folder.path("inner")).unwrap().count(), 1);
    let mut left = folder.entries();
    left.sort();
    assert_eq!(left, ["inner", "x.pth"]);
}

fn replaced_all(bytes: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let places: Vec<usize> =
        (0..=bytes.len() - old.len()).filter(|at| bytes[*at..].starts_with(old)).collect();
    assert!(!places.is_empty());
    places.iter().for_each(|at| bytes[*at..at + new.len()].copy_from_slice(new));
    bytes
}
