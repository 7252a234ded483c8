//! Networks that formulas call by their files: read once each, and held against their calls.

use std::path::PathBuf;

use super::description::Description;
use super::dynamics::Dynamics;
use super::network_file::{MOST_NETWORKS, NetworkFile};
use super::policy::Policy;
use super::written::Written;
use crate::error::Result;
use crate::formula::text::{NetworkCall, Networks, shown};
use crate::policy::Mlp;

/// A formula's call of a network.
type Found<'a> = (&'a Written, &'a NetworkCall);

impl Description {
    /// The networks that formulas call, each once: intermediate formulas first, then the dynamics, the
    /// margins, the policy. The file of number `i`, from 0, which formulas call `name`, is at
    /// `place(i, name)`.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming formula and column of a call whose network cannot be read, or that gives
    /// it another number of inputs or asks for an output that it does not have.
    pub fn networks(&self, place: impl Fn(usize, &str) -> PathBuf) -> Result<Vec<NetworkFile>> {
        let mut files = Vec::new();
        self.gather(&mut files, self.calls(), place)?;
        Ok(files)
    }

    /// Adds to `files` those that `calls` call and that are not there.
    fn gather<'a>(
        &self,
        files: &mut Vec<NetworkFile>,
        calls: impl Iterator<Item = Found<'a>>,
        place: impl Fn(usize, &str) -> PathBuf,
    ) -> Result<()> {
        for (written, call) in calls {
            let refuse = |problem: String| written.refuse(&self.origin, call.at, problem);
            let known = files.iter().position(|file| file.name == call.file);
            let at = known.unwrap_or(files.len());
            if at == MOST_NETWORKS {
                return Err(refuse(format!("more than {MOST_NETWORKS} files of networks")));
            }
            if known.is_none() {
                let file = NetworkFile::read(&call.file, place(at, &call.file));
                files.push(file.map_err(|error| refuse(error.to_string()))?);
            }
            check(call, &files[at].network).map_err(refuse)?;
        }
        Ok(())
    }

    /// The same description with the networks that its formulas call, which are then not read again.
    #[must_use]
    pub fn with_networks(self, networks: Vec<NetworkFile>) -> Self {
        Self { networks: Some(networks), ..self }
    }

    /// The networks by their names: those that were given, or those beside the description.
    pub(super) fn table(&self) -> Result<Networks> {
        self.table_with(&[])
    }

    /// The same with those that `formulas` of costs call, which lie beside the description where they are
    /// not among those that were given.
    pub(super) fn table_with(&self, formulas: &[&Written]) -> Result<Networks> {
        let beside = |_: usize, name: &str| self.origin.folder.join(name);
        let mut files = match &self.networks {
            Some(given) => self.networks_among(given)?,
            None => self.networks(beside)?,
        };
        self.gather(&mut files, formulas.iter().flat_map(|written| calls_of(written)), beside)?;
        let mut table = Networks::default();
        files.into_iter().for_each(|file| table.add(&file.name, file.network));
        Ok(table)
    }

    /// Those of `given` that formulas call.
    fn networks_among(&self, given: &[NetworkFile]) -> Result<Vec<NetworkFile>> {
        for (written, call) in self.calls() {
            let refuse = |problem: String| written.refuse(&self.origin, call.at, problem);
            let file = given.iter().find(|file| file.name == call.file);
            let missing = || refuse(format!("the network `{}` was not given", shown(&call.file)));
            check(call, &file.ok_or_else(missing)?.network).map_err(refuse)?;
        }
        Ok(given.to_vec())
    }

    /// All calls of networks.
    fn calls(&self) -> impl Iterator<Item = Found<'_>> {
        let (Dynamics::Next(moves) | Dynamics::Flow(moves, _)) = &self.dynamics;
        let law: Vec<&Written> = match &self.policy {
            None => Vec::new(),
            Some(Policy::Formulas(formulas)) => formulas.iter().collect(),
            Some(Policy::Network(policy)) => {
                [&policy.observe, &policy.act].into_iter().flatten().flatten().collect()
            }
        };
        let margins = [&self.task.target, &self.task.constraint].into_iter().flatten();
        let all = self.lets.written().iter().chain(moves).chain(margins).chain(law);
        all.flat_map(calls_of)
    }
}

/// The calls of a formula.
fn calls_of(written: &Written) -> impl Iterator<Item = Found<'_>> {
    written.formula.networks().iter().map(move |call| (written, call))
}

/// Why `network` does not fit the call.
fn check(call: &NetworkCall, network: &Mlp) -> std::result::Result<(), String> {
    let (file, widths, given) = (shown(&call.file), network.widths(), call.arguments.len());
    let (inputs, outputs) = (widths[0], widths[widths.len() - 1]);
    if given != inputs {
        let plural = if inputs == 1 { "" } else { "s" };
        return Err(format!("the network `{file}` takes {inputs} input{plural}, found {given}"));
    }
    if call.output as usize >= outputs {
        let last = outputs - 1;
        let output = call.output;
        return Err(format!("the network `{file}` has the outputs 0 to {last}, found [{output}]"));
    }
    Ok(())
}
