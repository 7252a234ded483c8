//! Keys that somebody wrote and that nothing reads, since the claim that they are of is not asked for.

use super::deterministic::Enclosing;
use super::drops::TighteningSource;
use super::section::{Config, Profile};
use super::sources::Sources;
use crate::error::{Error, Result};
use crate::scenario::growth_plan::{GrowthMethod, GrowthShape};
use crate::scenario::sequential_record::SequentialOf;

/// Keys that are read in one case only.
struct Rule {
    /// A section or a key.
    keys: &'static str,
    /// The key that says whether they are read; written by itself it is never unused.
    switch: &'static str,
    /// What reads them.
    reader: &'static str,
    /// Whether it is there.
    read: fn(&Config) -> bool,
}

const RULES: [Rule; 13] = [
    Rule { keys: "drops", switch: "global.tightening", reader: DROPS, read: by_drops },
    Rule {
        keys: "calibration",
        switch: "global.tightening",
        reader: DROPS,
        // Of a calibration that is none, the rule below says what is not read.
        read: |config| by_drops(config) || config.calibration.epsilon >= 1.0,
    },
    Rule { keys: "global.share_draws", switch: "global.tightening", reader: DROPS, read: by_drops },
    Rule {
        keys: "global.risk",
        switch: "global.tightening",
        reader: DROPS,
        // A risk of 1 asks for none.
        read: |config| by_drops(config) || config.global.risk.is_none_or(|risk| risk >= 1.0),
    },
    Rule {
        keys: "calibration",
        switch: "calibration.epsilon",
        reader: "`calibration.epsilon` below 1",
        read: |config| config.calibration.epsilon < 1.0,
    },
    Rule {
        keys: "deterministic",
        switch: "deterministic.kind",
        reader: "`deterministic.kind`: \"pieces\", \"tube\" or \"lipschitz\"",
        read: |config| config.deterministic.kind != Enclosing::None,
    },
    Rule {
        keys: "sequential",
        switch: "sequential.of",
        reader: "`sequential.of`: \"set\", \"box\" or \"ball\" (or `--sequential`)",
        read: |config| config.sequential.of != SequentialOf::None,
    },
    Rule {
        keys: "sequential.radius",
        switch: "sequential.of",
        reader: "`sequential.of = \"ball\"`",
        read: |config| config.sequential.of == SequentialOf::Ball,
    },
    Rule { keys: "growth.around", switch: "global.tightening", reader: DROPS, read: by_drops },
    Rule { keys: "growth.factor", switch: "growth.method", reader: UPWARD, read: climbs },
    Rule { keys: "growth.pilot", switch: "growth.method", reader: UPWARD, read: climbs },
    Rule {
        keys: "growth.pilot",
        switch: "growth.shape",
        reader: "`growth.shape`: \"ellipsoid\" or \"box\"",
        read: |config| config.growth.shape != GrowthShape::Ball,
    },
    Rule {
        keys: "growth.split_beta",
        switch: "growth.method",
        reader: "`growth.method = \"shrinking\"`",
        read: |config| !climbs(config),
    },
];

/// What reads the keys of margin drops.
const DROPS: &str = "`global.tightening = \"drops\"`";
/// What reads the keys of growth upward.
const UPWARD: &str = "`growth.method = \"upward\"`";

fn by_drops(config: &Config) -> bool {
    config.global.tightening == TighteningSource::Drops
}

fn climbs(config: &Config) -> bool {
    config.growth.method == GrowthMethod::Upward
}

/// Whether the command line names a profile of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProfileOf {
    /// It does, and may so turn off what the file has keys for.
    CommandLine,
    /// The file's counts.
    File,
}

impl ProfileOf {
    /// What an option for the profile and the settings of other keys say.
    pub(super) fn of(profile: Option<Profile>, sets: &[String]) -> Self {
        let key = |set: &String| set.split('=').next().is_some_and(|key| key.trim() == "profile");
        match profile.is_some() || sets.iter().any(key) {
            true => Self::CommandLine,
            false => Self::File,
        }
    }
}

/// Refuses keys of `sources` that nothing reads. What a file has may be turned off by name, in the file or
/// over it; what is set over the file is meant to be read.
///
/// # Errors
/// [`Error::Invalid`] naming the key, and what would read it.
pub(super) fn check(config: &Config, sources: &Sources, profile: ProfileOf) -> Result<()> {
    for rule in RULES.iter().filter(|rule| !(rule.read)(config)) {
        let turned_off = sources.give(rule.switch) || profile == ProfileOf::CommandLine;
        let set = sources.set_within(rule.keys, rule.switch);
        let given = || sources.given_within(rule.keys, rule.switch).filter(|_| !turned_off);
        if let Some(key) = set.or_else(given) {
            let problem = format!(
                "nothing reads it: it is for {}; give that too, or leave this out",
                rule.reader
            );
            return Err(Error::invalid(key, problem));
        }
    }
    Ok(())
}
