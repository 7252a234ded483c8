//! The arguments of the command line and their help texts.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use super::effort::USUAL;
use super::falsify::FalsifyArguments;
use super::init::{self, InitArguments};
use super::options::{Changes, Common, Global, Keys, Own, Replace};
use super::values::Target;
use crate::config::Registry;
use crate::files::Existing;
use crate::policy::Activation;
use crate::studies::StudyCommand;
use crate::train::settings::Method;

/// Batch rollouts and the probabilistic reach-avoid certificates that they support.
#[derive(Debug, Parser)]
#[command(name = "reachcast", version, max_term_width = 100, after_help = EXAMPLES)]
pub(super) struct Arguments {
    #[command(flatten, next_help_heading = "Options of every command")]
    pub(super) common: Common,
    #[command(subcommand)]
    pub(super) command: Command,
}

impl Arguments {
    /// The options that are not of one command alone.
    pub(crate) fn global(&self, registry: &Registry) -> Global {
        let Own { changes, out, replace } = self.command.options();
        let existing = if replace.overwrite { Existing::Replaced } else { Existing::Kept };
        Global { common: self.common.clone(), changes, out, existing, registry: registry.clone() }
    }
}

/// Shown after the help of the program.
const EXAMPLES: &str = "\
Examples:
  reachcast init plant.toml
  reachcast certify configs/race.toml
  reachcast certify configs/race.toml --profile study --set growth.rounds=10 --out study
  reachcast rollout configs/race.toml --starts configs/race_starts_500.csv --measures measures.npy
  reachcast query reachcast-out --states configs/race_starts_500.csv
  reachcast check reachcast-out
  reachcast falsify configs/models/dubins.toml
  reachcast plan configs/models/double_integrator.toml
  reachcast race configs/race.toml
  reachcast sweep configs/race.toml --samples 64,256,1024 --horizon 10,20
  reachcast train configs/train/race.toml
  reachcast policy import actor.pth --out policy.safetensors
  reachcast scenarios --epsilon 0.1 --beta 1e-3
  reachcast bench --quick

Exit codes:
  0  done
  1  failed
  2  wrong usage, configuration or input
  3  ran, but the claim asked for was not obtained, or a failing start was found";

/// The commands.
#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Write a starting configuration with comments: a plant as text, to be changed
    #[command(after_help = format!("Plants to start from:\n{}\nExample:\n  reachcast init car.toml --from dubins", init::names()))]
    Init(InitArguments),
    /// Certify a policy: deviation bound, certified set, and a locally grown ball
    ///
    /// Writes certificate.json, deviation.csv (step, bound, largest, exact), slice.npy (f32,
    /// [rows, columns]), report.html and, for a network, policy.safetensors to the folder of
    /// --out. Exit code 3: it ran, but a claim that was asked for was not obtained.
    #[command(after_help = "\
Examples:
  reachcast certify configs/smoke.toml
  reachcast certify configs/race.toml --backend gpu --seed 7 --out run7 --json")]
    Certify {
        /// Configuration (TOML)
        config: PathBuf,
        /// Folder of the results [default: reachcast-out]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        replace: Replace,
        /// Also look at starts one after the other until their risk is shown: of the certified set, of the
        /// box, or of a ball around the state (section [sequential])
        #[arg(long, value_name = "OF", num_args = 0..=1, default_missing_value = "set",
              value_parser = ["set", "box", "ball"], require_equals = true)]
        sequential: Option<String>,
        /// Number of this attempt at the same claims: it books beta times 6 / (pi^2 K^2), and scenarios that
        /// are not given follow. Beside an earlier certificate without a number, the second attempt is 2
        #[arg(long, value_name = "K")]
        attempt: Option<u32>,
        #[command(flatten, next_help_heading = "Configuration")]
        changes: Changes,
    },
    /// Compute the reach-avoid measure of each start
    #[command(after_help = "\
A start succeeds where its measure is positive. States are in the system's order, or in that of a
header of a .csv file, which names all of them; commas, semicolons, tabs or blanks separate them.

