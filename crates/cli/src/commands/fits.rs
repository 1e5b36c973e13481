//! Whether the parts of a scene lie as parts that fit do: near each other, not through each other.

use glam::{DQuat, DVec3};
use pegfit_scene::{FitSolids, Scene};
use sdf_grid::{Interference, InterferenceQuery};
use serde::Serialize;

/// Share of the smaller part's volume up to which facets, or a press fit, may be all that overlaps.
pub(super) const FACETS: f64 = 2e-3;

/// Share up to which parts count as touching: what is shared then is rounding.
pub(super) const TOUCHING: f64 = 1e-6;

/// What is said of a fixed part and the moving one at the fit.
#[derive(Debug, Serialize)]
pub(super) struct Fit {
    /// The scene that puts them there.
    scene: String,
    fixed: String,
    moving: String,
    /// Cubic metres.
    shared_volume: f64,
    /// Of the smaller part's volume.
    share: f64,
    /// How deep a point of either lies in the other at most, metres.
    depth: f64,
    /// Metres between their boxes along the axis on which they are farthest apart; 0 if they meet.
    apart: f64,
    /// What to do, if anything.
    next: Vec<String>,
}

/// Every pair of a scene; none if a mesh cannot be used, which is said of the mesh.
pub(super) fn of(scene: &Scene) -> Vec<Fit> {
    let Ok(pairs) = scene.fit_solids() else {
        return Vec::new();
    };
    let path = scene.path.display().to_string();
    let fit = |pair: FitSolids| judge(&pair, &scene.moving.name, &path);
    pairs.into_iter().map(fit).collect()
}

fn judge(pair: &FitSolids, moving: &str, scene: &str) -> Fit {
    let (a, b) = (pair.fixed.bounds(), pair.moving.bounds());
    let gap = (a.min - b.max).max(b.min - a.max).max_element().max(0.0);
    let query = InterferenceQuery::new(&pair.fixed, &pair.moving);
    let Interference { volume, depth } = query.at(DQuat::IDENTITY, DVec3::ZERO);
    let share = volume / pair.fixed.volume().min(pair.moving.volume());
    let mut next: Vec<String> = pair.scale.iter().map(|w| w.to_string()).collect();
    if share > FACETS {
        next.push(format!(
            "they overlap by more than facets do: put them where they fit (position, rotation under \
             [moving], or [fit]); `pegfit plot overlap {scene} -o overlap.png` shows where"
        ));
        next.push(format!(
            "if the overlap is meant: `pegfit path {scene} --allow-overlap` says how deep it is"
        ));
    }
    if gap > 0.375 * b.diagonal() {
        next.push(
            "they are out of reach of each other: export both from one assembly, or put them where \
             they fit (position, rotation under [moving], or [fit])"
                .to_owned(),
        );
    }
    Fit {
        scene: scene.to_owned(),
        fixed: pair.name.clone(),
        moving: moving.to_owned(),
        shared_volume: volume,
        share,
        depth,
        apart: gap,
        next,
    }
}

/// For people.
pub(super) fn print(fit: &Fit) {
    let Fit { fixed, moving, .. } = fit;
    match (fit.share > TOUCHING, fit.apart > 0.0) {
        (true, _) => crate::say!(
            "{moving} in {fixed}: they share {:.4} mm³, {:.3} % of the smaller, {:.4} mm deep",
            fit.shared_volume / 1e-9,
            100.0 * fit.share,
            1e3 * fit.depth
        ),
        (false, true) => {
            crate::say!(
                "{moving} in {fixed}: {:.3} mm apart at the fit",
                1e3 * fit.apart
            )
        }
        (false, false) => crate::say!("{moving} in {fixed}: they do not overlap"),
    }
    for next in &fit.next {
        crate::say!("  next         {next}");
    }
}
