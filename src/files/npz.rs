//! Several named arrays in one .npz file: a zip archive of .npy files, stored as they are.

use std::collections::BTreeMap;
use std::io::{BufReader, Cursor, Write};
use std::path::Path;

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipWriter};

use super::archive::Archive;
use super::array::{NpyHeader, by_rows, header};
use crate::digest::sha256;
use crate::error::{Error, Result};

/// Ending of the names in the archive.
const ENDING: &str = ".npy";
/// Most dimensions of an array, NumPy's limit up to its version 1.
const MOST_DIMENSIONS: usize = 32;

/// An array, its last index the fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// As many elements as the product of the lengths.
    pub data: Data,
}

/// The elements of an array, in order; little-endian in files.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// `<f4`.
    F32(Vec<f32>),
    /// `<f8`.
    F64(Vec<f64>),
    /// `|u1`.
    U8(Vec<u8>),
    /// `<u4`.
    U32(Vec<u32>),
    /// `<u8`.
    U64(Vec<u64>),
}

impl Data {
    /// Number of elements.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::U8(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::U64(values) => values.len(),
        }
    }

    /// The elements, if they are f32.
    pub fn as_f32(&self) -> Option<&[f32]> {
        if let Self::F32(values) = self { Some(values) } else { None }
    }

    /// The elements, if they are f64.
    pub fn as_f64(&self) -> Option<&[f64]> {
        if let Self::F64(values) = self { Some(values) } else { None }
    }

    /// The elements, if they are bytes.
    pub fn as_u8(&self) -> Option<&[u8]> {
        if let Self::U8(values) = self { Some(values) } else { None }
    }

    /// The elements, if they are u32.
    pub fn as_u32(&self) -> Option<&[u32]> {
        if let Self::U32(values) = self { Some(values) } else { None }
    }

    /// Whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Size of the elements, bytes.
    pub fn bytes(&self) -> usize {
        let each = match self {
            Self::U8(_) => 1,
            Self::F32(_) | Self::U32(_) => 4,
            Self::F64(_) | Self::U64(_) => 8,
        };
        each * self.len()
    }

    /// Type of the elements as .npy headers have it.
    fn descr(&self) -> &'static str {
        match self {
            Self::F32(_) => "<f4",
            Self::F64(_) => "<f8",
            Self::U8(_) => "|u1",
            Self::U32(_) => "<u4",
            Self::U64(_) => "<u8",
        }
    }

    fn to_bytes(&self) -> Vec<u8> {
        match self {
            Self::F32(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::F64(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::U8(values) => values.clone(),
            Self::U32(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Self::U64(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        }
    }

    /// The elements of type `descr` in `bytes`; `None` for another type or a part of an element.
    fn parse(descr: &str, bytes: &[u8]) -> Option<Self> {
        Some(match descr {
            "<f4" => Self::F32(elements(bytes, f32::from_le_bytes)?),
            "<f8" => Self::F64(elements(bytes, f64::from_le_bytes)?),
            "|u1" => Self::U8(bytes.to_vec()),
            "<u4" => Self::U32(elements(bytes, u32::from_le_bytes)?),
            "<u8" => Self::U64(elements(bytes, u64::from_le_bytes)?),
            _ => return None,
        })
    }

    /// The same elements of an array of this shape, the first index of which ran fastest.
    fn by_rows(self, shape: &[usize]) -> Self {
        match self {
            Self::F32(values) => Self::F32(by_rows(&values, shape)),
            Self::F64(values) => Self::F64(by_rows(&values, shape)),
            Self::U8(values) => Self::U8(by_rows(&values, shape)),
            Self::U32(values) => Self::U32(by_rows(&values, shape)),
            Self::U64(values) => Self::U64(by_rows(&values, shape)),
        }
    }
}

/// The elements of `N` bytes each.
fn elements<const N: usize, T>(bytes: &[u8], from: fn([u8; N]) -> T) -> Option<Vec<T>> {
    let (whole, rest) = bytes.as_chunks::<N>();
    rest.is_empty().then(|| whole.iter().map(|&element| from(element)).collect())
}

/// The bytes of a .npz file; the same for the same arrays, on any day and system.
///
/// # Errors
/// [`Error::Invalid`] for an array whose shape does not fit its elements, a name that occurs
/// twice or is too long, more than 32 dimensions, or an archive beyond what the format holds.
pub fn npz_bytes(arrays: &[(&str, Array)]) -> Result<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, array) in arrays {
        let refused = |problem: String| Error::invalid(format!("array {name}"), problem);
        let (have, shape) = (array.data.len(), &array.shape);
        if shape.len() > MOST_DIMENSIONS {
            let most = format!("at most {MOST_DIMENSIONS} are supported");
            return Err(refused(format!("{} dimensions; {most}", shape.len())));
        }
        if shape.iter().try_fold(1, |n: usize, &length| n.checked_mul(length)) != Some(have) {
            return Err(refused(format!("{have} elements do not fill the shape {shape:?}")));
        }
        add(&mut archive, name, array).map_err(|e| refused(e.to_string()))?;
    }
    let whole = archive.finish().map_err(|e| Error::invalid("archive", e.to_string()))?;
    Ok(whole.into_inner())
}

/// Adds an array to the archive.
fn add(
    archive: &mut ZipWriter<Cursor<Vec<u8>>>,
    name: &str,
    array: &Array,
) -> std::result::Result<(), ZipError> {
    let bytes = npy_array_bytes(array);
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::DEFAULT)
        .system(System::Unix)
        .large_file(u32::try_from(bytes.len()).is_err());
    archive.start_file(format!("{name}{ENDING}"), options)?;
    Ok(archive.write_all(&bytes)?)
}

