//! Stored certificates: read, shown as a page, and asked about two states.

#![no_main]

use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use reachcast::Result;
use reachcast::backend::{Backend, cpu::Cpu};
use reachcast::config::Config;
use reachcast::rollout::StateList;
use reachcast::scenario::query;
use reachcast::scenario::record::Record;
use reachcast_fuzz::{policy, refused};

fn backend() -> &'static Backend {
    static BACKEND: OnceLock<Backend> = OnceLock::new();
    BACKEND.get_or_init(|| Backend::Cpu(Cpu::new(Some(1)).expect("a thread")))
}

fn read(record: &Record) -> Result<()> {
    let config = Config::from_json(&record.provenance.config)?;
    let plant = config.plant(&policy(&config))?;
    let axes = &plant.model.states;
    let states = [0.0, 0.5].map(|value| vec![value; axes.len()]);
    let states = StateList::new(axes.len()).with(states);
    let program = backend().prepare(&plant)?;
    query(&program, record, &config.settings(axes)?, states.view()).map(drop)
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
