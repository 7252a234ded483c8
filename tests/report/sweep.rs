//! The sweep report as text: every number, escaping, self-containment, and records at the edge.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::page::{assert_sound, attributes, change_strings, drawing, escaped, figure, tags};
use crate::sweeps::{Axes, certificate_grid, certificates, judged, race_grid, races};
use reachcast::race::judge::Judge;
use reachcast::race::sweep::record::{CertificatePoint, PointResult, RacePoint, SweepRecord};
use reachcast::race::sweep_html;
use reachcast::scenario::record::GrowthOutcome;

/// The words of enumerations.
const MODES: [&str; 15] = [
    "study",
    "paper",
    "rigorous",
    "unsafe-start",
    "not-finite",
    "collision",
    "fence",
    "missed-gate",
    "overtaken",
    "timeout",
    "race",
    "certificate",
    "verified",
    "exhausted",
    "no-boundary",
];

/// A sound page with its table.
fn sound(record: &SweepRecord, case: &str) -> String {
    let page = sweep_html(record);
    assert_sound(&page, case);
    let tables = page.matches("<table class=\"sortable\">").count();
    assert_eq!(tables, usize::from(!record.points.is_empty()), "{case}");
    for word in ["NaN", "inf<", "inf ", "inf%", "inf\u{a0}"] {
        let (text, _) = page.split_once("<script>").unwrap();
        assert!(!text.contains(word), "{case}: {word}");
    }
    for (name, value) in tags(&page).into_iter().flat_map(attributes) {
        if name == "data-value" {
            assert!(value.parse::<f64>().unwrap().is_finite(), "{case}: {value}");
        }
    }
    page
}

/// The headings of the table of points, and the texts and numbers of a row.
fn row(page: &str, index: usize) -> Vec<(String, String, Option<f64>)> {
    let (_, table) = page.split_once("<table class=\"sortable\">").unwrap();
    let (head, body) = table.split_once("<tbody>").unwrap();
    let text = |cell: &str| cell.split_once('>').unwrap().1.split_once('<').unwrap().0.to_owned();
    let heads = head.split("<th scope").skip(1).map(text);
    let row = body.split("<tr>").nth(index + 1).unwrap();
    let row = row.replace("<th", "<td");
    let cells = row.split("<td").skip(1).map(|cell| {
        let value = attributes(cell.split_once('>').unwrap().0)
            .into_iter()
            .find(|(name, _)| *name == "data-value")
            .map(|(_, value)| value.parse().unwrap());
        (text(cell).replace('\u{a0}', " "), value)
    });
    heads.zip(cells).map(|(head, (text, value))| (head, text, value)).collect()
}

fn cell(page: &str, index: usize, head: &str) -> (String, Option<f64>) {
    let row = row(page, index);
    let cell = row.iter().find(|(name, ..)| name == head);
    let (_, text, value) = cell.unwrap_or_else(|| panic!("no column {head}: {row:?}"));
    (text.clone(), *value)
}

fn race(record: &mut SweepRecord, index: usize) -> &mut RacePoint {
    match &mut record.points[index].result {
        PointResult::Race(race) => race,
        PointResult::Certificate(_) => panic!("a sweep of races"),
    }
}

fn certificate(record: &mut SweepRecord, index: usize) -> &mut CertificatePoint {
    match &mut record.points[index].result {
        PointResult::Race(_) => panic!("a sweep of certificates"),
        PointResult::Certificate(certificate) => certificate,
    }
}

/// Gives a point this success rate under every judge, and this median latency in milliseconds.
fn set(record: &mut SweepRecord, index: usize, rate: f64, milliseconds: f64) {
    let race = race(record, index);
    race.judged = Judge::ALL.map(|judge| judged(judge, rate)).to_vec();
    race.judged.iter_mut().for_each(|judged| judged.rate = rate);
    race.latency.median_seconds = 1e-3 * milliseconds;
    race.latency.p95_seconds = 2e-3 * milliseconds;
    race.latency.p99_seconds = 3e-3 * milliseconds;
}

/// Four sample counts whose front has a known knee, and a fifth point that is dominated.
fn known() -> SweepRecord {
    let mut record = race_grid(&[("samples", &["8", "16", "32", "64", "128"])]);
    let points = [(0.30, 1.0), (0.60, 2.0), (0.66, 4.0), (0.68, 8.0), (0.65, 16.0)];
    for (index, (rate, milliseconds)) in points.into_iter().enumerate() {
        set(&mut record, index, rate, milliseconds);
    }
    record
}

