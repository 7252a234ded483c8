//! SHA-256 digests in hexadecimal: of policies, shader text and certificates.

use sha2::{Digest, Sha256};

/// SHA-256 over the concatenated parts.
pub fn sha256<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
