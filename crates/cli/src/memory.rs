//! Refusing a computation that would not fit in memory, before anything is allocated.

use crate::error::CommandError;

/// Share of the available memory that one command may plan to use; the rest is for what the
/// estimate leaves out.
const USABLE: f64 = 0.9;

/// Bytes per lattice node of a density field: two complex singles and one single.
pub const FIELD_BYTES_PER_NODE: u64 = 2 * 8 + 4;

/// Refuses if `needed` bytes are more than the machine has to give.
///
/// # Errors
/// Names the computation, its need and what is available.
pub fn require(what: &str, needed: u64) -> Result<(), CommandError> {
    let available = available();
    if needed as f64 > USABLE * available as f64 {
        return Err(CommandError::Memory {
            what: what.to_owned(),
            needed,
            available,
        });
    }
    Ok(())
}

/// Memory that can be had without swapping, bytes: what the system has free or the limit of this
/// process' control group, whichever is less.
pub fn available() -> u64 {
    // A system that does not tell is trusted to have enough.
    let Ok(mut system) = sysinfo::System::new() else {
        return u64::MAX;
    };
    system.refresh_memory();
    let free = system.available_memory();
    match system.cgroup_limits() {
        Some(limits) => free.min(limits.free_memory),
        None => free,
    }
}

/// A byte count for people: `1.5 GiB`.
pub fn display_bytes(bytes: u64) -> String {
    const UNITS: [&str; 5] = ["B", "KiB", "MiB", "GiB", "TiB"];
    let mut value = bytes as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    match unit {
        0 => format!("{bytes} B"),
        _ => format!("{value:.1} {}", UNITS[unit]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_readable() {
        assert_eq!(display_bytes(12), "12 B");
        assert_eq!(display_bytes(1536), "1.5 KiB");
        assert_eq!(display_bytes(3 << 30), "3.0 GiB");
    }

    #[test]
    fn an_impossible_need_is_refused_with_both_numbers() {
        let error = require("a field", u64::MAX / 2).unwrap_err().to_string();
        assert!(error.contains("a field needs about"), "{error}");
        assert!(error.contains("is available"), "{error}");
        assert!(require("a crumb", 1).is_ok());
    }
}
