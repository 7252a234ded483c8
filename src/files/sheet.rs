//! Arrays of two dimensions of any width, from .npy files.

use std::io::BufReader;
use std::path::Path;

use super::array::NpyHeader;
use super::elements::Elements;
use crate::error::{Error, Result};

/// Numbers in rows and columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// `[rows, columns]`.
    pub numbers: Vec<f32>,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
}

impl Sheet {
    /// Reads the .npy file at `path`: f32 or f64 of two dimensions, at most `most` numbers.
    ///
    /// # Errors
    /// [`Error::File`] if it is missing or damaged, or of another type or shape.
    pub fn read(path: &Path, most: usize) -> Result<Self> {
        let file = || super::open(path).map(BufReader::new).map_err(|e| Error::file(path, e));
        let refused = |problem: String| Error::file(path, problem);
        let shape = NpyHeader::read(&mut file()?).map_err(refused)?.shape;
        let [rows, columns] = sizes(&shape, most).map_err(refused)?;
        let mut elements = Elements::open(file()?, columns).map_err(refused)?;
        let mut numbers = vec![0.0; rows * columns];
        for row in numbers.chunks_mut(columns) {
            elements.next(row).map_err(refused)?;
        }
        Ok(Self { numbers, rows, columns })
    }
}

/// Rows and columns of an array of this shape.
fn sizes(shape: &[u64], most: usize) -> std::result::Result<[usize; 2], String> {
    let &[rows, columns] = shape else {
        return Err(format!("shape {shape:?}, expected two dimensions, [rows, columns]"));
    };
    match rows.checked_mul(columns) {
        Some(count) if (1..=most as u64).contains(&count) => Ok([rows as usize, columns as usize]),
        _ => Err(format!("shape {shape:?}, expected 1 to {most} numbers")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::npy_bytes;

    #[test]
    fn rows_and_columns_are_kept_and_other_shapes_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.npy");
        let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        std::fs::write(&path, npy_bytes(&numbers, [2, 3])).unwrap();
        let sheet = Sheet::read(&path, 6).unwrap();
        assert_eq!(sheet, Sheet { numbers: numbers.to_vec(), rows: 2, columns: 3 });
        let problem = Sheet::read(&path, 5).unwrap_err().to_string();
        assert!(problem.contains("[2, 3], expected 1 to 5 numbers"), "{problem}");
        std::fs::write(&path, super::super::array::header("<f4", &[6])).unwrap();
        let problem = Sheet::read(&path, 9).unwrap_err().to_string();
        assert!(problem.contains("two dimensions"), "{problem}");
        let missing = Sheet::read(&folder.path().join("missing.npy"), 9).unwrap_err().to_string();
        assert!(missing.contains("missing.npy"), "{missing}");
    }
}
