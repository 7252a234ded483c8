//! The cards that a process may use, where its environment says so in the words of CUDA or ROCm.

use super::assigned::{Assigned, Named};
use super::pci::PciAddress;

/// Who made a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Maker {
    Nvidia,
    Amd,
    Other,
}

impl Maker {
    /// The maker that PCI knows by `number`.
    pub(super) fn of(number: u32) -> Self {
        match number {
            0x10de => Self::Nvidia,
            0x1002 | 0x1022 => Self::Amd,
            _ => Self::Other,
        }
    }
}

/// A card of the listing.
#[derive(Clone, Debug)]
pub(super) struct Card {
    pub(super) maker: Maker,
    pub(super) name: String,
    pub(super) pci: Option<PciAddress>,
}

/// What of a listing may be used.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Visible {
    /// Places in the listing of those cards, the environment's first choice first.
    pub(super) order: Vec<usize>,
    /// What was hidden, in words.
    pub(super) notes: Vec<String>,
    /// Why the environment's words cannot be followed, where they cannot: no card may be picked then
    /// but one that is named by its place on the bus.
    pub(super) obstacle: Option<String>,
}

/// The cards among `cards` that `assigned` leaves, those that it says nothing of behind them.
pub(super) fn visible(cards: &[Card], assigned: &Assigned) -> Visible {
    let mut visible = Visible::default();
    let nvidia = places(cards, |card| card.maker == Maker::Nvidia && assigned.cuda.is_some());
    let rocm_variable = match (&assigned.hip, &assigned.rocr) {
        (Some(_), _) => Some("HIP_VISIBLE_DEVICES"),
        (None, Some(_)) => Some("ROCR_VISIBLE_DEVICES"),
        (None, None) => None,
    };
    // A card that ROCm does not know is none that it could lend.
    let lent = |card: &Card| {
        assigned.amd.is_empty() || assigned.amd.iter().any(|known| Some(known.pci) == card.pci)
    };
    let amd =
        places(cards, |card| card.maker == Maker::Amd && rocm_variable.is_some() && lent(card));
    visible.follow(cards, &nvidia, "CUDA_VISIBLE_DEVICES", || cuda(cards, assigned));
    visible.follow(cards, &amd, rocm_variable.unwrap_or_default(), || rocm(assigned));
    let governed = |i: &usize| nvidia.contains(i) || amd.contains(i);
    visible.order.extend((0..cards.len()).filter(|i| !governed(i)));
    visible
}

/// The places of the cards that fit.
fn places(cards: &[Card], fits: impl Fn(&Card) -> bool) -> Vec<usize> {
    (0..cards.len()).filter(|i| fits(&cards[*i])).collect()
}

impl Visible {
    /// Takes of the cards at `own`, which `variable` governs, those that are lent; all of them where that
    /// is not known.
    fn follow(
        &mut self,
        cards: &[Card],
        own: &[usize],
        variable: &str,
        lent: impl FnOnce() -> Result<Vec<PciAddress>, String>,
    ) {
        if own.is_empty() {
            return;
        }
        let lent = match lent() {
            Ok(lent) => lent,
            Err(problem) => {
                self.order.extend(own);
                self.obstacle = Some(format!("{variable} {problem}"));
                return;
            }
        };
        let mut taken = Vec::new();
        for place in lent {
            taken.extend(own.iter().filter(|i| cards[**i].pci == Some(place)));
        }
        for hidden in own.iter().filter(|i| !taken.contains(i)).map(|i| &cards[*i]) {
            let place = hidden.pci.map_or_else(String::new, |pci| format!(" (pci:{pci})"));
            self.notes.push(format!("{}{place} is hidden by {variable}", hidden.name));
        }
        self.order.extend(taken);
    }
}

