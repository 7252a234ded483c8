//! TOML configurations: read, checked against their plant, stored and read again.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast::Result;
use reachcast::config::{Config, Job, Overrides};
use reachcast::policy::Policy;
use reachcast::rollout::Plant;
use reachcast::scenario::check_settings;
use reachcast::system::System;
use reachcast_fuzz::{policy, refused, with_file};

struct Settings<'a>(&'a Config);

impl Job for Settings<'_> {
    type Output = ();

    fn run<S, P, const NX: usize, const NU: usize>(self, plant: Plant<'_, S, P>) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        check_settings(&self.0.settings(&plant.system.states())?)
    }
}

fn read(config: &Config) -> Result<()> {
    let stored = config.to_json()?;
    assert_eq!(Config::from_json(&stored)?.to_json()?, stored);
    config.with_plant(&policy(config), Settings(config))
}

fuzz_target!(|bytes: &[u8]| {
    let config = with_file("fuzz.toml", bytes, |path| Config::load(path, &Overrides::default()));
    if let Err(error) = config.and_then(|config| read(&config)) {
        refused(&error);
    }
});
