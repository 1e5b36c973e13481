//! Scenes from the file to energies: whatever they say of places, scales and parts.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use fft_correlate::{DirectOptions, EnergySource, Pose};
use glam::{DQuat, DVec3};
use haptic::scene::PairState;
use pegfit_scene::{Assembly, LivePairs, Motion, Scene, SceneError, SceneSetup, SceneWarning};
use sdf_grid::{Monitor, Silent, TriangleMesh, mesh_io, shapes, shapes::PegInHole};

/// Enough for everything here.
const MEMORY: u64 = 1 << 30;

/// What all scenes here say: so coarse that a field takes a fraction of a second.
const COARSE: &str = "\
[lattice]
spacing = 0.0025
halo = 0.006
field_tolerance = 0.01
[window]
half_extent = 0.004
";

/// Where the modeller left each part, and where the scene therefore puts it back.
fn lying(mesh: &TriangleMesh, turn: DQuat, shift: DVec3) -> (TriangleMesh, String) {
    let place = Pose::new(turn, shift).inverse();
    let [x, y, z] = place.translation.to_array();
    let [qx, qy, qz, qw] = place.rotation.to_array();
    let text = format!("position = [{x}, {y}, {z}]\nrotation = [{qx}, {qy}, {qz}, {qw}]\n");
    (mesh.transformed(turn, shift), text)
}

/// A folder with `hole.obj` and `peg.obj`, both turned and shifted by their modeller, of a square peg
/// with 1 mm of clearance, and the text of the scene that puts them together.
fn parts() -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let (hole, peg) = PegInHole::Rectangular.pair(1e-3).unwrap();
    let turn = |x, y, z| DQuat::from_euler(glam::EulerRot::XYZ, x, y, z);
    let mut text = String::from("unit = \"m\"\n");
    for (role, name, mesh, turn, shift) in [
        (
            "fixed",
            "hole",
            &hole,
            turn(0.3, -0.2, 0.5),
            DVec3::new(0.02, -0.01, 0.03),
        ),
        (
            "moving",
            "peg",
            &peg,
            turn(-0.7, 0.4, 0.1),
            DVec3::new(-0.04, 0.015, 0.01),
        ),
    ] {
        let (lies, place) = lying(mesh, turn, shift);
        mesh_io::write_obj(folder.path().join(format!("{name}.obj")), &lies).unwrap();
        text += &format!("[{role}]\nmesh = \"{name}.obj\"\n{place}");
    }
    (folder, text + COARSE)
}

fn scene(folder: &Path, text: &str) -> Scene {
    Scene::parse(folder.join("scene.toml"), text).unwrap()
}

/// The load of a motion is minus the slope of the energy along it, by central differences.
#[test]
fn loads_of_oblique_motions_are_slopes_of_the_energy() {
    let (folder, text) = parts();
    let assembly = Assembly::load(scene(folder.path(), &text), MEMORY, &Silent).unwrap();
    let source = assembly.direct(&DirectOptions::FULL).unwrap();
    let direction = DVec3::new(0.6, 0.0, -0.8);
    for (motion, amounts, step) in [
        (
            Motion::Translation(direction),
            [-1.7e-3, 4e-4, 2.3e-3],
            8e-6,
        ),
        (Motion::Rotation(direction), [-0.11, 0.03, 0.2], 6e-4),
    ] {
        let points = assembly.profile(&source, motion, &amounts);
        let (mut difference, mut size) = (0.0, 0.0);
        for (point, amount) in points.iter().zip(amounts) {
            assert_eq!(
                (point.amount, point.pose),
                (amount, assembly.moved(motion, amount))
            );
            let energy = |amount| {
                let pose = assembly.moved(motion, amount);
                source.evaluate(&pose, &mut source.scratch()).energy
            };
            let slope = (energy(amount + step) - energy(amount - step)) / (2.0 * step);
            difference += (point.load + slope).powi(2);
            size += slope * slope;
        }
        // The wrench is the exact gradient, the difference is not: a shorter step loses digits to
        // single-precision sums, a longer one crosses more kinks of the interpolant.
        let error = (difference / size).sqrt();
        assert!(error < 5e-3, "{motion:?}: {error}");
    }
}

