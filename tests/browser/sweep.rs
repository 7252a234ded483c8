//! The sweep report in headless Chromium: legible at every width in both schemes, and its table
//! sorts both ways, by mouse and by keyboard.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::chromium::live::Live;
use crate::chromium::{browser, check_everywhere};
use crate::sweeps;
use reachcast::race::sweep::record::SweepRecord;
use reachcast::race::sweep_html;
use serde_json::{Value, json};

/// Phone, tablet and wide screen, in CSS pixels.
const WIDTHS: [u32; 3] = [400, 800, 1600];

fn check(records: &[SweepRecord], drawings: usize) {
    let pages: Vec<String> = records.iter().map(sweep_html).collect();
    check_everywhere(&pages, &WIDTHS, drawings);
}

/// The realistic sweep; one that was interrupted; one with names longer than any line.
#[test]
fn sweeps_of_races_fit_every_width_in_both_schemes() {
    if !browser() {
        return;
    }
    let mut partial = sweeps::races();
    partial.points.truncate(13);
    let mut long = sweeps::races();
    long.axes[2].name = "a-name-without-any-place-to-break-it".repeat(6);
    long.provenance.policy = "PolicyOf".repeat(40);
    long.provenance.device = "Device".repeat(40);
    // Success, latency, front, heat map, and a panel of failures for each horizon.
    check(&[sweeps::races(), partial, long], 7);
}

/// More lines than colours, more rows and columns than labels.
#[test]
fn long_axes_fit_every_width_in_both_schemes() {
    if !browser() {
        return;
    }
    let values: Vec<String> = (1..=40).map(|value| (25 * value).to_string()).collect();
    let values: Vec<&str> = values.iter().map(String::as_str).collect();
    let long: sweeps::Axes<'_> = &[("samples", &["16", "64"]), ("horizon", &values)];
    // Success, latency, front, heat map, six panels of failures.
    check(&[sweeps::race_grid(long)], 10);
    let wide: sweeps::Axes<'_> = &[("samples", &values), ("sigma", &["0.1", "0.2"])];
    // Too many bars to read.
    check(&[sweeps::race_grid(wide)], 4);
}

#[test]
fn grids_of_words_and_of_many_axes_fit_every_width() {
    if !browser() {
        return;
    }
    let noise: &[&str] = &["independent", "colored:3", "<script>alert(1)</script>"];
    let words = [("controller", &["mppi", "hybrid-no-policy", "hybrid"][..]), ("noise", noise)];
    // Rows of both measures, the front, and a panel of failures for each noise.
    check(&[sweeps::race_grid(&words)], 6);
    let five: sweeps::Axes<'_> = &[
        ("controller", &["mppi", "hybrid"]),
        ("samples", &["64", "256", "1024"]),
        ("noise", noise),
        ("sigma", &["0.1", "[0.2,0.4,0.4]"]),
        ("temperature", &["0.01", "1"]),
    ];
    // Three panels of both measures, the front, the heat map, two panels of failures.
    check(&[sweeps::race_grid(five)], 10);
    let one: sweeps::Axes<'_> = &[("controller", &["mppi"]), ("samples", &["64"])];
    check(&[sweeps::race_grid(one), sweeps::race_grid(&[])], 4);
}

#[test]
fn sweeps_of_certificates_fit_every_width_in_both_schemes() {
    if !browser() {
        return;
    }
    check(&[sweeps::certificates()], 4);
    let two: sweeps::Axes<'_> = &[
        ("epsilon", &["0.00125", "0.01", "0.1"]),
        ("radius", &["0.05", "0.1", "0.15", "0.2", "0.25", "0.3", "0.35"]),
    ];
    check(&[sweeps::certificate_grid(two)], 5);
}

/// The cells of a column, from top to bottom, and how it says it is sorted.
fn column(live: &mut Live, index: usize) -> (Vec<String>, Value) {
    let cells = format!(
        "[...document.querySelectorAll('table.sortable tbody tr')]\
         .map(row => row.cells[{index}].textContent)"
    );
    let cells = serde_json::from_value(live.value(&cells)).unwrap();
    let sorted = "[...document.querySelectorAll('table.sortable thead th')]\
                  .map(head => head.getAttribute('aria-sort'))";
    let sorted: Vec<Value> = serde_json::from_value(live.value(sorted)).unwrap();
    let others = sorted.iter().enumerate().filter(|(other, _)| *other != index);
    assert!(others.into_iter().all(|(_, sorted)| sorted.is_null()), "{sorted:?}");
    (cells, sorted[index].clone())
}

