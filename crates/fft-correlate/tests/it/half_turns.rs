//! Tables and searches of all rotations, where four at a time share the moving part's transforms.

use std::path::Path;

use crate::direct_support::{Blobs, model, pair};
use crate::store_support::{SHARED, chunk, files};
use fft_correlate::correlate::{CorrelatorPlan, HalfTurn, PairSupport, RotationSum};
use fft_correlate::testing::{half_turn_groups, search_rotations};
use fft_correlate::{
    EnergyTable, NodeEnergies, Pair, PairEnergies, RotationDomain, Share, TableSpec, TableStore,
    TranslationWindow, bake,
};
use glam::DQuat;
use ndarray::{Array3, ArrayViewMut3};
use sdf_grid::Silent;

const H: f64 = 0.001;

/// A small pair and a table.
fn scene(rotations: RotationDomain) -> (Pair, TranslationWindow, TableSpec) {
    let pair = pair(&Blobs::new(3), &Blobs::new(4), H, model(0.0));
    let window = TranslationWindow::cube(4.0 * H, H).unwrap();
    let spec = TableSpec::for_pair(&pair, &window, rotations);
    (pair, window, spec)
}

fn energies_of(pair: &Pair, window: &TranslationWindow, rotations: &[DQuat]) -> PairEnergies {
    let (support, groups) = (PairSupport::of(pair).unwrap(), half_turn_groups(rotations));
    let plan = CorrelatorPlan::for_groups(&support, window, &groups).unwrap();
    PairEnergies::build(&plan.for_sums(), pair).unwrap()
}

fn energies(pair: &Pair, window: &TranslationWindow, spec: &TableSpec) -> PairEnergies {
    let energies = energies_of(pair, window, spec.grid().unwrap().nodes());
    assert!(energies.correlator().plan().shares_half_turns);
    energies
}

/// One pair among many rotations saves less than the longer transforms may cost.
#[test]
fn a_few_half_turns_are_not_shared() {
    let (pair, window, _) = scene(RotationDomain::full(30.0));
    let shares = |rotations: &[DQuat]| {
        let energies = energies_of(&pair, &window, rotations);
        energies.correlator().plan().shares_half_turns
    };
    let alone: Vec<_> = (0..6)
        .map(|i| DQuat::from_rotation_z(0.1 * f64::from(i)))
        .collect();
    let one_pair = [&alone[..], &[HalfTurn::Y.rotation()]].concat();
    assert_eq!(half_turn_groups(&one_pair).len(), 6);
    assert!(!shares(&alone) && !shares(&one_pair) && shares(&search_rotations(1.0, &[])));
}

/// Energies of rotations one by one: sums are added up from whole correlations.
struct OneByOne(PairEnergies);

impl NodeEnergies for OneByOne {
    type Scratch = <PairEnergies as NodeEnergies>::Scratch;

    fn scratch(&self) -> Self::Scratch {
        self.0.scratch()
    }

    fn unit(&self) -> f32 {
        self.0.unit()
    }

    fn energies(&self, rotation: DQuat, scratch: &mut Self::Scratch, out: ArrayViewMut3<'_, f32>) {
        self.0.energies(rotation, scratch, out);
    }
}

/// Largest difference of any coefficient of a rotation node, as a share of the largest, and the rms
/// difference over all nodes as a share of the rms.
fn apart(found: &EnergyTable, expected: &EnergyTable) -> [f64; 2] {
    let (mut worst, mut off, mut size) = (0f64, 0.0, 0.0);
    for row in 0..expected.grid().nodes().len() {
        let (found, expected) = (node(found, row), node(expected, row));
        let largest = expected.iter().fold(0f64, |a, e| a.max(e.abs()));
        for (found, expected) in found.iter().zip(&expected) {
            worst = worst.max((found - expected).abs() / largest);
            off += (found - expected).powi(2);
            size += expected * expected;
        }
    }
    [worst, (off / size).sqrt()]
}

/// A node whose transform serves half turns has the coefficients that it has by itself: to a rounding
/// of the transforms and a unit of half precision.
#[test]
fn sharing_half_turns_changes_no_coefficient() {
    let (pair, window, spec) = scene(RotationDomain::full(30.0));
    let shared = energies(&pair, &window, &spec);
    let alone = PairEnergies::plan(&pair, &window).unwrap();
    assert!(!alone.correlator().plan().shares_half_turns);
    let of = |energies| EnergyTable::compute(spec.clone(), energies, 1 << 30, &Silent).unwrap();
    let [worst, _] = apart(&of(&shared), &of(&alone));
    assert!(worst < 1e-3, "{worst}");
}

