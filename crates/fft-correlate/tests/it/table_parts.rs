//! Tables in memory by parts: what is there answers as the whole table does, what is not is far away.

use crate::common::*;
use fft_correlate::testing::bake_files;
use fft_correlate::{
    AxisSymmetry, EnergySource, EnergyTable, PartialTable, Pose, Response, RotationDomain, Share,
    Side, StoreError, TableFiles, TableSpec, TableStore,
};
use glam::{DQuat, DVec3};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::Silent;

/// A table in a store, opened in both ways.
fn both(spec: &TableSpec) -> (EnergyTable, PartialTable) {
    let energy = match &spec.symmetry {
        Some(symmetry) => Gaussians::symmetric(31, symmetry),
        None => Gaussians::random(31),
    };
    let files = TableFiles::in_memory("parts");
    let producer = OnWindow(&energy, spec.window);
    bake_files(&files, spec, &producer, Share::ALL, &Silent).unwrap();
    let open = || TableStore::open_files(&files).unwrap();
    let whole = open().load(1 << 30).unwrap();
    (whole, PartialTable::new(open()).unwrap())
}

/// Loads all nodes nearer to `rotation` than `reach` and drops the others; the distances.
fn keep_near(parts: &mut PartialTable, rotation: DQuat, reach: f32) -> Vec<f32> {
    let mut distances = vec![0.0; parts.nodes()];
    parts.distances(rotation, &mut distances);
    let near: Vec<usize> = (0..parts.nodes())
        .filter(|&n| distances[n] < reach)
        .collect();
    parts.load(&near).unwrap();
    for node in (0..parts.nodes()).filter(|&n| distances[n] >= reach) {
        parts.unload(node);
    }
    distances
}

fn symmetry(part: Side, order: u32) -> AxisSymmetry {
    AxisSymmetry {
        part,
        axis: [0.2, -0.4, 1.0],
        point: [0.1, 0.2, -0.3],
        order,
    }
}

fn specs() -> Vec<TableSpec> {
    let window = window(0.3, 0.15);
    let mut specs: Vec<TableSpec> = [
        RotationDomain::ball(40.0, 8.0),
        RotationDomain::full(20.0),
        RotationDomain::Spin {
            center: [0.0, 0.6, 0.0, 0.8],
            axis: [0.0, 0.6, 0.8],
            range_deg: None,
            step_deg: 12.0,
        },
        RotationDomain::Spin {
            center: [0.0, 0.0, 0.0, 1.0],
            axis: [0.0, 0.0, 1.0],
            range_deg: Some([-90.0, 60.0]),
            step_deg: 10.0,
        },
    ]
    .map(|domain| spec(window, domain))
    .into();
    for symmetric in [symmetry(Side::Moving, 3), symmetry(Side::Fixed, 0)] {
        let mut spec = spec(window, RotationDomain::full(15.0));
        spec.symmetry = Some(symmetric);
        specs.push(spec);
    }
    specs
}

fn bits(r: &Response) -> [u64; 7] {
    let Response { energy, wrench, .. } = r;
    let [t, f] = [wrench.torque.to_array(), wrench.force.to_array()];
    [*energy, t[0], t[1], t[2], f[0], f[1], f[2]].map(|v| (v + 0.0).to_bits())
}

/// Sparse layouts read far values where a dense one reads the zeros themselves, so the bits are the
/// same; `+ 0.0` above makes of the two zeros one.
#[test]
fn what_is_in_memory_answers_as_the_whole_table_bit_by_bit() {
    for spec in specs() {
        let (whole, mut parts) = both(&spec);
        let step = whole.grid().step();
        let mut rng = SmallRng::seed_from_u64(5);
        let (mut near, mut far, mut unsure) = (0, 0, 0);
        for _ in 0..12 {
            let center = whole.grid().nodes()[rng.random_range(0..parts.nodes())];
            // Turned by 0.4 steps, a pose moves by less than a node anywhere in a chart.
            keep_near(&mut parts, center, PartialTable::NEEDED + 1.0);
            let table = parts.table();
            let scratch = table.scratch();
            for k in 0..200 {
                let turn = match k % 2 {
                    0 => rotation_within(&mut rng, 0.4 * step) * center,
                    _ => {
                        let nodes = whole.grid().nodes();
                        let elsewhere = nodes[rng.random_range(0..nodes.len())];
                        rotation_within(&mut rng, 0.5 * step) * elsewhere
                    }
                };
                let p = pose(turn, vector(&mut rng) * 0.4);
                let (found, expected) = (table.respond(&p), whole.respond(&p));
                let loaded = table.is_loaded(&p, &scratch);
                if loaded || bits(&found) == bits(&expected) {
                    assert_eq!(bits(&found), bits(&expected), "{p:?}");
                    near += 1;
                } else {
                    assert_eq!(found, Response::default(), "{p:?}");
                    far += 1;
                }
                unsure += u32::from(!loaded && k % 2 == 0);
            }
        }
        assert_eq!(unsure, 0, "{:?}: what is needed was there", spec.rotations);
        assert!(
            near >= 1200 && far > 50,
            "{:?}: {near} {far}",
            spec.rotations
        );
    }
}

