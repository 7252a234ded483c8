//! Networks that formulas call by their file.

use std::path::Path;

use crate::formula::text::{NetworkCall, shown};
use crate::policy::Mlp;

/// Why the call of a network is refused: its file, its width, or that no formula runs one yet.
pub(super) fn refusal(call: &NetworkCall, folder: &Path) -> String {
    let file = shown(&call.file);
    let network = match Mlp::load(&folder.join(&call.file)) {
        Ok(network) => network,
        Err(error) => return error.to_string(),
    };
    let widths = network.widths();
    let (inputs, outputs) = (widths[0], widths[widths.len() - 1]);
    let given = call.arguments.len();
    if given != inputs {
        return format!("the network `{file}` takes {inputs} inputs, found {given}");
    }
    if call.output as usize >= outputs {
        return format!(
            "the network `{file}` has the outputs 0 to {}, found [{}]",
            outputs - 1,
            call.output
        );
    }
    format!("the network `{file}` fits, but a network inside a formula cannot be run yet")
}