fn heading(index: usize) -> String {
    format!("document.querySelectorAll('table.sortable thead th')[{index}].firstChild")
}

/// A sweep whose rates and costs sort differently by number and by text.
fn uneven() -> SweepRecord {
    let axes: sweeps::Axes<'_> =
        &[("samples", &["100", "20", "3000"]), ("noise", &["spline:4", "colored:12", "colored:3"])];
    let mut record = sweeps::race_grid(axes);
    for (index, point) in record.points.iter_mut().enumerate() {
        let reachcast::race::sweep::record::PointResult::Race(race) = &mut point.result else {
            panic!("a sweep of races");
        };
        race.effective_samples = (index != 4).then_some([100.0, 9.5, 21.0][index % 3]);
    }
    record
}

#[test]
fn the_table_sorts_both_ways_by_mouse_and_keyboard() {
    if !browser() {
        return;
    }
    let page = sweep_html(&uneven());
    for width in [400, 1600] {
        let mut live = Live::open(&page, [width, 900]);
        let (grid, sorted) = column(&mut live, 1);
        assert_eq!(grid, ["100", "100", "100", "20", "20", "20", "3000", "3000", "3000"]);
        assert_eq!(sorted, Value::Null);
        // By number, and rows that are equal stay in their order.
        live.click(&heading(1));
        let (cells, sorted) = column(&mut live, 1);
        assert_eq!(cells, ["20", "20", "20", "100", "100", "100", "3000", "3000", "3000"]);
        assert_eq!(sorted, "ascending");
        let points = live.value(
            "[...document.querySelectorAll('table.sortable tbody th')].map(c => c.textContent)",
        );
        assert_eq!(points, json!(["4", "5", "6", "1", "2", "3", "7", "8", "9"]));
        live.click(&heading(1));
        let (cells, sorted) = column(&mut live, 1);
        assert_eq!(cells, ["3000", "3000", "3000", "100", "100", "100", "20", "20", "20"]);
        assert_eq!(sorted, "descending");
        // From heading to heading by tab; enter and space press it.
        live.key("Tab", 9, "");
        let focused = format!("document.activeElement === {}", heading(2));
        assert_eq!(live.value(&focused), true);
        live.key("Enter", 13, "\r");
        let (cells, sorted) = column(&mut live, 2);
        let [three, twelve, spline] = ["colored:3", "colored:12", "spline:4"];
        let expected = [three, three, three, twelve, twelve, twelve, spline, spline, spline];
        assert_eq!((cells, sorted), (expected.map(str::to_owned).to_vec(), json!("ascending")));
        live.key(" ", 32, " ");
        let (cells, sorted) = column(&mut live, 2);
        assert_eq!([&cells[0], &cells[8]], [spline, three]);
        assert_eq!(sorted, "descending");
    }
}

#[test]
fn what_has_no_number_is_sorted_last_both_ways() {
    if !browser() {
        return;
    }
    let mut live = Live::open(&sweep_html(&uneven()), [1600, 900]);
    let heads = "[...document.querySelectorAll('table.sortable thead th')]\
                 .map(head => head.textContent)";
    let heads: Vec<String> = serde_json::from_value(live.value(heads)).unwrap();
    let index = heads.iter().position(|head| head == "effective samples").unwrap();
    for expected in [["9.5", "21", "100"], ["100", "21", "9.5"]] {
        live.click(&heading(index));
        let (mut cells, _) = column(&mut live, index);
        assert_eq!(cells.pop().unwrap(), "–");
        cells.dedup();
        assert_eq!(cells, expected);
    }
}

/// Paper does not scroll, and nothing on it is unfolded. US letter and A4 on their side are 960 pixels
/// wide and more.
#[test]
fn printed_pages_are_whole() {
    if !browser() {
        return;
    }
    let mut long = sweeps::races();
    long.axes[2].name = "a-name-without-any-place-to-break-it".repeat(2);
    for record in [sweeps::races(), sweeps::certificates(), long] {
        let mut live = Live::open(&sweep_html(&record), [960, 900]);
        live.print();
        let cut = "[...document.querySelectorAll('.scroll, pre')].filter(e => \
                   e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1).length";
        assert_eq!(live.value(cut), 0);
        let folded = "[...document.querySelectorAll('details > :not(summary)')]\
                      .filter(e => !e.checkVisibility() || e.getBoundingClientRect().height < 1).length";
        assert_eq!(live.value(folded), 0);
        assert_eq!(live.value("document.querySelectorAll('.scroll.tall, details').length"), 2);
    }
}
