//! Activations: their words, their formulas and what they may be at most.

mod range;
#[cfg(feature = "train")]
mod slope;

use std::fmt;
use std::str::FromStr;

use crate::real::Real;
use crate::real::bound::Interval;

/// Below it SiLU is 0 to f64: the formula stops there, so that minus infinity has its limit.
const LOWEST: f32 = -40.0;
/// The same of GELU.
const LOWEST_NORMAL: f32 = -9.0;
/// The same where a factor is a bare exponential, which f32 still has at -103.
const LOWEST_EXPONENT: f32 = -105.0;
/// What other programs call some of them.
const OTHER_NAMES: [(&str, &str); 8] = [
    ("swish", "silu"),
    ("linear", "identity"),
    ("none", "identity"),
    ("logistic", "sigmoid"),
    ("lrelu", "leaky_relu"),
    ("htanh", "hardtanh"),
    ("geluapproximate", "gelu_tanh"),
    ("clip", "hardtanh"),
];
/// Beyond it 1 makes no difference.
const FAR: f32 = 1e30;

/// What follows the sums of a layer, number by number.
///
/// Parameters are those of PyTorch, whose defaults go without saying in the text form: `elu` is `elu(1)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Activation {
    /// `x`.
    Identity,
    /// `max(0, x)`.
    Relu,
    /// `x`, below 0 `slope x`.
    LeakyRelu {
        /// By default 0.01.
        slope: f32,
    },
    /// `x`, below 0 `alpha (exp(x) - 1)`.
    Elu {
        /// Not negative; by default 1.
        alpha: f32,
    },
    /// `elu` with two constants of its own, which keep mean and variance.
    Selu,
    /// `x`, below 0 `alpha (exp(x / alpha) - 1)`.
    Celu {
        /// Positive; by default 1.
        alpha: f32,
    },
    /// `x` times the standard normal distribution function.
    Gelu,
    /// `x (1 + tanh(sqrt(2 / pi) (x + 0.044715 x^3))) / 2`.
    GeluTanh,
    /// `x / (1 + exp(-x))`.
    Silu,
    /// `x tanh(ln(1 + exp(x)))`.
    Mish,
    /// Hyperbolic tangent.
    Tanh,
    /// `1 / (1 + exp(-x))`.
    Sigmoid,
    /// `ln(1 + exp(beta x)) / beta`.
    Softplus {
        /// Positive; by default 1.
        beta: f32,
    },
    /// `x / (1 + |x|)`.
    Softsign,
    /// `x` within two limits.
    Hardtanh {
        /// By default -1.
        low: f32,
        /// By default 1.
        high: f32,
    },
    /// `x` within 0 and 6.
    Relu6,
}

impl Activation {
    /// Scale and alpha of SELU.
    pub(crate) const SELU: [f32; 2] = [1.050_701, 1.673_263_2];
    /// `sqrt(2 / pi)`, and its product with 0.044715.
    pub(crate) const GELU_TANH: [f32; 2] = [0.797_884_6, 0.035_677_407];

    /// Each kind, with its default parameters.
    pub const ALL: [Self; 16] = [
        Self::Identity,
        Self::Relu,
        Self::LeakyRelu { slope: 0.01 },
        Self::Elu { alpha: 1.0 },
        Self::Selu,
        Self::Celu { alpha: 1.0 },
        Self::Gelu,
        Self::GeluTanh,
        Self::Silu,
        Self::Mish,
        Self::Tanh,
        Self::Sigmoid,
        Self::Softplus { beta: 1.0 },
        Self::Softsign,
        Self::Hardtanh { low: -1.0, high: 1.0 },
        Self::Relu6,
    ];

    /// The words of all kinds, for messages.
    pub fn words() -> String {
        Self::ALL.map(Self::word).join(", ")
    }

    /// The text form: the word, and the parameters where they are not the defaults.
    pub fn name(self) -> String {
        self.to_string()
    }

