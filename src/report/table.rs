//! The tables of the page: every number that the record holds.

use super::text::{count, escape, interval, lower, number, or_dash, upper};
use super::words;
use crate::model::Form;
use crate::scenario::record::{Claim, Record};

/// A table in a box of its own that scrolls; the first row holds headings, cells are text.
pub(crate) fn table(title: &str, rows: &[Vec<String>]) -> String {
    let wide = rows.first().is_some_and(|head| head.len() > 3);
    sized(title, rows, if wide { " wide" } else { "" })
}

/// A table of numbers across the page: no number is broken.
pub(crate) fn across_page(title: &str, rows: &[Vec<String>]) -> String {
    sized(title, rows, " wide")
}

fn sized(title: &str, rows: &[Vec<String>], wide: &str) -> String {
    let row = |cells: &Vec<String>, head: bool| {
        let cells = cells.iter().enumerate().map(|(index, cell)| {
            let cell = escape(cell);
            match (head, index) {
                (true, _) => format!("<th scope=\"col\">{cell}</th>"),
                (false, 0) => format!("<th scope=\"row\">{cell}</th>"),
                (false, _) => format!("<td>{cell}</td>"),
            }
        });
        format!("<tr>{}</tr>", cells.collect::<String>())
    };
    let Some((head, body)) = rows.split_first() else {
        return String::new();
    };
    let body: String = body.iter().map(|cells| row(cells, false)).collect();
    format!(
        "<section class=\"numbers{wide}\"><h3>{title}</h3>\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\">\
         <table><thead>{}</thead><tbody>{body}</tbody></table></div></section>\n",
        row(head, true)
    )
}

/// A table of names and values.
pub(crate) fn pairs(title: &str, pairs: &[(&str, String)]) -> String {
    let head = vec!["quantity".to_owned(), "value".to_owned()];
    let rows = pairs.iter().map(|(name, value)| vec![(*name).to_owned(), value.clone()]);
    table(title, &std::iter::once(head).chain(rows).collect::<Vec<_>>())
}

/// The claims side by side.
pub(crate) fn claims(record: &Record) -> String {
    let claims = record.claims();
    let row = |name: &str, value: &dyn Fn(&Claim) -> String| {
        let values = claims.iter().map(|claim| value(claim));
        std::iter::once(name.to_owned()).chain(values).collect()
    };
    table(
        "Claims",
        &[
            row("quantity", &|claim| claim.name.clone()),
            row("risk obtained", &|claim| upper(claim.certified_risk)),
            row("risk asked for, epsilon", &|claim| or_dash(claim.epsilon.map(upper))),
            row("one minus confidence, beta", &|claim| upper(claim.beta)),
            row("beta of this draw", &|claim| upper(claim.beta_used)),
            row("scenarios N", &|claim| count(claim.scenarios)),
            row("failures k", &|claim| count(claim.failures)),
            row("decision variables d", &|claim| claim.decision_vars.to_string()),
            row("N asked by the simple bound", &|claim| or_dash(claim.required_simple.map(count))),
            row("N asked by the exact bound", &|claim| or_dash(claim.required_exact.map(count))),
            row("sampling measure", &|claim| claim.measure.clone()),
            row("coordinates that vary", &|claim| claim.dimension.to_string()),
            row("frozen coordinates", &|claim| {
                if claim.frozen.is_empty() { "none".to_owned() } else { claim.frozen.join(", ") }
            }),
        ],
    )
}

/// The tables of two or three columns.
pub(crate) fn narrow(record: &Record) -> String {
    [
        setting(record),
        deviation(record),
        certified_set(record),
        growth(record),
        state(record),
        ledger(record),
        provenance(record),
    ]
    .concat()
}

/// The tables that need the width of the page.
pub(crate) fn wide(record: &Record) -> String {
    [constants(record), rounds(record), system(record)].concat()
}

fn setting(record: &Record) -> String {
    let task = &record.system.task;
    // Of reach-avoid without a window the sentences say it all.
    let words = format!("{task}: a rollout that {}", task.words(Form::One, record.horizon));
    let task = (!task.is_plain()).then_some(("task", words));
    let rows = [
        ("horizon T", format!("{} steps", record.horizon)),
        ("discount gamma", number(record.gamma)),
        ("seed", record.provenance.seed.to_string()),
        ("generator", record.provenance.generator.clone()),
        ("backend", record.provenance.backend.clone()),
        ("device", record.provenance.device.clone()),
        ("wall time", format!("{} s", number(record.timing.wall_seconds))),
        ("threads", record.timing.threads.to_string()),
        ("rollouts", count(record.timing.rollouts)),
    ];
    let networks = record.provenance.networks.clone().map(|words| ("networks", words));
    pairs("Setting", &task.into_iter().chain(rows).chain(networks).collect::<Vec<_>>())
}

