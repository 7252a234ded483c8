//! Models from text: sections of a TOML document, checked as they are read.

mod axes;
mod bodies;
mod control;
mod costs;
mod description;
mod disturbances;
mod dynamics;
mod interface;
mod lets;
mod maps;
mod names;
mod network;
mod network_file;
mod origin;
mod placed;
mod policy;
mod recorded_costs;
mod references;
mod section;
mod shapes;
mod step;
mod task;
mod written;

pub use axes::{MOST_CONTROLS, MOST_PARAMETERS, MOST_STATES, State, Topology};
pub use bodies::{Bodies, WrittenBody};
pub use costs::{MOST_COSTS, WrittenCosts, WrittenTerm};
pub use description::Description;
pub use disturbances::{Disturbance, MOST_DISTURBANCES};
pub use dynamics::{Dynamics, Integration, Integrator};
pub use maps::{MOST_MAPS, WrittenMap};
pub use network_file::{MOST_NETWORKS, NetworkFile};
pub use origin::Origin;
pub use policy::{NetworkPolicy, Policy};
pub use references::{MOST_REFERENCES, WrittenReference, WrittenSource};
pub use task::WrittenTask;
pub use written::Written;

use std::path::Path;

use toml::Table;

use crate::error::{Error, Result};
use crate::formula::text::LONGEST_TEXT;

/// The sections `model` and `policy` of the TOML document `text`, which errors call `origin`; paths
/// in it are relative to `folder`. Other sections are not looked at.
///
/// ```
/// use std::path::Path;
/// let text = r#"
/// [model]
/// name = "cart"
/// [model.states]
/// x = { unit = "m", box = [-1.0, 1.0] }
/// v = { unit = "m/s", box = [-1.0, 1.0] }
/// [model.controls]
/// force = { unit = "N", bounds = [-1.0, 1.0] }
/// [model.parameters]
/// mass = { unit = "kg", value = 2.0 }
/// [model.flow]
/// x = "v"
/// v = "force / mass"
/// [model.time]
/// period = 0.1
/// integrator = "rk4"
/// [model.task]
/// kind = "reach-avoid"
/// target = "0.1 - abs(x)"
/// constraint = "1 - abs(v)"
/// "#;
/// let model = reachcast::model::text::read(text, "cart.toml", Path::new("."))?.model()?;
/// // Position, velocity, force, mass, time, step.
/// let next = model.step.eval(&[0.0_f64, 1.0, 1.0, 2.0, 0.0, 0.0]);
/// assert!((next[0] - 0.1025).abs() < 1e-7 && (next[1] - 1.05).abs() < 1e-7);
/// # Ok::<(), reachcast::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] naming file, line, key and, in a formula, the column of the first thing that
/// is wrong, with what was expected and the nearest name.
pub fn read(text: &str, origin: &str, folder: &Path) -> Result<Description> {
    if text.len() > LONGEST_TEXT {
        let problem = format!("a model of {} bytes, at most {LONGEST_TEXT} are read", text.len());
        return Err(Error::invalid(origin, problem));
    }
    let origin = Origin::new(origin, folder).with_text(text);
    let table: Table = toml::from_str(text).map_err(|error| origin.refuse_toml(&error))?;
    read_table(&table, &origin)
}

/// The sections `model` and `policy` of `table`, as [`read`] reads them: what a configuration is
/// after values were laid over its text.
///
/// # Errors
/// As for [`read`].
pub fn read_table(table: &Table, origin: &Origin) -> Result<Description> {
    Description::read(table, origin)
}
