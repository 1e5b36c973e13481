use std::sync::Arc;

use sdf_grid::shapes::PegInHole;

use super::*;

/// Nothing may begin.
struct Nothing;

impl Monitor for Nothing {
    fn begin(&self, stage: &str, _: u64) {
        panic!("{stage} began");
    }

    fn cancelled(&self) -> bool {
        false
    }
}

#[test]
fn a_correlation_beyond_the_limit_is_refused_before_any_field_is_computed() {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
    let mut setup = PairSetup::new(Arc::new(hole), Arc::new(peg));
    let plan = Docking::new(&setup, DockingOptions::default())
        .plan()
        .unwrap();
    let needed = plan.scoring_bytes(rayon::current_num_threads());
    let said = plan.to_string();
    assert!(
        said.contains("coarse: ") && said.contains("rotations x"),
        "{said}"
    );
    // Enough for each pair's fields.
    let limit = needed - 1;
    assert!(plan.pairs.iter().all(|p| p.bytes <= limit), "{said}");
    setup.builder.memory_limit = Some(limit);
    let refused = Docking::new(&setup, DockingOptions::default()).run(&Nothing);
    match refused {
        Err(DockingError::Memory {
            needed: n,
            limit: l,
        }) => assert_eq!((n, l), (needed, limit)),
        other => panic!("{other:?}"),
    }
}