    /// The word of its kind.
    fn word(self) -> &'static str {
        match self {
            Self::Identity => "identity",
            Self::Relu => "relu",
            Self::LeakyRelu { .. } => "leaky_relu",
            Self::Elu { .. } => "elu",
            Self::Selu => "selu",
            Self::Celu { .. } => "celu",
            Self::Gelu => "gelu",
            Self::GeluTanh => "gelu_tanh",
            Self::Silu => "silu",
            Self::Mish => "mish",
            Self::Tanh => "tanh",
            Self::Sigmoid => "sigmoid",
            Self::Softplus { .. } => "softplus",
            Self::Softsign => "softsign",
            Self::Hardtanh { .. } => "hardtanh",
            Self::Relu6 => "relu6",
        }
    }

    /// Its parameters, in the order of the text form.
    pub(crate) fn parameters(self) -> Vec<f32> {
        match self {
            Self::LeakyRelu { slope } => vec![slope],
            Self::Elu { alpha } | Self::Celu { alpha } => vec![alpha],
            Self::Softplus { beta } => vec![beta],
            Self::Hardtanh { low, high } => vec![low, high],
            _ => Vec::new(),
        }
    }

    /// The kind with other parameters, as many as it has.
    fn with(self, parameters: &[f32]) -> Option<Self> {
        Some(match (self, parameters) {
            (kind, []) => kind,
            (Self::LeakyRelu { .. }, &[slope]) => Self::LeakyRelu { slope },
            (Self::Elu { .. }, &[alpha]) => Self::Elu { alpha },
            (Self::Celu { .. }, &[alpha]) => Self::Celu { alpha },
            (Self::Softplus { .. }, &[beta]) => Self::Softplus { beta },
            (Self::Hardtanh { .. }, &[low, high]) => Self::Hardtanh { low, high },
            _ => return None,
        })
    }

    /// Refuses parameters for which it is no function of numbers, or another kind.
    ///
    /// # Errors
    /// What is wrong with which parameter, in words.
    pub fn check(self) -> Result<(), String> {
        if self.parameters().iter().any(|parameter| !parameter.is_finite()) {
            return Err(format!("`{self}`: parameters have to be finite numbers"));
        }
        // A quotient by a smaller number may be infinite.
        let divides = |parameter: f32| parameter >= f32::MIN_POSITIVE;
        match self {
            Self::Elu { alpha } if alpha < 0.0 => Err(format!("`{self}`: alpha is below 0")),
            Self::Celu { alpha } if !divides(alpha) => {
                Err(format!("`{self}`: alpha has to be above 0, {:?} at least", f32::MIN_POSITIVE))
            }
            Self::Softplus { beta } if !divides(beta) => {
                Err(format!("`{self}`: beta has to be above 0, {:?} at least", f32::MIN_POSITIVE))
            }
            Self::Hardtanh { low, high } if low >= high => {
                Err(format!("`{self}`: the lower limit has to be below the upper one"))
            }
            _ => Ok(()),
        }
    }

    /// The activation at `x`; NaN stays NaN, and an infinity has its limit.
    #[inline(always)]
    pub fn apply<R: Real>(self, x: R) -> R {
        if self.is_smooth()
            && let Some(known) = x.known_by(|x| self.range(x))
        {
            return known;
        }
        self.formula(x)
    }

    /// Whether bounds take its range and slopes in place of its formula: what is piecewise linear, and what
    /// the scalar type knows, has its bounds by itself.
    fn is_smooth(self) -> bool {
        let known = matches!(self, Self::Identity | Self::Relu | Self::LeakyRelu { .. });
        let clipped = matches!(self, Self::Hardtanh { .. } | Self::Relu6);
        !(known || clipped || matches!(self, Self::Tanh | Self::Silu))
    }

    /// Its formula.
    #[inline(always)]
    fn formula<R: Real>(self, x: R) -> R {
        let zero = R::lit(0.0);
        match self {
            Self::Identity => x,
            Self::Relu => x.at_least(zero),
            // Minus infinity times 0 would be no number.
            Self::LeakyRelu { slope: 0.0 } => x.at_least(zero),
            Self::LeakyRelu { slope } => x.if_lt(zero, R::lit(slope) * x, x),
            // The part of either side is 0 on the other.
            Self::Elu { alpha: 1.0 } => x.at_least(zero) + x.exp_m1_negative(),
            Self::Elu { alpha } => x.at_least(zero) + R::lit(alpha) * x.exp_m1_negative(),
            Self::Selu => {
                let [scale, alpha] = Self::SELU;
                R::lit(scale) * x.at_least(zero) + R::lit(scale * alpha) * x.exp_m1_negative()
            }
            Self::Celu { alpha } => {
                let alpha = R::lit(alpha);
                x.at_least(zero) + alpha * (x / alpha).exp_m1_negative()
            }
            Self::Gelu => {
                let x = x.at_least(R::lit(LOWEST_NORMAL));
                let half = R::lit(0.5) * x;
                half + half * x.normal_share()
            }
            Self::GeluTanh => {
                let x = x.at_least(R::lit(LOWEST_NORMAL));
                let [first, third] = Self::GELU_TANH.map(R::lit);
                let half = R::lit(0.5) * x;
                // The constant first: some drivers would move it there, and round otherwise.
                half + half * (x * (first + (third * x) * x)).tanh()
            }
            // The logistic function is (1 + tanh(x / 2)) / 2.
            Self::Silu => {
                let half = R::lit(0.5) * x.at_least(R::lit(LOWEST));
                half + half * half.tanh()
            }
            // With e = exp(-|x|), the tangent of the logarithm is n / (n + 2), n = e (e + 2), below 0, and
            // n / (n + 2 e^2), n = 1 + 2 e, above.
            Self::Mish => {
                let x = x.at_least(R::lit(LOWEST_EXPONENT));
                let (one, two) = (R::lit(1.0), R::lit(2.0));
                let e = (-x.abs()).exp_negative();
                let n = x.if_lt(zero, e * (e + two), one + two * e);
                let more = x.if_lt(zero, two, (two * e) * e);
                x * (n / (n + more))
            }
            Self::Tanh => x.tanh(),
            // Of exp(-|x|) as well: the other exponential is rounded otherwise by some drivers.
            Self::Sigmoid => {
                let e = (-x.abs()).exp_negative();
                let one = R::lit(1.0);
                x.if_lt(zero, e, one) / (one + e)
            }

            Self::Softplus { beta: 1.0 } => x.at_least(zero) + x.softplus_excess(),
            Self::Softplus { beta } => {
                let beta = R::lit(beta);
                x.at_least(zero) + (beta * x).softplus_excess() / beta
            }
            Self::Softsign => {
                let x = x.clamp(R::lit(-FAR), R::lit(FAR));
                x / (R::lit(1.0) + x.abs())
            }
            Self::Hardtanh { low, high } => x.clamp(R::lit(low), R::lit(high)),
            Self::Relu6 => x.clamp(zero, R::lit(6.0)),
        }
    }
}

