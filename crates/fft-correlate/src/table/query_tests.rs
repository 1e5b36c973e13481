use glam::DQuat;
use ndarray::ArrayViewMut3;
use sdf_grid::{Lattice, Silent};

use super::*;
use crate::geometry::placement::Placement;
use crate::pair::model::PairProvenance;
use crate::pair::model::ScoreModel;
use crate::rotations::domain::RotationDomain;
use crate::sweep::NodeEnergies;
use crate::table::energy_table::EnergyTable;
use crate::table::spec::Storage;
use crate::table::spec::TableSpec;
use crate::table::stencil::value_of;

/// The definition: every product of six weights with a stored energy, in double precision.
fn read_slowly(table: &EnergyTable, chart: &Chart, r: &[Taps; 3], t: &[Taps; 3]) -> PatchValue {
    let far = table.spec().far_energy;
    let stored = |rotation: [usize; 3], node: [usize; 3]| {
        let [_, ny, nz] = chart.shape;
        let slot = chart.rows[(rotation[0] * ny + rotation[1]) * nz + rotation[2]];
        if slot == Chart::ABSENT {
            return far;
        }
        let codes = table.row(slot).unwrap();
        value_of(codes[table.plan.layout.place(node)]) * table.unit()
    };
    // Value, then slopes along x, y, z and the three rotation coordinates.
    let mut sums = [0.0; 7];
    for slots in 0..4usize.pow(6) {
        let s: [usize; 6] = std::array::from_fn(|k| slots >> (2 * k) & 3);
        let axes = [&t[0], &t[1], &t[2], &r[0], &r[1], &r[2]];
        let node = |k: usize| axes[k].nodes[s[k]];
        let e = stored([node(3), node(4), node(5)], [node(0), node(1), node(2)]);
        for (which, sum) in sums.iter_mut().enumerate() {
            let weight = |k: usize| match which == k + 1 {
                true => axes[k].slopes[s[k]],
                false => axes[k].weights[s[k]],
            };
            *sum += (0..6).map(weight).product::<f64>() * e;
        }
    }
    PatchValue {
        energy: sums[0] - far,
        translation: DVec3::new(sums[1], sums[2], sums[3]),
        rotation: [sums[4], sums[5], sums[6]],
    }
}

/// Energies that do not repeat.
struct Mixed;

impl NodeEnergies for Mixed {
    type Scratch = ();

    fn scratch(&self) {}

    fn energies(&self, rotation: DQuat, _: &mut (), mut out: ArrayViewMut3<'_, f32>) {
        for ((i, j, k), e) in out.indexed_iter_mut() {
            let phase = 1.7 * i as f64 + 2.9 * j as f64 + 0.6 * k as f64;
            let turn = rotation.x + 1.3 * rotation.y - 0.7 * rotation.z;
            *e = (phase + 9.0 * turn).sin() as f32;
        }
    }
}

/// Single precision errs by 6e-8 for each of a few hundred additions; coefficients of energies that
/// change as fast as these are some ten times as large, and the weights of slopes sum to 2.
#[test]
fn readings_are_those_of_the_definition() {
    for shape in [[1, 1, 1], [2, 5, 3], [5, 1, 4], [6, 13, 9], [7, 8, 5]] {
        let window = Lattice::new(DVec3::splat(-0.5), 0.25, shape).unwrap();
        let spec = TableSpec {
            provenance: PairProvenance::without_fields(
                ScoreModel::GUIDED,
                DVec3::new(0.1, 0.2, -0.1),
            ),
            window,
            rotations: RotationDomain::ball(20.0, 10.0),
            symmetry: None,
            far_energy: 0.2,
            storage: Storage::default(),
            placement: Placement::IDENTITY,
            contact: None,
        };
        let table = EnergyTable::compute(spec, &Mixed, 1 << 30, &Silent).unwrap();
        for step in 0..40 {
            let s = f64::from(step);
            let turn = 0.5 * DVec3::new(s.sin(), (2.0 * s).cos(), (0.7 * s).sin());
            let pose = Pose::new(DQuat::from_scaled_axis(turn), DVec3::ZERO);
            let x = DVec3::from_array(std::array::from_fn(|k| {
                (0.5 + 0.62 * (s * (1.1 + k as f64)).sin()) * (shape[k] - 1) as f64
            }));
            let Some(displacement) = table.displacement(x) else {
                continue;
            };
            table.grid().visit(&pose, |site| {
                let (r, t) = (&site.taps, &displacement.taps);
                let fast = table.read(site.chart, r, t).unwrap();
                let slow = read_slowly(&table, site.chart, r, t);
                let numbers = |r: &PatchValue| {
                    [&[r.energy][..], &r.translation.to_array(), &r.rotation].concat()
                };
                for (a, b) in numbers(&fast).iter().zip(numbers(&slow)) {
                    assert!((a - b).abs() < 2e-5, "{shape:?}: {a} {b}");
                }
            });
        }
    }
}
