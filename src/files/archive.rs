//! Zip archives whose entries are stored as they are, or are texts that are compressed, read without trusting a length
//! in them.

use std::io::{Read, Seek};

use miniz_oxide::inflate::decompress_to_vec_with_limit;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

/// A zip archive of `size` bytes.
#[derive(Debug)]
pub(crate) struct Archive<R> {
    zip: ZipArchive<R>,
    size: u64,
}

impl<R: Read + Seek> Archive<R> {
    /// Reads the directory of an archive of `size` bytes.
    ///
    /// # Errors
    /// A damaged directory, or one in which an entry occurs twice, lies inside another, or is
    /// left out.
    pub(crate) fn open(source: R, size: u64) -> Result<Self, ZipError> {
        let mut zip = ZipArchive::new(source)?;
        // What is read is no more than the file.
        zip.validate_header_consistency()?;
        Ok(Self { zip, size })
    }

    /// The names of the entries, in the order of their numbers.
    ///
    /// # Errors
    /// A name that is no text.
    pub(crate) fn names(&self) -> Result<Vec<String>, ZipError> {
        self.zip.file_names().map(|name| name.map(|name| name.into_owned())).collect()
    }

    /// Content of the entry number `index`.
    ///
    /// # Errors
    /// A sentence about an entry that is compressed, cut off or has the wrong checksum.
    pub(crate) fn read(&mut self, index: usize) -> Result<Vec<u8>, String> {
        let mut file = self.zip.by_index(index).map_err(|e| e.to_string())?;
        if file.compression() != CompressionMethod::Stored || file.size() > self.size {
            return Err("compressed, which is not supported, or damaged".to_owned());
        }
        // The end is read as well: only there is the checksum compared.
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(|e| e.to_string())?;
        Ok(bytes)
    }

    /// Content of the entry number `index`, at most `most` bytes, which may be compressed.
    ///
    /// # Errors
    /// A sentence about an entry that is damaged, larger, or compressed by another method than deflate.
    pub(crate) fn inflated(&mut self, index: usize, most: usize) -> Result<Vec<u8>, String> {
        if self
            .zip
            .by_index_raw(index)
            .is_ok_and(|file| file.compression() == CompressionMethod::Stored)
        {
            return self.read(index);
        }
        let mut file = self.zip.by_index_raw(index).map_err(|e| e.to_string())?;
        if file.compression() != CompressionMethod::DEFLATE || file.compressed_size() > self.size {
            return Err("compressed by a method that is not read, or damaged".to_owned());
        }
        let mut packed = Vec::new();
        file.read_to_end(&mut packed).map_err(|e| e.to_string())?;
        decompress_to_vec_with_limit(&packed, most)
            .map_err(|_| format!("damaged, or more than {most} bytes"))
    }
}
