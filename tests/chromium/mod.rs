//! Headless Chromium: pages are shown at several widths, measured, and their console is read.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

pub(crate) mod live;

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Debian's Chromium.
const CHROMIUM: &str = "/usr/bin/chromium";
/// A browser that hangs is killed after this.
const LIMIT: Duration = Duration::from_secs(120);
/// Smallest legible label on screen, CSS pixels: ten is what browsers and platforms advise.
const LEGIBLE: f64 = 10.0;

/// Shows a page at a width in a frame of its own and writes down what it measures.
const MEASURE: &str = r#"
function measure(frame) {
  const page = frame.contentDocument, view = frame.contentWindow;
  const box = element => element.getBoundingClientRect();
  const meets = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const name = element => element.textContent.replace(/[<>&]/g, '?');
  const figure = svg => {
    const texts = [...svg.querySelectorAll('text')], area = box(svg);
    const scale = area.width / svg.viewBox.baseVal.width;
    const cut = texts.filter(text => { const b = box(text);
      return b.left < area.left - 1 || b.right > area.right + 1
        || b.top < area.top - 1 || b.bottom > area.bottom + 1; });
    const covered = texts.filter((a, i) => texts.some((b, j) => j < i && meets(box(a), box(b))));
    return { id: svg.closest('figure').id, width: area.width, height: area.height,
      cut: cut.map(name), covered: covered.map(name), labels: texts.length,
      smallest: Math.min(...texts.map(t => scale * parseFloat(view.getComputedStyle(t).fontSize))) };
  };
  const root = page.documentElement;
  return { scroll: root.scrollWidth, window: view.innerWidth,
    background: view.getComputedStyle(page.body).backgroundColor,
    figures: [...page.querySelectorAll('svg.plot')].map(figure) };
}
window.onload = () => {
  const frames = [...document.querySelectorAll('iframe')];
  document.getElementById('measured').textContent = JSON.stringify(frames.map(measure));
};
"#;

/// The reader's setting.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Scheme {
    Light,
    Dark,
}

/// What the browser said: the document after loading, and its console.
pub(crate) struct Visit {
    pub(crate) document: String,
    pub(crate) console: Vec<String>,
}

/// Whether there is a browser; a machine that must have one fails here.
pub(crate) fn browser() -> bool {
    let found = Path::new(CHROMIUM).exists();
    let required = std::env::var("REACHCAST_REQUIRE_CHROMIUM").is_ok_and(|value| value == "1");
    assert!(found || !required, "{CHROMIUM} is missing: apt-get install chromium");
    if !found {
        println!("SKIPPED: no chromium");
    }
    found
}

pub(crate) fn visit(folder: &Path, page: &str, scheme: Scheme) -> Visit {
    visit_for(folder, page, scheme, Duration::ZERO)
}

/// As [`visit`], with the page's own clock run ahead by `wait` before it is read.
pub(crate) fn visit_for(folder: &Path, page: &str, scheme: Scheme, wait: Duration) -> Visit {
    let (document, log) = (folder.join("document"), folder.join("log"));
    let profile = tempfile::tempdir().unwrap();
    let color = if scheme == Scheme::Dark { 0 } else { 1 };
    let mut child = Command::new(CHROMIUM)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--allow-file-access-from-files", "--enable-logging=stderr"])
        .arg(format!("--blink-settings=preferredColorScheme={color}"))
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args((!wait.is_zero()).then(|| format!("--virtual-time-budget={}", wait.as_millis())))
        .args(["--dump-dom", &format!("file://{}", folder.join(page).display())])
        .stdin(Stdio::null())
        .stdout(File::create(&document).unwrap())
        .stderr(File::create(&log).unwrap())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > LIMIT {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("chromium did not finish within {LIMIT:?}");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let log = fs::read_to_string(log).unwrap();
    assert!(status.success(), "chromium failed: {status}\n{log}");
    let console = log.lines().filter(|line| line.contains("CONSOLE"));
    Visit {
        document: fs::read_to_string(document).unwrap(),
        console: console.map(str::to_owned).collect(),
    }
}

/// Writes the pages and `index.html`, which measures each of them at every width.
pub(crate) fn write_pages(folder: &Path, pages: &[String], widths: &[u32]) {
    let mut frames = String::new();
    for (index, page) in pages.iter().enumerate() {
        fs::write(folder.join(format!("{index}.html")), page).unwrap();
        for width in widths {
            frames += &format!(
                "<iframe src=\"{index}.html\" style=\"width:{width}px;height:900px;border:0\">\
                 </iframe>"
            );
        }
    }
    let page = format!(
        "<!doctype html><meta charset=\"utf-8\"><pre id=\"measured\"></pre>{frames}\
         <script>{MEASURE}</script>"
    );
    fs::write(folder.join("index.html"), page).unwrap();
}

/// What was measured of each page at each width.
pub(crate) fn measured(visit: &Visit) -> Vec<Value> {
    let (_, rest) = visit.document.split_once("<pre id=\"measured\">").unwrap();
    let (json, _) = rest.split_once("</pre>").unwrap();
    serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {json}"))
}

/// No scrolling, the right background, and `count` drawings whose labels are whole and legible.
pub(crate) fn check(page: &Value, width: u32, scheme: Scheme, count: usize) {
    assert_eq!(page["window"], width);
    let scroll = page["scroll"].as_u64().unwrap();
    assert!(scroll <= u64::from(width), "{scroll} px wide on a {width} px screen");
    let dark = light(page["background"].as_str().unwrap()) < 0.5;
    assert_eq!(dark, scheme == Scheme::Dark, "background {}", page["background"]);
    let figures = page["figures"].as_array().unwrap();
    assert_eq!(figures.len(), count);
    for figure in figures {
        let number = |key: &str| figure[key].as_f64().unwrap();
        assert!(number("width") > 0.0 && number("height") > 0.0, "{figure}");
        assert!(number("width") <= f64::from(width), "{figure}");
        assert!(number("labels") >= 4.0, "{figure}");
        assert!(number("smallest") >= LEGIBLE, "{width} px: {figure}");
        assert_eq!(figure["cut"], serde_json::json!([]), "{width} px: {figure}");
        assert_eq!(figure["covered"], serde_json::json!([]), "{width} px: {figure}");
    }
}

/// Mean of the channels of `rgb(r, g, b)`, between 0 and 1.
fn light(color: &str) -> f64 {
    let channels = color.split(|character: char| !character.is_ascii_digit());
    let channels: Vec<f64> = channels.filter_map(|channel| channel.parse().ok()).collect();
    channels.iter().take(3).sum::<f64>() / 3.0 / 255.0
}

/// Shows `pages` at every width in both schemes; each has to fit with its `drawings` drawings, and
/// the console has to stay empty.
pub(crate) fn check_everywhere(pages: &[String], widths: &[u32], drawings: usize) {
    let folder = tempfile::tempdir().unwrap();
    write_pages(folder.path(), pages, widths);
    for scheme in [Scheme::Light, Scheme::Dark] {
        let visit = visit(folder.path(), "index.html", scheme);
        assert!(visit.console.is_empty(), "{:?}", visit.console);
        let measured = measured(&visit);
        assert_eq!(measured.len(), pages.len() * widths.len());
        for (index, page) in measured.iter().enumerate() {
            check(page, widths[index % widths.len()], scheme, drawings);
        }
    }
}
