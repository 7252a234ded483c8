//! Stored certificates: read, shown as a page, and asked about two states.

#![no_main]

use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use reachcast::Result;
use reachcast::backend::{Backend, cpu::Cpu};
use reachcast::config::{Config, Job};
use reachcast::policy::Policy;
use reachcast::rollout::Plant;
use reachcast::scenario::record::Record;
use reachcast::scenario::query;
use reachcast::system::System;
use reachcast_fuzz::{policy, refused};

fn backend() -> &'static Backend {
    static BACKEND: OnceLock<Backend> = OnceLock::new();
    BACKEND.get_or_init(|| Backend::Cpu(Cpu::new(Some(1)).expect("a thread")))
}

struct Ask<'a> {
    record: &'a Record,
    config: &'a Config,
}

impl Job for Ask<'_> {
    type Output = ();

    fn run<S, P, const NX: usize, const NU: usize>(self, plant: Plant<'_, S, P>) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let settings = self.config.settings(&plant.system.states())?;
        query(backend(), plant, self.record, &settings, &[[0.0; NX], [0.5; NX]]).map(drop)
    }
}

fn read(record: &Record) -> Result<()> {
    let config = Config::from_json(&record.provenance.config)?;
    config.with_plant(&policy(&config), Ask { record, config: &config })
}

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Err(error) = Record::read(text) {
        refused(&error);
    }
    // Past the digests, which no change gets through: as if they had been computed again.
    let Ok(record) = serde_json::from_str::<Record>(text) else { return };
    let page = reachcast::report::html(&record);
    assert!(page.ends_with("</html>\n"));
    if let Err(error) = read(&record) {
        refused(&error);
    }
});
