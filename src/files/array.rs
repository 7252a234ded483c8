//! Arrays as .npy files: the header, read strictly and written, and measures as they come.

use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::{Format, clear, folder_of, temporary};
use crate::error::{Error, Result};

/// First bytes of every .npy file.
const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// Longest header that is read, bytes: NumPy's own limit, since a damaged length must not decide
/// how much memory is taken.
const LONGEST_HEADER: usize = 10_000;
/// Length of the headers that are written, bytes: room for any usual shape, a multiple of 64.
const WRITTEN_HEADER: usize = 128;

/// Type of the elements of measures and pictures.
const F32: &str = "<f4";

/// What a .npy file says about its array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NpyHeader {
    /// Type of the elements, like `<f4`.
    pub(super) descr: String,
    /// Whether the first index runs fastest.
    pub(super) fortran_order: bool,
    /// Length of each dimension.
    pub(super) shape: Vec<u64>,
}

impl NpyHeader {
    /// Reads the header and leaves `file` at the first element.
    pub(super) fn read(file: &mut impl Read) -> std::result::Result<Self, String> {
        let whole = |e: std::io::Error| format!("not a whole .npy file ({e})");
        let mut fixed = [0; 8];
        file.read_exact(&mut fixed).map_err(whole)?;
        if !fixed.starts_with(MAGIC) {
            return Err("not a .npy file: it does not begin with \\x93NUMPY".to_owned());
        }
        let mut length = [0; 4];
        let bytes = match fixed[6] {
            1 => 2,
            2 | 3 => 4,
            version => return Err(format!("version {version} of .npy is not known")),
        };
        file.read_exact(&mut length[..bytes]).map_err(whole)?;
        let length = u32::from_le_bytes(length) as usize;
        if length > LONGEST_HEADER {
            return Err(format!("damaged: the header claims {length} bytes"));
        }
        let mut text = vec![0; length];
        file.read_exact(&mut text).map_err(whole)?;
        let text = String::from_utf8_lossy(&text);
        Self::parse(&text).ok_or_else(|| format!("unreadable header `{}`", text.trim()))
    }

    /// The header of the Python dictionary `text`, as NumPy writes it.
    fn parse(text: &str) -> Option<Self> {
        // NumPy knows three keys; what another one would say is not known.
        if text.matches(':').count() > 3 {
            return None;
        }
        let value = |key: &str| {
            let key = format!("'{key}'");
            let after = text.split_once(&key)?.1;
            // Of two values, Python takes one and others the other.
            let after = Some(after).filter(|after| !after.contains(&key))?;
            Some(after.trim_start().strip_prefix(':')?.trim_start())
        };
        let descr = value("descr")?;
        let descr = match descr.strip_prefix('\'') {
            Some(quoted) => quoted.split_once('\'')?.0,
            // A structured type, shown as it is.
            None => descr.split_once(']')?.0,
        };
        let fortran_order = match value("fortran_order")? {
            order if order.starts_with("True") => true,
            order if order.starts_with("False") => false,
            _ => return None,
        };
        let (shape, _) = value("shape")?.strip_prefix('(')?.split_once(')')?;
        let lengths = shape.split(',').map(str::trim).filter(|length| !length.is_empty());
        Some(Self {
            descr: descr.to_owned(),
            fortran_order,
            shape: lengths.map(|length| length.parse().ok()).collect::<Option<_>>()?,
        })
    }
}

