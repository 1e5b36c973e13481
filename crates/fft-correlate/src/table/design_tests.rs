use std::sync::Arc;

use glam::DVec3;
use sdf_grid::{Silent, shapes::PegInHole};

use super::*;

#[test]
fn a_correlation_beyond_the_limit_is_refused_by_what_its_plan_says() {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
    let mut setup = PairSetup::new(Arc::new(hole), Arc::new(peg));
    setup.builder.spacing = Some(0.004);
    setup.half_extent = Some(DVec3::splat(0.01));
    let pair = setup.load(&Silent).unwrap();
    let design = TableDesign::new(&setup, pair, RotationDomain::ball(20.0, 10.0)).unwrap();
    let plan = design.plan().unwrap();
    let needed = plan.scores.bytes(rayon::current_num_threads());
    match design.energies(needed - 1) {
        Err(TableDesignError::Memory { needed: n, limit }) => {
            assert_eq!((n, limit), (needed, needed - 1));
        }
        other => panic!("{:?}", other.map(|_| "energies")),
    }
    let energies = design.energies(needed).unwrap();
    assert_eq!(*energies.correlator().plan(), plan.scores);
    let said = plan.to_string();
    let rotations = design.spec.grid().unwrap().nodes().len();
    assert!(
        said.contains(&format!("{rotations} rotations")) && said.contains("MiB"),
        "{said}"
    );
}