Example:
  reachcast rollout configs/race.toml --starts configs/race_starts_500.csv --measures out.npy")]
    Rollout {
        /// Configuration (TOML)
        config: PathBuf,
        /// Starts: .npy (f32 or f64, [N, states]) or .csv
        #[arg(long, value_name = "FILE")]
        starts: PathBuf,
        /// Where the measures go: .npy (f32, [N]) or .csv
        #[arg(long, value_name = "FILE")]
        measures: PathBuf,
        #[command(flatten)]
        replace: Replace,
        #[command(flatten, next_help_heading = "Configuration")]
        keys: Keys,
    },
    /// Tell the tier and the tightened measure V_check of states against a stored certificate
    #[command(after_help = "\
Tiers: 0 in the target set, 1 in the certified set, 2 in the set that local growth verified, 3 otherwise.
Prints a line per state (index, tier, check_margin, target_margin); with --out DIR these go to
DIR/query.csv instead and a summary is printed. More columns where the certificate has what they are of:
  score       the largest lambda at which the state is certified by margin drops
  measure     the measure of its rollout, and in
  calibrated  whether that is above alpha: in the calibrated set
  radius      of a ball around it that is certified without samples, up to 8 times the one asked for

Example:
  reachcast query reachcast-out --states configs/race_starts_500.csv")]
    Query {
        /// Folder that `certify` wrote
        folder: PathBuf,
        /// States: .npy (f32 or f64, [N, states]) or .csv
        #[arg(long, value_name = "FILE")]
        states: PathBuf,
        /// Folder for query.csv, instead of a line per state on standard output
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        replace: Replace,
    },
    /// Verify a stored certificate again, and try its claims on fresh scenarios
    ///
    /// Exit code 3: it no longer holds.
    #[command(after_help = "\
Example:
  reachcast check reachcast-out")]
    Check {
        /// Folder that `certify` wrote
        folder: PathBuf,
        /// Seed of the fresh samples, to repeat a check [default: another one each time, which is told]
        #[arg(long, value_name = "N")]
        fresh_seed: Option<u64>,
        /// Most operations that it may take, for folders of other people: what it takes at most is said first
        #[arg(long, value_name = "N", default_value_t = USUAL)]
        effort: f64,
    },
    /// Look for a start that fails: within the box, or where a certificate claims something
    ///
    /// Uniform draws first, then from the best of them cross-entropy and descent along differences of
    /// the measure, again and again until a start fails or the budget is spent. Writes falsify.json,
    /// report.html and, where something fails, counterexamples.csv (for `rollout --starts`) to the folder
    /// of --out. Exit code 3: a failing start was found, by the search or in the file of --starts.
    #[command(after_help = "\
It finds what the measure slopes to. Where it finds nothing it says what it tried, which proves nothing.
A certificate allows for failures: one that is found is compared with the risk that is claimed.
Starts are varied, of a certificate's pairs perturbations too. Parameters keep their values, which the
words list; models have no disturbances that could be searched.

Examples:
  reachcast falsify configs/models/dubins.toml
  reachcast falsify configs/race.toml --budget 1000000 --seed 2 --out search
  reachcast falsify configs/race.toml --radius 0.1 --starts configs/race_starts_500.csv
  reachcast falsify --around reachcast-out --within ball")]
    Falsify(FalsifyArguments),
    /// Steer a model in closed loop by sampled plans (MPPI) that cost little
    ///
    /// For a model as text with [model.costs]: what a plan pays at each stage and at its end. Section [plan]
    /// says how plans are made; a run starts at [state], several start in the box. Writes plan.json, steps.csv
    /// (a row for each step: states, controls, margins, what each term costs, effective samples,
    /// milliseconds), trajectories.npz and report.html to the folder of --out.
    #[command(after_help = "\
