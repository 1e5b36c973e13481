//! What arrays are read from and written to.

use zarrs_storage::ReadableWritableListableStorageTraits;

/// A folder, an object store or memory.
pub(super) type Backend = dyn ReadableWritableListableStorageTraits;