/// SHA-256 over `label` and the arrays, in any order of their names.
pub fn npz_sha256<'a>(
    label: &str,
    arrays: impl IntoIterator<Item = (&'a str, &'a Array)>,
) -> String {
    let arrays: BTreeMap<&str, &Array> = arrays.into_iter().collect();
    let mut parts = vec![label.as_bytes().to_vec()];
    for (name, array) in arrays {
        let shape: Vec<u64> = array.shape.iter().map(|&length| length as u64).collect();
        parts.extend([name.into(), header(array.data.descr(), &shape), array.data.to_bytes()]);
    }
    // Each part after its length: no two lists of parts are the same bytes.
    let lengths: Vec<[u8; 8]> =
        parts.iter().map(|part| (part.len() as u64).to_le_bytes()).collect();
    sha256(lengths.iter().zip(&parts).flat_map(|(length, part)| [&length[..], part]))
}

/// The arrays of a .npz file by their names, as [`npz_bytes`] and NumPy's `savez` write them.
///
/// # Errors
/// [`Error::File`] if it is missing, damaged in any part that matters (every entry is checked
/// against its checksum), compressed, or holds another kind of array.
pub fn read_npz(path: &Path) -> Result<BTreeMap<String, Array>> {
    let at = |problem: String| Error::file(path, problem);
    let file = super::open(path).map_err(|e| Error::file(path, e))?;
    let size = file.metadata().map_err(|e| Error::file(path, e))?.len();
    let damaged = |e: ZipError| at(format!("not a whole .npz file ({e})"));
    let mut archive = Archive::open(BufReader::new(file), size).map_err(damaged)?;
    let mut arrays = BTreeMap::new();
    for (index, full) in archive.names().map_err(damaged)?.into_iter().enumerate() {
        let Some(name) = full.strip_suffix(ENDING) else {
            return Err(at(format!("entry `{full}` is no {ENDING} file")));
        };
        let array = archive.read(index).and_then(|bytes| parse(&bytes));
        let array = array.map_err(|problem| at(format!("entry `{full}`: {problem}")))?;
        arrays.insert(name.to_owned(), array);
    }
    Ok(arrays)
}

/// The array of the .npy file `path`.
///
/// # Errors
/// [`Error::File`] if it is missing, damaged, or an array of another kind.
pub(crate) fn npy_array(path: &Path) -> Result<Array> {
    let bytes = super::read(path, super::ARCHIVE_BYTES).map_err(|e| Error::file(path, e))?;
    parse(&bytes).map_err(|problem| Error::file(path, problem))
}