/// A parameter as it is read again: the shortest decimal, a whole number without a point.
fn written(parameter: &f32) -> String {
    let text = format!("{parameter:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

impl fmt::Display for Activation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())?;
        if Self::ALL.contains(self) {
            return Ok(());
        }
        let parameters = self.parameters();
        let parameters: Vec<String> = parameters.iter().map(written).collect();
        write!(f, "({})", parameters.join(","))
    }
}

impl FromStr for Activation {
    type Err = String;

    /// The activation of a text form, `elu` or `hardtanh(-2,2)`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (word, rest) =
            text.split_once('(').map_or((text, None), |(word, rest)| (word, Some(rest)));
        let kind = Self::ALL.into_iter().find(|kind| kind.word() == word.trim());
        let meant = || nearest(word).map_or(String::new(), |kind| format!("; `{kind}` is meant?"));
        let kind =
            kind.ok_or_else(|| format!("`{text}` is none of {}{}", Self::words(), meant()))?;
        let Some(rest) = rest else { return Ok(kind) };
        let takes = kind.parameters().len();
        let problem = || format!("`{text}`: `{word}` takes {takes} numbers in brackets");
        let inside = rest.trim_end().strip_suffix(')').ok_or_else(problem)?;
        let numbers = inside.split(',').map(|number| number.trim().parse());
        let numbers: Vec<f32> = numbers.collect::<Result<_, _>>().map_err(|_| problem())?;
        let found = kind.with(&numbers).ok_or_else(problem)?;
        found.check().map(|()| found)
    }
}

/// The word that another spelling or another name of an activation stands for.
fn nearest(word: &str) -> Option<&'static str> {
    let plain = |text: &str| text.trim().to_lowercase().replace(['_', '-', ' '], "");
    let word = plain(word);
    let other = OTHER_NAMES.iter().find(|(name, _)| *name == word).map(|(_, known)| *known);
    let mut words = Activation::ALL.iter().map(|kind| kind.word());
    other.or_else(|| words.find(|known| plain(known) == word))
}

#[cfg(test)]
mod tests;
