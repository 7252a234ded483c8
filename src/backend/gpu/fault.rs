//! Failures of a device: noted as they come, and injected where a test asks for them.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::error::Fault;

/// A failure of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Failure {
    /// Its kind.
    pub(super) fault: Fault,
    /// What the driver says.
    pub(super) problem: String,
}

/// Failures of a device, in order.
#[derive(Default)]
pub(super) struct Faults(Mutex<Vec<Failure>>);

impl Faults {
    /// Adds a failure.
    pub(super) fn note(&self, fault: Fault, problem: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(Failure { fault, problem });
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    /// What fails a call that began when there were `seen`: the loss of the device, whenever it
    /// was, else the first failure since: later ones follow from it.
    pub(super) fn since(&self, seen: usize) -> Option<Failure> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let lost = all.iter().find(|failure| failure.fault == Fault::Lost);
        lost.or(all.get(seen)).cloned()
    }
}

/// A failure that a test asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Injection {
    /// How the device fails.
    pub fault: Fault,
    /// At which submission, counted from 0 over all calls; also after the adapter was opened again.
    pub submission: u64,
    /// Whether all later ones fail too.
    pub repeats: bool,
}

/// The failures that a test asks for, and the submissions so far.
#[derive(Default)]
pub(super) struct Injector {
    asked: Vec<Injection>,
    submissions: AtomicU64,
}

impl Injector {
    /// Fails as `asked`, from submission 0 on.
    pub(super) fn new(asked: Vec<Injection>) -> Self {
        Self { asked, submissions: AtomicU64::new(0) }
    }

    /// Counts a submission; how it fails, if it does.
    pub(super) fn next(&self) -> Option<Fault> {
        let number = self.submissions.fetch_add(1, Ordering::Relaxed);
        let meant = |asked: &&Injection| {
            asked.submission == number || (asked.repeats && asked.submission < number)
        };
        self.asked.iter().find(meant).map(|asked| asked.fault)
    }

    /// Submissions so far.
    pub(super) fn submissions(&self) -> u64 {
        self.submissions.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_fails_for_its_own_faults_and_for_a_lost_device() {
        let faults = Faults::default();
        let note = |fault, text: &str| faults.note(fault, text.to_owned());
        note(Fault::OutOfMemory, "an earlier call");
        assert_eq!(faults.since(faults.count()), None);
        note(Fault::Validation, "first");
        note(Fault::Timeout, "second");
        let failed = |fault, text: &str| Some(Failure { fault, problem: text.to_owned() });
        assert_eq!(faults.since(1), failed(Fault::Validation, "first"));
        note(Fault::Lost, "gone");
        let gone = failed(Fault::Lost, "gone");
        assert_eq!((faults.since(1), faults.since(faults.count())), (gone.clone(), gone));
    }

    #[test]
    fn injected_where_asked() {
        let once = Injection { fault: Fault::Timeout, submission: 1, repeats: false };
        let onwards = Injection { fault: Fault::Lost, submission: 3, repeats: true };
        let injector = Injector::new(vec![once, onwards]);
        let found: Vec<_> = (0..5).map(|_| injector.next()).collect();
        let lost = Some(Fault::Lost);
        assert_eq!(found, [None, Some(Fault::Timeout), None, lost, lost]);
        assert_eq!(injector.submissions(), 5);
    }
}
