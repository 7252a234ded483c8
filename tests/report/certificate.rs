//! The report as text: escaping, completeness, self-containment, and records at the edge.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::page;
use crate::page::{attributes, cells, change_strings, drawing, escaped, figure, tags};
use crate::records;
use reachcast::report::html;
use reachcast::scenario::record::{GrowthOutcome, Record};

/// A sound page with all five figures.
fn assert_sound(page: &str, case: &str) {
    page::assert_sound(page, case);
    assert_eq!(page.matches("<figure ").count(), 5, "{case}");
}

/// The words of enumerations.
const MODES: [&str; 7] =
    ["replay", "fixed-shape", "scenario", "verified", "exhausted", "rays", "no-boundary"];

#[test]
fn markup_in_a_record_is_text() {
    let hostile = "</title></svg><script>alert(\"x\")</script><img src='http://x'>&amp;";
    let mut count = 0;
    let record = change_strings(&records::race(), &MODES, &mut |_| {
        count += 1;
        hostile.to_owned()
    });
    assert!(count > 60, "{count} strings in the record");
    let page = html(&record);
    assert_sound(&page, "hostile");
    assert!(!page.contains("<script") && !page.contains("<img"));
    assert!(page.matches(&escaped(hostile)).count() > 40);
}

#[test]
fn every_text_of_the_record_is_there() {
    for record in [records::race(), records::double_integrator()] {
        let mut texts = Vec::new();
        change_strings(&record, &MODES, &mut |text| {
            texts.push(text.to_owned());
            text.to_owned()
        });
        let page = html(&record);
        for text in texts {
            // The claims in words are the statements; a claim's own sentence repeats them.
            let own = text.ends_with("claim in words.");
            assert!(own || page.contains(&escaped(&text)), "missing: {text}");
        }
        for statement in &record.statements {
            assert!(page.contains(&format!("<li>{}</li>", escaped(statement))));
        }
    }
}

#[test]
fn every_number_stands_in_its_row() {
    let page = html(&records::race());
    let one = |name: &str, expected: &str| {
        let rows = cells(&page, name);
        assert!(rows.contains(&vec![expected.to_owned()]), "{name}: {expected} not in {rows:?}");
    };
    let claims = |name: &str, expected: [&str; 3]| {
        assert_eq!(cells(&page, name), [expected.map(str::to_owned).to_vec()], "{name}");
    };
    claims("risk obtained", ["0.0426", "0.0119", "0.0571"]);
    claims("risk asked for, epsilon", ["0.1", "0.1", "0.1"]);
    claims("one minus confidence, beta", ["0.001"; 3]);
    claims("beta of this draw", ["0.0002"; 3]);
    claims("scenarios N", ["159", "1,377", "159"]);
    claims("failures k", ["0", "4", "0"]);
    claims("decision variables d", ["1"; 3]);
    claims("N asked by the simple bound", ["191", "–", "191"]);
    claims("N asked by the exact bound", ["81", "–", "81"]);
    claims("frozen coordinates", ["none"; 3]);
    one("horizon T", "30 steps");
    one("discount gamma", "0.95");
    one("seed", "20260131");
    one("wall time", "1.235 s");
    one("threads", "2");
    one("rollouts", "123,456");
    one("pilot pairs", "1,000");
    one("scale of the fixed shape", "1.037");
    one("support scenarios", "1");
    one("a posteriori risk (wait and judge; if no two pairs set the bound together)", "0.0723");
    one("pairs not finite", "0");
    one("pairs drawn from the box", "100,000");
    one("nominal starts with V_check > 0", "1,377");
    one("P(V_global)", "0.01261 to 0.01502");
    one("volume of the box", "73.73");
    one("volume of V_global", "0.9297 to 1.108");
    one("perturbed starts that reach the target", "31,415");
    one("failures that are not finite", "3");
    one("measured f32 error of the measure", "7.3e-7");
    one("band of f64 re-runs", "2.92e-6");
    one("f64 re-runs", "17");
    one("radius of the verified ball", "0.2831");
    one("volume of the verified ball", "0.007312");
    let row = |name: &str, expected: &[&str]| {
        let rows = cells(&page, name);
        assert!(rows.iter().any(|row| row == expected), "{name}: {expected:?} not in {rows:?}");
    };
    row("L_r of the target margin", &["14.15", "computed", "14.15", "14.11", "no", "no"]);
    row("total", &["", "0.004"]);
    row("growth", &["5 rounds at 2e-4", "0.001"]);
    row("1", &["0.55", "159", "23", "0.4313", "0", "2"]);
    row("3", &["0.2831", "159", "0", "–", "0", "2"]);
    row("ego_y", &["m", "-3.2", "0", "-2.2", "-1.93", "varies"]);
    row("0", &["0.1", "0.09", "0.108"]);
}