Examples:
  reachcast plan configs/models/double_integrator.toml
  reachcast plan configs/models/double_integrator.toml --set plan.runs=100 --out plan100
  reachcast plan configs/models/double_integrator.toml --set plan.samples=4096 --backend gpu --json")]
    Plan {
        /// Configuration (TOML)
        config: PathBuf,
        /// Folder of the results [default: reachcast-plan]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        replace: Replace,
        #[command(flatten, next_help_heading = "Configuration")]
        changes: Changes,
    },
    #[command(flatten)]
    Study(StudyCommand),
    /// Train a policy, or a network that tells its value
    ///
    /// Writes policy.safetensors (or value.safetensors, or action_value.safetensors; beside the policy
    /// of `ddpg` disturbance.safetensors and critic.safetensors), train.json, curve.csv and report.html
    /// to the folder of --out (default: reachcast-train). Stopped half-way, the same command goes on
    /// where it was; the network is the same. Needs a program that was built with `--features train`.
    #[command(after_help = "\
Rollouts, scores and networks are functions of the configuration and the seed, on any number of
threads. Everything in the section [train] of the configuration can be set.

Examples:
  reachcast train configs/train/race.toml
  reachcast train configs/train/race.toml --seed 2 --set train.analytic.iterations=1500 --out quick
  reachcast train configs/race.toml --method value --out value
  reachcast train configs/train/race_ppo.toml
  reachcast train configs/train/race_ddpg.toml --set train.ddpg.iterations=20000 --out quick")]
    Train {
        /// Configuration (TOML)
        config: PathBuf,
        /// What is trained, and how, instead of the configuration's
        #[arg(long, value_enum)]
        method: Option<Method>,
        /// Folder of the results [default: reachcast-train]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        replace: Replace,
        #[command(flatten, next_help_heading = "Configuration")]
        changes: Changes,
    },
    /// Import a policy of another program, evaluate or export one, or tell what is in it
    #[command(subcommand)]
    Policy(PolicyCommand),
    /// Tell how many scenarios a claim needs
    #[command(after_help = "\
Examples:
  reachcast scenarios --epsilon 0.1 --beta 1e-3
  reachcast scenarios --epsilon 0.1 --beta 1e-3 --rounds 5
  reachcast scenarios --epsilon 0.01 --beta 1e-6 --failures 3")]
    Scenarios(ScenarioArguments),
    /// Measure this machine's limits, then how near the workloads come to them
    ///
    /// Runs on the CPU and on a hardware GPU if there is one; --backend or --device names one of them,
    /// and may name a software adapter, which gets the small workloads only. Rates are medians of
    /// repeated calls after a warm-up. With --out DIR the record goes to DIR/bench.json as well.
    #[command(after_help = "\
Examples:
  reachcast bench --quick
  reachcast bench --workload rollout/3x64 --threads 1
  reachcast bench --json --out bench-out
  reachcast bench --export exported        # networks, starts and results for other programs")]
    Bench(BenchArguments),
    /// List the devices that can run rollouts
    Devices,
}

impl Command {
    /// What lies over the configuration, where the results go and whether they may replace others;
    /// nothing where the command has no such option.
    pub(super) fn options(&self) -> Own {
        let no_seed = |keys: &Keys| Changes { seed: None, keys: keys.clone() };
        let own =
            |changes, out: &Option<PathBuf>, replace| Own { changes, out: out.clone(), replace };
        match self {
            Self::Certify { changes, out, replace, sequential, attempt, .. } => {
                let mut changes = changes.clone();
                let of = sequential.iter().map(|of| format!("sequential.of={of}"));
                changes.keys.set.extend(of);
                changes.keys.set.extend(attempt.map(|number| format!("attempt={number}")));
                own(changes, out, *replace)
            }
            Self::Train { changes, out, replace, .. } => own(changes.clone(), out, *replace),
            Self::Rollout { keys, replace, .. } => own(no_seed(keys), &None, *replace),
            Self::Query { out, replace, .. } => own(Changes::default(), out, *replace),
            Self::Init(asked) => asked.own(),
            Self::Falsify(asked) => own(asked.changes.clone(), &asked.out, asked.replace),
            Self::Plan { changes, out, replace, .. } => own(changes.clone(), out, *replace),
            Self::Study(asked) => asked.options(),
            Self::Policy(PolicyCommand::Import(asked)) => {
                own(no_seed(&asked.keys), &asked.out, asked.replace)
            }
            Self::Policy(PolicyCommand::Eval(asked)) => {
                own(Changes::default(), &None, asked.replace)
            }
            Self::Policy(PolicyCommand::Export(asked)) => {
                own(Changes::default(), &asked.out, asked.replace)
            }
            Self::Policy(PolicyCommand::Inspect { changes, .. }) => {
                Own { changes: changes.clone(), ..Own::default() }
            }
            Self::Bench(asked) => {
                let changes = Changes { seed: asked.seed, ..Changes::default() };
                own(changes, &asked.out, asked.replace)
            }
            Self::Check { .. } | Self::Scenarios(_) | Self::Devices => Own::default(),
        }
    }
}