/// The same sums over the nodes of one lattice or the other.
#[test]
fn scores_over_a_window_are_those_of_direct_quadrature() {
    let (folder, text) = parts();
    let assembly = Assembly::load(scene(folder.path(), &text), MEMORY, &Silent).unwrap();
    let window = assembly.design().unwrap().window;
    let scores = assembly.scores(&window).unwrap();
    let direct = assembly.direct(&DirectOptions::FULL).unwrap();
    let rotation = assembly.setup.parts.assembled.rotation;
    let (mut difference, mut size) = (0.0, 0.0);
    for ([i, j, k], score) in scores.indexed_iter().map(|((i, j, k), s)| ([i, j, k], s)) {
        let pose = assembly.pair.pose(rotation, window.displacement([i, j, k]));
        let expected = direct.score(&pose).re;
        difference += (f64::from(*score) - expected).powi(2);
        size += expected * expected;
    }
    // The part is turned: either side interpolates the other part's density, 2.5 mm apart here
    // where the halo ends at 6.
    let error = (difference / size).sqrt();
    assert!(error < 1e-2, "{error}");
}

/// A small part of a large assembly is as usual as it is small.
#[test]
fn parts_of_usual_sizes_may_differ_by_any_factor() {
    let (folder, text) = parts();
    let peg = PegInHole::Rectangular.pair(1e-3).unwrap().1;
    let small = peg.vertices().iter().map(|v| *v * 0.02).collect();
    let options = sdf_grid::RepairOptions::default();
    let (small, _) = TriangleMesh::clean("peg", small, peg.triangles().to_vec(), &options).unwrap();
    mesh_io::write_obj(folder.path().join("peg.obj"), &small).unwrap();
    let setup = SceneSetup::read(scene(folder.path(), &text), MEMORY).unwrap();
    assert!(setup.warnings.is_empty(), "{:?}", setup.warnings);
}

#[test]
fn parts_in_different_units_are_a_warning_and_parts_below_a_cell_an_error() {
    let (folder, text) = parts();
    let peg = PegInHole::Rectangular.pair(1e-3).unwrap().1;
    let small = peg.vertices().iter().map(|v| *v * 1e-3).collect();
    let options = sdf_grid::RepairOptions::default();
    let (small, _) = TriangleMesh::clean("peg", small, peg.triangles().to_vec(), &options).unwrap();
    mesh_io::write_obj(folder.path().join("peg.obj"), &small).unwrap();
    let setup = SceneSetup::read(scene(folder.path(), &text), MEMORY).unwrap();
    let said: Vec<String> = setup.warnings.iter().map(|w| w.to_string()).collect();
    assert!(
        matches!(setup.warnings[..], [SceneWarning::Scale { .. }]),
        "{said:?}"
    );
    assert!(said[0].contains("are both in m?"), "{said:?}");
    let error = Assembly::new(setup, &Silent).unwrap_err();
    assert!(
        matches!(error, SceneError::TooSmall { part: "moving", .. }),
        "{error}"
    );
    assert!(error.to_string().contains("moving part peg"), "{error}");
}

#[test]
fn fields_beyond_the_memory_allowed_are_refused_with_both_numbers() {
    let (folder, text) = parts();
    let error = Assembly::load(scene(folder.path(), &text), 1000, &Silent).unwrap_err();
    assert!(
        matches!(error, SceneError::Memory { needed, limit: 1000, .. } if needed > 1000),
        "{error}"
    );
}

