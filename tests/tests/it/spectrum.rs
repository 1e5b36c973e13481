//! How strong a signal is above a frequency.

use pegfit_tests::spectrum::rms_above;
use rand::{Rng, SeedableRng, rngs::SmallRng};

#[test]
fn knows_a_sine_and_where_it_lies() {
    let sine = |hz: f64| -> Vec<f64> {
        (0..8192)
            .map(|k| 3.0 + (std::f64::consts::TAU * hz * k as f64 / 1000.0).sin())
            .collect()
    };
    // A sine has the mean square 1/2; windows share it with one part in a thousand.
    let inside = rms_above(&sine(120.0), 1000.0, 50.0);
    assert!((inside - 0.5f64.sqrt()).abs() < 1e-3, "{inside}");
    assert!(rms_above(&sine(12.0), 1000.0, 50.0) < 1e-3);
}

#[test]
fn white_noise_is_shared_by_width() {
    let mut rng = SmallRng::seed_from_u64(1);
    let noise: Vec<f64> = (0..1 << 17).map(|_| rng.random_range(-1.0..1.0)).collect();
    let all = (1.0f64 / 3.0).sqrt();
    // 256 segments: a few per mille.
    let above = rms_above(&noise, 1000.0, 250.0);
    assert!((above / all - 0.5f64.sqrt()).abs() < 0.01, "{above}");
}
