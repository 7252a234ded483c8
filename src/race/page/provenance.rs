//! Who computed a record, as the pages of races and of sweeps show it.

use crate::report::table::pairs;
use crate::report::text::or_dash;
use crate::scenario::record::Provenance;

/// The table of `provenance`, for a record of the layout `schema`; `networks` beside the policy have their
/// digests, where they take part.
pub(in crate::race) fn provenance(
    schema: u32,
    provenance: &Provenance,
    networks: &[(&str, Option<&String>)],
) -> String {
    let mut rows = vec![
        ("reachcast", provenance.version.clone()),
        ("layout of the record", schema.to_string()),
        ("seed", provenance.seed.to_string()),
        ("generator", provenance.generator.clone()),
        ("backend", provenance.backend.clone()),
        ("device", provenance.device.clone()),
        ("policy", provenance.policy.clone()),
        ("policy SHA-256", provenance.policy_sha256.clone()),
    ];
    rows.extend(networks.iter().map(|(name, digest)| (*name, or_dash(*digest))));
    rows.push(("physics SHA-256", provenance.physics_sha256.clone()));
    pairs("Provenance", &rows)
}