/// The same of energies, which no storage rounds.
#[test]
fn sharing_half_turns_changes_no_energy() {
    let (pair, window, spec) = scene(RotationDomain::full(30.0));
    let rotations = spec.grid().unwrap().nodes().to_vec();
    let (shared, alone) = (
        energies(&pair, &window, &spec),
        PairEnergies::plan(&pair, &window).unwrap(),
    );
    let (mut scratch, mut own) = (shared.scratch(), alone.scratch());
    for group in half_turn_groups(&rotations) {
        let turns: Vec<_> = group.members.iter().map(|(turn, _)| *turn).collect();
        let mut found = vec![Array3::<f32>::zeros(window.shape()); turns.len()];
        let mut outs: Vec<_> = found.iter_mut().map(|f| f.view_mut()).collect();
        let sum = RotationSum::one(group.rotation);
        shared.sums(&sum, &turns, &mut scratch, &mut outs);
        for ((_, row), found) in group.members.iter().zip(&found) {
            let mut expected = Array3::zeros(window.shape());
            alone.energies(rotations[*row], &mut own, expected.view_mut());
            let largest = expected.fold(0f32, |a, e| a.max(e.abs()));
            let worst = (found - &expected).fold(0f32, |a, e| a.max(e.abs()));
            assert!(worst < 1e-5 * largest, "row {row}: {worst} of {largest}");
        }
    }
}

/// What near rotations add up to, by one turned field and by whole correlations of each. The turns'
/// fourth order and, away from a chart's middle, its bends are left out; what remains at small steps
/// is the kinks of linear reading, which these densities are read by.
#[test]
fn one_field_stands_for_sums_of_near_rotations() {
    for (step, bound) in [(12.0, 6e-3), (6.0, 2.5e-3), (3.0, 2.5e-3)] {
        let ball = RotationDomain::Ball {
            center: DQuat::from_xyzw(0.1, 0.3, -0.2, 0.8).normalize().to_array(),
            angle_deg: 2.0 * step,
            step_deg: step,
        };
        let (pair, window, spec) = scene(ball);
        let fast = PairEnergies::plan(&pair, &window).unwrap();
        let slow = OneByOne(PairEnergies::plan(&pair, &window).unwrap());
        let fast = EnergyTable::compute(spec.clone(), &fast, 1 << 30, &Silent).unwrap();
        let slow = EnergyTable::compute(spec, &slow, 1 << 30, &Silent).unwrap();
        let [_, off] = apart(&fast, &slow);
        println!("{step} degrees: {off}");
        assert!(off < bound, "{step} degrees: {off}");
    }
}

/// Ranks, and resuming where any members of groups are missing, change no byte.
#[test]
fn what_is_shared_does_not_show_in_the_files() {
    // Groups of four and of two, and two rotations by themselves.
    let four = search_rotations(1.0, &[]);
    assert_eq!(four.len(), 80);
    let two = [0.3, 0.8].map(DQuat::from_rotation_x);
    let two = two.iter().flat_map(|q| [*q, HalfTurn::Y.rotation() * *q]);
    let alone = [0.2, 0.5].map(DQuat::from_rotation_z);
    let list = four.into_iter().chain(two).chain(alone);
    let list = RotationDomain::List {
        rotations: list.map(|q| q.to_array()).collect(),
        margin_deg: 10.0,
    };
    let (pair, window, spec) = scene(list);
    let energies = energies(&pair, &window, &spec);
    let folder = tempfile::tempdir().unwrap();
    let made = |path: &Path, share| bake(path, &spec, &energies, share, &Silent).unwrap();
    let whole = folder.path().join("whole.zarr");
    let rotations = made(&whole, Share::ALL).rotations;
    let expected = files(&whole);
    let split = folder.path().join("split.zarr");
    let shares = [0, 1, 2].map(|rank| Share {
        rank,
        size: 3,
        resume: false,
    });
    let computed: usize = shares.iter().map(|s| made(&split, *s).computed).sum();
    assert_eq!(computed, rotations);
    assert!(files(&split) == expected, "three ranks");
    // A different choice of each group, among them groups of which only the first is left.
    let missing: Vec<usize> = (0..rotations).filter(|row| row % 7 < 3).collect();
    for row in &missing {
        std::fs::remove_file(chunk(&whole, *row)).unwrap();
    }
    let report = made(&whole, SHARED);
    assert_eq!(
        (report.computed, report.kept),
        (missing.len(), rotations - missing.len())
    );
    assert!(files(&whole) == expected, "resumed");
    let loaded = TableStore::open(&whole).unwrap().load(1 << 30).unwrap();
    let table = EnergyTable::compute(spec.clone(), &energies, 1 << 30, &Silent).unwrap();
    for row in 0..rotations {
        assert_eq!(node(&loaded, row), node(&table, row), "row {row}");
    }
}

fn node(table: &EnergyTable, row: usize) -> Vec<f64> {
    let window = table.spec().window;
    let indices = (0..window.len()).map(|flat| window.unravel(flat));
    indices
        .map(|index| table.coefficient(row, index).unwrap())
        .collect()
}
