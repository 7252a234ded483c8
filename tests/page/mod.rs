//! Reading a report back: its tags, rows and drawings.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Tags that the page is made of.
const TAGS: &str = "html head meta link title style body header main footer section div p span h1 \
    h2 h3 h4 ol ul dl dt dd li figure figcaption table thead tbody tr th td code pre details summary \
    svg input button output noscript script defs pattern clipPath g path rect circle ellipse text";
/// Tags without an end tag.
const VOID: [&str; 3] = ["meta", "link", "input"];
/// Attributes that hold coordinates.
const DRAWN: [&str; 13] = [
    "d",
    "x",
    "y",
    "cx",
    "cy",
    "r",
    "rx",
    "ry",
    "width",
    "height",
    "viewBox",
    "transform",
    "textLength",
];

/// The tags of a page, each without its brackets.
pub(crate) fn tags(page: &str) -> Vec<&str> {
    let (head, rest) = page.split_once("<style>").unwrap();
    let (_, rest) = rest.split_once("</style>").unwrap();
    [head, rest]
        .into_iter()
        .flat_map(|part| part.split('<').skip(1))
        .map(|tag| tag.split_once('>').expect("a tag ends").0)
        .filter(|tag| !tag.starts_with('!'))
        .collect()
}

/// Attributes of a tag as `(name, value)`.
pub(crate) fn attributes(tag: &str) -> Vec<(&str, &str)> {
    let mut parts = tag.split('"');
    let mut attributes = Vec::new();
    while let (Some(name), Some(value)) = (parts.next(), parts.next()) {
        let name = name.trim().trim_end_matches('=');
        attributes.push((name.rsplit(' ').next().unwrap_or(name), value));
    }
    attributes
}

/// Only known tags, each closed in order; only drawable coordinates.
pub(crate) fn assert_sound(page: &str, case: &str) {
    let mut open = Vec::new();
    for tag in tags(page) {
        let name = tag.trim_start_matches('/').split([' ', '/']).next().unwrap_or_default();
        let known = TAGS.split_whitespace().any(|known| known == name);
        // The title is a tooltip inside a drawing and the page's name in its head.
        assert!(known, "{case}: unknown tag <{tag}>");
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "{case}: </{name}> closes another tag");
        } else if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
        for (attribute, value) in attributes(tag) {
            if DRAWN.contains(&attribute) {
                assert_drawable(value, &format!("{case}: <{tag}>"));
            }
        }
    }
    assert!(open.is_empty(), "{case}: never closed: {open:?}");
}

/// Numbers within what `coordinate` lets through, and nothing that stands for no number.
fn assert_drawable(value: &str, place: &str) {
    for word in value.split(|c: char| !c.is_ascii_alphabetic()) {
        let command = word.chars().all(|c| "MLHVZhvlz".contains(c));
        let known = ["translate", "rotate", "scale"].contains(&word);
        assert!(command || known, "{word:?} in {place}");
    }
    let separated = value.replace('-', " -");
    for number in separated.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')) {
        if !number.is_empty() {
            let number: f64 = number.parse().unwrap_or_else(|_| panic!("{number:?} in {place}"));
            assert!(number.abs() <= 1e4, "{number} in {place}");
        }
    }
}

/// The text of an HTML text node for `text`.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

/// Cells of every row of that name, in the order of the page.
pub(crate) fn cells(page: &str, name: &str) -> Vec<Vec<String>> {
    let row = format!("<tr><th scope=\"row\">{}</th>", escaped(name));
    let rows = page.split(&row).skip(1);
    rows.map(|rest| {
        let (row, _) = rest.split_once("</tr>").unwrap();
        let cells = row.split("<td>").skip(1);
        cells.map(|cell| cell.trim_end_matches("</td>").to_owned()).collect()
    })
    .collect()
}

/// The part of a page that is one figure.
pub(crate) fn figure<'a>(page: &'a str, id: &str) -> &'a str {
    let (_, rest) = page.split_once(&format!("<figure class=\"card\" id=\"{id}\">")).unwrap();
    rest.split_once("</figure>").unwrap().0
}

/// The drawing of a figure, without its legend.
pub(crate) fn drawing<'a>(page: &'a str, id: &str) -> &'a str {
    let (_, rest) = figure(page, id).split_once("<svg class=\"plot\"").unwrap();
    rest.split_once("</svg>").unwrap().0
}

/// Applies `change` to every string of a record that is a free text; `modes` are the words of
/// enumerations, which must stay.
pub(crate) fn change_strings<T: Serialize + DeserializeOwned>(
    record: &T,
    modes: &[&str],
    change: &mut impl FnMut(&str) -> String,
) -> T {
    fn walk(value: &mut Value, modes: &[&str], change: &mut impl FnMut(&str) -> String) {
        match value {
            Value::String(text) if !modes.contains(&text.as_str()) => *text = change(text),
            Value::Array(items) => items.iter_mut().for_each(|item| walk(item, modes, change)),
            Value::Object(map) => map.values_mut().for_each(|item| walk(item, modes, change)),
            _ => {}
        }
    }
    let mut value = serde_json::to_value(record).unwrap();
    walk(&mut value, modes, change);
    serde_json::from_value(value).unwrap()
}
