//! From meshes to a session.

use std::path::Path;
use std::sync::Arc;

use fft_correlate::{DirectOptions, EnergySource};
use haptic::{PlacedSource, SharedSource, SumSource};
use pegfit_play::{
    Content, LocalSession, PlayError, PlaySession, PlayedScene, SceneContent, start_pose,
};
use pegfit_scene::{Assembly, Scene, SceneError, SceneSetup, example_text};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Aabb, LengthUnit, TriangleMesh};

use crate::progress::Progress;

/// Bytes that fields and searches may plan to use: a browser gives a page four times as much.
const MEMORY: u64 = 1 << 30;

/// How far from the fit there are forces at least, in longest sides of the moving part: the hand
/// begins nearly one and a half away.
const AROUND: f64 = 1.6;

/// A solid, metres, and what to call it.
#[derive(Debug, Clone)]
pub(crate) struct NamedSolid {
    pub(crate) name: String,
    pub(crate) mesh: TriangleMesh,
}

/// One of the paper's pairs.
pub(crate) fn paper(shape: PegInHole) -> Result<SceneSetup, PlayError> {
    let scene = Scene::parse(format!("{}.toml", shape.name()), &example_text(shape))?;
    let (hole, peg) = shape.pair(0.0).map_err(SceneError::from)?;
    Ok(SceneSetup::from_solids(scene, hole, peg, MEMORY)?)
}

/// Two solids that fit as they lie: one that stays and one that moves.
pub(crate) fn own(
    [fixed, moving]: [NamedSolid; 2],
    unit: LengthUnit,
) -> Result<SceneSetup, PlayError> {
    let text = format!("unit = \"{unit}\"\nfixed = \"fixed.stl\"\nmoving = \"moving.stl\"\n");
    let mut scene = Scene::parse(Path::new("your parts"), &text)?;
    scene.fixed.name = fixed.name;
    scene.moving.name = moving.name;
    Ok(SceneSetup::from_solids(
        scene,
        fixed.mesh,
        moving.mesh,
        MEMORY,
    )?)
}

/// Computes the fields of a scene and begins its session of this number, of the pair of that one.
pub(crate) fn open(setup: SceneSetup, number: u32, pair: usize) -> Result<LocalSession, PlayError> {
    let progress = Arc::new(Progress::default());
    let assembly = Assembly::about_fit(setup, AROUND, &*progress)?;
    let source = energies(&assembly)?;
    let (workspace, geometry) = (assembly.workspace(), assembly.geometry(&*source));
    let scene = assembly.scene();
    let played = PlayedScene {
        scene,
        assembly: &assembly,
        names: std::slice::from_ref(&scene.fixed.name),
        source: &*source,
        geometry,
        table: None,
    };
    let content = SceneContent::new(&played, progress)?;
    let session = PlaySession {
        source: &*source,
        config: scene.device.clone(),
        workspace,
        start: start_pose(&geometry, workspace.grip),
        geometry,
        joints: Vec::new(),
        path: None,
        content: Arc::new(content) as Arc<dyn Content>,
    };
    LocalSession::new(&session, Arc::clone(&source), number, pair)
}

/// Energies in the scene. Of a pair that is there about its fit only, there are none elsewhere.
fn energies(assembly: &Assembly) -> Result<Arc<dyn EnergySource>, PlayError> {
    let source = assembly.direct(&DirectOptions::REAL_TIME)?;
    let own = assembly.pair.pivot();
    let around = |d: Aabb| Aabb::around([own + d.min, own + d.max]);
    let placed = PlacedSource {
        source: Some(SharedSource::new(Arc::new(source))),
        placement: *assembly.placement(),
        reach: assembly.pair.displacements().map(around),
    };
    Ok(Arc::new(SumSource::new(assembly.pivot(), vec![placed])))
}

#[cfg(test)]
mod tests {
    use fft_correlate::Pose;
    use glam::DVec3;
    use sdf_grid::shapes;

    use super::*;

    /// The page's session is that of `pegfit play`: a hand before the hole, a fit in it.
    #[test]
    fn a_pair_of_the_paper_is_played() {
        let mut play = open(paper(PegInHole::Rectangular).unwrap(), 1, 1).unwrap();
        let said = play.description();
        assert_eq!(said["fixed"][0], "rectangular_hole");
        assert_eq!(said["moving"], "rectangular_peg");
        let profile = said["profile"].as_array().unwrap();
        let energies: Vec<f64> = profile.iter().map(|p| p[1].as_f64().unwrap()).collect();
        let least = energies.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least < -0.01 && energies[0] > 0.2 * least, "{least}");
        while !play.step() {}
        assert!(play.frame().is_some());
        assert!(play.bytes("mesh/0").is_some() && play.bytes("slice/moving").is_some());
    }

    /// A pin on a plate many times its size: only what is near is computed, and beyond there is no
    /// force instead of a wrong one.
    #[test]
    fn of_a_large_part_only_what_is_near_the_fit_has_forces() {
        let pin = shapes::cuboid(DVec3::splat(0.002)).unwrap();
        let plate = shapes::cuboid(DVec3::new(0.06, 0.06, 0.004)).unwrap();
        let above = plate.bounds().max.z - pin.bounds().min.z;
        let named = |name: &str, mesh| NamedSolid {
            name: name.to_owned(),
            mesh,
        };
        let pin = pin.transformed(glam::DQuat::IDENTITY, DVec3::new(0.0, 0.0, above));
        let setup = own([named("plate", plate), named("pin", pin)], LengthUnit::Mm).unwrap();
        let assembly = Assembly::about_fit(setup, AROUND, &Progress::default()).unwrap();
        assert!(!assembly.pair.is_whole());
        let source = energies(&assembly).unwrap();
        let at = |x: f64| {
            let pose = Pose::from_translation(DVec3::new(x, 0.0, 0.0));
            source.evaluate(&pose, &mut source.scratch())
        };
        assert!(at(0.0).coverage > 0.0 && at(0.0).energy != 0.0);
        // Well on the plate, whose energy there is that at the fit.
        let far = at(0.02);
        assert_eq!(
            (far.energy, far.wrench.force, far.coverage),
            (0.0, DVec3::ZERO, 0.0)
        );
    }
}