/// A part in two places is felt in both, from the same memory.
#[test]
fn a_part_in_two_places_is_felt_in_both() {
    let (folder, text) = parts();
    let mut scene = scene(folder.path(), &text);
    let alone = Assembly::load(scene.clone(), MEMORY, &Silent).unwrap();
    let apart = Pose::from_translation(DVec3::new(0.5, 0.2, -0.3));
    let mut second = scene.fixed.clone();
    second.name = "second".to_owned();
    second.pose = apart * second.pose;
    scene.others.push(second);
    let first = scene.clone().only(Some("hole")).unwrap();
    let assembly = Assembly::load(first, MEMORY, &Silent).unwrap();
    let monitor: Arc<dyn Monitor + Send> = Arc::new(Silent);
    let pairs = LivePairs::start(&scene, assembly, None, &monitor).unwrap();
    assert_eq!(pairs.names, ["hole", "second"]);
    assert!(pairs.warnings.is_empty(), "{:?}", pairs.warnings);
    let direct = alone.source(&DirectOptions::REAL_TIME).unwrap();
    let pose = Pose::from_translation(DVec3::new(3e-4, -5e-4, 7e-4)) * alone.assembled();
    let expected = direct.evaluate(&pose, &mut direct.scratch()).energy;
    assert!(expected < 0.0, "{expected}");
    for (pair, pose) in [(0, pose), (1, apart * pose)] {
        let live = pairs.live.source();
        let mut felt = live.evaluate(&pose, &mut live.scratch());
        // The loading thread hears from the source where the part is.
        for _ in 0..1000 {
            if pairs.live.states()[pair] == PairState::Loaded && felt.coverage == 1.0 {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
            felt = live.evaluate(&pose, &mut live.scratch());
        }
        // The same evaluator on the same fields, asked at a pose that was rounded on the way.
        let difference = (felt.energy - expected).abs();
        assert!(
            difference <= 1e-6 * expected.abs(),
            "pair {pair}: {felt:?}, {expected}"
        );
    }
}

/// A small part at a large one begins with what is near the fit; what is near the hand follows.
#[test]
fn a_large_part_is_felt_near_the_fit_first_and_wherever_the_hand_goes() {
    let folder = tempfile::tempdir().unwrap();
    let plate = shapes::cuboid(DVec3::new(0.3, 0.2, 0.01)).unwrap();
    let block = shapes::cuboid(DVec3::splat(0.01)).unwrap();
    mesh_io::write_obj(folder.path().join("plate.obj"), &plate).unwrap();
    mesh_io::write_obj(folder.path().join("block.obj"), &block).unwrap();
    let text = "unit = \"m\"\n[fixed]\nmesh = \"plate.obj\"\n[moving]\nmesh = \"block.obj\"\n\
                [fit]\nposition = [0.02, 0.03, 0.01]\n";
    let scene = scene(folder.path(), &(text.to_owned() + COARSE));
    let setup = || SceneSetup::read(scene.clone(), MEMORY).unwrap();
    let whole = Assembly::new(setup(), &Silent).unwrap();
    let near = Assembly::near_fit(setup(), &Silent).unwrap();
    assert!(whole.pair.is_whole() && !near.pair.is_whole());
    let nodes = |a: &Assembly| a.pair.fixed().lattice().len();
    assert!(5 * nodes(&near) < nodes(&whole), "{}", nodes(&near));
    let monitor: Arc<dyn Monitor + Send> = Arc::new(Silent);
    let pairs = LivePairs::start(&scene, near, None, &monitor).unwrap();
    let live = pairs.live.source();
    let direct = whole.source(&DirectOptions::REAL_TIME).unwrap();
    let energy = |source: &dyn EnergySource, x: f64| {
        let pose = Pose::from_translation(DVec3::new(x, 0.03, 0.0098));
        source.evaluate(&pose, &mut source.scratch()).energy
    };
    let here = energy(&direct, 0.02);
    let off = (energy(live, 0.02) - here).abs();
    assert!(here != 0.0 && off < 0.05 * here.abs(), "{off} of {here} J");
    // Wherever the part goes, once what is there has been loaded.
    for x in [0.05, 0.1, -0.12, -0.05] {
        let there = energy(&direct, x);
        let mut felt = (0..1000).map(|_| {
            std::thread::sleep(Duration::from_millis(10));
            energy(live, x)
        });
        let near = |felt: f64| (felt - there).abs() < 0.05 * there.abs();
        assert!(felt.any(near), "{there} J at {x}");
    }
    let events = pairs.live.events();
    assert!(events.len() >= 3, "{events:?}");
}
