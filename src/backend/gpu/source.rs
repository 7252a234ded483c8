//! Plants as the kernels need them, on no device yet.

use std::sync::{Arc, Mutex, PoisonError};

use super::compose::PlantText;
use crate::error::Result;
use crate::model::{Controller, Model, Plant};
use crate::policy::{Layer, Mlp};

/// Sources that are remembered.
const REMEMBERED: usize = 16;

/// A plant printed, and the network that drives it, if one does: apart from those that formulas call,
/// which the text holds.
pub(super) struct Source {
    /// The texts of its kernels, its network in layers.
    pub(super) text: PlantText,
    /// The network.
    pub(super) network: Option<Arc<Mlp>>,
}

impl Source {
    /// Prints `model` and `controller`.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] where their parts do not fit.
    pub(super) fn new(model: &Model, controller: &Controller) -> Result<Self> {
        let controller = &*controller.unmapped(model);
        let text = PlantText::new(model, controller)?;
        // In a chain it is one of the networks that are called.
        let driving = controller.shared_network().filter(|_| text.chain().is_none());
        Ok(Self { network: driving.cloned(), text })
    }

    /// Whether both have the same kernels and the same parameters of a network, bit by bit.
    fn same(&self, other: &Self) -> bool {
        let networks = match (&self.network, &other.network) {
            (None, None) => true,
            (Some(one), Some(other)) => Arc::ptr_eq(one, other) || same_bits(one, other),
            _ => false,
        };
        networks && self.text == other.text && self.same_called(other)
    }

    /// Whether the networks that formulas call have the same parameters.
    fn same_called(&self, other: &Self) -> bool {
        let of = |source: &Self| {
            source.text.chain().map(|chain| chain.networks().to_vec()).unwrap_or_default()
        };
        let (mine, theirs) = (of(self), of(other));
        mine.len() == theirs.len() && mine.iter().zip(&theirs).all(|(a, b)| same_bits(a, b))
    }
}

/// Whether two networks have the same layers, bit by bit: 0 and -0 differ.
pub(super) fn same_bits(one: &Mlp, other: &Mlp) -> bool {
    let bits = |numbers: &[f32], others: &[f32]| {
        bytemuck::cast_slice::<f32, u32>(numbers) == bytemuck::cast_slice::<f32, u32>(others)
    };
    let norms = |one: &Layer, other: &Layer| match (&one.norm, &other.norm) {
        (None, None) => true,
        (Some(one), Some(other)) => {
            let epsilon = one.epsilon.to_bits() == other.epsilon.to_bits();
            epsilon && bits(&one.scale, &other.scale) && bits(&one.shift, &other.shift)
        }
        _ => false,
    };
    let activations = |one: &Layer, other: &Layer| {
        let [one, other] = [one, other].map(|layer| layer.activation);
        one == other && bits(&one.parameters(), &other.parameters())
    };
    let mut layers = one.layers().iter().zip(other.layers());
    one.widths() == other.widths()
        && layers.all(|(a, b)| {
            let sums = bits(&a.weight, &b.weight) && bits(&a.bias, &b.bias);
            sums && norms(a, b) && activations(a, b)
        })
}

/// The sources that were asked for last.
#[derive(Default)]
pub(super) struct Sources(Mutex<Vec<Remembered>>);

/// A source, and the plant that it was last asked for with.
struct Remembered {
    plant: Plant,
    source: Arc<Source>,
}

impl Sources {
    /// The source of `plant`: a look-up if the same one was asked for before; else `printed` notes that
    /// it was printed.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] where its parts do not fit.
    pub(super) fn of_plant(&self, plant: &Plant, printed: impl FnOnce()) -> Result<Arc<Source>> {
        if let Some(source) = self.known(plant) {
            return Ok(source);
        }
        printed();
        let source = Source::new(&plant.model, &plant.controller)?;
        Ok(self.remember(plant.clone(), source))
    }

    /// The source of this very plant.
    fn known(&self, plant: &Plant) -> Option<Arc<Source>> {
        let same = |known: &Plant| {
            Arc::ptr_eq(&known.model, &plant.model)
                && Arc::ptr_eq(&known.controller, &plant.controller)
        };
        let list = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = list.iter().find(|known| same(&known.plant));
        found.map(|known| Arc::clone(&known.source))
    }

    /// Notes `source`, or the one that is the same as it, as the last one that was asked for.
    fn remember(&self, plant: Plant, source: Source) -> Arc<Source> {
        let mut list = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = list.iter().position(|known| known.source.same(&source));
        let source = known.map_or_else(|| Arc::new(source), |at| list.remove(at).source);
        list.push(Remembered { plant, source: Arc::clone(&source) });
        if list.len() > REMEMBERED {
            list.remove(0);
        }
        source
    }
}
