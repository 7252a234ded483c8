//! The beta ledger: what each claim of a run may be wrong by, and whether the budget allows more.

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// Slack of the budget, relative: M rounds of `beta / M` must fit in `beta` in spite of rounding.
const ROUNDING: f64 = 1e-12;

/// What betas come to: by the union bound, the chance that any of so many claims is wrong. Certificates,
/// races and sweeps sum with this.
pub fn total(betas: impl IntoIterator<Item = f64>) -> f64 {
    betas.into_iter().sum()
}

/// One expense: a chance `beta` of being wrong, and what it was taken for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The claim in few words, such as `deviation` or `local growth`.
    pub claim: String,
    /// The tier or the purpose that the claim serves.
    pub purpose: String,
    /// Number of the call within the run, from 0.
    pub call: u64,
    /// Number of the round within the call, from 0.
    pub round: u32,
    /// The chance that the claim is wrong.
    pub beta: f64,
}

/// Whether the budget allowed an expense.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub enum Spend {
    /// Entered; this much is left.
    Granted {
        /// Budget left after the expense.
        left: f64,
    },
    /// Not entered: the claim cannot be made within this budget.
    Refused {
        /// Budget left, less than was asked for.
        left: f64,
    },
}

/// Expenses of a run against its budget: by the union bound all claims hold together with
/// probability at least `1 - total`, section 8 of `docs/method.md`.
///
/// ```
/// use reachcast::scenario::ledger::{Entry, Ledger, Spend};
/// let mut ledger = Ledger::new(1e-3)?;
/// let entry = |round| Entry {
///     claim: "local growth".into(),
///     purpose: "tier 2".into(),
///     call: 0,
///     round,
///     beta: 5e-4,
/// };
/// assert!(matches!(ledger.spend(entry(0)), Spend::Granted { .. }));
/// assert!(matches!(ledger.spend(entry(1)), Spend::Granted { .. }));
/// assert!(matches!(ledger.spend(entry(2)), Spend::Refused { .. }));
/// assert_eq!(ledger.total(), 1e-3);
/// # Ok::<(), reachcast::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Record", try_from = "Record")]
pub struct Ledger {
    budget: f64,
    entries: Vec<Entry>,
}

impl Ledger {
    /// An empty ledger.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the budget is outside (0, 1).
    pub fn new(budget: f64) -> Result<Self, Error> {
        if !(budget > 0.0 && budget < 1.0) {
            let problem = format!("{budget} is not strictly between 0 and 1");
            return Err(Error::invalid("beta budget", problem));
        }
        Ok(Self { budget, entries: Vec::new() })
    }

    /// Enters an expense if the budget allows it; an expense that is not positive never is.
    pub fn spend(&mut self, entry: Entry) -> Spend {
        let left = self.budget - self.total();
        if !(entry.beta > 0.0 && entry.beta <= left + ROUNDING * self.budget) {
            return Spend::Refused { left };
        }
        self.entries.push(entry);
        Spend::Granted { left: (self.budget - self.total()).max(0.0) }
    }

    /// What may be spent in all.
    pub fn budget(&self) -> f64 {
        self.budget
    }

    /// What has been spent.
    pub fn total(&self) -> f64 {
        total(self.entries.iter().map(|entry| entry.beta))
    }

    /// The expenses, in order.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }
}

/// The ledger as files hold it: with its total, which is checked when it is read.
#[derive(Serialize, Deserialize)]
struct Record {
    budget: f64,
    total: f64,
    entries: Vec<Entry>,
}

impl From<Ledger> for Record {
    fn from(ledger: Ledger) -> Self {
        Self { budget: ledger.budget, total: ledger.total(), entries: ledger.entries }
    }
}

impl TryFrom<Record> for Ledger {
    type Error = Error;

    fn try_from(record: Record) -> Result<Self, Error> {
        let mut ledger = Self::new(record.budget)?;
        for entry in record.entries {
            let beta = entry.beta;
            if let Spend::Refused { left } = ledger.spend(entry) {
                let problem = format!("the beta ledger spends {beta} with {left} left");
                return Err(Error::Refused(problem));
            }
        }
        let total = ledger.total();
        if (total - record.total).abs() <= ROUNDING * record.budget {
            return Ok(ledger);
        }
        let problem =
            format!("the entries of the beta ledger sum to {total}, not {}", record.total);
        Err(Error::Refused(problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(round: u32, beta: f64) -> Entry {
        Entry {
            claim: "local growth".to_owned(),
            purpose: "tier 2".to_owned(),
            call: 3,
            round,
            beta,
        }
    }

    /// Equal shares fit whatever their number: rounding must not refuse the last one.
    #[test]
    fn equal_shares_fit_and_no_more() {
        for rounds in 1..200 {
            let mut ledger = Ledger::new(1e-3).unwrap();
            for round in 0..rounds {
                let spend = ledger.spend(entry(round, 1e-3 / f64::from(rounds)));
                assert!(matches!(spend, Spend::Granted { .. }), "{round} of {rounds}");
            }
            let over = ledger.spend(entry(rounds, 1e-9));
            assert!(matches!(over, Spend::Refused { .. }));
            assert_eq!(ledger.entries().len(), rounds as usize);
        }
    }

    #[test]
    fn what_is_left_is_the_difference() {
        let mut ledger = Ledger::new(0.5).unwrap();
        assert_eq!(ledger.spend(entry(0, 0.125)), Spend::Granted { left: 0.375 });
        assert_eq!(ledger.spend(entry(1, 0.5)), Spend::Refused { left: 0.375 });
        assert_eq!(ledger.total(), 0.125);
        for bad in [0.0, -0.1, f64::NAN] {
            assert!(matches!(ledger.spend(entry(1, bad)), Spend::Refused { .. }));
            assert!(Ledger::new(bad).is_err());
        }
    }

    #[test]
    fn reads_back_what_it_wrote_and_refuses_what_does_not_add_up() {
        let mut ledger = Ledger::new(1e-3).unwrap();
        assert!(matches!(ledger.spend(entry(0, 2e-4)), Spend::Granted { .. }));
        let text = serde_json::to_string(&ledger).unwrap();
        assert!(text.contains("\"total\":0.0002"), "{text}");
        assert_eq!(serde_json::from_str::<Ledger>(&text).unwrap(), ledger);
        for (from, to) in [("\"total\":0.0002", "\"total\":0.0001"), ("0.0002", "0.2")] {
            let forged = text.replace(from, to);
            assert!(serde_json::from_str::<Ledger>(&forged).is_err(), "{forged}");
        }
    }
}
