//! The score of a part in a perfect mould of itself, from its own field, against a mould that is made.

use fft_correlate::{DirectEvaluator, DirectOptions, PairBuilder, Pose, ScoreModel};
use glam::{DQuat, DVec3};
use sdf_grid::{RepairOptions, Silent, TriangleMesh, shapes};

/// A block around `part`, as wide on every side as `room`, hollow where the part is.
fn mould(part: &TriangleMesh, room: f64) -> TriangleMesh {
    let bounds = part.bounds().grown(room);
    let block = shapes::cuboid(bounds.size()).unwrap();
    let block = block.transformed(DQuat::IDENTITY, bounds.center());
    let first = block.vertices().len() as u32;
    let vertices = [block.vertices(), part.vertices()].concat();
    let inner = part.triangles().iter().map(|t| t.map(|v| v + first));
    let triangles = block.triangles().iter().copied().chain(inner).collect();
    let options = RepairOptions::default();
    let (mould, report) = TriangleMesh::clean("mould", vertices, triangles, &options).unwrap();
    assert_eq!((report.components, report.cavities), (2, 1));
    mould
}

#[test]
fn a_part_scores_in_its_mould_what_its_own_field_says() {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7));
    let parts = [
        (
            "cuboid",
            shapes::cuboid(DVec3::new(0.02, 0.02, 0.03)).unwrap(),
        ),
        (
            "plate",
            shapes::cuboid(DVec3::new(0.03, 0.02, 0.006)).unwrap(),
        ),
        ("sphere", shapes::icosphere(0.01, 16).unwrap()),
        ("torus", shapes::torus(0.012, 0.004, 48, 24).unwrap()),
    ];
    for (name, part) in parts {
        let part = part.transformed(turn, DVec3::new(0.001, 0.002, -0.003));
        let builder = PairBuilder {
            spacing: Some(1e-3),
            halo: Some(0.01),
            ..PairBuilder::default()
        };
        let mould = mould(&part, 0.015);
        let pair = builder
            .build(&mould, &part, &ScoreModel::GUIDED, &Silent)
            .unwrap();
        let source = DirectEvaluator::new(&pair, &DirectOptions::FULL).unwrap();
        let found = source.score(&Pose::IDENTITY).re;
        let share = found / pair.mould_score();
        println!("{name}: {share:.4}");
        assert!((share - 1.0).abs() < 0.1, "{name}: {share}");
    }
}