#[test]
fn markup_in_a_record_is_text() {
    let hostile = "</title></svg><script>alert(\"x\")</script><img src='http://x'>&amp;";
    for record in [races(), certificates()] {
        let record = change_strings(&record, &MODES, &mut |_| hostile.to_owned());
        let page = sound(&record, "hostile");
        assert_eq!(page.matches("<script").count(), 1);
        assert!(!page.contains("<img"));
        assert!(page.matches(&escaped(hostile)).count() > 10);
    }
    let values: Axes<'_> =
        &[("noise", &["[0.2,0.4,0.4]", "colored:3", "<script>alert(1)</script>"])];
    let page = sound(&race_grid(values), "values");
    assert_eq!(page.matches("<script").count(), 1);
    for value in values[0].1 {
        assert!(page.contains(&escaped(value)), "{value}");
    }
}

#[test]
fn the_head_says_what_was_swept_and_how() {
    let page = sound(&races(), "as it is").replace('\u{a0}', " ");
    for text in [
        "<h1>27 points over samples and horizon</h1>",
        "<dt>controller</dt><dd>mppi</dd>",
        "<dt>samples</dt><dd>16, 32, 64, 128, 256, 512, 1024, 2048 and 4096</dd>",
        "500 starts (configs/race_starts_500.csv) with noise seeds 1 and 2.",
        "The judge is rigorous, under which 479 starts are safe before anyone moves: at most 95.8 %.",
        "Backend cpu, a test machine; seed 20260131; reachcast 0.1.0-test. Policy: three layers",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("points are done"));
    let mut partial = races();
    partial.points.truncate(13);
    let page = sound(&partial, "partial");
    assert!(page.contains("13 of 27 points are done"));
    assert!(page.contains("<h1>13 points over samples and horizon</h1>"));
}

#[test]
fn every_number_of_a_race_stands_in_its_column() {
    let mut record = races();
    set(&mut record, 4, 0.625, 1.234_56);
    let point = race(&mut record, 4);
    (point.effective_samples, point.best_cost) = (Some(12.345), Some(-3.25));
    (point.non_finite_samples, point.batch_seconds) = (1234, 0.000_25);
    point.judged[2].interval = [0.58, 0.67];
    point.judged[0].rate = 0.7;
    point.judged[2].failures[2].count = 321;
    let page = sound(&record, "numbers");
    for (head, text, value) in [
        ("point", "5", 5.0),
        ("samples", "32", 32.0),
        ("horizon", "20", 20.0),
        ("won", "62.5 %", 0.625),
        ("95 % interval", "58 to 67 %", 0.58),
        ("spread of seeds, points", "0.424", 0.004_24),
        ("latency, median ms", "1.235", 0.001_234_56),
        ("95th percentile, ms", "2.469", 0.002_469_12),
        ("99th percentile, ms", "3.704", 0.003_703_68),
        ("steps timed", "200", 200.0),
        ("share of a batch step, ms", "0.25", 0.000_25),
        ("effective samples", "12.35", 12.345),
        ("best cost", "−3.25", -3.25),
        ("samples not finite", "1,234", 1234.0),
        ("races", "1,000", 1000.0),
        ("collision", "321", 321.0),
        ("won, study judge", "70 %", 0.7),
        ("won, paper judge", "62.5 %", 0.625),
    ] {
        let (shown, sorted) = cell(&page, 4, head);
        assert_eq!(shown, text, "{head}");
        assert!((sorted.unwrap() - value).abs() < 1e-12, "{head}: {sorted:?}");
    }
    assert_eq!(cell(&page, 4, "controller"), ("mppi".to_owned(), None));
    // A controller without plans has no samples.
    race(&mut record, 0).effective_samples = None;
    let page = sound(&record, "no plans");
    assert_eq!(cell(&page, 0, "effective samples"), ("–".to_owned(), None));
}

