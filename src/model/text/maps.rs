//! Maps of a description, which its costs ask: a grid over two coordinates with a number in each cell.

use std::path::PathBuf;
use std::sync::Arc;

use super::names::Scope;
use super::origin::Origin;
use super::section::Section;
use crate::cost::{CostMap, Grid, MAX_CELLS};
use crate::error::Result;
use crate::files::Sheet;

/// Most maps of a model.
pub const MOST_MAPS: usize = 8;

/// A map as it is written; its cells are in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenMap {
    /// Its dotted key, as in `model.maps.ground`.
    pub key: String,
    /// The .npy file of its cells, `[rows, columns]`: the first coordinate runs along a row.
    pub file: PathBuf,
    /// Lower corner of the first cell.
    pub origin: [f32; 2],
    /// Side of a cell.
    pub cell: f32,
    /// What it says outside; the largest number of its cells where that is not given.
    pub outside: Option<f32>,
}

/// Reads `[model.maps]` and adds its names to `scope`.
pub(super) fn maps(section: Option<Section<'_>>, scope: &mut Scope) -> Result<Vec<WrittenMap>> {
    let Some(section) = section else { return Ok(Vec::new()) };
    section.at_most("maps", MOST_MAPS)?;
    section.entries().map(|(name, _)| map(&section, name, scope)).collect()
}

fn map(section: &Section<'_>, name: &str, scope: &mut Scope) -> Result<WrittenMap> {
    scope.names.add_map(name).map_err(|problem| section.refuse(name, problem))?;
    let expected = "{ file = \"ground.npy\", origin = [0.0, 0.0], cell = 0.1 }";
    let entry = section.required(name, expected)?;
    entry.only(["file", "origin", "cell", "outside"].into_iter())?;
    let missing = |key: &str, what: &str| entry.refuse(key, format!("missing; expected {what}"));
    let file = entry.text("file")?.ok_or_else(|| missing("file", "a .npy file"))?;
    let corner = entry.point("origin")?;
    let cell = entry.number("cell")?;
    let written = WrittenMap {
        key: section.at(name),
        file: section.origin.folder.join(file),
        origin: corner.ok_or_else(|| missing("origin", "the lower corner of the first cell"))?,
        cell: cell.ok_or_else(|| missing("cell", "the side of a cell"))?,
        outside: entry.number("outside")?,
    };
    check(&entry, &written)?;
    Ok(written)
}

/// Refuses numbers that make no grid.
fn check(entry: &Section<'_>, map: &WrittenMap) -> Result<()> {
    if !map.origin.iter().all(|corner| corner.is_finite()) {
        return Err(entry.refuse("origin", format!("{:?} is not finite as f32", map.origin)));
    }
    if !(map.cell > 0.0 && map.cell.is_finite() && (1.0 / map.cell).is_finite()) {
        return Err(entry.refuse("cell", format!("{}; expected a side above 0", map.cell)));
    }
    match map.outside {
        Some(outside) if !outside.is_finite() => {
            Err(entry.refuse("outside", format!("{outside} is not a finite number as f32")))
        }
        _ => Ok(()),
    }
}

impl WrittenMap {
    /// The map with the cells of its file.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming the key of a file that cannot be read, that has another shape, or
    /// a number that is not finite.
    pub(super) fn read(&self, origin: &Origin) -> Result<Arc<CostMap>> {
        let refused = |problem: String| origin.refuse(&self.key, problem);
        let sheet = Sheet::read(&self.file, MAX_CELLS).map_err(|e| refused(e.to_string()))?;
        let Sheet { numbers, rows, columns } = sheet;
        let grid = Grid { origin: self.origin, resolution: self.cell, size: [columns, rows] };
        let largest = numbers.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let map = CostMap::new(grid, &numbers, self.outside.unwrap_or(largest));
        map.map(Arc::new).map_err(|e| refused(format!("{}: {e}", self.file.display())))
    }
}
