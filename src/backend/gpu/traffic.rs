//! What calls cost the host: counted, so that tests can say what a prepared program leaves out.

use std::sync::atomic::{AtomicU64, Ordering};

/// What is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Count {
    /// Writes of the host to buffers.
    Write,
    /// Submissions.
    Submission,
    /// Waits for submissions.
    Wait,
    /// Buffers mapped and read.
    Read,
    /// Texts of formulas or kernels printed.
    Text,
    /// Kernels compiled.
    Pipeline,
    /// Networks packed.
    Pack,
    /// Buffers made.
    Buffer,
    /// Bind groups made.
    Group,
}

/// Number of [`Count`]s.
const COUNTS: usize = 9;

/// What the calls of an adapter cost the host so far, also those before it was opened again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "hidden, and named as what is counted")]
pub struct Traffic {
    pub writes: u64,
    pub submissions: u64,
    pub waits: u64,
    pub reads: u64,
    pub texts: u64,
    pub pipelines: u64,
    pub packs: u64,
    pub buffers: u64,
    pub groups: u64,
}

impl Traffic {
    /// What came on top of `before`.
    #[must_use]
    pub fn since(self, before: Self) -> Self {
        Self {
            writes: self.writes - before.writes,
            submissions: self.submissions - before.submissions,
            waits: self.waits - before.waits,
            reads: self.reads - before.reads,
            texts: self.texts - before.texts,
            pipelines: self.pipelines - before.pipelines,
            packs: self.packs - before.packs,
            buffers: self.buffers - before.buffers,
            groups: self.groups - before.groups,
        }
    }
}

/// Counters of an adapter.
#[derive(Default)]
pub(super) struct Counters([AtomicU64; COUNTS]);

impl Counters {
    /// Counts one more.
    pub(super) fn add(&self, what: Count) {
        self.0[what as usize].fetch_add(1, Ordering::Relaxed);
    }

    /// The counts so far.
    pub(super) fn so_far(&self) -> Traffic {
        let of = |what: Count| self.0[what as usize].load(Ordering::Relaxed);
        Traffic {
            writes: of(Count::Write),
            submissions: of(Count::Submission),
            waits: of(Count::Wait),
            reads: of(Count::Read),
            texts: of(Count::Text),
            pipelines: of(Count::Pipeline),
            packs: of(Count::Pack),
            buffers: of(Count::Buffer),
            groups: of(Count::Group),
        }
    }
}