#[test]
fn every_number_of_a_certificate_stands_in_its_column() {
    let mut record = certificates();
    let point = certificate(&mut record, 3);
    point.share_interval = [0.0659, 0.0781];
    (point.accepted, point.deviation_scenarios) = (1436, 159);
    (point.deviation_bound, point.radius, point.rounds) = (0.274_31, 0.138_79, 7);
    point.growth = GrowthOutcome::Verified;
    (point.conditional_risk, point.seconds) = (0.004_791, 0.312_34);
    let page = sound(&record, "numbers");
    for (head, text) in [
        ("epsilon", "0.02"),
        ("bound", "exact"),
        ("certified share", "7.18 %"),
        ("interval of the share", "6.59 to 7.81 %"),
        ("certified draws", "1,436"),
        ("draws", "20,000"),
        ("pairs N", "159"),
        ("deviation risk", "0.0086"),
        ("largest deviation bound", "0.2744"),
        ("failure risk in the set", "0.004791"),
        ("local growth", "verified"),
        ("radius", "0.1387"),
        ("rounds", "7"),
        ("every claim obtained", "yes"),
        ("beta of all claims", "0.004"),
        ("wall time, s", "0.3123"),
    ] {
        assert_eq!(cell(&page, 3, head).0, text, "{head}");
    }
}

#[test]
fn the_table_is_plain_without_the_script() {
    let page = sweep_html(&races());
    assert!(!page.contains("<button"));
    let (_, head) = page.split_once("<table class=\"sortable\"><thead><tr>").unwrap();
    let (head, body) = head.split_once("</thead>").unwrap();
    let columns = head.matches("<th scope=\"col\" data-order=").count();
    assert_eq!(head.matches("<th").count(), columns);
    let (body, _) = body.split_once("</tbody>").unwrap();
    assert_eq!(body.matches("<tr>").count(), 27);
    assert_eq!(body.matches("<th scope=\"row\"").count(), 27);
    assert_eq!(body.matches("<td").count(), 27 * (columns - 1));
    for (text, order) in [("samples", "number"), ("controller", "text"), ("won", "number")] {
        assert!(head.contains(&format!("data-order=\"{order}\">{text}</th>")), "{text}");
    }
}

#[test]
fn findings_follow_the_record() {
    let page = sound(&known(), "known").replace('\u{a0}', " ");
    assert!(page.contains("The best of 5 points is samples 64: 68 % (63.71 to 72.29 %), 8 ms"));
    // 60 % reaches to 64.5 %, 30 % does not.
    assert!(page.contains(
        "The fewest samples, and the lowest latency, whose interval overlaps that of the best \
         point: samples 16: 60 %"
    ));
    assert!(page.contains("The knee of the Pareto front is samples 16: 60 %"));
    let front = figure(&page, "figure-front");
    assert!(front.contains("The knee, samples 16, is the point of the front"));
    assert!(front.contains("the logarithm of the latency"));
    assert!(front.contains(">knee: samples 16</text>"));
    let drawn = drawing(&page, "figure-front");
    let (_, line) = drawn.split_once("class=\"front\" d=\"M").unwrap();
    assert_eq!(line.split_once('"').unwrap().0.split('L').count(), 4);
    assert_eq!(drawn.matches("class=\"spot").count(), 5);
    // A lower latency elsewhere, within the interval, is said apart.
    let mut record = known();
    set(&mut record, 2, 0.66, 1.5);
    let page = sound(&record, "apart").replace('\u{a0}', " ");
    assert!(
        page.contains(
            "The fewest samples whose interval overlaps that of the best point: samples 16"
        )
    );
    assert!(
        page.contains(
            "The lowest latency whose interval overlaps that of the best point: samples 32"
        )
    );
}

#[test]
fn fronts_of_few_points_have_no_knee() {
    let without = |count: usize, text: &str| {
        let mut record = known();
        record.points.truncate(count);
        let page = sound(&record, text);
        assert!(figure(&page, "figure-front").contains(text), "{text}");
        assert!(!page.contains("class=\"knee") && !page.contains("Knee of the front"));
    };
    without(1, "The front is a single point and has no knee.");
    without(2, "A front of two points has no knee.");
    let mut straight = known();
    straight.points.truncate(3);
    set(&mut straight, 1, 0.48, 2.0);
    set(&mut straight, 2, 0.66, 4.0);
    let page = sound(&straight, "on the chord");
    assert!(page.contains("No point of the front lies above the chord"));
    // Without a logarithm of 0 the chord is in latency itself.
    let mut zero = known();
    set(&mut zero, 0, 0.30, 0.0);
    let page = sound(&zero, "latency 0");
    assert!(page.contains("with latency and the success rate each scaled"));
    assert!(!figure(&page, "figure-latency").contains("logarithmic"));
}