#[test]
fn nothing_is_loaded_from_anywhere() {
    let page = html(&records::race());
    for tag in tags(&page) {
        for (name, value) in attributes(tag) {
            assert!(!["src", "srcset", "action", "style"].contains(&name), "<{tag}>");
            assert!(!name.starts_with("on"), "<{tag}>");
            assert!(name != "href" || value == "data:,", "<{tag}>");
        }
    }
    assert!(!page.contains("://") && !page.contains("@import"));
    let local = page.matches("url(#").count();
    assert_eq!(page.matches("url(").count(), local);
    for identity in page.split("url(#").skip(1) {
        let (identity, _) = identity.split_once(')').unwrap();
        assert_eq!(page.matches(&format!("id=\"{identity}\"")).count(), 1, "{identity}");
    }
    assert!(page.contains("default-src 'none'"));
}

#[test]
fn a_page_depends_on_the_record_alone() {
    let record = records::race();
    let page = html(&record);
    assert_eq!(page, html(&record));
    let stored = serde_json::to_string(&record).unwrap();
    assert_eq!(page, html(&serde_json::from_str(&stored).unwrap()));
    let mut later = record;
    later.timing.wall_seconds = 2.5;
    assert_eq!(page.replace("1.235 s", "2.5 s"), html(&later));
}

#[test]
fn a_claim_that_was_not_obtained_is_named() {
    let page = html(&records::race());
    assert!(page.contains("Every claim that was asked for was obtained."));
    assert!(!page.contains("not obtained"));
    let record = records::double_integrator();
    let page = html(&record);
    assert!(page.contains("Not obtained: local growth."));
    let mut record = records::race();
    record.holds = false;
    assert!(html(&record).contains("Not every claim that was asked for was obtained."));
    record.deviation.claim.certified_risk = 0.11;
    assert!(html(&record).contains("Not obtained: deviation bound."));
}

#[test]
fn starts_are_marked_by_outcome() {
    let record = records::double_integrator();
    let page = html(&record);
    let drawn = drawing(&page, "figure-certified");
    let samples = &record.growth.samples;
    let failed = samples.iter().filter(|sample| !sample.success).count();
    assert!(failed > 0);
    assert_eq!(drawn.matches("class=\"bad-line\"").count(), failed);
    assert_eq!(drawn.matches("class=\"good\"").count(), samples.len() - failed);
}

#[test]
fn the_ball_is_drawn_as_the_plane_cuts_it() {
    let half = |page: &str| {
        let drawn = drawing(page, "figure-certified").to_owned();
        let (_, rest) = drawn.split_once("<ellipse class=\"ball\"").unwrap();
        let tag = rest.split_once('>').unwrap().0.to_owned();
        let value = |name: &str| -> f64 {
            let attributes = attributes(&tag);
            attributes.iter().find(|(other, _)| *other == name).unwrap().1.parse().unwrap()
        };
        [value("rx"), value("ry")]
    };
    // In the plane of the slice the centre's velocity ego_vy is 0.04 off the state's.
    let mut record = records::race();
    let off = half(&html(&record));
    record.growth.center.as_mut().unwrap()[3] = record.state.x[3];
    let page = html(&record);
    let within = half(&page);
    assert!((within[0] - within[1]).abs() < 0.011, "a circle: {within:?}");
    let radius = record.growth.radius;
    let expected = (radius * radius - 0.04 * 0.04).sqrt() / radius;
    // Coordinates are rounded to a hundredth: two of them in a ratio of lengths near 40.
    assert!((off[0] / within[0] - expected).abs() < 0.01 / within[0], "{off:?} {within:?}");
    assert!(!drawing(&page, "figure-certified").contains("class=\"shadow\""));
    // A centre further off than the radius leaves only the shadow.
    record.growth.center.as_mut().unwrap()[5] = 0.5;
    let page = html(&record);
    let drawn = drawing(&page, "figure-certified");
    assert!(drawn.contains("class=\"shadow\"") && !drawn.contains("class=\"ball"));
}