/// What `bench` is asked for.
#[derive(Args, Clone, Debug)]
pub(super) struct BenchArguments {
    /// Fewer calls, no large work: about a quarter of a minute
    #[arg(long)]
    pub(super) quick: bool,
    /// Only the workloads whose names contain this
    #[arg(long, value_name = "FILTER")]
    pub(super) workload: Option<String>,
    /// Measure nothing; write what the workloads run on, and what they must come to, to this folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["quick", "workload"])]
    pub(super) export: Option<PathBuf>,
    /// Folder for the record, bench.json, as well
    #[arg(long, value_name = "DIR", conflicts_with = "export")]
    pub(super) out: Option<PathBuf>,
    /// Seed of every random stream [default: 1]
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
    #[command(flatten)]
    pub(super) replace: Replace,
}

/// What is done with a policy file.
#[derive(Debug, Subcommand)]
pub(super) enum PolicyCommand {
    /// Write a dense network of another program as a policy file
    ///
    /// Nothing in the file is executed. Read are checkpoints of PyTorch (.pth, .pt, .ckpt; TorchScript; before
    /// 1.6), models of stable-baselines3 (.zip), parameters of JAX (pickles of Brax and flax), safetensors of any
    /// names, ONNX graphs (.onnx), .nnet, and the texts of Sherlock and POLAR. Where a library's layout is recognised
    /// (stable-baselines3, rsl_rl, rl_games, CleanRL, tianshou, omnisafe, safe-control-gym, Brax and others), its
    /// layers, normalisers and activations are taken, and said. What would be lost is refused, unless --network asks
    /// for the layers by name. docs/import.md has all of it.
    #[command(after_help = "\
A network is what stands before the layers' own names: `actor` of `actor.0.weight`, and of
`actor.preprocess.model.model.0.weight` and `actor.last.model.0.weight` as tianshou names them. If
there are several, they are listed, and --network names one. A critic takes the state and then the
controls of both players.

Examples:
  reachcast policy import model.zip --out policy.safetensors
  reachcast policy import actor.pth --out policy.safetensors --config configs/race.toml
  reachcast policy import policy.pth --network actor1_old --out policy.safetensors
  reachcast policy import ppo.pt --network net.body,net.mean --activation tanh --out ppo.safetensors
  reachcast policy import policy.onnx --out policy.safetensors")]
    Import(ImportArguments),
    /// Evaluate a policy file at inputs from a .npy file
    #[command(after_help = "\
Example:
  reachcast policy eval policy.safetensors --inputs x.npy --outputs u.npy")]
    Eval(EvalArguments),
    /// Write a policy file as an ONNX graph or as NumPy arrays
    #[command(after_help = "\
Examples:
  reachcast policy export policy.safetensors --to onnx --out policy.onnx
  reachcast policy export policy.safetensors --to npz --out policy.npz")]
    Export(ExportArguments),
    /// Tell widths, parameters, a Lipschitz bound and the range of actions of a policy file
    #[command(after_help = "\
The Lipschitz bound is the product of the layers' spectral norms, never below the true constant.
The range of each action is that of interval arithmetic, which holds for every state of the box
but may be wide, beside the range of random states of the box, which is seen but may be narrow. The
box is that of the configuration, or from -1 to 1 without one.

Example:
  reachcast policy inspect configs/policies/race_policy.safetensors --config configs/race.toml")]
    Inspect {
        /// Policy (.safetensors)
        file: PathBuf,
        /// Configuration (TOML) with the names of the states and their box
        #[arg(long, value_name = "CONFIG")]
        config: Option<PathBuf>,
        #[command(flatten, next_help_heading = "Configuration")]
        changes: Changes,
    },
}

