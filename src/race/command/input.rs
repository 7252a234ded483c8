//! What races start from: a configuration with its networks, controllers, noise seeds and starts.

use std::path::{Path, PathBuf};

use crate::backend::{Backend, Program};
use crate::cli::folder_of;
use crate::cli::inputs::inputs;
use crate::config::{Config, Overrides, PolicySource, check_network, no_formula};
use crate::error::{Error, Result};
use crate::files::{Inputs, StateReader};
use crate::model::{Model, Plant};
use crate::policy::Mlp;
use crate::race::controller::{Name, World};
use crate::race::settings::RaceSettings;
use crate::race::system::DroneRace;
use crate::rollout::{Purpose, Region, Starts, Stream};
use crate::scenario::settings::Settings;
use crate::studies::BuiltIn;
use crate::system::System;

/// What starts of races are drawn for.
const RACE_START: Purpose = Purpose::numbered(14);
/// Most starts that can be drawn.
const MOST_STARTS: u64 = 1_000_000;
/// Most noise seeds.
const MOST_SEEDS: u64 = 1000;

/// Starts of races.
pub(super) struct RaceStarts {
    /// The joint states, `[starts, 12]`.
    pub(super) states: Vec<[f32; 12]>,
    /// Where they come from, in words.
    pub(super) source: String,
}

/// A configuration that has races, with everything that it names.
pub(super) struct RaceInput {
    /// The configuration.
    pub(super) config: Config,
    folder: PathBuf,
    race: RaceSettings,
    certificates: Settings,
    system: DroneRace,
    policy: PolicySource,
    networks: Networks,
}

impl RaceInput {
    /// Reads the configuration at `path`, with `overrides` over it, and the files that it names.
    pub(super) fn load(path: &Path, overrides: &Overrides) -> Result<Self> {
        let config = Config::load(path, overrides)?;
        let race = config.study.clone().ok_or_else(|| {
            let problem = "only the system `drone-race` has races; certificates it has: `certify`, \
                           `sweep --of certificate`";
            Error::invalid(path.display().to_string(), problem)
        })?;
        let folder = folder_of(path).to_owned();
        let policy = config.policy_source(&folder)?;
        let networks = Networks::read(&race, &folder)?;
        let mut certificates = config.settings(&DroneRace::default().states())?;
        certificates.growth.plan.method = race.hybrid.growth;
        no_enclosure(&certificates)?;
        let system = system(&config)?;
        policy_of(&system, &policy)?;
        Ok(Self { config, folder, race, certificates, system, policy, networks })
    }

    /// The files that this and the starts `asked` for were read from; the configuration is at `path`.
    pub(super) fn inputs(&self, path: &Path, asked: Option<&str>) -> Inputs {
        let named = &self.race.networks;
        let networks = [&named.value, &named.disturbance, &named.ppo];
        let networks = networks.into_iter().filter(|file| !file.is_empty());
        let networks = networks.map(|file| self.folder.join(file));
        inputs(path, &self.policy, networks.chain(self.starts_file(asked)))
    }

    /// The file of the starts `asked` for; none if they are drawn.
    fn starts_file(&self, asked: Option<&str>) -> Option<PathBuf> {
        match asked {
            Some(text) if text.parse::<u64>().is_ok() => None,
            Some(path) => Some(PathBuf::from(path)),
            None => Some(self.folder.join(&self.race.starts)),
        }
    }

    /// The plant under the policy.
    pub(super) fn plant(&self) -> Result<Plant> {
        self.config.plant(&self.policy)
    }

    /// What controllers are made of; `program` is the plant as prepared on `backend`.
    pub(super) fn world<'a>(
        &'a self,
        backend: &'a Backend,
        program: &'a Program<'a>,
    ) -> Result<World<'a>> {
        let policy = policy_of(&self.system, &self.policy)?;
        Ok(World {
            backend,
            program,
            system: &self.system,
            policy,
            value: self.networks.value.as_ref(),
            disturbance: self.networks.disturbance.as_ref(),
            ppo: self.networks.ppo.as_ref(),
            race: &self.race,
            certificates: &self.certificates,
        })
    }

    /// The starts: drawn, of a file, or those of the configuration.
    pub(super) fn starts(&self, asked: Option<&str>) -> Result<RaceStarts> {
        if let Some(count) = asked.and_then(|text| text.parse::<u64>().ok()) {
            return drawn(&self.race, count, self.config.seed);
        }
        let path = asked.map_or_else(|| self.folder.join(&self.race.starts), PathBuf::from);
        let names = DroneRace::default().states().map(|axis| axis.name);
        let states = StateReader::open(&path, names.to_vec())?.rest()?.arrays();
        // Its name alone: the same starts elsewhere are the same experiment.
        let source = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(RaceStarts { states, source })
    }
}

