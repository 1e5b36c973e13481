//! Against densities summed over samples of space.

use fft_correlate::ScoreModel;
use pegfit_truth::{Truth, TruthOptions, sampled_energy};
use sdf_grid::shapes::PegInHole;

use crate::common::poses;

#[test]
#[ignore = "long; run by `just truth`"]
fn energies_are_those_of_samples() {
    let model = ScoreModel::GUIDED;
    let which = PegInHole::Rectangular;
    let (hole, peg) = which.pair(1e-4).unwrap();
    let truth = Truth::new(&hole, &peg, &model, &TruthOptions::COARSE).unwrap();
    for pose in poses() {
        let sampled = sampled_energy([&hole, &peg], &model, None, &pose, 16_000).unwrap();
        let exact = truth.at(&pose).energy;
        let off = (sampled.energy - exact).abs();
        println!(
            "{}: {exact:.4e} {off:.1e} {:.1e}",
            which.name(),
            sampled.error
        );
        // The samples' own spread, and 0.5 % that coarse cells may err by.
        assert!(off < 4.0 * sampled.error + 5e-3 * exact.abs());
    }
}
