//! Values of flags that the library knows as types: how the command line spells them.

use clap::ValueEnum;
use clap::builder::PossibleValue;

use crate::policy::{Activation, OutputActivation};

impl ValueEnum for Activation {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Relu, Self::Tanh, Self::Silu]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Relu => "`max(0, x)`",
            Self::Tanh => "Hyperbolic tangent",
            Self::Silu => "`x / (1 + exp(-x))`",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

impl ValueEnum for OutputActivation {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Tanh, Self::Identity]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Tanh => "Hyperbolic tangent: controls in `[-1, 1]`",
            Self::Identity => "None",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}
