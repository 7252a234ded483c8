//! What calls cost the host: counted, so that tests can say what a prepared program leaves out.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Count {
    /// Writes of the host to buffers.
    Write,
    /// Bytes of them.
    BytesWritten,
    /// Submissions.
    Submission,
    /// Passes of dispatches.
    Pass,
    /// Waits for submissions.
    Wait,
    /// Buffers mapped and read.
    Read,
    /// Bytes of them.
    BytesRead,
    /// Texts of formulas or kernels printed.
    Text,
    /// Kernels compiled.
    Pipeline,
    /// Networks packed.
    Pack,
    /// Plants and plannings made ready on a device.
    Program,
    /// Buffers made.
    Buffer,
    /// Bind groups made.
    Group,
}

/// Number of [`Count`]s.
const COUNTS: usize = 13;

/// What the calls of an adapter cost the host so far, also those before it was opened again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "hidden, and named as what is counted")]
pub struct Traffic {
    pub writes: u64,
    pub bytes_written: u64,
    pub submissions: u64,
    pub passes: u64,
    pub waits: u64,
    pub reads: u64,
    pub bytes_read: u64,
    pub texts: u64,
    pub pipelines: u64,
    pub packs: u64,
    pub programs: u64,
    pub buffers: u64,
    pub groups: u64,
}

impl Traffic {
    /// What came on top of `before`.
    #[must_use]
    pub fn since(self, before: Self) -> Self {
        Self {
            writes: self.writes - before.writes,
            bytes_written: self.bytes_written - before.bytes_written,
            submissions: self.submissions - before.submissions,
            passes: self.passes - before.passes,
            waits: self.waits - before.waits,
            reads: self.reads - before.reads,
            bytes_read: self.bytes_read - before.bytes_read,
            texts: self.texts - before.texts,
            pipelines: self.pipelines - before.pipelines,
            packs: self.packs - before.packs,
            programs: self.programs - before.programs,
            buffers: self.buffers - before.buffers,
            groups: self.groups - before.groups,
        }
    }
}

/// Counters of an adapter.
#[derive(Default)]
pub(super) struct Counters {
    counts: [AtomicU64; COUNTS],
    /// Time that submissions and waits took, ns.
    driver: AtomicU64,
}

impl Counters {
    /// Counts one more.
    pub(super) fn add(&self, what: Count) {
        self.add_many(what, 1);
    }

    /// Counts `number` more.
    pub(super) fn add_many(&self, what: Count, number: u64) {
        self.counts[what as usize].fetch_add(number, Ordering::Relaxed);
    }

    /// Does `work`, a submission or a wait, and adds the time that it takes.
    pub(super) fn in_driver<T>(&self, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let done = work();
        self.driver.fetch_add(begun.elapsed().as_nanos() as u64, Ordering::Relaxed);
        done
    }

    /// Time that submissions and waits took so far.
    pub(super) fn driver_time(&self) -> Duration {
        Duration::from_nanos(self.driver.load(Ordering::Relaxed))
    }

    /// The counts so far.
    pub(super) fn so_far(&self) -> Traffic {
        let of = |what: Count| self.counts[what as usize].load(Ordering::Relaxed);
        Traffic {
            writes: of(Count::Write),
            bytes_written: of(Count::BytesWritten),
            submissions: of(Count::Submission),
            passes: of(Count::Pass),
            waits: of(Count::Wait),
            reads: of(Count::Read),
            bytes_read: of(Count::BytesRead),
            texts: of(Count::Text),
            pipelines: of(Count::Pipeline),
            packs: of(Count::Pack),
            programs: of(Count::Program),
            buffers: of(Count::Buffer),
            groups: of(Count::Group),
        }
    }
}
