//! The rows of a .npy file, read in pieces, in whichever order its elements lie.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};

use super::array::NpyHeader;

/// Rows that are read at a time.
const PIECE: u64 = 4096;

/// Rows of f32 or f64, of which a piece is in memory.
#[derive(Debug)]
pub(super) struct Elements {
    file: BufReader<File>,
    /// Where the elements begin, bytes.
    begin: u64,
    /// Bytes of an element.
    bytes: usize,
    /// Rows and columns.
    shape: [u64; 2],
    /// Whether the elements of a column lie side by side.
    by_columns: bool,
    /// Rows handed out.
    read: u64,
    /// The rows of the piece, row by row, and the first of them.
    piece: Vec<f32>,
    first: u64,
}

impl Elements {
    /// The array of shape `[N, columns]` that `file` holds.
    ///
    /// # Errors
    /// A sentence about a header of another type or shape, and about bytes that are missing or left.
    pub(super) fn open(mut file: BufReader<File>, columns: usize) -> Result<Self, String> {
        let size = file.get_ref().metadata().map_err(|e| e.to_string())?.len();
        let header = NpyHeader::read(&mut file)?;
        let begin = file.stream_position().map_err(|e| e.to_string())?;
        let (bytes, rows) = check(&header, columns, size.saturating_sub(begin))?;
        let (shape, by_columns) = ([rows, columns as u64], header.fortran_order);
        Ok(Self { file, begin, bytes, shape, by_columns, read: 0, piece: Vec::new(), first: 0 })
    }

    /// Rows that are left.
    pub(super) fn left(&self) -> u64 {
        self.shape[0] - self.read
    }

    /// Fills `row` with the next row; false at the end.
    ///
    /// # Errors
    /// A sentence about a file that ends too soon.
    pub(super) fn next(&mut self, row: &mut [f32]) -> Result<bool, String> {
        if self.left() == 0 {
            return Ok(false);
        }
        let columns = row.len();
        if self.read == self.first + (self.piece.len() / columns) as u64 {
            self.fetch().map_err(|e| format!("truncated ({e})"))?;
        }
        let at = (self.read - self.first) as usize * columns;
        row.copy_from_slice(&self.piece[at..at + columns]);
        self.read += 1;
        Ok(true)
    }

    /// Reads the piece that begins with the next row.
    fn fetch(&mut self) -> std::io::Result<()> {
        let (rows, columns) = (self.left().min(PIECE), self.shape[1]);
        self.first = self.read;
        self.piece = vec![0.0; (rows * columns) as usize];
        let runs = if self.by_columns { columns } else { 1 };
        let length = (rows * columns / runs) as usize;
        for run in 0..runs {
            let element = match self.by_columns {
                true => run * self.shape[0] + self.read,
                false => self.read * columns,
            };
            self.file.seek(SeekFrom::Start(self.begin + element * self.bytes as u64))?;
            let mut bytes = vec![0; length * self.bytes];
            self.file.read_exact(&mut bytes)?;
            for (i, number) in bytes.chunks_exact(self.bytes).map(number).enumerate() {
                let (run, runs) = (run as usize, runs as usize);
                self.piece[i * runs + run] = number;
            }
        }
        Ok(())
    }
}

/// The f32 or f64 of these bytes.
fn number(bytes: &[u8]) -> f32 {
    match *bytes {
        [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
        _ => bytes.try_into().map_or(f32::NAN, |bytes| f64::from_le_bytes(bytes) as f32),
    }
}

/// Bytes of an element and number of rows of an array of states that has `size` bytes.
fn check(header: &NpyHeader, columns: usize, size: u64) -> Result<(usize, u64), String> {
    let NpyHeader { descr, shape, .. } = header;
    let bytes = match descr.as_str() {
        "<f4" => 4,
        "<f8" => 8,
        other => {
            return Err(format!(
                "dtype {other}, expected <f4 or <f8 (f32 or f64); in NumPy: x.astype('<f4')"
            ));
        }
    };
    let &[rows, width] = shape.as_slice() else {
        let one = if *shape == [columns as u64] { "; a lone state is x[None, :]" } else { "" };
        return Err(format!("shape {shape:?}, expected [N, {columns}]{one}"));
    };
    if width != columns as u64 {
        return Err(format!(
            "shape {shape:?}, expected [N, {columns}]: a state has {columns} numbers"
        ));
    }
    match rows.checked_mul((columns * bytes) as u64) {
        Some(need) if need == size => Ok((bytes, rows)),
        Some(need) if need < size => Err(format!(
            "{} bytes follow the {rows} states that it announces; one file holds one array",
            size - need
        )),
        _ => Err(format!("truncated: {rows} states announced, {size} bytes are there")),
    }
}
