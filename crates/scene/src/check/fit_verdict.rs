//! How parts of a scene overlap where they fit, in the words of `pegfit check`.

use glam::{DQuat, DVec3};
use sdf_grid::{Interference, InterferenceQuery};
use serde::Serialize;

use crate::scene::Scene;
use crate::setup::parts::FitSolids;
use crate::shell::shell_word;

/// Share of the smaller part's volume up to which facets, or a press fit, may be all that overlaps.
pub const FACETS: f64 = 2e-3;

/// Share up to which parts count as touching: what is shared then is rounding.
pub const TOUCHING: f64 = 1e-6;

/// Interference of a fixed part and the moving one at the fit.
///
/// ```
/// use pegfit_scene::{FitSolids, FitVerdict};
/// use sdf_grid::shapes::PegInHole;
///
/// let (fixed, moving) = PegInHole::Rectangular.pair(1e-4)?;
/// let solids = FitSolids { name: "hole".into(), fixed, moving, scale: None };
/// let verdict = FitVerdict::of(&solids, "peg", "scene.toml");
/// // With this clearance the parts share no volume (m³), to no depth (m).
/// assert_eq!((verdict.shared_volume, verdict.depth), (0.0, 0.0));
/// assert_eq!(verdict.lines()[0], "peg in hole: they do not overlap");
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Serialize)]
pub struct FitVerdict {
    /// The scene that puts them there.
    pub scene: String,
    /// The fixed part's name.
    pub fixed: String,
    /// The moving part's name.
    pub moving: String,
    /// Cubic metres.
    pub shared_volume: f64,
    /// Of the smaller part's volume.
    pub share: f64,
    /// How deep a point of either lies in the other at most, metres.
    pub depth: f64,
    /// Metres between their boxes along the axis on which they are farthest apart; 0 if they meet.
    pub apart: f64,
    /// What to do, if anything.
    pub next: Vec<String>,
}

impl FitVerdict {
    /// Every pair of a scene; none if a mesh cannot be used: its own verdict says so.
    pub fn all(scene: &Scene) -> Vec<Self> {
        let Ok(pairs) = scene.fit_solids() else {
            return Vec::new();
        };
        let path = scene.path.display().to_string();
        let fit = |pair: FitSolids| Self::of(&pair, &scene.moving.name, &path);
        pairs.into_iter().map(fit).collect()
    }

    /// A pair; `moving` is the moving part's name, `scene` the scene's.
    pub fn of(pair: &FitSolids, moving: &str, scene: &str) -> Self {
        let (a, b) = (pair.fixed.bounds(), pair.moving.bounds());
        let gap = (a.min - b.max).max(b.min - a.max).max_element().max(0.0);
        let query = InterferenceQuery::new(&pair.fixed, &pair.moving);
        let Interference { volume, depth } = query.at(DQuat::IDENTITY, DVec3::ZERO);
        let share = volume / pair.fixed.volume().min(pair.moving.volume());
        let mut next: Vec<String> = pair.scale.iter().map(|w| w.to_string()).collect();
        if share > FACETS {
            let word = shell_word(scene.as_ref());
            next.push(format!(
                "they overlap by more than facets do: put them where they fit (position, rotation \
                 under [moving], or [fit]); `pegfit plot overlap {word} -o overlap.png` shows \
                 where"
            ));
            next.push(format!(
                "if the overlap is meant: `pegfit path {word} --allow-overlap` says how deep it is"
            ));
        }
        if gap > 0.375 * b.diagonal() {
            next.push(
                "they are out of reach of each other: export both from one assembly, or put them \
                 where they fit (position, rotation under [moving], or [fit])"
                    .to_owned(),
            );
        }
        Self {
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
    pub fn lines(&self) -> Vec<String> {
        let Self { fixed, moving, .. } = self;
        let mut lines = Vec::new();
        match (self.share > TOUCHING, self.apart > 0.0) {
            (true, _) => lines.push(format!(
                "{moving} in {fixed}: they share {:.4} mm³, {:.3} % of the smaller, {:.4} mm deep",
                self.shared_volume / 1e-9,
                100.0 * self.share,
                1e3 * self.depth
            )),
            (false, true) => lines.push(format!(
                "{moving} in {fixed}: {:.3} mm apart at the fit",
                1e3 * self.apart
            )),
            (false, false) => lines.push(format!("{moving} in {fixed}: they do not overlap")),
        }
        for next in &self.next {
            lines.push(format!("  next         {next}"));
        }
        lines
    }
}