#[test]
fn a_pose_is_loaded_as_long_as_one_more_node_around_is_there() {
    let (_, mut parts) = both(&spec(window(0.3, 0.15), RotationDomain::ball(40.0, 8.0)));
    keep_near(&mut parts, DQuat::IDENTITY, 5.0);
    let table = parts.table();
    let scratch = table.scratch();
    let turned = |angle: f64| pose(DQuat::from_rotation_y(angle), DVec3::ZERO);
    // Half angles are even along an axis through the centre: nodes every 8 degrees, five on each
    // side but the fifth, so the cell from the second node out has its neighbours' neighbours.
    let answers = |degrees: f64| table.respond(&turned(degrees.to_radians())).energy != 0.0;
    let loaded = |degrees: f64| table.is_loaded(&turned(degrees.to_radians()), &scratch);
    assert!(answers(15.9) && loaded(15.9));
    assert!(answers(16.1) && !loaded(16.1));
    assert!(answers(23.9) && !loaded(23.9));
    assert!(!answers(24.1));
    assert!(table.is_loaded(
        &Pose::new(DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0), DVec3::ZERO),
        &scratch
    ));
}

#[test]
fn listed_rotations_are_loaded_one_by_one() {
    let rotations: Vec<[f64; 4]> = (0..9)
        .map(|k| DQuat::from_rotation_x(0.3 * f64::from(k)).to_array())
        .collect();
    let domain = RotationDomain::List {
        rotations,
        margin_deg: 5.0,
    };
    let (whole, mut parts) = both(&spec(window(0.3, 0.15), domain));
    let mut distances = vec![0.0; 9];
    parts.distances(DQuat::from_rotation_x(0.61), &mut distances);
    let nearest = (0..9).min_by(|&a, &b| distances[a].total_cmp(&distances[b]));
    assert_eq!(nearest, Some(2));
    parts.load(&[2]).unwrap();
    let table = parts.table();
    let at = |angle: f64| pose(DQuat::from_rotation_x(angle), DVec3::splat(0.05));
    assert_eq!(table.respond(&at(0.61)), whole.respond(&at(0.61)));
    let scratch = table.scratch();
    assert!(table.is_loaded(&at(0.61), &scratch));
    assert!(!table.is_loaded(&at(0.31), &scratch));
}

#[test]
fn memory_is_counted_until_the_last_table_lets_go() {
    let (_, mut parts) = both(&spec(window(0.3, 0.15), RotationDomain::ball(40.0, 8.0)));
    assert_eq!(parts.held_bytes(), 0);
    keep_near(&mut parts, DQuat::IDENTITY, 2.0);
    let (count, each) = (parts.resident() as u64, parts.node_bytes());
    assert_eq!(parts.held_bytes(), count * each);
    let table = parts.table();
    assert_eq!(table.memory(), count * each);
    for node in 0..parts.nodes() {
        parts.unload(node);
    }
    assert_eq!((parts.resident(), parts.held_bytes()), (0, count * each));
    drop(table);
    assert_eq!(parts.held_bytes(), 0);
}

#[test]
fn an_unfinished_table_is_refused_and_a_lost_chunk_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let spec = spec(window(0.3, 0.15), RotationDomain::ball(20.0, 10.0));
    let energy = Gaussians::random(31);
    let producer = OnWindow(&energy, spec.window);
    fft_correlate::bake(&path, &spec, &producer, Share::ALL, &Silent).unwrap();
    let mut parts = PartialTable::new(TableStore::open(&path).unwrap()).unwrap();
    let chunk = path.join("coefficients/c.7.0.0.0");
    let kept = std::fs::read(&chunk).unwrap();
    std::fs::remove_file(&chunk).unwrap();
    let error = PartialTable::new(TableStore::open(&path).unwrap()).unwrap_err();
    let incomplete = |e: &StoreError| {
        matches!(
            e,
            StoreError::Incomplete {
                missing: 1,
                first: 7,
                ..
            }
        )
    };
    assert!(incomplete(&error), "{error}");
    // Lost after it was opened: the others are loaded all the same.
    let error = parts.load(&[6, 7, 8]).unwrap_err();
    assert!(incomplete(&error), "{error}");
    assert_eq!(
        (parts.has(6), parts.has(7), parts.has(8)),
        (true, false, true)
    );
    let mut damaged = kept;
    *damaged.last_mut().unwrap() ^= 1;
    std::fs::write(&chunk, damaged).unwrap();
    let error = parts.load(&[7]).unwrap_err();
    assert!(matches!(error, StoreError::Damaged { .. }), "{error}");
}
