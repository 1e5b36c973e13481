//! Refusing a computation that would not fit in memory, before anything is allocated.

use crate::error::CommandError;

/// Share of the available memory that one command may plan to use; the rest is for what the
/// estimate leaves out.
const USABLE: f64 = 0.9;

/// What a computation may plan to use, bytes: `limit` if the user set one, else a share of what is
/// available.
pub fn budget(limit: Option<u64>) -> u64 {
    limit.unwrap_or_else(|| (USABLE * available() as f64) as u64)
}

/// Refuses if `needed` bytes are more than `budget`.
///
/// # Errors
/// Names the computation, its need and the budget.
pub(crate) fn require(what: &str, needed: u64, budget: u64) -> Result<(), CommandError> {
    if needed > budget {
        return Err(CommandError::memory(what, needed, budget));
    }
    Ok(())
}

/// Memory that can be had without swapping, bytes: what the system has free or the limit of this
/// process' control group, whichever is less.
pub(crate) fn available() -> u64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_need_beyond_the_budget_is_refused_with_both_numbers() {
        let error = require("a field", 3 << 30, 2 << 30)
            .unwrap_err()
            .to_string();
        assert!(error.contains("a field needs about 3.0 GiB"), "{error}");
        assert!(error.contains("only 2.0 GiB"), "{error}");
        assert!(require("a crumb", 1, 1).is_ok());
        assert_eq!(budget(Some(7)), 7);
        assert!(budget(None) > 0);
    }
}
