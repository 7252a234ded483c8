//! A search beside the claim of a certificate: a failure is compared with the risk, not with none.

use serde::Serialize;

use super::pairs::PairSettings;
use super::record::FalsifyRecord;
use crate::rollout::{Region, RolloutSpec};
use crate::rounding::{lower, upper};
use crate::scenario::bound::lower_bound;
use crate::scenario::record::{Claim, Record};
use crate::scenario::sets::tightening;
use crate::scenario::tier::verified_set;

/// Chance that uniform draws call a true claim false.
const FALSE_ALARM: f64 = 1e-6;

/// Where starts are looked for, and what a certificate claims about them.
#[derive(Clone, Debug)]
pub struct Target {
    /// The starts.
    pub region: Region,
    /// The same in words.
    pub words: String,
    /// Pairs that are drawn with them, where the claim is about pairs.
    pub pairs: Option<PairSettings>,
    /// What is claimed about a start drawn from there, if anything.
    pub claim: Option<Claim>,
}

impl Target {
    /// The set that the local growth of `record` verified, of a model with so many states.
    ///
    /// # Errors
    /// A sentence where none was verified.
    pub fn ball(record: &Record, states: usize) -> Result<Self, String> {
        match verified_set(&record.growth, states) {
            Some(region) => Ok(Self {
                words: format!(
                    "the verified {} of radius {}",
                    record.growth.shape().name(),
                    lower(record.growth.radius)
                ),
                region,
                pairs: None,
                claim: record.growth.claim.clone(),
            }),
            None => {
                Err("the certificate verified no set by growth; look within its box (--within box)"
                    .to_owned())
            }
        }
    }

    /// The pairs of `record` whose nominal start is certified.
    ///
    /// # Errors
    /// As [`Target::whole_box`], and a sentence of a set that is enclosed: what is certified there is not
    /// told by a rollout of the nominal start.
    pub fn certified(record: &Record, spec: &RolloutSpec) -> Result<Self, String> {
        if let Some(enclosed) = &record.enclosed {
            return Err(format!(
                "the certified set is enclosed by `{}`, which holds for every perturbation within {}: no \
                 search among them; look within its box (--within box), or try it with `check`",
                enclosed.kind.name(),
                lower(enclosed.radius)
            ));
        }
        let pairs = PairSettings {
            radius: record.deviation.radius as f32,
            control: record.deviation.control,
            tightening: tightening(record, spec),
        };
        Ok(Self {
            words: "the perturbed starts of the certified set".to_owned(),
            pairs: Some(pairs),
            claim: Some(record.global.claim.clone()),
            ..Self::whole_box(record)?
        })
    }

    /// The box of `record`.
    ///
    /// # Errors
    /// A sentence where it has no extent.
    pub fn whole_box(record: &Record) -> Result<Self, String> {
        let side = |of: fn(&crate::system::Axis) -> f32| -> Vec<f32> {
            record.system.states.iter().map(of).collect()
        };
        let region = Region::new_box(side(|axis| axis.low), side(|axis| axis.high));
        Ok(Self {
            region: region.map_err(|error| error.to_string())?,
            words: "the box".to_owned(),
            pairs: None,
            claim: record.whole_box.as_ref().map(|found| found.claim.clone()),
        })
    }
}

/// The claim of a certificate about starts, beside the uniform draws among them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Against {
    /// Name of the claim.
    pub claim: String,
    /// The risk that it states.
    #[serde(with = "crate::files::number")]
    pub risk: f64,
    /// What the uniform draws show the risk to be at least, with confidence 1 - 1e-6.
    #[serde(with = "crate::files::number")]
    pub at_least: f64,
    /// Whether that is more than the claim states.
    pub refuted: bool,
    /// The comparison in words.
    pub words: String,
}

impl Against {
    /// Compares `claim` with what `found` saw.
    pub fn new(claim: &Claim, found: &FalsifyRecord) -> Self {
        let FalsifyRecord { uniform, uniform_failures, .. } = *found;
        let (risk, name) = (claim.certified_risk, &claim.name);
        let at_least = lower_bound(uniform_failures, uniform, FALSE_ALARM);
        let refuted = at_least > risk;
        let single = match found.found {
            true => "one start that fails does not contradict it",
            false => "that none was found does not confirm it",
        };
        let verdict = match refuted {
            true => "more than is claimed: the claim is refuted",
            false => "which does not contradict the claim",
        };
        let words = format!(
            "the claim `{name}` is that such a start, drawn at random, fails with probability at most \
             {}: {single}. Of the {uniform} uniform draws {uniform_failures} fail: a probability of \
             at least {} with confidence 1 - {FALSE_ALARM:e}, {verdict}",
            upper(risk),
            lower(at_least)
        );
        Self { claim: name.clone(), risk, at_least, refuted, words }
    }
}