/// Where the ticks with these texts stand along x.
fn across(drawing: &str, texts: &[&str]) -> Vec<f64> {
    let at = |text: &&str| -> f64 {
        let end = format!("text-anchor=\"middle\">{text}</text>");
        let (before, _) = drawing.split_once(&end).unwrap_or_else(|| panic!("no tick {text}"));
        let (_, tag) = before.rsplit_once("<text").unwrap();
        attributes(tag).iter().find(|(name, _)| *name == "x").unwrap().1.parse().unwrap()
    };
    texts.iter().map(at).collect()
}

#[test]
fn an_axis_of_more_than_a_decade_is_logarithmic() {
    let steps = |record: &SweepRecord, texts: &[&str]| -> Vec<f64> {
        let page = sweep_html(record);
        let at = across(drawing(&page, "figure-success"), texts);
        at.windows(2).map(|pair| pair[1] - pair[0]).collect()
    };
    let octaves = steps(&races(), &["16", "64", "256", "1024"]);
    assert!(octaves.iter().all(|step| (step - octaves[0]).abs() < 0.02), "{octaves:?}");
    // In the order of the numbers, not of the record.
    let tens = steps(&race_grid(&[("horizon", &["40", "10", "20"])]), &["10", "20", "40"]);
    assert!((tens[1] - 2.0 * tens[0]).abs() < 0.02, "{tens:?}");
}

#[test]
fn a_drawing_holds_every_point_and_its_interval() {
    let mut record = races();
    let point = race(&mut record, 13);
    (point.judged[2].rate, point.judged[2].interval) = (0.25, [0.125, 0.5]);
    let page = sound(&record, "as it is");
    let success = drawing(&page, "figure-success");
    assert_eq!(success.matches("class=\"spot").count(), 27);
    assert_eq!(success.matches("class=\"line hue-").count(), 3);
    assert_eq!(success.matches("class=\"band hue-").count(), 3);
    assert_eq!(success.matches("class=\"ceiling\"").count(), 1);
    // Axes 280 high from 14 down, 0 to 100: point 13 is the fifth of the second line.
    let (_, reach) = success.split_once("class=\"reach inner hue-1\" d=\"").unwrap();
    let reach = reach.split('M').nth(5).unwrap();
    let ends: Vec<f64> = reach
        .split(['L', '"'])
        .take(2)
        .map(|point| point.split(' ').nth(1).unwrap().parse().unwrap())
        .collect();
    assert_eq!(ends, [14.0 + 280.0 * 0.875, 14.0 + 280.0 * 0.5]);
    assert_eq!(drawing(&page, "figure-front").matches("class=\"spot").count(), 27);
    for (index, name) in ["horizon 10", "horizon 20", "horizon 30"].iter().enumerate() {
        let swatch = format!("class=\"spot hue-{index}\"");
        let legend = figure(&page, "figure-success").split_once("<ul").unwrap().1;
        let (before, _) = legend.split_once(&format!("<span>{name}</span>")).unwrap();
        assert!(before.rsplit_once("<li>").unwrap().1.contains(&swatch), "{name}");
    }
}

#[test]
fn heat_maps_show_each_cell_with_its_number() {
    let mut record = races();
    set(&mut record, 0, 0.111, 1.0);
    set(&mut record, 26, 0.888, 1.0);
    let page = sound(&record, "heat");
    let map = drawing(&page, "figure-heat");
    let cells = |map: &str| map.matches("class=\"cell ").count() - 16;
    assert_eq!(cells(map), 27);
    assert_eq!(map.matches("class=\"on ").count(), 27);
    // The colours go from 0 to 100 in sixteen steps.
    assert!(map.contains("<text class=\"on p2\" y=\"4.3\" text-anchor=\"middle\">11.1</text>"));
    assert!(map.contains("<text class=\"on p15\" y=\"4.3\" text-anchor=\"middle\">88.8</text>"));
    assert!(!page.contains("not run"));
    record.points.truncate(13);
    let page = sound(&record, "partial");
    let map = drawing(&page, "figure-heat");
    assert_eq!(map.matches("class=\"on ").count(), 13);
    assert_eq!(map.matches("class=\"cell nf\"").count(), 14);
    assert!(figure(&page, "figure-heat").contains("not run"));
    // One number is not enough, and a share of the box is mapped too.
    assert!(!sweep_html(&race_grid(&[("samples", &["16", "64"])])).contains("figure-heat"));
    let two: Axes<'_> = &[("epsilon", &["0.01", "0.1"]), ("radius", &["0.05", "0.1", "0.2"])];
    let page = sound(&certificate_grid(two), "certificates");
    assert_eq!(cells(drawing(&page, "figure-heat")), 6);
}