fn constants(record: &Record) -> String {
    let head = [
        "constant",
        "used",
        "from",
        "computed bound",
        "largest sampled gradient",
        "assumes continuity",
        "hulls",
    ];
    let flag = |flag: Option<bool>| or_dash(flag.map(|flag| if flag { "yes" } else { "no" }));
    let rows = [
        ("L_r of the target margin", &record.constants.target),
        ("L_c of the constraint margin", &record.constants.constraint),
    ]
    .map(|(name, constant)| {
        vec![
            name.to_owned(),
            upper(constant.used),
            constant.source.clone(),
            upper(constant.computed),
            lower(constant.sampled),
            flag(constant.assumed_continuous),
            flag(constant.hulled),
        ]
    });
    let [target, constraint] = rows;
    let task = &record.system.task;
    let rows = [task.has_target().then_some(target), task.has_constraint().then_some(constraint)];
    let head = std::iter::once(head.map(str::to_owned).to_vec());
    table("Lipschitz constants", &head.chain(rows.into_iter().flatten()).collect::<Vec<_>>())
}

fn deviation(record: &Record) -> String {
    let deviation = &record.deviation;
    pairs(
        "Deviation bound",
        &[
            ("radius around a nominal start", lower(deviation.radius)),
            ("perturbed rollouts", words::control(deviation.control).to_owned()),
            ("joint over the steps", words::joint(deviation.joint).to_owned()),
            ("the bound", words::source(deviation.source).to_owned()),
            ("pilot pairs", count(deviation.pilot)),
            ("scale of the fixed shape", or_dash(deviation.scale.map(upper))),
            ("support scenarios", count(deviation.support)),
            (
                "a posteriori risk (wait and judge; if no two pairs set the bound together)",
                upper(deviation.posterior_risk),
            ),
            ("pairs not finite", count(deviation.non_finite)),
        ],
    )
}

fn certified_set(record: &Record) -> String {
    let global = &record.global;
    let reached = match record.system.task.is_plain() {
        true => "perturbed starts that reach the target",
        false => "perturbed starts that succeed",
    };
    pairs(
        "Certified set",
        &[
            ("pairs drawn from the box", count(global.draws)),
            ("nominal starts with V_check > 0", count(global.accepted)),
            ("P(V_global)", interval(global.share_interval)),
            ("volume of the box", number(global.box_volume)),
            ("volume of V_global", interval(global.volume_interval)),
            (reached, count(global.reached)),
            ("failures that are not finite", count(global.non_finite)),
            ("measured f32 error of the measure", upper(global.f32_error)),
            ("band of f64 re-runs", lower(global.band)),
            ("f64 re-runs", count(global.f64_reruns)),
        ],
    )
}

fn state(record: &Record) -> String {
    let (state, task) = (&record.state, &record.system.task);
    let target = ("target margin", number(state.target_margin));
    let constraint = ("constraint margin", number(state.constraint_margin));
    let all = [
        Some(("tier", words::tier(record))),
        Some(("V_check", lower(state.check_margin))),
        task.has_target().then_some(target),
        task.has_constraint().then_some(constraint),
    ];
    pairs("The state of slice and growth", &all.into_iter().flatten().collect::<Vec<_>>())
}

fn growth(record: &Record) -> String {
    let growth = &record.growth;
    let [radius, volume] =
        ["radius", "volume"].map(|what| format!("{what} of the verified {}", words::grown(record)));
    pairs(
        "Local growth",
        &[
            ("centre on the boundary of", growth.around.words().to_owned()),
            ("centre from", words::boundary(growth.boundary).to_owned()),
            ("distance of the centre from the state", or_dash(growth.distance.map(number))),
            (&radius, lower(growth.radius)),
            (&volume, lower(growth.volume)),
            ("coordinates that vary", {
                growth.varies.iter().filter(|&&varies| varies).count().to_string()
            }),
        ],
    )
}

