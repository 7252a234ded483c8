//! The `reachcast` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_mesa();
    heed_file_limits();
    ExitCode::from(reachcast::cli::run(std::env::args_os()))
}

/// A write beyond the limit on the size of files (`ulimit -f`) fails with a message, where its signal
/// would end the program without one.
#[cfg(unix)]
fn heed_file_limits() {
    use nix::sys::signal::{SigSet, Signal};
    // Threads that start later inherit the mask. Where it cannot be set, all is as without it.
    _ = SigSet::from_iter([Signal::SIGXFSZ]).thread_block();
}

/// Only Unix has such limits.
#[cfg(not(unix))]
fn heed_file_limits() {}

/// Without a display, Mesa's device selection layer complains on stderr at every start and goes on
/// without a choice to make; it is left out then.
#[allow(unsafe_code, reason = "the variable is set before any thread exists")]
fn quiet_mesa() {
    let headless = std::env::var_os("XDG_RUNTIME_DIR").is_none();
    if headless && std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: `main` has started no thread that could read the environment at the same time.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
