//! Entries of the metadata of a safetensors file that are there twice: the library takes the last in silence.

use std::collections::HashSet;
use std::fmt;

use serde::Deserialize;
use serde::de::{Error, IgnoredAny, MapAccess, Visitor};

/// The header, of which the metadata alone is looked at.
#[derive(Deserialize)]
struct Header {
    #[serde(rename = "__metadata__", default)]
    _metadata: Option<Once>,
}

/// A map whose keys are all different.
struct Once;

impl<'de> Deserialize<'de> for Once {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Keys)
    }
}

/// Reads the keys of a map.
struct Keys;

impl<'de> Visitor<'de> for Keys {
    type Value = Once;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map of texts")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Once, A::Error> {
        let mut keys = HashSet::new();
        while let Some((key, _)) = map.next_entry::<String, IgnoredAny>()? {
            if keys.contains(&key) {
                return Err(A::Error::custom(format!(
                    "metadata `{}` is there twice",
                    key.escape_debug()
                )));
            }
            keys.insert(key);
        }
        Ok(Once)
    }
}

/// Refuses a header with an entry of the metadata, or the metadata as a whole, that is there twice.
///
/// # Errors
/// A sentence that names the entry.
pub(super) fn refuse(header: &[u8]) -> Result<(), String> {
    let header: Result<Header, _> = serde_json::from_slice(header);
    header.map(drop).map_err(|e| format!("the header of the file: {e}"))
}