/// The bytes of a .npy file with `array`.
pub(crate) fn npy_array_bytes(array: &Array) -> Vec<u8> {
    let shape: Vec<u64> = array.shape.iter().map(|&length| length as u64).collect();
    let mut bytes = header(array.data.descr(), &shape);
    bytes.extend(array.data.to_bytes());
    bytes
}

/// The array of a .npy file in memory.
fn parse(mut bytes: &[u8]) -> std::result::Result<Array, String> {
    let NpyHeader { descr, fortran_order, shape } = NpyHeader::read(&mut bytes)?;
    let data = Data::parse(&descr, bytes).ok_or_else(|| {
        format!(
            "{} bytes are no array of type `{descr}`: little-endian numbers of 32 or 64 bits are expected; in NumPy: \
             numpy.ascontiguousarray(x, dtype=\"<f4\")",
            bytes.len()
        )
    })?;
    let elements = shape.iter().try_fold(1, |n: u64, &length| n.checked_mul(length));
    let whole =
        shape.iter().map(|&length| usize::try_from(length).ok()).collect::<Option<Vec<_>>>();
    match (elements, whole) {
        (Some(n), Some(shape)) if n == data.len() as u64 => {
            let data = if fortran_order { data.by_rows(&shape) } else { data };
            Ok(Array { shape, data })
        }
        _ => Err(format!("{} elements do not fill the shape {shape:?}", data.len())),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use zip::ZipArchive;

    use super::*;

    fn array(shape: &[usize], data: Data) -> Array {
        Array { shape: shape.to_vec(), data }
    }

    /// One array of each type; an empty one and one without dimensions.
    fn arrays() -> Vec<(&'static str, Array)> {
        vec![
            ("state", array(&[2, 1, 3], Data::F32(vec![1.5, -2.0, 0.1, f32::MIN, 4.0, -0.0]))),
            ("time", array(&[2], Data::F64(vec![0.1, 1e300]))),
            ("tier", array(&[4], Data::U8(vec![0, 1, 2, 255]))),
            ("count", array(&[], Data::U32(vec![u32::MAX]))),
            ("seed", array(&[0, 7], Data::U64(vec![]))),
        ]
    }

    /// Writes `bytes` and reads them as an archive.
    fn read(bytes: &[u8]) -> Result<BTreeMap<String, Array>> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(bytes).unwrap();
        read_npz(file.path())
    }

    fn owned(arrays: Vec<(&str, Array)>) -> BTreeMap<String, Array> {
        arrays.into_iter().map(|(name, array)| (name.to_owned(), array)).collect()
    }

    #[test]
    fn arrays_come_back() {
        let bytes = npz_bytes(&arrays()).unwrap();
        assert_eq!(read(&bytes).unwrap(), owned(arrays()));
        assert_eq!(npz_bytes(&arrays()).unwrap(), bytes);
        assert_eq!(read(&npz_bytes(&[]).unwrap()).unwrap(), BTreeMap::new());
    }

    #[test]
    fn entries_are_read_by_another_library() {
        let bytes = npz_bytes(&arrays()).unwrap();
        let mut archive = ZipArchive::new(Cursor::new(bytes)).unwrap();
        let mut entry = |name: &str| {
            let mut bytes = Vec::new();
            archive.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
            bytes
        };
        let bytes = entry("state.npy");
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        assert_eq!((file.shape(), file.order()), (&[2_u64, 1, 3][..], npyz::Order::C));
        assert_eq!(file.into_vec::<f32>().unwrap(), [1.5, -2.0, 0.1, f32::MIN, 4.0, -0.0]);
        let bytes = entry("tier.npy");
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        assert_eq!(file.into_vec::<u8>().unwrap(), [0, 1, 2, 255]);
        let bytes = entry("count.npy");
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        assert_eq!(file.shape(), &[] as &[u64]);
        assert_eq!(file.into_vec::<u32>().unwrap(), [u32::MAX]);
    }

    #[test]
    fn truncated_files_are_refused() {
        let bytes = npz_bytes(&arrays()).unwrap();
        for length in 0..bytes.len() {
            let error = read(&bytes[..length]).unwrap_err();
            assert!(matches!(error, Error::File { .. }), "{length}: {error}");
        }
    }

    /// A changed bit is refused, or lies where nothing is read: dates, permissions, versions.
    #[test]
    fn changed_bits_are_refused_or_change_nothing() {
        let bytes = npz_bytes(&arrays()).unwrap();
        let (mut refused, expected) = (0, owned(arrays()));
        for bit in 0..8 * bytes.len() {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            match read(&changed) {
                Err(error) => {
                    assert!(matches!(error, Error::File { .. }), "bit {bit}: {error}");
                    refused += 1;
                }
                Ok(arrays) => assert_eq!(arrays, expected, "bit {bit} of byte {}", bit / 8),
            }
        }
        // All of the arrays and most of the rest.
        let elements = 8 * (5 * 128 + 24 + 16 + 4 + 4);
        assert!(refused > elements, "{refused} of {} refused", 8 * bytes.len());
    }

    /// The entry `x.npy` with this content, in an archive that is otherwise whole.
    fn with_entry(name: &str, content: &[u8]) -> Result<BTreeMap<String, Array>> {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        archive.start_file(name, SimpleFileOptions::default()).unwrap();
        archive.write_all(content).unwrap();
        read(&archive.finish().unwrap().into_inner())
    }

    #[test]
    fn wrong_arrays_are_refused() {
        let problem = |descr: &str, shape: &[u64], bytes: usize| {
            let mut content = header(descr, shape);
            content.resize(content.len() + bytes, 0);
            with_entry("x.npy", &content).unwrap_err().to_string()
        };
        assert!(problem("<f4", &[3], 8).contains("2 elements do not fill the shape [3]"));
        assert!(problem("<f4", &[1], 8).contains("2 elements do not fill the shape [1]"));
        assert!(problem("<f4", &[2], 7).contains("7 bytes are no array of type `<f4`"));
        assert!(problem(">f4", &[2], 8).contains("`>f4`"));
        assert!(problem("<f4", &[1 << 40, 1 << 40], 8).contains("do not fill"));
        assert!(problem("<f4", &[u64::MAX], 8).contains("do not fill"));
        assert!(with_entry("x.txt", b"").unwrap_err().to_string().contains("x.txt"));
        assert!(with_entry("x.npy", b"\x93NUM").unwrap_err().to_string().contains("x.npy"));
    }

    #[test]
    fn arrays_by_columns_come_back_by_rows() {
        let by_columns = |shape: &[u64], values: &[u8]| {
            let text = header("|u1", shape);
            let text = String::from_utf8_lossy(&text[10..]).replace("False", "True ");
            let mut content = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
            content.extend(text.as_bytes());
            content.extend(values);
            parse(&content).unwrap()
        };
        // [[1, 2, 3], [4, 5, 6]].
        let two = by_columns(&[2, 3], &[1, 4, 2, 5, 3, 6]);
        assert_eq!(two, array(&[2, 3], Data::U8(vec![1, 2, 3, 4, 5, 6])));
        // Its number i, j, k is 4 i + 2 j + k.
        let three = by_columns(&[2, 2, 2], &[0, 4, 2, 6, 1, 5, 3, 7]);
        assert_eq!(three, array(&[2, 2, 2], Data::U8((0..8).collect())));
        assert_eq!(by_columns(&[3], &[7, 8, 9]), array(&[3], Data::U8(vec![7, 8, 9])));
        assert!(by_columns(&[0, 3], &[]).data.is_empty());
    }

    #[test]
    fn wrong_arguments_are_named() {
        let bad = array(&[2, 2], Data::U8(vec![1, 2, 3]));
        let error = npz_bytes(&[("grid", bad)]).unwrap_err().to_string();
        assert_eq!(error, "array grid: 3 elements do not fill the shape [2, 2]");
        let deep = array(&[1; 33], Data::U8(vec![1]));
        assert!(npz_bytes(&[("deep", deep)]).unwrap_err().to_string().contains("33 dimensions"));
        let flat = array(&[1; 32], Data::U8(vec![1]));
        assert_eq!(read(&npz_bytes(&[("flat", flat.clone())]).unwrap()).unwrap()["flat"], flat);
        let one = || array(&[1], Data::U8(vec![1]));
        assert!(npz_bytes(&[("twice", one()), ("twice", one())]).is_err());
        assert!(read_npz(Path::new("/missing.npz")).is_err());
    }
}
