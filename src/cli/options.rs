//! The options that commands share, and what a command is told by them.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::config::{Overrides, Profile, Registry};
use crate::files::Existing;

/// Most threads: beyond what any processor runs at once they only cost.
const MOST_THREADS: i64 = 1024;

/// Options of every command; none of them changes a result on the CPU.
#[derive(Args, Clone, Debug)]
pub(crate) struct Common {
    /// Who runs the rollouts; `auto` takes a hardware GPU if there is one, else the CPU
    #[arg(long, global = true, value_enum, default_value_t = BackendName::Auto)]
    pub(crate) backend: BackendName,
    /// The GPU adapter: a part of its name, its number, or pci:0000:01:00.0, as `devices` lists them
    #[arg(long, global = true, value_name = "NAME")]
    pub(crate) device: Option<String>,
    /// Go on on the CPU where no adapter opens, or where it fails for good; it is reported
    #[arg(long, global = true)]
    pub(crate) fallback: bool,
    /// Threads of the CPU backend [default: as many as the processor runs at once]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u16>,
    /// Print one JSON document on standard output and nothing else
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Print errors only
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
}

/// What lies over the keys of a configuration.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Keys {
    /// Profile whose defaults count, instead of the configuration's
    #[arg(long, value_enum)]
    pub(crate) profile: Option<Profile>,
    /// Override a key of the configuration, for instance rollout.horizon=40; repeatable
    #[arg(long, value_name = "SECTION.KEY=VALUE")]
    pub(crate) set: Vec<String>,
}

/// Everything that lies over a configuration with random numbers.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Changes {
    /// Seed of every random stream, instead of the configuration's
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    #[command(flatten)]
    pub(crate) keys: Keys,
}

/// Whether results may take the place of others.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct Replace {
    /// Replace what an earlier command left at that place
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// The options that only some commands have, of one command; nothing where it has no such option.
#[derive(Clone, Debug, Default)]
pub(crate) struct Own {
    /// What lies over the configuration.
    pub(crate) changes: Changes,
    /// Where the results go.
    pub(crate) out: Option<PathBuf>,
    /// Whether they may replace others.
    pub(crate) replace: Replace,
}

/// What every command is told by its options, those that it does not have left out.
#[derive(Clone, Debug)]
pub(crate) struct Global {
    /// Options of every command.
    pub(crate) common: Common,
    /// What lies over the configuration.
    pub(crate) changes: Changes,
    /// Where the results go.
    pub(crate) out: Option<PathBuf>,
    /// What becomes of results that are there.
    pub(crate) existing: Existing,
    /// Plants of the program beside the carried ones.
    pub(crate) registry: Registry,
}

impl Global {
    /// What lies over a configuration file.
    pub(crate) fn overrides(&self) -> Overrides {
        let Changes { seed, keys: Keys { profile, set } } = self.changes.clone();
        Overrides { profile, seed, set, registry: self.registry.clone() }
    }

    /// The folder of the results, `usual` unless another one was named.
    pub(crate) fn folder(&self, usual: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| PathBuf::from(usual))
    }
}

/// The values of `--backend`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendName {
    /// A hardware GPU if there is one, else the CPU; never a software adapter
    Auto,
    /// The native CPU backend
    Cpu,
    /// A GPU, or a software adapter where there is none
    Gpu,
}
