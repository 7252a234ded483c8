//! The ledger of a certificate: what its claims may be wrong by together.

use super::ledger::{Entry, Ledger, Spend};
use super::record::Spending;
use super::settings::Settings;
use crate::error::{Error, Result};

/// The ledger of all claims; growth books every round it may take.
pub(super) fn ledger(settings: &Settings) -> Result<Ledger> {
    let growth = &settings.growth;
    let rounds = f64::from(growth.booked_rounds());
    let global = settings.global.beta;
    let budget = settings.deviation.beta + 2.0 * global + rounds * growth.round_beta();
    let sequential = settings.sequential.map_or(0.0, |asked| asked.beta);
    let mut ledger = Ledger::new((budget + sequential).min(1.0 - f64::EPSILON))?;
    let claims = [
        ("deviation", "bound", settings.deviation.beta),
        ("global", "conditional failure", global),
        ("global", "interval of the certified share", global),
    ];
    let rounds =
        (0..growth.booked_rounds()).map(|round| ("growth", "round", round, growth.round_beta()));
    let once = claims.into_iter().map(|(claim, purpose, beta)| (claim, purpose, 0, beta));
    let sequential = settings.sequential.map(|asked| ("sequential", "at any time", 0, asked.beta));
    for (claim, purpose, round, beta) in once.chain(rounds).chain(sequential) {
        let entry =
            Entry { claim: claim.to_owned(), purpose: purpose.to_owned(), call: 0, round, beta };
        if let Spend::Refused { left } = ledger.spend(entry) {
            let problem = format!("the claims together spend more than 1 ({left} left)");
            return Err(Error::invalid("beta", problem));
        }
    }
    Ok(ledger)
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