/// The ball goes far beyond the slice: the frame holds it with all of its starts.
#[test]
fn the_frame_holds_the_ball_and_its_starts() {
    let mut record = records::double_integrator();
    let width = record.slice.x.values.last().unwrap() - record.slice.x.values[0];
    let reach = 4.0 * width;
    record.growth.outcome = GrowthOutcome::Verified;
    record.growth.radius = f64::from(reach);
    let center = record.growth.center.clone().unwrap();
    for (number, sample) in record.growth.samples.iter_mut().enumerate() {
        let angle = number as f32;
        sample.x = vec![center[0] + reach * angle.cos(), center[1] + reach * angle.sin()];
    }
    let page = html(&record);
    let drawn = drawing(&page, "figure-certified");
    let tag = |start: &str| drawn.split_once(start).unwrap().1.split_once('>').unwrap().0;
    let value = |tag: &str, name: &str| -> f64 {
        attributes(tag).iter().find(|(other, _)| *other == name).unwrap().1.parse().unwrap()
    };
    let (ball, frame) = (tag("<ellipse class=\"ball\""), tag("<rect class=\"frame\""));
    for [middle, half, low, length] in [["cx", "rx", "x", "width"], ["cy", "ry", "y", "height"]] {
        let (middle, half) = (value(ball, middle), value(ball, half));
        let (low, length) = (value(frame, low), value(frame, length));
        assert!(middle - half > low && middle + half < low + length, "{ball} in {frame}");
    }
    let marks = drawn.matches("class=\"good\"").count() + drawn.matches("\"bad-line\"").count();
    assert_eq!(marks, record.growth.samples.len());
    assert!(figure(&page, "figure-certified").contains("The slice ends where it is grey"));
}

/// Swatches of areas stand beside a drawing that has them, and beside no other.
#[test]
fn a_legend_names_what_is_drawn() {
    let legend = |page: &str, id: &str, class: &str| {
        let (_, legend) = figure(page, id).split_once("class=\"legend\"").unwrap();
        legend.contains(&format!("class=\"{class}\""))
    };
    let swatches = [("target-area target", "target-area"), ("hatched constraint", "hatched")];
    let mut seen = [0; 2];
    for margin in [None, Some(-1.0), Some(1.0)] {
        for mut record in [records::race(), records::double_integrator()] {
            if let Some(margin) = margin {
                fill(&mut record.slice.target_margin, margin);
                fill(&mut record.slice.constraint_margin, margin);
            }
            let page = html(&record);
            for id in ["figure-certified", "figure-paths"] {
                for (swatch, area) in swatches {
                    let drawn = drawing(&page, id).contains(&format!("class=\"{area}\""));
                    assert_eq!(legend(&page, id, swatch), drawn, "{id}: {swatch}, {margin:?}");
                    seen[usize::from(drawn)] += 1;
                }
            }
        }
    }
    assert!(seen.iter().all(|count| *count > 3), "{seen:?}");
}

#[test]
fn it_is_said_where_rollouts_begin() {
    let record = records::double_integrator();
    let page = html(&record);
    let others = record.picture.rollouts.len() - 1;
    let grown = others.min(record.growth.samples.len());
    let words = format!("They begin: the first at the state and {grown} at starts drawn from the");
    assert!(figure(&page, "figure-paths").contains(&words), "{}", figure(&page, "figure-paths"));
}

#[test]
fn an_unverified_ball_is_dashed_and_no_boundary_has_none() {
    let mut record = records::double_integrator();
    let page = html(&record);
    let drawn = drawing(&page, "figure-certified");
    assert!(drawn.contains("class=\"ball unverified\"") && !drawn.contains("class=\"ball\""));
    record.growth.outcome = GrowthOutcome::NoBoundary;
    let page = html(&record);
    assert!(!figure(&page, "figure-certified").contains("class=\"ball"));
}

