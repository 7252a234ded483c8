//! A certificate as a page of text.

use std::path::PathBuf;

use crate::rollout::PairControl;
use crate::rounding::{interval, lower, number, upper};
use crate::scenario::record::{Claim, GlobalRecord, GrowthOutcome, Record};

/// What the columns of the table are.
const TABLE: &str = "\
N scenarios were drawn, some failed; d: decision variables, the numbers that the scenarios bound;
epsilon: the risk asked for; beta: chance that the sample misleads; simple, exact: the N that either
bound asks for; risk: the one obtained, which N and the failures certify";
/// What the words below the table mean.
const WORDS: &str = "\
tier 0: in the target, 1: certified, 2: in the set that growth verified, 3: none of these; V_check: the
measure with its margins tightened, certified where positive; a pair: a start with a perturbed one beside
it, fresh where it is drawn anew; fixed shape: one number scales bounds that a pilot sample fixed";

/// What was claimed, with the numbers behind it, and where the files are.
pub(super) fn text(record: &Record, files: &[PathBuf]) -> String {
    let mut lines = vec![headline(record), String::new()];
    lines.extend(record.statements.iter().map(|statement| format!("* {statement}")));
    lines.extend(replayed(record));
    lines.push(String::new());
    lines.extend(table(record));
    lines.push(TABLE.to_owned());
    lines.push(String::new());
    let (inside, draws, what) = match record.global.share {
        Some(share) => (share.inside, share.draws, "fresh starts"),
        None => (record.global.accepted, record.global.draws, "draws"),
    };
    lines.push(format!(
        "certified set   {inside} of {draws} {what}, P(V_global) within {}",
        interval(record.global.share_interval)
    ));
    lines.push(format!("conditional     {}", conditional(&record.global)));
    lines
        .extend(record.enclosed.as_ref().map(|found| format!("enclosed        {}", found.short())));
    lines.push(format!("growth          {}", growth(record)));
    let state = &record.state;
    let check_margin = lower(state.check_margin);
    lines.push(format!("state           tier {}, V_check {check_margin}", state.tier));
    lines.push(WORDS.to_owned());
    let timing = &record.timing;
    lines.push(format!(
        "work            {} rollouts in {} s on {}",
        timing.rollouts,
        number(timing.wall_seconds),
        record.provenance.device
    ));
    let networks = record.provenance.networks.as_ref();
    lines.extend(networks.map(|words| format!("networks        {words}")));
    lines.extend(again(&record.global));
    let names = files.iter().map(|file| file.display().to_string());
    lines.push(format!("files           {}", names.collect::<Vec<_>>().join("\n                ")));
    lines.join("\n") + "\n"
}

/// That many pairs were decided in f64 and not in f32, since that is what takes the time.
fn again(global: &GlobalRecord) -> Option<String> {
    let many = 10 * global.f64_reruns > global.draws;
    many.then(|| {
        format!(
            "in f64          {} of {} pairs of the certified set, one at a time: f32 does not tell on which side of its \
             edge they are",
            global.f64_reruns, global.draws
        )
    })
}

/// What may be the matter where perturbed starts fail under controls that are not theirs.
fn replayed(record: &Record) -> Option<String> {
    let deviation = &record.deviation;
    (!record.holds && deviation.control == PairControl::Replay).then(|| {
        "* Perturbed starts are driven by the controls of the nominal one (`deviation.control = \"replay\"`): where \
         the plant is unstable they drift away. `--set deviation.control=closed-loop` lets the policy see them."
            .to_owned()
    })
}

/// System, policy and verdict.
fn headline(record: &Record) -> String {
    let verdict = match record.holds {
        true => "all claims obtained",
        false => "NOT all claims obtained",
    };
    let (system, policy) = (&record.system.name, &record.provenance.policy);
    let whole = record.whole_box.as_ref().map(|found| format!("; {}", found.verdict));
    let whole = whole.unwrap_or_default();
    let sought = record.looked_for().map_or_else(String::new, |found| format!("; {found}"));
    format!("{system} under {policy}, T = {}: {verdict}{sought}{whole}", record.horizon)
}

/// The counts behind each claim, a row each.
fn table(record: &Record) -> Vec<String> {
    let mut rows = vec![format!(
        "{:<12} {:>10} {:>8} {:>3} {:>8} {:>9} {:>8} {:>8} {:>10}",
        "claim", "N", "failed", "d", "epsilon", "beta", "simple", "exact", "risk"
    )];
    rows.extend(record.claims().into_iter().map(row));
    rows
}

/// The counts behind one claim.
fn row(claim: &Claim) -> String {
    let count = |count: Option<u64>| count.map_or("-".to_owned(), |count| count.to_string());
    let asked = claim.epsilon.map_or("-".to_owned(), upper);
    format!(
        "{:<12} {:>10} {:>8} {:>3} {:>8} {:>9} {:>8} {:>8} {:>10}",
        claim.name,
        claim.scenarios,
        claim.failures,
        claim.decision_vars,
        asked,
        upper(claim.beta_used),
        count(claim.required_simple),
        count(claim.required_exact),
        upper(claim.certified_risk)
    )
}

/// The failure of rollouts from the certified set, where it has any start.
fn conditional(global: &GlobalRecord) -> String {
    if global.accepted == 0 {
        return "no claim: no start that was drawn is certified".to_owned();
    }
    let claim = &global.claim;
    format!("failure inside it at most {} ({} failed)", upper(claim.certified_risk), claim.failures)
}

/// What came of local growth.
fn growth(record: &Record) -> String {
    let growth = &record.growth;
    let (rounds, set) = (growth.rounds.len(), growth.shape().with_article());
    match growth.outcome {
        GrowthOutcome::Verified if growth.upward.is_some() => {
            format!("verified {set} of radius {} in {rounds} rounds upward", lower(growth.radius))
        }
        GrowthOutcome::Exhausted if growth.upward.is_some() => {
            "exhausted: the first radius was refused".to_owned()
        }
        GrowthOutcome::Verified => {
            format!("verified {set} of radius {} in round {rounds}", lower(growth.radius))
        }
        GrowthOutcome::Exhausted => format!("exhausted: each of {rounds} rounds had a failure"),
        GrowthOutcome::NoBoundary => "no boundary of the certified set to grow from".to_owned(),
    }
}