#[test]
fn what_a_figure_leaves_out_is_said() {
    let five: Axes<'_> = &[
        ("controller", &["mppi", "hybrid"]),
        ("samples", &["64", "256", "1024"]),
        ("noise", &["independent", "colored:3"]),
        ("sigma", &["0.1", "0.3"]),
        ("temperature", &["0.01", "1"]),
    ];
    let mut record = race_grid(five);
    // The best point: hybrid, 256, colored:3, 0.3, 0.01.
    set(&mut record, 38, 0.9, 1.0);
    let page = sound(&record, "five axes");
    let success = figure(&page, "figure-success");
    assert_eq!(success.matches("<div class=\"panel\">").count(), 2);
    assert!(
        success.contains("Shown is the slice at sigma 0.3, temperature 0.01, through the best")
    );
    let heat = figure(&page, "figure-heat");
    assert!(heat.contains("slice at controller hybrid, noise colored:3, temperature 0.01,"));
    assert!(heat.contains(">90.0</text>"));
    let many: Vec<String> = (1..=20).map(|value| value.to_string()).collect();
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    let page = sound(&race_grid(&[("samples", &["16", "64"]), ("horizon", &many)]), "many lines");
    let success = figure(&page, "figure-success");
    assert!(success.contains("Of the 20 values of horizon, steps, 6 are shown."));
    assert_eq!(success.matches("class=\"line hue-").count(), 6 + 6);
    assert_eq!(drawing(&page, "figure-front").matches("class=\"spot").count(), 40);
}

#[test]
fn certificates_have_their_own_figures_and_findings() {
    let mut record = certificates();
    certificate(&mut record, 5).accepted = 4000;
    certificate(&mut record, 5).share_interval = [0.19, 0.21];
    let ball = certificate(&mut record, 2);
    (ball.radius, ball.holds) = (0.5, false);
    let page = sound(&record, "certificates").replace('\u{a0}', " ");
    for id in ["figure-share", "figure-scenarios", "figure-deviation", "figure-growth"] {
        assert_eq!(figure(&page, id).matches("class=\"line hue-").count(), 2 + 2, "{id}");
    }
    assert!(!page.contains("figure-front") && !page.contains("Pareto"));
    let best = "at epsilon 0.05, bound exact: 20 % (19 to 21 %), with a failure risk of at most";
    assert!(page.contains(best));
    assert!(
        page.contains("The largest verified set has radius 0.5, at epsilon 0.02, bound scenario.")
    );
    assert!(page.contains("At 9 of 10 points every claim that was asked for was obtained."));
    assert!(page.contains("All 10 hold together with confidence at least 1 − 0.04;"));
    for index in 0..10 {
        let point = certificate(&mut record, index);
        (point.beta_total, point.radius, point.growth) = (0.2, 0.0, GrowthOutcome::NoBoundary);
    }
    let page = sound(&record, "no ball");
    assert!(page.contains("The betas of all 10 certificates sum to 2:"));
    assert!(page.contains("Local growth verified no set at any point."));
    assert_eq!(cell(&page, 0, "local growth").0, "no boundary");
}

/// A change that takes a record to an edge, and a word that the page must hold then.
type Edge = (&'static str, fn(&mut SweepRecord), &'static str);

