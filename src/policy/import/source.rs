//! What a file holds: tensors with names, and where their numbers lie.

use std::collections::HashMap;

use super::archive::Entries;
use super::kind::{Cast, FloatReader, Kind};
use super::script::Script;

/// A file with named tensors.
#[derive(Debug, Default)]
pub(super) struct Source<'a> {
    /// Its tensors in the order of the file, which is that of the modules in a state dict.
    pub(super) tensors: Vec<Tensor>,
    /// Plain numbers, and lists of them.
    pub(super) plain: Vec<Plain>,
    /// What else it says.
    pub(super) said: Vec<Said>,
    /// Truth values, by the keys on the way to them, joined by dots.
    pub(super) flags: HashMap<String, bool>,
    /// What in it is no tensor, and was not made.
    pub(super) unmade: Vec<Unmade>,
    /// What the code beside the tensors does, of a compiled module.
    pub(super) script: Option<Script>,
    /// Numbers that are entries of an archive.
    pub(super) entries: Option<Entries<'a>>,
    /// Numbers that lie in the file itself.
    pub(super) runs: Vec<Vec<u8>>,
}

/// A named tensor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tensor {
    /// The keys on the way to it, joined by dots.
    pub(super) name: String,
    /// Number of the dictionary that it lies in.
    pub(super) dict: usize,
    /// Length of each dimension.
    pub(super) shape: Vec<usize>,
    /// Elements of the storage from one index to the next, for each dimension.
    pub(super) strides: Vec<usize>,
    /// Element of the storage that it begins at.
    pub(super) offset: usize,
    /// What its numbers are.
    pub(super) kind: Kind,
    /// Where they are.
    pub(super) place: Place,
}

/// Where the numbers of a tensor are.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Place {
    /// In the entry of this name.
    Entry(String),
    /// In the run of bytes of this number.
    Run(usize),
}

/// How many numbers lie under a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Amount {
    /// At most one.
    One,
    /// More.
    Many,
}

impl Amount {
    /// So many numbers.
    pub(super) fn of(count: usize) -> Self {
        if count <= 1 { Self::One } else { Self::Many }
    }
}

/// Numbers that are no tensor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plain {
    /// The keys on the way to them, joined by dots.
    pub(super) name: String,
    /// How many there are.
    pub(super) amount: Amount,
}

/// Words beside the tensors.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Said {
    /// The keys on the way to them, joined by dots.
    pub(super) name: String,
    /// The words.
    pub(super) text: String,
}

/// An object that a file would have had made by a program.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unmade {
    /// The keys on the way to it, joined by dots.
    pub(super) name: String,
    /// Number of the dictionary that it lies in.
    pub(super) dict: usize,
    /// The class or function that would have made it.
    pub(super) maker: String,
}

impl Source<'_> {
    /// The numbers of `tensor`, its last index the fastest; f32 as they are, others if `cast` allows it.
    ///
    /// # Errors
    /// A sentence that names the tensor, about numbers that are missing, damaged, or of another kind.
    pub(super) fn numbers(&mut self, tensor: &Tensor, cast: Cast) -> Result<Vec<f64>, String> {
        let read = || {
            let reader = tensor.kind.reader(cast)?;
            match &tensor.place {
                Place::Run(number) => {
                    tensor.numbers(self.runs.get(*number).map_or(&[], Vec::as_slice), &reader)
                }
                Place::Entry(key) => {
                    let entries = self.entries.as_mut().ok_or("its numbers lie in no archive")?;
                    tensor.numbers(&entries.read(&format!("data/{key}"))?, &reader)
                }
            }
        };
        let mut read = read;
        read().map_err(|problem: String| format!("`{}`: {problem}", tensor.name))
    }

    /// The tensor called `name`.
    pub(super) fn tensor(&self, name: &str) -> Option<&Tensor> {
        self.tensors.iter().find(|tensor| tensor.name == name)
    }
}

impl Tensor {
    /// A tensor whose last index runs fastest and whose numbers are the run `run`.
    pub(super) fn plain(name: String, shape: Vec<usize>, kind: Kind, run: usize) -> Self {
        let strides = (0..shape.len()).map(|i| shape[i + 1..].iter().product()).collect();
        Self { name, dict: 0, shape, strides, offset: 0, kind, place: Place::Run(run) }
    }

    /// How many numbers it has.
    pub(super) fn amount(&self) -> Amount {
        Amount::of(self.shape.iter().fold(1, |count, length| count.saturating_mul(*length)))
    }

    /// Its numbers in a storage of these bytes.
    fn numbers(&self, bytes: &[u8], reader: &FloatReader) -> Result<Vec<f64>, String> {
        let elements = bytes.len() / reader.size;
        if !self.fits(elements) {
            let Self { shape, strides, offset, .. } = self;
            return Err(format!(
                "shape {shape:?} with strides {strides:?} from element {offset} on does not fit \
                 the {elements} numbers of its storage; clone() expanded tensors before saving"
            ));
        }
        let at = |element: usize| (reader.number)(&bytes[reader.size * element..]);
        Ok(self.elements().into_iter().map(at).collect())
    }

    /// Whether all indices lie within a storage of `elements`, and are no more than these.
    fn fits(&self, elements: usize) -> bool {
        if self.shape.len() != self.strides.len() || self.shape.contains(&0) {
            return false;
        }
        let count = self.shape.iter().try_fold(1, |n: usize, &length| n.checked_mul(length));
        let dimensions = self.shape.iter().zip(&self.strides);
        let last = dimensions.into_iter().try_fold(self.offset, |last, (&length, &stride)| {
            last.checked_add(stride.checked_mul(length.saturating_sub(1))?)
        });
        count.is_some_and(|count| count <= elements) && last.is_some_and(|last| last < elements)
    }

    /// The elements of the storage in the order of the tensor's indices.
    fn elements(&self) -> Vec<usize> {
        let dimensions = self.shape.iter().zip(&self.strides);
        dimensions.fold(vec![self.offset], |starts, (&length, &stride)| {
            let row = |start: usize| (0..length).map(move |i| start + i * stride);
            starts.into_iter().flat_map(row).collect()
        })
    }
}
