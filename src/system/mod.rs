//! Systems: dynamics, target and constraint, written once over `Real`.

mod clipped;
mod diff_drive;
mod double_integrator;

pub use clipped::Clipped;
pub use diff_drive::{DiffDrive, Disc};
pub use double_integrator::{BangBang, DoubleIntegrator};

use crate::real::Real;

/// A discrete-time system `x[t+1] = f(x[t], u[t])` with its two margins.
///
/// `NX` states and `NU` controls. Numbers are recorded as literals, but for those that
/// [`System::parameters`] declares, which are inputs: the WGSL text that comes of it, with the values
/// of the parameters, is the experiment, and its hash goes into every certificate. Mark the formulas
/// `#[inline(always)]`, so that SIMD lanes are compiled for the machine's widest instructions.
///
/// ```
/// use reachcast::real::Real;
/// use reachcast::system::{Axis, System};
///
/// struct Cart;
///
/// impl System<2, 1> for Cart {
///     fn name(&self) -> &str {
///         "cart"
///     }
///     fn states(&self) -> [Axis; 2] {
///         [Axis::new("position", "m", -1.0, 1.0), Axis::new("velocity", "m/s", -1.0, 1.0)]
///     }
///     fn controls(&self) -> [Axis; 1] {
///         [Axis::new("force", "N", -1.0, 1.0)]
///     }
///     #[inline(always)]
///     fn step<R: Real>(&self, [x, v]: [R; 2], [u]: [R; 1]) -> [R; 2] {
///         let dt = R::lit(0.1);
///         [x + dt * v, v + dt * u.clamp(R::lit(-1.0), R::lit(1.0))]
///     }
///     #[inline(always)]
///     fn target<R: Real>(&self, [x, _]: [R; 2]) -> R {
///         R::lit(0.1) - x.abs()
///     }
///     #[inline(always)]
///     fn constraint<R: Real>(&self, [_, v]: [R; 2]) -> R {
///         R::lit(1.0) - v.abs()
///     }
/// }
/// assert_eq!(Cart.step([1.0_f64, 0.0], [5.0])[1], f64::from(0.1_f32));
/// ```
pub trait System<const NX: usize, const NU: usize>: Sync {
    /// Short name, lower case with hyphens.
    fn name(&self) -> &str;
    /// Name, unit and default box of each state; the order is the state order of every file.
    fn states(&self) -> [Axis; NX];
    /// Name, unit and bounds of each control.
    fn controls(&self) -> [Axis; NU];
    /// The next state; clips the control to its bounds itself, or stands behind [`Clipped`].
    fn step<R: Real>(&self, x: [R; NX], u: [R; NU]) -> [R; NX];
    /// Target margin `r`: positive inside the target set.
    fn target<R: Real>(&self, x: [R; NX]) -> R;
    /// Constraint margin `c`: positive where safe.
    fn constraint<R: Real>(&self, x: [R; NX]) -> R;
    /// The parameters that the formulas ask for by name ([`Real::parameter`]): inputs of the recorded
    /// formulas, so that another value compiles nothing anew. What is not declared is a literal.
    fn parameters(&self) -> Vec<Parameter> {
        Vec::new()
    }
    /// The bodies that a picture shows, by the indices of their two coordinates in the plane.
    fn bodies(&self) -> Vec<Body> {
        Vec::new()
    }
    /// The narrowest thing that the margins know of, where it is known: a step that is longer may leap
    /// over it, since margins are looked at at the samples alone.
    fn smallest_feature(&self) -> Option<Feature> {
        None
    }
}

/// Something that the margins know of, and how wide it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// In words, with an article.
    pub name: String,
    /// How wide it is, m.
    pub width: f32,
}

impl<S: System<NX, NU>, const NX: usize, const NU: usize> System<NX, NU> for &S {
    fn name(&self) -> &str {
        (**self).name()
    }
    fn states(&self) -> [Axis; NX] {
        (**self).states()
    }
    fn controls(&self) -> [Axis; NU] {
        (**self).controls()
    }
    #[inline(always)]
    fn step<R: Real>(&self, x: [R; NX], u: [R; NU]) -> [R; NX] {
        (**self).step(x, u)
    }
    #[inline(always)]
    fn target<R: Real>(&self, x: [R; NX]) -> R {
        (**self).target(x)
    }
    #[inline(always)]
    fn constraint<R: Real>(&self, x: [R; NX]) -> R {
        (**self).constraint(x)
    }
    fn parameters(&self) -> Vec<Parameter> {
        (**self).parameters()
    }
    fn bodies(&self) -> Vec<Body> {
        (**self).bodies()
    }
    fn smallest_feature(&self) -> Option<Feature> {
        (**self).smallest_feature()
    }
}

/// Something that moves in a plane: what a report draws the path of.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Body {
    /// Name for the legend.
    pub name: String,
    /// Index of the state drawn to the right.
    pub x: usize,
    /// Index of the state drawn upwards.
    pub y: usize,
}

/// Name, unit and interval of a state or control.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Axis {
    /// Name, as in `state_order`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Lower end of the default box, or lower bound of a control.
    #[serde(with = "crate::files::number::or_minus_infinite")]
    pub low: f32,
    /// Upper end.
    #[serde(with = "crate::files::number::or_infinite")]
    pub high: f32,
}

impl Axis {
    /// An axis over `[low, high]`.
    pub fn new(name: &str, unit: &str, low: f32, high: f32) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), low, high }
    }
}

/// A named number of a model that is fixed for a rollout: an input of its formulas, so that another
/// value compiles nothing anew.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Parameter {
    /// Name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value.
    #[serde(with = "crate::files::number")]
    pub value: f32,
}

impl Parameter {
    /// The parameter `name` with its value.
    pub fn new(name: &str, unit: &str, value: f32) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), value }
    }
}