fn rounds(record: &Record) -> String {
    let head = ["round", "radius", "starts", "failures", "nearest", "not finite", "f64 re-runs"];
    let rows = record.growth.rounds.iter().enumerate().map(|(index, round)| {
        vec![
            (index + 1).to_string(),
            lower(round.radius),
            count(round.scenarios),
            count(round.failures),
            or_dash(round.nearest_failure.map(lower)),
            count(round.non_finite),
            count(round.f64_reruns),
        ]
    });
    let head = head.map(str::to_owned).to_vec();
    if record.growth.rounds.is_empty() {
        return String::new();
    }
    table("Rounds of growth", &std::iter::once(head).chain(rows).collect::<Vec<_>>())
}

fn ledger(record: &Record) -> String {
    let head = ["claim", "item", "beta spent"].map(str::to_owned).to_vec();
    let row = |claim: &str, item: &str, beta| vec![claim.to_owned(), item.to_owned(), beta];
    let lines = record.ledger.iter().map(|line| row(&line.claim, &line.item, upper(line.beta)));
    let total = row("total", "", upper(record.beta_total));
    let rows: Vec<_> = std::iter::once(head).chain(lines).chain([total]).collect();
    table("Ledger of beta", &rows)
}

fn provenance(record: &Record) -> String {
    let provenance = &record.provenance;
    pairs(
        "Provenance",
        &[
            ("reachcast", provenance.version.clone()),
            ("layout of the record", record.schema.to_string()),
            ("policy", provenance.policy.clone()),
            ("policy SHA-256", provenance.policy_sha256.clone()),
            ("physics SHA-256", provenance.physics_sha256.clone()),
        ],
    )
}

fn system(record: &Record) -> String {
    let set = words::grown(record);
    let (centre, within) = (format!("{set} centre"), format!("in the {set}"));
    let head = ["state", "unit", "box low", "box high", "at the state", &centre, &within];
    let region = record.constants.region.as_ref();
    let extra = region.map_or(&[][..], |_| &["constants from", "constants to"]);
    let side = |ends: &[f32], index: usize, outwards: fn(f64) -> String| {
        or_dash(ends.get(index).map(|&end| outwards(end.into())))
    };
    let at = |x: &[f32], index: usize| or_dash(x.get(index).map(|&value| number(value.into())));
    let rows = record.system.states.iter().enumerate().map(|(index, axis)| {
        let center = record.growth.center.as_deref().unwrap_or_default();
        let varies = record.growth.varies.get(index).copied().unwrap_or(true);
        let mut row = vec![
            axis.name.clone(),
            axis.unit.clone(),
            number(axis.low.into()),
            number(axis.high.into()),
            at(&record.state.x, index),
            at(center, index),
            if varies { "varies" } else { "frozen" }.to_owned(),
        ];
        // Rounded inwards: the constants hold there.
        row.extend(region.map(|region| side(&region.low, index, upper)));
        row.extend(region.map(|region| side(&region.high, index, lower)));
        row
    });
    let controls = record.system.controls.iter().map(|axis| {
        let mut row = vec![
            format!("control {}", axis.name),
            axis.unit.clone(),
            number(axis.low.into()),
            number(axis.high.into()),
            "–".to_owned(),
            "–".to_owned(),
            "–".to_owned(),
        ];
        row.extend(extra.iter().map(|_| "–".to_owned()));
        row
    });
    let head: Vec<String> = head.iter().chain(extra).map(|&name| name.to_owned()).collect();
    table(
        "States and controls",
        &std::iter::once(head).chain(rows).chain(controls).collect::<Vec<_>>(),
    )
}

/// The deviation bound step by step.
pub(crate) fn steps(record: &Record) -> String {
    let deviation = &record.deviation;
    let exact = deviation.exact.as_deref();
    let mut head = vec!["step".to_owned(), "bound used".to_owned(), "largest seen".to_owned()];
    head.extend(exact.map(|_| "exact supremum".to_owned()));
    let rows = deviation.bound.iter().enumerate().map(|(step, &bound)| {
        let at = |series: &[f64]| or_dash(series.get(step).map(|&value| upper(value)));
        let mut row = vec![step.to_string(), upper(bound), at(&deviation.largest)];
        row.extend(exact.map(at));
        row
    });
    table("Deviation at each step", &std::iter::once(head).chain(rows).collect::<Vec<_>>())
}
