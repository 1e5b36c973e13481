//! Digests that tie a table's answers to what it says of itself.
//!
//! Two digests: one over the attribute `pegfit`, stored in it, by which no number of it changes
//! unseen; and one in every chunk, over its numbers, its place and everything that the energies
//! depend on, by which a chunk is none of another place or table. Neither keeps out who computes
//! them again.

use serde::Serialize;

/// What distinguishes a table's identity from other digests of the same bytes.
const CONTEXT: &str = "pegfit 2026-11 energies of a table";

/// What the energies of a table depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Identity([u8; blake3::OUT_LEN]);

impl Identity {
    /// Of everything that the energies depend on.
    pub(super) fn of(material: &impl Serialize) -> Self {
        Self(blake3::derive_key(CONTEXT, &text(material)))
    }

    /// The digest of a rotation node's numbers, as little-endian bytes.
    pub(super) fn chunk(&self, row: usize, codes: &[u8]) -> [u8; blake3::OUT_LEN] {
        let mut hasher = blake3::Hasher::new_keyed(&self.0);
        hasher.update(&(row as u64).to_le_bytes());
        // What numbers are multiplied by, which formats up to 6 could choose.
        hasher.update(&1f32.to_le_bytes());
        hasher.update(codes);
        hasher.finalize().into()
    }
}

/// The digest of what a table says of itself.
pub(super) fn digest(header: &impl Serialize) -> String {
    blake3::hash(&text(header)).to_hex().to_string()
}

/// Keys as they are declared, no spaces, numbers as short as they can be.
fn text(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("headers hold no maps but those of their fields' names")
}