/// The places that `CUDA_VISIBLE_DEVICES` names, in its order.
fn cuda(cards: &[Card], assigned: &Assigned) -> Result<Vec<PciAddress>, String> {
    let asked = assigned.cuda.as_deref().unwrap_or_default();
    let own: Vec<&Card> = cards.iter().filter(|card| card.maker == Maker::Nvidia).collect();
    let mut known = assigned.nvidia.clone();
    for pci in own.iter().filter_map(|card| card.pci) {
        if !known.iter().any(|card| card.pci == pci) {
            known.push(Named { pci, uuid: String::new() });
        }
    }
    known.sort_by_key(|card| card.pci);
    let alike = own.windows(2).all(|pair| pair[0].name == pair[1].name);
    let by_bus = assigned.cuda_order.as_deref() == Some("PCI_BUS_ID");
    let counted = asked.split(',').any(|entry| entry.trim().parse::<u32>().is_ok());
    // CUDA counts the fastest card first, which only CUDA knows; of equal ones, by the bus.
    if counted && known.len() > 1 && !alike && !by_bus {
        return Err(format!(
            "is {asked}, and which cards CUDA counts so cannot be told for cards of several kinds; \
             set CUDA_DEVICE_ORDER=PCI_BUS_ID"
        ));
    }
    picked(asked, &known)
}

/// The places that the variables of ROCm name, in their order.
fn rocm(assigned: &Assigned) -> Result<Vec<PciAddress>, String> {
    let known = &assigned.amd;
    if known.is_empty() {
        return Err("is set, and the system does not tell how ROCm counts the cards".to_owned());
    }
    let left = match &assigned.rocr {
        None => known.clone(),
        Some(asked) => {
            let places = picked(asked, known)?;
            let card = |place| known.iter().find(|card| card.pci == place).cloned();
            places.into_iter().filter_map(card).collect()
        }
    };
    match &assigned.hip {
        None => Ok(left.into_iter().map(|card| card.pci).collect()),
        Some(asked) => picked(asked, &left),
    }
}

/// The places of the cards that a list names by number or by the beginning of their identity. As the
/// makers' systems do it, the list ends at the first entry that is no card.
fn picked(asked: &str, known: &[Named]) -> Result<Vec<PciAddress>, String> {
    let mut places: Vec<PciAddress> = Vec::new();
    for entry in asked.split(',').map(str::trim) {
        let place = match entry.parse::<usize>() {
            Ok(number) => known.get(number).map(|card| card.pci),
            Err(_) => identified(entry, known)?,
        };
        let Some(place) = place else { break };
        if !places.contains(&place) {
            places.push(place);
        }
    }
    Ok(places)
}

