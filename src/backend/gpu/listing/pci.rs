//! Places on the PCI bus: what tells cards of one name apart.

use std::fmt;

use crate::error::{Error, Result};

/// The place of a card on the PCI bus, as `0000:01:00.0`: domain, bus, device, function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PciAddress {
    domain: u32,
    bus: u8,
    device: u8,
    function: u8,
}

impl PciAddress {
    /// Reads `domain:bus:device.function`, hexadecimal; without a domain it is 0, without a function too.
    ///
    /// # Errors
    /// [`Error::Invalid`] for any other text.
    pub fn parse(text: &str) -> Result<Self> {
        Self::read(text).ok_or_else(|| {
            let problem = "is no place on the PCI bus; it looks like 0000:01:00.0";
            Error::invalid(format!("pci:{text}"), problem)
        })
    }

    /// The same; none for any other text.
    pub(super) fn read(text: &str) -> Option<Self> {
        let (place, function) = text.trim().rsplit_once('.').unwrap_or((text.trim(), "0"));
        let mut parts = place.rsplit(':');
        let device = u8::from_str_radix(parts.next()?, 16).ok()?;
        let bus = u8::from_str_radix(parts.next()?, 16).ok()?;
        let domain = u32::from_str_radix(parts.next().unwrap_or("0"), 16).ok()?;
        let function = u8::from_str_radix(function, 16).ok()?;
        (parts.next().is_none() && device < 32 && function < 8).then_some(Self {
            domain,
            bus,
            device,
            function,
        })
    }

    /// The place that the kernel's driver for AMD's cards counts as `location`: bus, device and function
    /// in 8, 5 and 3 bits.
    pub(super) fn of_location(domain: u32, location: u16) -> Self {
        let [bus, rest] = location.to_be_bytes();
        Self { domain, bus, device: rest >> 3, function: rest & 7 }
    }
}

impl fmt::Display for PciAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { domain, bus, device, function } = self;
        write!(f, "{domain:04x}:{bus:02x}:{device:02x}.{function:x}")
    }
}

impl serde::Serialize for PciAddress {
    fn serialize<S: serde::Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_however_long_they_are_written() {
        let place = PciAddress { domain: 0, bus: 0xc1, device: 0x1f, function: 7 };
        for text in ["0000:c1:1f.7", "00000000:C1:1F.7", "c1:1f.7", " c1:1f.7\n"] {
            assert_eq!(PciAddress::parse(text).unwrap(), place, "{text}");
        }
        assert_eq!(place.to_string(), "0000:c1:1f.7");
        assert_eq!(PciAddress::parse("1:0").unwrap().to_string(), "0000:01:00.0");
        assert_eq!(PciAddress::of_location(0, 0xc1ff), place);
        for text in ["", "1", "0:0:0:0.0", "0000:01:20.0", "0000:01:00.8", "x:y.z", "0000:101:00.0"]
        {
            let refused = PciAddress::parse(text).unwrap_err().to_string();
            assert!(refused.contains("0000:01:00.0"), "{text}: {refused}");
        }
    }
}
