//! A record as a file holds it: sealed with a digest of every field, so that an edited one is named.
//!
//! The digests guard against slips and edits by hand. Who edits a field can compute its digest as
//! well: they are no signature.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::record::{OLDEST_SCHEMA, Record, SCHEMA};
use crate::digest::sha256;
use crate::error::{Error, Result};

/// The field that holds the digests, the only one without.
const DIGESTS: &str = "digests";
/// Fields that a refusal names.
const NAMED: usize = 3;

impl Record {
    /// The record with the digests of its fields.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it has no JSON form.
    pub fn sealed(mut self) -> Result<Self> {
        let invalid = |e: serde_json::Error| Error::invalid("certificate", e.to_string());
        // By way of the text: that is what a reader has.
        let text = serde_json::to_string(&self).map_err(invalid)?;
        self.digests = digests(&serde_json::from_str(&text).map_err(invalid)?);
        Ok(self)
    }

    /// The sealed record of a JSON document, if every field is as it was sealed.
    ///
    /// # Errors
    /// [`Error::Refused`], naming the fields that were changed, added or removed, or what else is
    /// wrong with the document.
    pub fn read(text: &str) -> Result<Self> {
        let refused =
            |what: &str, e: &dyn std::fmt::Display| Error::Refused(format!("{what} ({e})"));
        let document: Value =
            serde_json::from_str(text).map_err(|e| refused("not a certificate", &e))?;
        let schema = document.get("schema").unwrap_or(&Value::Null);
        let known = u64::from(OLDEST_SCHEMA)..=u64::from(SCHEMA);
        if !schema.as_u64().is_some_and(|schema| known.contains(&schema)) {
            let problem =
                format!("schema is {schema}, this program reads {OLDEST_SCHEMA} to {SCHEMA}");
            return Err(Error::Refused(problem));
        }
        let sealed = document.get(DIGESTS).unwrap_or(&Value::Null);
        let sealed = BTreeMap::<String, String>::deserialize(sealed)
            .map_err(|e| refused("damaged certificate, certify again: `digests`", &e))?;
        unchanged(&sealed, &digests(&document))?;
        serde_json::from_str(text).map_err(|e| refused("damaged certificate", &e))
    }
}

/// SHA-256 of every field of the document by its path; a list is one field.
fn digests(document: &Value) -> BTreeMap<String, String> {
    let mut digests = BTreeMap::new();
    let mut open = vec![(String::new(), document)];
    while let Some((path, value)) = open.pop() {
        match value {
            Value::Object(fields) if !fields.is_empty() => {
                let inner = |key: &String| match path.as_str() {
                    "" => key.clone(),
                    outer => format!("{outer}.{key}"),
                };
                open.extend(fields.iter().map(|(key, value)| (inner(key), value)));
            }
            _ => _ = digests.insert(path, sha256([value.to_string().as_bytes()])),
        }
    }
    digests.retain(|path, _| !path.starts_with(DIGESTS));
    digests
}

/// Refuses fields that differ from what was sealed.
fn unchanged(sealed: &BTreeMap<String, String>, found: &BTreeMap<String, String>) -> Result<()> {
    let mut changes = Vec::new();
    for (path, digest) in sealed {
        match found.get(path) {
            Some(other) if other == digest => {}
            Some(_) => changes.push(format!("`{path}` was changed")),
            None => changes.push(format!("`{path}` was removed")),
        }
    }
    let added = found.keys().filter(|path| !sealed.contains_key(*path));
    changes.extend(added.map(|path| format!("`{path}` was added")));
    if changes.is_empty() {
        return Ok(());
    }
    let more = changes.len().saturating_sub(NAMED);
    changes.truncate(NAMED);
    if more > 0 {
        changes.push(format!("{more} more"));
    }
    let changes = changes.join(", ");
    Err(Error::Refused(format!("{changes}, after the certificate was stored; certify again")))
}
