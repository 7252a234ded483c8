//! Progress on standard error, and stopping at Ctrl-C.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::options::Global;
use crate::error::{Error, Result};
use crate::scenario::Watch;

/// Set by Ctrl-C or a termination signal.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Exit code of a program that was interrupted.
const FAILED: i32 = 1;

/// Asks the work to stop, and stops the program where it was asked before: what is being written
/// then stays under its temporary name, which the next run removes.
fn interrupt() {
    let again = INTERRUPTED.swap(true, Ordering::Relaxed);
    let text = match again {
        false => "interrupted: stopping at the next chance; again to stop at once\n",
        true => "error: interrupted again, stopped at once\n",
    };
    // Nobody reads what a closed pipe does not take.
    let _ = std::io::stderr().write_all(text.as_bytes());
    if again {
        std::process::exit(FAILED);
    }
}

/// Work that is done sooner shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// A bar per stage with rate and time left, on a terminal and for work over a second.
#[derive(Debug)]
pub(crate) struct Progress {
    begun: Instant,
    visible: bool,
    bar: Mutex<ProgressBar>,
}

impl Progress {
    /// A bar for the command, and the end of the work at Ctrl-C.
    pub(crate) fn new(global: &Global) -> Self {
        // A second handler is refused: tests of this library may run commands side by side.
        let _ = ctrlc::set_handler(interrupt);
        Self {
            begun: Instant::now(),
            visible: std::io::stderr().is_terminal() && !global.common.json && !global.common.quiet,
            bar: Mutex::new(ProgressBar::hidden()),
        }
    }

    /// Takes the bar off the screen.
    pub(crate) fn finish(&self) {
        self.with_bar(|bar| bar.finish_and_clear());
    }

    /// [`Error::Interrupted`] once Ctrl-C was pressed.
    pub(crate) fn check(&self) -> Result<()> {
        match INTERRUPTED.load(Ordering::Relaxed) {
            true => Err(Error::Interrupted),
            false => Ok(()),
        }
    }

    fn with_bar<T>(&self, work: impl FnOnce(&mut ProgressBar) -> T) -> T {
        // A bar has no state that a panic elsewhere could break.
        let mut bar = self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        work(&mut bar)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Rollouts per second, whole.
fn rate(state: &ProgressState, out: &mut dyn std::fmt::Write) {
    // A bar that cannot be written to is no reason to stop the work.
    let _ = write!(out, "{}/s", HumanCount(state.per_sec() as u64));
}

impl Watch for Progress {
    fn begin(&self, stage: &str, total: u64) {
        let template = "{msg:28} [{bar:24}] {percent:>3} %  {rate}, {eta} left";
        let style = ProgressStyle::with_template(template);
        let style = style
            .unwrap_or_else(|_| ProgressStyle::default_bar())
            .with_key("rate", rate)
            .progress_chars("=> ");
        self.with_bar(|bar| {
            bar.finish_and_clear();
            *bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden())
                .with_style(style)
                .with_message(super::plain(stage));
        });
    }

    fn advance(&self, count: u64) -> Result<()> {
        self.with_bar(|bar| {
            if self.visible && bar.is_hidden() && self.begun.elapsed() > PATIENCE {
                bar.set_draw_target(ProgressDrawTarget::stderr());
            }
            bar.inc(count);
        });
        self.check()
    }
}
