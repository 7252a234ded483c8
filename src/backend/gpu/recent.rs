//! The few things of a kind that were used last.

use std::sync::{Mutex, PoisonError};

use crate::error::Result;

/// The things that were used last, the latest last.
pub(super) struct Recent<T> {
    items: Mutex<Vec<T>>,
    most: usize,
}

impl<T> Recent<T> {
    /// Nothing yet, and never more than `most`.
    pub(super) fn new(most: usize) -> Self {
        Self { items: Mutex::default(), most }
    }

    /// Takes out one that `fits`.
    pub(super) fn take(&self, fits: impl Fn(&T) -> bool) -> Option<T> {
        let mut items = self.items.lock().unwrap_or_else(PoisonError::into_inner);
        let found = items.iter().position(fits)?;
        Some(items.remove(found))
    }

    /// Keeps `item`.
    pub(super) fn keep(&self, item: T) {
        let mut items = self.items.lock().unwrap_or_else(PoisonError::into_inner);
        self.push(&mut items, item);
    }

    /// Adds `item`; the oldest goes where they would be too many.
    fn push(&self, items: &mut Vec<T>, item: T) {
        items.push(item);
        if items.len() > self.most {
            items.remove(0);
        }
    }

    /// The one that `fits`, made and kept now if there is none.
    ///
    /// # Errors
    /// Those of `make`.
    pub(super) fn get(
        &self,
        fits: impl Fn(&T) -> bool,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<T>
    where
        T: Clone,
    {
        let mut items = self.items.lock().unwrap_or_else(PoisonError::into_inner);
        let item = match items.iter().position(fits) {
            Some(at) => items.remove(at),
            None => make()?,
        };
        self.push(&mut items, item.clone());
        Ok(item)
    }

    /// Lets go of all of them.
    pub(super) fn clear(&self) {
        self.items.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}
