//! TOML configurations: read, checked against their plant, stored and read again.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast::Result;
use reachcast::config::{Config, Overrides};
use reachcast::scenario::check_settings;
use reachcast_fuzz::{policy, refused, with_file};

fn read(config: &Config) -> Result<()> {
    let stored = config.to_json()?;
    assert_eq!(Config::from_json(&stored)?.to_json()?, stored);
    let plant = config.plant(&policy(config))?;
    check_settings(&config.settings(&plant.model.states)?)
}

fuzz_target!(|bytes: &[u8]| {
    let config = with_file("fuzz.toml", bytes, |path| Config::load(path, &Overrides::default()));
    if let Err(error) = config.and_then(|config| read(&config)) {
        refused(&error);
    }
});