#[test]
fn the_colour_of_a_cell_is_its_sign() {
    let mut record = records::race();
    record.slice.x.values.truncate(2);
    record.slice.y.values.truncate(1);
    record.slice.check_margin = vec![-1.0, 1.0];
    record.slice.target_margin.truncate(2);
    record.slice.constraint_margin.truncate(2);
    let page = html(&record);
    let drawn = drawing(&page, "figure-value");
    let (cells, _) = drawn.split_once("class=\"frame\"").unwrap();
    assert!(cells.contains("cell n16") && cells.contains("cell p16"));
    assert_eq!(cells.matches("class=\"cell").count(), 2);
}

/// A change that takes a record to an edge.
type Edge = (&'static str, fn(&mut Record));

const EDGES: [Edge; 20] = [
    ("all negative", |record| fill(&mut record.slice.check_margin, -2.0)),
    ("all zero", |record| fill(&mut record.slice.check_margin, 0.0)),
    ("constant margins", |record| {
        fill(&mut record.slice.target_margin, 1.0);
        fill(&mut record.slice.constraint_margin, 1.0);
    }),
    ("no slice value finite", |record| fill(&mut record.slice.check_margin, -1e30)),
    ("some slice values not finite", |record| {
        record.slice.check_margin[7] = f32::NAN;
        record.slice.target_margin[9] = f32::INFINITY;
        record.slice.constraint_margin[9] = -1e30;
    }),
    ("bound not finite", |record| {
        record.deviation.bound[5..].fill(f64::NAN);
        record.deviation.largest[9..].fill(1e30);
        record.deviation.exact.as_mut().unwrap().fill(f64::INFINITY);
    }),
    ("no bound finite", |record| {
        record.deviation.bound.fill(1e30);
        record.deviation.largest.fill(f64::NAN);
        record.deviation.exact = None;
    }),
    ("no steps", |record| {
        record.deviation.bound.clear();
        record.deviation.largest.clear();
    }),
    ("one cell", |record| {
        record.slice.x.values.truncate(1);
        record.slice.y.values.truncate(1);
        record.slice.check_margin.truncate(1);
        record.slice.target_margin.truncate(1);
        record.slice.constraint_margin.truncate(1);
    }),
    ("no cells", |record| record.slice.x.values.clear()),
    ("cells that do not fit", |record| record.slice.check_margin.truncate(3)),
    ("states that are not there", |record| record.slice.x.state = 99),
    ("no rollouts", |record| record.picture.rollouts.clear()),
    ("a rollout that explodes", |record| {
        record.picture.rollouts[0].states[9].fill(1e12);
        record.picture.rollouts[0].states[10].fill(f32::NAN);
        record.picture.rollouts[1].states.clear();
        record.picture.rollouts[2].states[3].clear();
    }),
    ("no rounds", |record| record.growth.rounds.clear()),
    ("no centre", |record| {
        record.growth.center = None;
        record.growth.distance = None;
        record.growth.samples.clear();
    }),
    ("forty rounds", |record| {
        let round = record.growth.rounds[0].clone();
        record.growth.rounds = vec![round; 40];
    }),
    ("far starts", |record| {
        record.growth.samples[0].x.fill(1e9);
        record.growth.samples[1].x.fill(f32::NAN);
        record.growth.radius = 1e9;
    }),
    ("no words", |record| {
        record.statements.clear();
        record.system.name.clear();
        record.system.states.iter_mut().for_each(|axis| axis.name.clear());
    }),
    ("one varying axis", |record| record.growth.varies.fill(false)),
];

fn fill(values: &mut [f32], value: f32) {
    values.fill(value);
}

#[test]
fn records_at_the_edge_still_make_a_page() {
    for record in [records::race(), records::double_integrator()] {
        assert_sound(&html(&record), "as it is");
        for (case, change) in EDGES {
            let mut record = record.clone();
            change(&mut record);
            assert_sound(&html(&record), case);
        }
    }
}

#[test]
fn what_is_not_finite_is_said() {
    let mut record = records::race();
    record.deviation.bound[4] = 1e30;
    record.slice.check_margin[0] = -1e30;
    let page = html(&record);
    assert!(figure(&page, "figure-deviation").contains("From step 4 on the bound is not finite."));
    assert!(figure(&page, "figure-value").contains("not finite: a failure"));
    assert_eq!(cells(&page, "4").last().unwrap()[0], "not finite");
}