/// The header of an array of this type and shape, [`WRITTEN_HEADER`] bytes or, for many
/// dimensions, a multiple of them.
pub(super) fn header(descr: &str, shape: &[u64]) -> Vec<u8> {
    let lengths: String = shape.iter().map(|length| format!("{length},")).collect();
    let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({lengths}), }}");
    let length = (text.len() + 11).next_multiple_of(WRITTEN_HEADER);
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend(((length - 10) as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.resize(length - 1, b' ');
    bytes.push(b'\n');
    bytes
}

/// The elements with the last index the fastest, where it was the first.
#[cfg(feature = "cli")]
pub(super) fn by_rows<T: Copy>(values: &[T], shape: &[usize]) -> Vec<T> {
    let (mut places, mut stride) = (vec![0], 1);
    for &length in shape {
        let row = |start: usize| (0..length).map(move |i| start + i * stride);
        places = places.into_iter().flat_map(row).collect();
        stride *= length;
    }
    places.into_iter().map(|place| values[place]).collect()
}

/// The bytes of a .npy file with the f32 `values`, row by row, in the shape `[rows, columns]`.
pub fn npy_bytes(values: &[f32], [rows, columns]: [usize; 2]) -> Vec<u8> {
    debug_assert_eq!(values.len(), rows * columns);
    let mut bytes = header(F32, &[rows as u64, columns as u64]);
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// Writes one measure per start, `[N]`, as they come; the file appears when it is complete.
#[derive(Debug)]
pub struct MeasureWriter {
    path: PathBuf,
    format: Format,
    file: BufWriter<NamedTempFile>,
    count: u64,
}

impl MeasureWriter {
    /// A file that will be called `path`, .npy (f32) or .csv (header `measure`).
    ///
    /// # Errors
    /// [`Error::File`] for another ending, [`Error::Write`] if its folder is not writable.
    pub fn create(path: &Path) -> Result<Self> {
        let format = Format::of(path)?;
        clear(folder_of(path));
        let mut file = BufWriter::new(temporary(folder_of(path))?);
        // The number of measures is known at the end only.
        let begun = match format {
            Format::Npy => file.write_all(&header(F32, &[0])),
            Format::Csv => writeln!(file, "measure"),
        };
        let path = path.to_owned();
        match begun {
            Ok(()) => Ok(Self { path, format, file, count: 0 }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    /// Adds the measures of the next starts.
    ///
    /// # Errors
    /// [`Error::Write`] with the system's reason.
    pub fn add(&mut self, measures: &[f32]) -> Result<()> {
        self.count += measures.len() as u64;
        let file = &mut self.file;
        let written = measures.iter().try_for_each(|measure| match self.format {
            Format::Npy => file.write_all(&measure.to_le_bytes()),
            // The shortest decimal that is read back as the same f32.
            Format::Csv => writeln!(file, "{measure}"),
        });
        written.map_err(|source| Error::Write { path: self.path.clone(), source })
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// [`Error::Write`] with the system's reason.
    pub fn publish(self) -> Result<()> {
        let Self { path, format, mut file, count } = self;
        let mut complete = || {
            if format == Format::Npy {
                file.seek(SeekFrom::Start(0))?;
                file.write_all(&header(F32, &[count]))?;
            }
            file.flush()?;
            file.get_ref().as_file().sync_all()
        };
        let renamed = complete().and_then(|()| {
            let file = file.into_inner().map_err(|e| e.into_error())?;
            file.persist(&path).map_err(|e| e.error)
        });
        renamed.map(|_| ()).map_err(|source| Error::Write { path, source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_arrays_are_read_by_another_library() {
        let values = [1.5_f32, -2.0, 3.25, f32::MIN_POSITIVE, 0.0, 7.0];
        let bytes = npy_bytes(&values, [2, 3]);
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        assert_eq!((file.shape(), file.order()), (&[2_u64, 3][..], npyz::Order::C));
        assert_eq!(file.into_vec::<f32>().unwrap(), values);
    }

    #[test]
    fn measures_appear_when_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("measures.npy");
        let mut writer = MeasureWriter::create(&path).unwrap();
        writer.add(&[0.5, -1.0]).unwrap();
        writer.add(&[0.25]).unwrap();
        assert!(!path.exists());
        writer.publish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        assert_eq!(file.shape(), [3]);
        assert_eq!(file.into_vec::<f32>().unwrap(), [0.5, -1.0, 0.25]);
        // Nothing but the result is left.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn headers_of_numpy_are_understood() {
        let parse = NpyHeader::parse;
        let plain = "{'descr': '<f8', 'fortran_order': False, 'shape': (500, 12), }   \n";
        let header = parse(plain).unwrap();
        assert_eq!((header.descr.as_str(), header.fortran_order), ("<f8", false));
        assert_eq!(header.shape, [500, 12]);
        let one = parse("{'descr':'|i1','fortran_order':True,'shape':(7,)}").unwrap();
        assert!(one.fortran_order && one.shape == [7]);
        assert_eq!(parse("{'descr': '<f8', 'fortran_order': False, 'shape': (-3,)}"), None);
        assert_eq!(parse("{'descr': '<f8'}"), None);
        assert_eq!(parse("{'descr': '<f8', 'fortran_order': 1, 'shape': (3,)}"), None);
        let twice = "{'descr': '<f8', 'descr': '<f4', 'fortran_order': False, 'shape': (3,)}";
        assert_eq!(parse(twice), None);
    }
}