/// Refuses certificates that races would wait for: an enclosure takes a thousand times as long as a rollout.
fn no_enclosure(certificates: &Settings) -> Result<()> {
    let Some(kind) = certificates.enclosed else { return Ok(()) };
    let problem = format!(
        "`{}` is for `certify`, `query`, `check` and `sweep --of certificate`: races ask for the tier of \
         hundreds of states at each step; use `drops` or `lipschitz`",
        kind.name()
    );
    Err(Error::invalid("global.tightening", problem))
}

/// The drone race that the configuration asks for.
fn system(config: &Config) -> Result<DroneRace> {
    match config.built_in()? {
        BuiltIn::DroneRace(system) => Ok(system),
        _ => Err(Error::invalid("system.name", "only `drone-race` has races")),
    }
}

/// The policy, a network that fits.
fn policy_of<'a>(system: &DroneRace, policy: &'a PolicySource) -> Result<&'a Mlp> {
    match policy {
        PolicySource::Formula(name) => Err(no_formula(system.name(), name, "none")),
        PolicySource::Network { path, network, .. } => {
            check_network(&Model::of(*system), path, network)?;
            Ok(network)
        }
    }
}

/// The noise seeds `seed`, `seed + 1`, ...
pub(super) fn noise_seeds(seed: u64, count: u64) -> Result<Vec<u64>> {
    if !(1..=MOST_SEEDS).contains(&count) {
        let problem = format!("{count} is not within 1..={MOST_SEEDS}");
        return Err(Error::invalid("--noise-seeds", problem));
    }
    Ok((0..count).map(|i| seed.wrapping_add(i)).collect())
}

/// The controllers of a list of names, each once, in its order.
pub(super) fn names(list: &[String]) -> Result<Vec<Name>> {
    let mut names = Vec::new();
    for text in list {
        let more = match text.as_str() {
            "all" => Name::STUDY.to_vec(),
            "ablations" => Name::ABLATIONS.to_vec(),
            "improvements" => Name::IMPROVEMENTS.to_vec(),
            _ => vec![name(text)?],
        };
        let new: Vec<Name> = more.into_iter().filter(|name| !names.contains(name)).collect();
        names.extend(new);
    }
    Ok(names)
}

/// The controller of a name.
pub(super) fn name(text: &str) -> Result<Name> {
    let known = Name::ALL;
    known.into_iter().find(|name| name.text() == text).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|name| name.text()).collect();
        let distance = |name: &&&str| strsim::damerau_levenshtein(text, name);
        let nearest = names.iter().min_by_key(distance).copied().unwrap_or_default();
        let problem = format!(
            "no controller `{text}`; did you mean `{nearest}`? There are all, ablations, improvements, \
             {}",
            names.join(", ")
        );
        Error::invalid("--controllers", problem)
    })
}

/// The networks beside the policy.
struct Networks {
    value: Option<Mlp>,
    disturbance: Option<Mlp>,
    ppo: Option<Mlp>,
}

impl Networks {
    /// Reads the files that the configuration in `folder` names.
    fn read(race: &RaceSettings, folder: &Path) -> Result<Self> {
        let states = DroneRace::default().states();
        let names = states.each_ref().map(|axis| axis.name.as_str());
        let read = |file: &str, outputs: usize| {
            if file.is_empty() {
                return Ok(None);
            }
            let path = folder.join(file);
            let network = Mlp::load(&path)?;
            let fits = network.check_fits(&names, outputs);
            fits.map_err(|problem| Error::file(&path, problem))?;
            Ok(Some(network))
        };
        let files = &race.networks;
        Ok(Self {
            value: read(&files.value, 1)?,
            disturbance: read(&files.disturbance, 3)?,
            ppo: read(&files.ppo, 3)?,
        })
    }
}

/// `count` starts drawn from the box of the configuration.
fn drawn(race: &RaceSettings, count: u64, seed: u64) -> Result<RaceStarts> {
    if !(1..=MOST_STARTS).contains(&count) {
        let problem = format!("{count} is not within 1..={MOST_STARTS}");
        return Err(Error::invalid("--starts", problem));
    }
    let place = "race.start_box";
    let corners: [[f64; 2]; 12] = race.start_box.as_slice().try_into().map_err(|_| {
        let problem = format!("{} intervals, expected 12, one per state", race.start_box.len());
        Error::invalid(place, problem)
    })?;
    let region =
        Region::new_box(corners.map(|[low, _]| low as f32), corners.map(|[_, high]| high as f32));
    let region = region.map_err(|error| Error::invalid(place, error.to_string()))?;
    let starts = Starts::Drawn { region, stream: Stream::new(seed, RACE_START, 0) };
    let source = format!("{count} drawn from the start box with seed {seed}");
    Ok(RaceStarts { states: (0..count).map(|i| starts.start_array(i)).collect(), source })
}
