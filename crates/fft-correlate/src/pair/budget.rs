//! Memory of a correlation, guessed before any of it is planned.

/// Bytes that a correlation over a window of `shape` nodes needs for a moving part of bounding
/// radius `radius` on lattices of `spacing` metres, about. Transforms cover the window and the
/// turned part; one field per product and a work space per thread of the current pool, 8 bytes per
/// point, lengths rounded up by at most a tenth.
pub(crate) fn correlation_bytes(shape: [usize; 3], radius: f64, spacing: f64) -> u64 {
    let moving = 2.0 * radius / spacing + 2.0;
    let lengths = shape.map(|n| 1.1 * (n as f64 + moving));
    let fields = 2.0 + 2.0 * rayon::current_num_threads() as f64;
    (8.0 * lengths.iter().product::<f64>() * fields) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_of_the_same_nodes_needs_more_with_a_larger_part() {
        let small = correlation_bytes([10; 3], 0.01, 0.001);
        assert!(small >= 8 * 4 * 32 * 32 * 32, "{small}");
        assert!(correlation_bytes([10; 3], 0.02, 0.001) > 3 * small);
    }
}
