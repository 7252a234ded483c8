//! Certificates of an adapter that fails half-way: they say so, hold, and can be checked.

use reachcast::Fault;
use reachcast::backend::cpu::Cpu;
use reachcast::backend::gpu::{Gpu, Injection};
use reachcast::backend::{Action, Backend};
use reachcast::model::Plant;
use reachcast::report::html;
use reachcast::scenario::record::Record;
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{Unwatched, certify, check};
use reachcast::system::{BangBang, DoubleIntegrator};

use crate::common::settings;
use crate::gpu;

/// The double integrator, of which a ball beyond the certified set is verified.
fn integrator() -> (Plant, Settings) {
    let system = DoubleIntegrator::default();
    let mut settings = settings(&system, 30);
    settings.state = vec![0.9, 0.6];
    settings.growth.radius = 0.2;
    (Plant::of(system, BangBang { acceleration: 1.0 }), settings)
}

fn certificate(backend: &Backend) -> Record {
    let (plant, settings) = integrator();
    let program = backend.prepare(&plant).expect("a program");
    let config = serde_json::json!({ "seed": settings.seed });
    certify(&program, &settings, config, &Unwatched).expect("a certificate")
}

/// Whether every finding of a check on `backend` holds.
fn holds(backend: &Backend, record: &Record) -> bool {
    let (plant, settings) = integrator();
    let program = backend.prepare(&plant).expect("a program");
    let report = check(&program, record, &settings, 7, &Unwatched).expect("a check");
    report.findings.iter().filter(|finding| !finding.holds).for_each(|f| println!("{f:?}"));
    report.holds
}

fn host() -> Cpu {
    Cpu::new(Some(2)).expect("two threads")
}

fn failing(gpu: Gpu, fault: Fault, submission: u64) -> Backend {
    let asked = vec![Injection { fault, submission, repeats: false }];
    Backend::Gpu(gpu.with_fallback(host()).with_failures(asked))
}

#[test]
fn a_certificate_of_two_backends_says_so_and_holds() {
    let Some(first) = gpu() else { return };
    let plain_backend = Backend::Gpu(first);
    let plain = certificate(&plain_backend);
    assert_eq!(plain.events, []);
    assert!(!html(&plain).contains("What failed on the adapter"));
    for (fault, action) in [
        (Fault::Validation, Action::Cpu),
        (Fault::OutOfMemory, Action::SmallerChunks(64)),
        (Fault::Lost, Action::Reopened),
    ] {
        let Some(gpu) = gpu() else { return };
        // At the 66 pairs of the deviation bound, after those of its pilot.
        let backend = failing(gpu, fault, 1);
        let mixed = certificate(&backend);
        assert!(mixed.holds, "{:?}", mixed.statements);
        let [event] = &mixed.events[..] else { panic!("one event: {:?}", mixed.events) };
        assert_eq!((event.fault, event.action), (fault, action), "{event}");
        let page = html(&mixed);
        assert!(page.contains("What failed on the adapter"));
        assert!(page.contains(&fault.to_string()), "{fault}");
        // Whatever the work went on on, these are counts of the same starts.
        assert_eq!(mixed.global.draws, plain.global.draws);
        assert!(mixed.global.accepted.abs_diff(plain.global.accepted) <= 1);
        let stored: Record =
            serde_json::from_str(&serde_json::to_string(&mixed).expect("JSON")).expect("a record");
        assert_eq!(stored, mixed);
        assert!(holds(&plain_backend, &stored), "checked on the adapter");
        assert!(holds(&Backend::Cpu(host()), &stored), "checked on the CPU");
        assert!(holds(&backend, &stored), "checked on what made it");
    }
}

/// Records of before there were events are read as free of them.
#[test]
fn a_record_without_events_is_read() {
    let record = certificate(&Backend::Cpu(host()));
    let mut value = serde_json::to_value(&record).expect("JSON");
    value.as_object_mut().expect("an object").remove("events").expect("it has the field");
    let read: Record = serde_json::from_value(value).expect("a record");
    assert_eq!(read, record);
}
