//! Values of options that lower floors define, as the command line spells and explains them.

use clap::ValueEnum;
use clap::builder::PossibleValue;
use serde::Serialize;

use crate::config::Profile;
use crate::train::settings::Method;

/// What a policy is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(super) enum Target {
    /// An ONNX graph, which imports as the same policy
    Onnx,
    /// NumPy arrays under the names of the policy file, its metadata as JSON in bytes
    Npz,
}

impl Target {
    /// Ending of its files.
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Onnx => "onnx",
            Self::Npz => "npz",
        }
    }
}

impl ValueEnum for Profile {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Paper, Self::Study, Self::Rigorous]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Paper => "The experiment as printed in the paper",
            Self::Study => "The experiment as the authors' published code does it",
            Self::Rigorous => "The same experiment with sound constants and accounting",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

impl ValueEnum for Method {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Analytic, Self::Value, Self::ActionValue, Self::Ddpg, Self::Ppo]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Analytic => {
                "A policy, by back-propagation of the softened measure through the known dynamics"
            }
            Self::Value => "V(x), the measure of the policy's rollout from a state",
            Self::ActionValue => "Q(x, u), the measure after a first control",
            Self::Ddpg => {
                "A policy against a disturbance, both by the critic of the reach-avoid backup"
            }
            Self::Ppo => "A policy, by proximal policy optimisation on an ordinary reward",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}
