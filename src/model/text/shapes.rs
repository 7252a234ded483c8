//! The shapes of a description, which pictures show.

use super::section::{Section, unknown};
use crate::error::Result;
use crate::model::{Outline, Shape, ShapeKind};

/// Kinds of shapes by their names.
const KINDS: [(&str, ShapeKind); 3] =
    [("unsafe", ShapeKind::Unsafe), ("target", ShapeKind::Target), ("plain", ShapeKind::Plain)];

/// Reads `[model.shapes]`.
pub(super) fn shapes(section: Option<Section<'_>>) -> Result<Vec<Shape>> {
    let Some(section) = section else { return Ok(Vec::new()) };
    section.entries().map(|(name, _)| shape(&section, name)).collect()
}

fn shape(section: &Section<'_>, name: &str) -> Result<Shape> {
    let entry = section.required(name, "{ box = [0.0, 0.0, 1.0, 1.0], kind = \"unsafe\" }")?;
    entry.only(["box", "disc", "kind"].into_iter())?;
    Ok(Shape { name: name.to_owned(), outline: outline(&entry)?, kind: kind(&entry)? })
}

fn outline(entry: &Section<'_>) -> Result<Outline> {
    let corners = entry.numbers::<4>("box", "a list of four numbers: left, lower, right, upper")?;
    let disc = entry.numbers::<3>("disc", "a list of three numbers: right, up, radius")?;
    match (corners, disc) {
        (Some(ends), None) => {
            let [left, lower, right, upper] = ends;
            if left >= right || lower >= upper {
                return Err(
                    entry.refuse("box", "empty; expected left below right, lower below upper")
                );
            }
            Ok(Outline::Box(ends))
        }
        (None, Some(disc)) if disc[2] > 0.0 => Ok(Outline::Disc(disc)),
        (None, Some(_)) => Err(entry.refuse("disc", "expected a radius above 0")),
        (Some(_), Some(_)) => {
            Err(entry.refuse("box", "both `box` and `disc` are given; keep one of them"))
        }
        (None, None) => Err(entry.refuse_whole("no outline; expected `box` or `disc`")),
    }
}

fn kind(entry: &Section<'_>) -> Result<ShapeKind> {
    let Some(name) = entry.text("kind")? else { return Ok(ShapeKind::default()) };
    let found = KINDS.iter().find(|(known, _)| *known == name);
    let names = KINDS.iter().map(|(known, _)| *known);
    let refused = || entry.refuse("kind", unknown("kind of shape", name, names));
    found.map(|(_, kind)| *kind).ok_or_else(refused)
}
