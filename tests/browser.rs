//! The report in headless Chromium: it opens without console messages, its figures have size, no
//! label is cut off or covered, and a phone's width is enough.
//!
//! To look at a report: `chromium --headless --no-sandbox --hide-scrollbars
//! --window-size=1400,1500 --screenshot=docs/report.png report.html`.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

mod records;

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use reachcast::report::html;
use reachcast::scenario::record::Record;
use serde_json::Value;

/// Debian's Chromium.
const CHROMIUM: &str = "/usr/bin/chromium";
/// A browser that hangs is killed after this.
const LIMIT: Duration = Duration::from_secs(120);
/// Phone and wide screen, in CSS pixels.
const WIDTHS: [u32; 2] = [400, 1600];
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

#[derive(Clone, Copy, PartialEq)]
enum Scheme {
    Light,
    Dark,
}

/// What the browser said: the document after loading, and its console.
struct Visit {
    document: String,
    console: Vec<String>,
}

/// Whether there is a browser; a machine that must have one fails here.
fn browser() -> bool {
    let found = Path::new(CHROMIUM).exists();
    let required = std::env::var("REACHCAST_REQUIRE_CHROMIUM").is_ok_and(|value| value == "1");
    assert!(found || !required, "{CHROMIUM} is missing: apt-get install chromium");
    if !found {
        println!("SKIPPED: no chromium");
    }
    found
}

fn visit(folder: &Path, page: &str, scheme: Scheme) -> Visit {
    let (document, log) = (folder.join("document"), folder.join("log"));
    let profile = tempfile::tempdir().unwrap();
    let color = if scheme == Scheme::Dark { 0 } else { 1 };
    let mut child = Command::new(CHROMIUM)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--allow-file-access-from-files", "--enable-logging=stderr"])
        .arg(format!("--blink-settings=preferredColorScheme={color}"))
        .arg(format!("--user-data-dir={}", profile.path().display()))
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

/// Writes the pages and a page that measures each of them at every width.
fn write_pages(folder: &Path, pages: &[String]) {
    let mut frames = String::new();
    for (index, page) in pages.iter().enumerate() {
        fs::write(folder.join(format!("{index}.html")), page).unwrap();
        for width in WIDTHS {
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
fn measured(visit: &Visit) -> Vec<Value> {
    let (_, rest) = visit.document.split_once("<pre id=\"measured\">").unwrap();
    let (json, _) = rest.split_once("</pre>").unwrap();
    serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {json}"))
}

/// The race, the double integrator, and the race under names longer than any line.
fn shown() -> Vec<Record> {
    let mut long = records::race();
    long.system.name = "a-name-without-any-place-to-break-it".repeat(6);
    long.provenance.policy = "PolicyOf".repeat(40);
    for axis in &mut long.system.states {
        axis.name = format!("{}_{}", axis.name, "very_long".repeat(12));
    }
    for body in &mut long.system.bodies {
        body.name = body.name.repeat(30);
    }
    vec![records::race(), records::double_integrator(), long]
}

#[test]
fn figures_have_size_and_labels_at_every_width_in_both_schemes() {
    if !browser() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let pages: Vec<String> = shown().iter().map(html).collect();
    write_pages(folder.path(), &pages);
    for scheme in [Scheme::Light, Scheme::Dark] {
        let visit = visit(folder.path(), "index.html", scheme);
        assert!(visit.console.is_empty(), "{:?}", visit.console);
        let measured = measured(&visit);
        assert_eq!(measured.len(), pages.len() * WIDTHS.len());
        for (index, page) in measured.iter().enumerate() {
            check(page, WIDTHS[index % WIDTHS.len()], scheme);
        }
    }
}

fn check(page: &Value, width: u32, scheme: Scheme) {
    assert_eq!(page["window"], width);
    let scroll = page["scroll"].as_u64().unwrap();
    assert!(scroll <= u64::from(width), "{scroll} px wide on a {width} px screen");
    let dark = light(page["background"].as_str().unwrap()) < 0.5;
    assert_eq!(dark, scheme == Scheme::Dark, "background {}", page["background"]);
    let figures = page["figures"].as_array().unwrap();
    assert_eq!(figures.len(), 5);
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

/// The page refuses scripts: one put into it by force does not run, and the console says so.
#[test]
fn the_page_runs_no_script_and_console_messages_are_seen() {
    if !browser() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let script = "<script>document.body.textContent = 'ran'</script></body>";
    let page = html(&records::race()).replace("</body>", script);
    fs::write(folder.path().join("index.html"), page).unwrap();
    let visit = visit(folder.path(), "index.html", Scheme::Light);
    assert_eq!(visit.console.len(), 1, "{:?}", visit.console);
    assert!(visit.console[0].contains("Content Security Policy"), "{:?}", visit.console);
    assert!(visit.document.contains("Reachcast certificate"));
}
