//! The `reachcast` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_mesa();
    ExitCode::from(reachcast::cli::run(std::env::args_os()))
}

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
