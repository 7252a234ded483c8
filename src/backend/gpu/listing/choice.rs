//! Which adapter to open, and what is said where it is not there.

use super::adapter::Adapter;
use super::pci::PciAddress;
use crate::error::Result;

/// What a place on the PCI bus is written behind.
const PCI: &str = "pci:";
/// Numbers below it are places in the listing; longer ones are parts of names, as in `4090`.
const MOST_LISTED: usize = 100;

/// Which adapter to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The best one that is not software.
    Hardware,
    /// The best one; software where there is nothing else.
    Any,
    /// The best one whose name contains this text, in any case.
    Named(String),
    /// The one at this place of [`super::adapters`], from 0.
    Listed(usize),
    /// The one at this place on the PCI bus: of equal cards the one that is meant.
    Pci(PciAddress),
}

impl Choice {
    /// The choice that a text names: `pci:` and a place on the bus, a number below 100 for a place in the
    /// listing, or a part of a name.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] where a place on the bus does not read as one.
    pub fn parse(text: &str) -> Result<Self> {
        if let Some(place) = text.strip_prefix(PCI) {
            return PciAddress::parse(place).map(Self::Pci);
        }
        let listed = text.parse::<usize>().ok().filter(|place| *place < MOST_LISTED);
        Ok(listed.map_or_else(|| Self::Named(text.to_owned()), Self::Listed))
    }

    /// The first adapter that fits, of those listed.
    pub(super) fn among<'a, T>(&self, listed: &'a [(Adapter, T)]) -> Option<&'a (Adapter, T)> {
        match self {
            Self::Hardware => listed.iter().find(|(adapter, _)| adapter.is_hardware()),
            Self::Any => listed.first(),
            Self::Named(part) => {
                let part = part.to_lowercase();
                listed.iter().find(|(adapter, _)| adapter.name.to_lowercase().contains(&part))
            }
            Self::Listed(place) => listed.get(*place),
            Self::Pci(place) => listed.iter().find(|(adapter, _)| adapter.pci == Some(*place)),
        }
    }

    /// Why no adapter of those `listed` was opened, and what to do.
    pub(super) fn nothing_fits(&self, listed: &[Adapter]) -> String {
        if listed.is_empty() {
            return "no GPU adapter found; install a Vulkan driver (Metal or DX12 on their systems), \
                    or use the native CPU backend"
                .to_owned();
        }
        let line = |(place, adapter): (usize, &Adapter)| {
            let pci = adapter.pci.map_or_else(String::new, |pci| format!(" {PCI}{pci}"));
            format!("{place}: {adapter}{pci}")
        };
        let found = listed.iter().enumerate().map(line).collect::<Vec<_>>().join("; ");
        let remedy = "name one of these, or use the native CPU backend";
        match self {
            Self::Named(part) => {
                format!("no adapter's name contains `{part}`; found: {found}; {remedy}")
            }
            Self::Listed(place) => {
                format!("no adapter has the number {place}; found: {found}; {remedy}")
            }
            Self::Pci(place) => {
                format!("no adapter is at {PCI}{place}; found: {found}; {remedy}")
            }
            Self::Hardware | Self::Any => format!(
                "no hardware GPU adapter; found: {found}; name it to run on it all the same, \
                 or use the native CPU backend, which is faster than software adapters"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::adapter::AdapterKind;
    use super::*;

    /// Two equal cards and a program.
    fn listed() -> Vec<(Adapter, usize)> {
        let card = |bus: &str| Adapter {
            name: "RTX 4090".to_owned(),
            kind: AdapterKind::Discrete,
            pci: Some(PciAddress::parse(bus).unwrap()),
            ..Adapter::made_up(1)
        };
        let program = Adapter { kind: AdapterKind::Software, ..Adapter::made_up(1) };
        vec![(card("41:00.0"), 0), (card("c1:00.0"), 1), (program, 2)]
    }

    #[test]
    fn a_text_names_a_place_a_number_or_a_name() {
        let all = listed();
        for (text, place) in [
            ("pci:0000:c1:00.0", Some(1)),
            ("pci:c1:00.0", Some(1)),
            ("pci:02:00.0", None),
            ("1", Some(1)),
            ("3", None),
            ("4090", Some(0)),
            ("made", Some(2)),
            ("5090", None),
        ] {
            let choice = Choice::parse(text).unwrap();
            let chosen = choice.among(&all).map(|(_, place)| *place);
            assert_eq!(chosen, place, "{text}");
            let adapters: Vec<Adapter> = all.iter().map(|(adapter, _)| adapter.clone()).collect();
            let refusal = choice.nothing_fits(&adapters);
            assert!(refusal.contains("1: RTX 4090") && refusal.contains("pci:0000:c1:00.0"));
        }
        assert!(Choice::parse("pci:here").is_err());
        assert_eq!(Choice::Hardware.among(&all).unwrap().1, 0);
    }
}