/// The place of the card whose identity begins with `entry`; none where there is none.
fn identified(entry: &str, known: &[Named]) -> Result<Option<PciAddress>, String> {
    // A slice of a card (MIG) is none that Vulkan lists.
    if !entry.starts_with("GPU-") {
        return Ok(None);
    }
    let named = known.iter().find(|card| card.uuid.starts_with(entry));
    // A driver without right to tell writes question marks.
    let told = |card: &Named| card.uuid.starts_with("GPU-") && !card.uuid.contains('?');
    if named.is_none() && !known.iter().all(told) {
        return Err(format!("names {entry}, and the system does not tell which card that is"));
    }
    Ok(named.map(|card| card.pci))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(bus: u8) -> PciAddress {
        PciAddress::parse(&format!("{bus:x}:00.0")).unwrap()
    }

    fn card(maker: Maker, name: &str, bus: u8) -> Card {
        Card { maker, name: name.to_owned(), pci: Some(at(bus)) }
    }

    fn named(bus: u8, uuid: &str) -> Named {
        Named { pci: at(bus), uuid: uuid.to_owned() }
    }

    /// Two equal cards that the driver lists against the bus, and a processor's unit.
    fn pair() -> Vec<Card> {
        let nvidia = |bus| card(Maker::Nvidia, "H100", bus);
        vec![nvidia(0x41), nvidia(0x01), card(Maker::Other, "unit", 0)]
    }

    fn asked(cuda: &str) -> Assigned {
        let nvidia = vec![named(0x41, "GPU-abcd"), named(0x01, "GPU-ab12")];
        Assigned { cuda: Some(cuda.to_owned()), nvidia, ..Assigned::default() }
    }

    #[test]
    fn all_are_visible_where_nothing_is_asked() {
        assert_eq!(visible(&pair(), &Assigned::default()).order, [0, 1, 2]);
    }

    #[test]
    fn numbers_count_equal_cards_by_the_bus() {
        for (list, order) in [
            ("0", vec![1, 2]),
            ("1", vec![0, 2]),
            ("1,0", vec![0, 1, 2]),
            ("0,0", vec![1, 2]),
            // The list ends at the first entry that is no card.
            ("0,7,1", vec![1, 2]),
            ("", vec![2]),
            ("-1", vec![2]),
            ("GPU-abcd", vec![0, 2]),
            ("GPU-ab1", vec![1, 2]),
            ("MIG-1234", vec![2]),
        ] {
            let seen = visible(&pair(), &asked(list));
            assert_eq!(seen.order, order, "{list}");
            assert_eq!(seen.notes.len(), 3 - order.len(), "{list}: {:?}", seen.notes);
            assert_eq!(seen.obstacle, None, "{list}");
        }
        let hidden = &visible(&pair(), &asked("0")).notes[0];
        assert_eq!(hidden, "H100 (pci:0000:41:00.0) is hidden by CUDA_VISIBLE_DEVICES");
    }

    #[test]
    fn cards_of_several_kinds_are_counted_by_the_bus_only_where_that_is_asked_for() {
        let cards = [card(Maker::Nvidia, "H100", 0x41), card(Maker::Nvidia, "T4", 0x01)];
        let seen = visible(&cards, &asked("0"));
        assert!(seen.obstacle.is_some_and(|text| text.contains("CUDA_DEVICE_ORDER=PCI_BUS_ID")));
        let ordered = Assigned { cuda_order: Some("PCI_BUS_ID".to_owned()), ..asked("0") };
        assert_eq!(visible(&cards, &ordered).order, [1]);
        assert_eq!(visible(&cards, &asked("GPU-abcd")).order, [0]);
    }

    #[test]
    fn an_identity_that_nobody_knows_is_no_guess() {
        let secret = Assigned { nvidia: vec![named(0x41, "GPU-????")], ..asked("GPU-abcd") };
        let seen = visible(&pair(), &secret);
        assert!(seen.obstacle.is_some_and(|text| text.contains("GPU-abcd")));
        assert_eq!(seen.order, [0, 1, 2]);
    }

    #[test]
    fn hip_counts_what_rocr_left() {
        let amd = |bus| card(Maker::Amd, "MI300X", bus);
        let cards = [amd(0x03), amd(0x63), amd(0xa3), card(Maker::Amd, "unit", 0xf0)];
        let of = |rocr: Option<&str>, hip: Option<&str>| Assigned {
            rocr: rocr.map(str::to_owned),
            hip: hip.map(str::to_owned),
            amd: vec![named(0x03, "GPU-1"), named(0x63, "GPU-2"), named(0xa3, "GPU-3")],
            ..Assigned::default()
        };
        assert_eq!(visible(&cards, &of(Some("2,0"), None)).order, [2, 0, 3]);
        assert_eq!(visible(&cards, &of(Some("2,0"), Some("1"))).order, [0, 3]);
        assert_eq!(visible(&cards, &of(None, Some("1"))).order, [1, 3]);
        assert_eq!(visible(&cards, &of(Some("GPU-3"), None)).order, [2, 3]);
        let untold = Assigned { amd: Vec::new(), ..of(None, Some("1")) };
        assert!(visible(&cards, &untold).obstacle.is_some());
        assert_eq!(visible(&pair(), &untold).obstacle, None, "there is no card to lend");
    }
}
