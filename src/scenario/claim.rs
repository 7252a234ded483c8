//! A claim: what was drawn, what failed, and what follows.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What was drawn, what failed, and what follows: the core of every claim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, remote = "Self")]
pub struct Claim {
    /// Name: `deviation`, `global` or `growth`.
    pub name: String,
    /// The claim in words.
    pub statement: String,
    /// The sampling measure in words.
    pub measure: String,
    /// Number of coordinates that vary.
    pub dimension: usize,
    /// Names of the frozen coordinates.
    pub frozen: Vec<String>,
    /// Scenarios N that count.
    pub scenarios: u64,
    /// Failures k among them.
    pub failures: u64,
    /// Decision variables d.
    pub decision_vars: u32,
    /// Risk asked for; none of the conditional claim, which says the risk that its sample gives. As JSON
    /// a number in either case: where none was asked for, the risk obtained.
    #[serde(serialize_with = "crate::files::number::serialize", deserialize_with = "present")]
    pub epsilon: Option<f64>,
    /// One minus the confidence asked for, before any split.
    #[serde(with = "crate::files::number")]
    pub beta: f64,
    /// Beta of this very draw, after the split over rounds or steps.
    #[serde(with = "crate::files::number")]
    pub beta_used: f64,
    /// Scenarios that the simple bound asks for; absent where it does not apply.
    pub required_simple: Option<u64>,
    /// Scenarios that the exact bound asks for; absent where it does not apply.
    pub required_exact: Option<u64>,
    /// Risk obtained: what N and k certify at `beta_used`.
    #[serde(with = "crate::files::number")]
    pub certified_risk: f64,
}

impl Claim {
    /// The risk that the claim states: the one asked for, and where none was, the one obtained.
    pub fn stated_risk(&self) -> f64 {
        self.epsilon.unwrap_or(self.certified_risk)
    }

    /// Whether the risk obtained is at most the one asked for, where one was.
    pub fn is_obtained(&self) -> bool {
        self.epsilon.is_none_or(|asked| self.certified_risk <= asked)
    }
}

/// A number, which may not be left out as an option may.
fn present<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    crate::files::number::deserialize::<f64, D>(from).map(Some)
}

impl Serialize for Claim {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let epsilon = Some(self.stated_risk());
        Self::serialize(&Self { epsilon, ..self.clone() }, to)
    }
}

impl<'de> Deserialize<'de> for Claim {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut claim = Self::deserialize(from)?;
        // Scenarios are asked for by a risk that is. An edited risk stays, so that it is found.
        let asked = claim.required_exact.is_some() || claim.epsilon != Some(claim.certified_risk);
        claim.epsilon = claim.epsilon.filter(|_| asked);
        Ok(claim)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A claim of which `epsilon` was asked for, and the exact bound asked for scenarios.
    fn claim(epsilon: Option<f64>, required_exact: Option<u64>) -> Claim {
        Claim {
            name: "global".to_owned(),
            statement: String::new(),
            measure: String::new(),
            dimension: 2,
            frozen: Vec::new(),
            scenarios: 66,
            failures: 0,
            decision_vars: 1,
            epsilon,
            beta: 1e-3,
            beta_used: 1e-3,
            required_simple: None,
            required_exact,
            certified_risk: 0.0994,
        }
    }

    #[test]
    fn json_holds_one_number_for_both_kinds_of_claims() {
        for (asked, exact, written) in
            [(Some(0.1), Some(66), 0.1), (Some(0.0994), Some(66), 0.0994), (None, None, 0.0994)]
        {
            let claim = claim(asked, exact);
            let text = serde_json::to_string(&claim).unwrap();
            let document: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(document["epsilon"], json!(written), "{text}");
            assert_eq!(document.as_object().unwrap().len(), 14, "{text}");
            assert_eq!(serde_json::from_str::<Claim>(&text).unwrap(), claim);
            assert_eq!(serde_json::from_value::<Claim>(document).unwrap(), claim);
        }
    }

    /// Whatever a file says is what is written again, so that a comparison sees every edit.
    #[test]
    fn an_edited_risk_is_not_taken_for_the_one_obtained() {
        let plain = serde_json::to_value(claim(None, None)).unwrap();
        for (field, value) in
            [("epsilon", json!(0.2)), ("certified_risk", json!(0.2)), ("required_exact", json!(66))]
        {
            let mut edited = plain.clone();
            edited[field] = value;
            let read: Claim = serde_json::from_value(edited.clone()).unwrap();
            assert_ne!(read, claim(None, None), "{field}");
            assert_eq!(serde_json::to_value(read).unwrap(), edited, "{field}");
        }
    }

    #[test]
    fn a_claim_without_a_risk_is_refused() {
        let mut document = serde_json::to_value(claim(None, None)).unwrap();
        document["epsilon"] = Value::Null;
        assert!(serde_json::from_value::<Claim>(document.clone()).is_err());
        document.as_object_mut().unwrap().remove("epsilon");
        let refused = serde_json::from_value::<Claim>(document).unwrap_err().to_string();
        assert!(refused.contains("missing field `epsilon`"), "{refused}");
    }

    #[test]
    fn a_risk_is_obtained_at_most_as_asked() {
        assert!(claim(Some(0.0994), Some(66)).is_obtained() && claim(None, None).is_obtained());
        assert!(!claim(Some(0.0993), Some(66)).is_obtained());
    }
}