const EDGES: [Edge; 12] = [
    ("no points", |record| record.points.clear(), "No point is done yet."),
    ("one point", |record| record.points.truncate(1), "The one point that was judged is"),
    ("no judge", |record| record.judge = None, "No point was judged."),
    ("no starts", |record| record.starts = None, "figure-success"),
    ("no ceilings", |record| record.starts.as_mut().unwrap().ceilings.clear(), "figure-success"),
    ("no noise seeds", |record| record.noise_seeds.clear(), "figure-success"),
    ("nothing won", |record| all(record, 0.0), "All 27 points won 0\u{a0}%."),
    ("everything won", |record| all(record, 1.0), "All 27 points won 100\u{a0}%."),
    (
        "no verdicts",
        |record| (0..27).for_each(|index| race(record, index).judged.clear()),
        "No point was judged.",
    ),
    (
        "rates that are not numbers",
        |record| {
            for judged in &mut race(record, 3).judged {
                (judged.rate, judged.interval) = (f64::NAN, [f64::NEG_INFINITY, 1e30]);
            }
        },
        "not finite",
    ),
    (
        "latencies that are not numbers",
        |record| {
            race(record, 3).latency.median_seconds = f64::NAN;
            race(record, 4).latency.p99_seconds = f64::INFINITY;
            race(record, 5).latency.median_seconds = 0.0;
            race(record, 6).best_cost = Some(f64::INFINITY);
        },
        "not finite",
    ),
    (
        "values that are on no axis",
        |record| record.points[3].values[1] = "12345".to_owned(),
        "<h1>27 points",
    ),
];

fn all(record: &mut SweepRecord, rate: f64) {
    (0..record.points.len()).for_each(|index| set(record, index, rate, 0.0));
}

#[test]
fn records_at_the_edge_still_make_a_page() {
    for (case, change, word) in EDGES {
        let mut record = races();
        change(&mut record);
        let page = sound(&record, case);
        assert!(page.contains(word), "{case}: no {word:?}");
    }
    let mut empty = certificates();
    empty.points.clear();
    assert!(sound(&empty, "no certificates").contains("Reachcast sweep of certificates"));
    let mut odd = certificates();
    let point = certificate(&mut odd, 0);
    (point.draws, point.accepted, point.radius) = (0, 0, f64::NAN);
    point.share_interval = [f64::NAN, f64::INFINITY];
    sound(&odd, "odd certificates");
}

#[test]
fn grids_of_any_shape_make_a_page() {
    let noise: &[&str] = &["independent", "colored:3", "spline:4"];
    let shapes: [Axes<'_>; 6] = [
        &[],
        &[("controller", &["mppi"])],
        &[("controller", &["mppi", "hybrid"])],
        &[("noise", noise), ("controller", &["mppi", "hybrid"]), ("sigma", &["[1,2,3]", "0.5"])],
        &[("temperature", &["0", "1e-3", "-1"])],
        &[("samples", &["64"]), ("noise", noise)],
    ];
    for shape in shapes {
        let case = format!("{shape:?}");
        for page in [sound(&race_grid(shape), &case), sound(&certificate_grid(shape), &case)] {
            // What is the same at all points is said, not drawn.
            let same = page.contains("The same at all points shown: ");
            assert!(page.contains("class=\"spot hue-0\"") || same, "{case}");
        }
    }
    // Words make rows with names, in their order, from top to bottom.
    let page = sweep_html(&race_grid(&[("noise", noise)]));
    let drawn = drawing(&page, "figure-success");
    let down = noise.iter().map(|name| -> f64 {
        let (before, _) = drawn.split_once(&format!(">{name}</text>")).unwrap();
        let (_, tag) = before.rsplit_once("<text").unwrap();
        attributes(tag).iter().find(|(name, _)| *name == "y").unwrap().1.parse().unwrap()
    });
    assert!(down.collect::<Vec<_>>().is_sorted());
}

#[test]
fn nothing_is_loaded_and_only_the_own_script_runs() {
    let page = sweep_html(&races());
    for tag in tags(&page) {
        for (name, value) in attributes(tag) {
            assert!(!["src", "srcset", "action", "style"].contains(&name), "<{tag}>");
            assert!(!name.starts_with("on"), "<{tag}>");
            assert!(name != "href" || value == "data:,", "<{tag}>");
        }
    }
    assert!(!page.contains("://") && !page.contains("@import"));
    for identity in page.split("url(#").skip(1) {
        let (identity, _) = identity.split_once(')').unwrap();
        assert_eq!(page.matches(&format!("id=\"{identity}\"")).count(), 1, "{identity}");
    }
    let policy = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
                  img-src data:";
    assert!(page.contains(&format!("content=\"{policy}\"")));
    assert_eq!(page.matches("<script").count(), 1);
}

#[test]
fn a_page_depends_on_the_record_alone() {
    for record in [races(), certificates()] {
        let page = sweep_html(&record);
        let stored = serde_json::to_string(&record).unwrap();
        assert_eq!(page, sweep_html(&serde_json::from_str(&stored).unwrap()));
    }
}