/// What `policy eval` is asked for.
#[derive(Args, Clone, Debug)]
pub(super) struct EvalArguments {
    /// Policy (.safetensors)
    pub(super) file: PathBuf,
    /// Inputs, f32 or f64 of shape [N, inputs] or [inputs] (.npy)
    #[arg(long, value_name = "FILE")]
    pub(super) inputs: PathBuf,
    /// The outputs to write, f32 of shape [N, outputs] or [outputs] (.npy)
    #[arg(long, value_name = "FILE")]
    pub(super) outputs: PathBuf,
    #[command(flatten)]
    pub(super) replace: Replace,
}

/// What `policy export` is asked for.
#[derive(Args, Clone, Debug)]
pub(super) struct ExportArguments {
    /// Policy (.safetensors)
    pub(super) file: PathBuf,
    /// What to write
    #[arg(long, value_enum)]
    pub(super) to: Target,
    /// The file to write, OUT.onnx or OUT.npz
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) replace: Replace,
}

/// What `policy import` is asked for.
#[derive(Args, Clone, Debug)]
pub(super) struct ImportArguments {
    /// File of another program: checkpoint, model, parameters, graph or text
    pub(super) file: PathBuf,
    /// Prefix of the names of the network's layers, which are imported alone; several, separated by
    /// commas, are joined; of a graph with several outputs, the name of one
    #[arg(long, value_name = "PREFIX", value_delimiter = ',')]
    pub(super) network: Vec<String>,
    /// Activation of the hidden layers, `elu` or `leaky_relu(0.2)` [default: that of the library, else relu]
    #[arg(long, value_name = "WORD")]
    pub(super) activation: Option<Activation>,
    /// Activation of its last layer [default: that of the library, else tanh; identity for a critic]
    #[arg(long, value_name = "WORD")]
    pub(super) output: Option<Activation>,
    /// Names of the inputs, separated by commas
    #[arg(long, value_name = "NAMES", value_delimiter = ',', conflicts_with = "config")]
    pub(super) state_order: Option<Vec<String>>,
    /// Configuration (TOML) whose system names the inputs, and has to fit the network
    #[arg(long, value_name = "CONFIG")]
    pub(super) config: Option<PathBuf>,
    /// Convert weights in float64, float16 or bfloat16 to float32 instead of refusing them
    #[arg(long)]
    pub(super) cast: bool,
    /// The policy file to write, OUT.safetensors
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) replace: Replace,
    #[command(flatten, next_help_heading = "Configuration")]
    pub(super) keys: Keys,
}

/// The claim that `scenarios` is asked about.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct ScenarioArguments {
    /// Risk, in (0, 1)
    #[arg(long)]
    pub(super) epsilon: f64,
    /// One minus the confidence, in (0, 1)
    #[arg(long)]
    pub(super) beta: f64,
    /// Decision variables of the scenario program
    #[arg(long, value_name = "D", default_value_t = 1)]
    pub(super) dim: u32,
    /// Failures that may be among the scenarios (Clopper-Pearson; for one decision variable)
    #[arg(long, value_name = "K")]
    pub(super) failures: Option<u64>,
    /// Rounds that share beta, each of which spends beta / M
    #[arg(long, value_name = "M", default_value_t = 1)]
    pub(super) rounds: u32,
}
