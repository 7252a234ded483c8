//! The names of a description: states, controls, parameters, time, intermediate formulas.

use super::section::Section;
use crate::error::Result;
use crate::formula::text::Names;

/// The names that formulas may use; up to the first intermediate formula, the place of a name is
/// the input of the model that it stands for.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Scope {
    pub(super) names: Names,
    pub(super) states: usize,
    pub(super) controls: usize,
    pub(super) parameters: usize,
    /// For each place the control or the disturbance that it is or uses.
    behind: Vec<Option<u32>>,
}

/// Whether formulas know the time in seconds: without a period there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Seconds {
    Known,
    Unknown,
}

impl Scope {
    /// Adds `key` of `section`, which is `what` ("a state").
    pub(super) fn declare(
        &mut self,
        section: &Section<'_>,
        key: &str,
        what: &'static str,
    ) -> Result<()> {
        self.names.add(key, what).map_err(|problem| section.refuse(key, problem))
    }

    /// Adds the time and the number of the step.
    pub(super) fn declare_time(&mut self, seconds: Seconds) {
        match seconds {
            Seconds::Known => self.names.add_reserved("t"),
            Seconds::Unknown => self.names.skip(),
        }
        self.names.add_reserved("step");
        let control = |place: usize| (self.states..self.states + self.controls).contains(&place);
        self.behind =
            (0..self.inputs()).map(|place| control(place).then_some(place as u32)).collect();
    }

    /// Adds the disturbance `key` of `section`, behind the inputs of the model.
    pub(super) fn declare_disturbance(&mut self, section: &Section<'_>, key: &str) -> Result<()> {
        let place = self.names.len();
        self.declare(section, key, "a disturbance")?;
        self.note_deed(place, Some(place as u32));
        Ok(())
    }

    /// Inputs of each formula of the model.
    pub(super) fn inputs(&self) -> usize {
        self.states + self.controls + self.parameters + 2
    }

    /// The control or the disturbance that the name at `place` is, or that its formula uses.
    pub(super) fn deed_behind(&self, place: u32) -> Option<u32> {
        self.behind.get(place as usize).copied().flatten()
    }

    /// Whether the name at `place` is a control.
    pub(super) fn is_control(&self, place: u32) -> bool {
        (self.states..self.states + self.controls).contains(&(place as usize))
    }

    /// Notes the control or the disturbance that the name at `place` is or uses.
    pub(super) fn note_deed(&mut self, place: usize, deed: Option<u32>) {
        self.behind.resize(self.names.len(), None);
        self.behind[place] = deed;
    }
}
