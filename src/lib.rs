//! Reachcast: batch rollouts on any GPU or CPU, and the probabilistic reach-avoid certificates
//! that they support.
//!
//! A plant is a model (how a state moves, where it should get to, what it must keep clear of) and the
//! policy that drives it. It is prepared on a backend once, and answers for any number of starts: did the
//! rollout from here reach the target before it violated the constraint, and with what margin. A
//! certificate draws scenarios and says what may be claimed of all starts, with which probability.
//!
//! # A plant as text
//!
//! Nothing is compiled for it; `docs/models.md` has all that may stand in one. Controls are clipped to
//! their bounds, and held over a step.
//!
//! ```
//! use std::path::Path;
//! use reachcast::backend::Backend;
//! use reachcast::model::text;
//! use reachcast::rollout::RolloutSpec;
//!
//! let text = r#"
//! [model]
//! name = "cart"
//! [model.states]
//! position = { unit = "m", box = [-1.0, 1.0] }
//! velocity = { unit = "m/s", box = [-1.0, 1.0] }
//! [model.controls]
//! force = { unit = "N", bounds = [-1.0, 1.0] }
//! [model.flow]
//! position = "velocity"
//! velocity = "force"
//! [model.time]
//! period = 0.1
//! integrator = "rk4"
//! [model.task]
//! kind = "reach-avoid"
//! target = "0.1 - hypot(position, velocity)"
//! constraint = "1.5 - abs(position)"
//! [policy]
//! formula = { force = "-position - 1.5 * velocity" }
//! "#;
//! let plant = text::read(text, "cart.toml", Path::new("."))?.plant()?;
//!
//! // `Backend::auto()` takes the hardware GPU of the machine where there is one.
//! let backend = Backend::cpu()?;
//! let program = backend.prepare(&plant)?;
//!
//! // 60 steps, no discount; position and velocity of each start.
//! let spec = RolloutSpec::new(60, 1.0)?;
//! let measures = program.measures(&[[0.8, 0.0], [1.4, 1.0]], &spec)?;
//! assert!(measures[0] > 0.0, "it comes to rest in the middle");
//! assert!(measures[1] < 0.0, "it is beyond the wall before it can stop");
//! # Ok::<(), reachcast::Error>(())
//! ```
//!
//! Plans for a model that is given as text take a cost as data: [`model::StageCost::new`] has an example. Costs
//! may be text, too: [`model::Costs`].
//!
//! # A plant in Rust
//!
//! Formulas over [`real::Real`] are written once and run as SIMD lanes at full speed, in f64, as sound
//! bounds and as WGSL. [`system::Clipped`] clips the controls. A number in a formula is an `R::lit`;
//! `#[inline(always)]` lets the formulas be compiled for the widest instructions of the processor, and
//! changes nothing but the speed.
//!
//! ```
//! use reachcast::backend::Backend;
//! use reachcast::model::Plant;
//! use reachcast::policy::Policy;
//! use reachcast::real::Real;
//! use reachcast::rollout::RolloutSpec;
//! use reachcast::system::{Axis, Clipped, System};
//!
//! struct Cart;
//!
//! impl System<2, 1> for Cart {
//!     fn name(&self) -> &str {
//!         "cart"
//!     }
//!     fn states(&self) -> [Axis; 2] {
//!         [Axis::new("position", "m", -1.0, 1.0), Axis::new("velocity", "m/s", -1.0, 1.0)]
//!     }
//!     fn controls(&self) -> [Axis; 1] {
//!         [Axis::new("force", "N", -1.0, 1.0)]
//!     }
//!     #[inline(always)]
//!     fn step<R: Real>(&self, [x, v]: [R; 2], [force]: [R; 1]) -> [R; 2] {
//!         let period = R::lit(0.1);
//!         [x + period * v, v + period * force]
//!     }
//!     #[inline(always)]
//!     fn target<R: Real>(&self, [x, v]: [R; 2]) -> R {
//!         R::lit(0.1) - x.hypot(v)
//!     }
//!     #[inline(always)]
//!     fn constraint<R: Real>(&self, [x, _]: [R; 2]) -> R {
//!         R::lit(1.5) - x.abs()
//!     }
//! }
//!
//! struct Brake;
//!
//! impl Policy<2, 1> for Brake {
//!     fn name(&self) -> String {
//!         "brake".to_owned()
//!     }
//!     #[inline(always)]
//!     fn control<R: Real>(&self, [x, v]: [R; 2]) -> [R; 1] {
//!         [-x - R::lit(1.5) * v]
//!     }
//! }
//!
//! let plant = Plant::of(Clipped::new(Cart), Brake);
//! let backend = Backend::cpu()?;
//! let measures = backend.prepare(&plant)?.measures(&[[0.8, 0.0]], &RolloutSpec::new(60, 1.0)?)?;
//! assert!(measures[0] > 0.0);
//! # Ok::<(), reachcast::Error>(())
//! ```
//!
//! # Many starts, in parts
//!
//! [`backend::Program::tally`] counts starts that are drawn by their index, as many as one likes, and holds none of
//! them; [`backend::Program::tally_pairs`] does pairs. A range that is cut anywhere, run in any order, on any
//! threads or machines alike, is merged to the same bits; its example merges two halves.
//!
//! # A certificate
//!
//! [`scenario::settings::Settings`] says what is asked for, risk and confidence included; the record that
//! comes of it holds every number that was found, and its claims as sentences.
//!
//! ```
//! use reachcast::backend::Backend;
//! use reachcast::model::Plant;
//! use reachcast::rollout::RolloutSpec;
//! use reachcast::scenario::settings::Settings;
//! use reachcast::scenario::{Unwatched, certify};
//! use reachcast::system::{BangBang, DoubleIntegrator};
//!
//! let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
//! let backend = Backend::cpu()?;
//! // Around the state at rest 0.9 m from the middle, over 40 steps.
//! let mut settings = Settings::new(&plant.model, [0.9, 0.0], RolloutSpec::new(40, 0.99)?)?;
//! settings.global.draws = 2000;
//! let record = certify(&backend.prepare(&plant)?, &settings, "a tour".into(), &Unwatched)?;
//! assert!(record.global.accepted > 0);
//! for claim in &record.statements {
//!     println!("{claim}");
//! }
//! # Ok::<(), reachcast::Error>(())
//! ```
//!
//! # A plan
//!
//! MPPI improves a plan by sampled rollouts; [`control::mppi::Planner`] does so step after step. What is
//! planned for is data, too: the model, the cost of a stage, and how samples are drawn.
//!
//! ```
//! use reachcast::backend::Backend;
//! use reachcast::cost::Quadratic;
//! use reachcast::rollout::{
//!     CostQuery, MppiProblem, MppiSettings, MppiSpec, MppiTask, Planning, Purpose, Stream,
//! };
//! use reachcast::system::{DoubleIntegrator, System};
//!
//! let system = DoubleIntegrator::default();
//! let cost = Quadratic { state: [1.0, 0.1], control: [0.01], last: [9.0, 1.0], obstacle: None };
//! // 256 samples of 20 steps.
//! let spec = MppiSpec::new(MppiSettings::new(&system.controls(), 256, 20))?;
//! let planning = Planning::of::<_, _, 2, 1, 3>(&system, cost, spec);
//!
//! let backend = Backend::cpu()?;
//! let program = backend.prepare_plans(&planning)?;
//! // From rest at 0.5 m, a plan of zeros; the cost wants to know where to be, and which stage is last.
//! let stage = |t| [0.0, 0.0, f32::from(u8::from(t == 19))];
//! let context: Vec<_> = (0..20).map(stage).collect();
//! let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
//! let problems = [MppiProblem::new([0.5, 0.0], &[[0.0]; 20], &context, stream)];
//! let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Summary };
//! let plan = &program.improve(&task)?[0].plan;
//! assert!(plan[0] < 0.0, "to the left, where the middle is");
//! # Ok::<(), reachcast::Error>(())
//! ```
//!
//! # Features
//!
//! * `gpu`: adapters, through wgpu. Without it, [`backend::Backend`] has the CPU alone.
//! * `import`: networks from checkpoints of PyTorch and from ONNX.
//! * `cli`, the default, which has both: the program, its configurations, reports and benchmarks, and the
//!   study of races.
//! * `train`, `train-gpu`: training, on the CPU and on a GPU.
//!
//! # Where what is
//!
//! The layers, each importing only from those before it: [`real`], [`error`] and [`digest`]; [`formula`],
//! [`system`], [`policy`], [`cost`] and [`model`]; [`rollout`]; [`backend`] and [`tube`]; [`scenario`] and [`control`];
//! then what is the program's. The mathematics is in `docs/method.md`, the architecture in
//! `ARCHITECTURE.md`.

pub mod backend;
#[cfg(feature = "cli")]
pub mod bench;
#[cfg(feature = "cli")]
pub mod certificate;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "cli")]
pub mod config;
pub mod control;
pub mod cost;
pub mod digest;
pub mod error;
pub mod files;
pub mod formula;
pub mod model;
#[cfg(feature = "cli")]
pub mod plan;
pub mod policy;
pub mod race;
pub mod real;
#[cfg(feature = "cli")]
pub mod report;
pub mod rollout;
mod rounding;
pub mod scenario;
#[cfg(feature = "cli")]
pub mod studies;
pub mod system;
mod tile;
#[cfg(feature = "cli")]
pub mod train;
pub mod tube;

#[doc(hidden)]
pub use race as experiment;

pub use error::{Error, Fault, Result};
