//! The ledger of a certificate: what its claims may be wrong by together.

use super::ledger::{Entry, Ledger, Spend};
use super::record::Spending;
use super::settings::{DeviationSettings, Joint, Settings};
use crate::error::{Error, Result};

impl DeviationSettings {
    /// What the deviation bound spends over `horizon` steps: bounds of each step on its own are so many
    /// claims, each with its own beta. The one rule of certificates, races and sweeps.
    pub fn spent(&self, horizon: u32) -> f64 {
        match self.joint {
            Joint::Separate => f64::from(horizon) * self.beta,
            Joint::FixedShape | Joint::Variables | Joint::Bonferroni => self.beta,
        }
    }
}

/// What the line of the deviation bound is of.
fn bound_of(joint: Joint) -> &'static str {
    match joint {
        Joint::Separate => "bounds of each step",
        Joint::FixedShape | Joint::Variables | Joint::Bonferroni => "bound",
    }
}

/// The ledger of all claims; growth books every round it may take.
pub(super) fn ledger(settings: &Settings) -> Result<Ledger> {
    let growth = &settings.growth;
    let rounds = f64::from(growth.booked_rounds());
    let global = settings.global.beta;
    let whole_box =
        settings.whole_box.map(|asked| ("box", "interval of the failing share", asked.beta));
    let share = "interval of the certified share";
    let deterministic = settings.deterministic.map(|asked| ("deterministic", share, asked.beta));
    let sequential = settings.sequential.map(|asked| ("sequential", "at any time", asked.beta));
    let more: Vec<_> = whole_box
        .into_iter()
        .chain(drops_claims(settings))
        .chain(deterministic)
        .chain(sequential)
        .collect();
    let of_more: f64 = more.iter().map(|(.., beta)| beta).sum();
    let deviation = settings.deviation.spent(settings.spec.horizon);
    let budget = deviation + 2.0 * global + of_more + rounds * growth.round_beta();
    let mut ledger = Ledger::new(budget.min(1.0 - f64::EPSILON))?;
    let claims = [
        ("deviation", bound_of(settings.deviation.joint), deviation),
        ("global", "conditional failure", global),
        ("global", "interval of the certified share", global),
    ];
    let rounds =
        (0..growth.booked_rounds()).map(|round| ("growth", "round", round, growth.round_beta()));
    let once =
        claims.into_iter().chain(more).map(|(claim, purpose, beta)| (claim, purpose, 0, beta));
    for (claim, purpose, round, beta) in once.chain(rounds) {
        let entry =
            Entry { claim: claim.to_owned(), purpose: purpose.to_owned(), call: 0, round, beta };
        if let Spend::Refused { left } = ledger.spend(entry) {
            let problem = format!("the claims together spend more than 1 ({left} left)");
            return Err(Error::invalid("beta", problem));
        }
    }
    Ok(ledger)
}

/// The claims that margin drops make beside the certified set's.
fn drops_claims(settings: &Settings) -> Vec<(&'static str, &'static str, f64)> {
    let Some(asked) = &settings.drops else { return Vec::new() };
    let share = "interval of the share";
    let drops = [("drops", "bound", asked.sample.beta), ("drops", share, asked.sample.beta)];
    let calibration = asked
        .calibration
        .map(|sample| [("calibration", "level", sample.beta), ("calibration", share, sample.beta)]);
    drops.into_iter().chain(calibration.into_iter().flatten()).collect()
}

/// The ledger's lines as records.
pub(super) fn spendings(ledger: &Ledger) -> Vec<Spending> {
    let line = |entry: &Entry| Spending {
        claim: entry.claim.clone(),
        item: match entry.purpose.as_str() {
            "round" => format!("round {}", entry.round + 1),
            other => other.to_owned(),
        },
        beta: entry.beta,
    };
    ledger.entries().iter().map(line).collect()
}
