//! Ways in: how a part gets to where it fits, or that it does not.
//!
//! [`PathSearch`] goes out of the fit: the part slides along what it touches, without friction, in every
//! direction that the walls leave, best first, until it lies beside the fixed part. What it may overlap
//! on the way is raised like water until a way opens. The way is then straightened into few screw
//! motions, taken off the walls, let down the energy where it climbs, and measured.
//!
//! ```
//! use std::sync::Arc;
//!
//! use fft_correlate::Pose;
//! use pegfit_path::{Outcome, PathOptions, PathSearch};
//! use sdf_grid::{Silent, shapes};
//!
//! let (groove, slider) = shapes::dovetail(2e-4)?;
//! let search = PathSearch::new(Arc::new(groove), Arc::new(slider), PathOptions::default())?;
//! let answer = search.find(&Pose::IDENTITY, None, &Silent)?;
//! assert_eq!(answer.outcome, Outcome::Free);
//! // Along the groove, 16 mm and more; out at the other end is as good.
//! assert!(answer.motions.len() == 1 && answer.motions[0].advance > 0.016);
//! assert!(answer.motions[0].axis[2].abs() > 0.999);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod answer;
mod contact;
mod error;
mod motion;
mod planner;
mod search;
mod way;

pub use answer::{Effort, OtherPath, Outcome, PathAnswer, PathPose};
pub use error::PathError;
pub use motion::words::Motion;
pub use planner::options::{PathOptions, Start};
pub use planner::plan::PathSearch;
pub use way::climb::Climb;

#[cfg(test)]
mod trial {
    use std::sync::Arc;
    use std::time::{Duration, Instant};

    use fft_correlate::Pose;
    use glam::{DQuat, DVec3};
    use sdf_grid::{TriangleMesh, shapes};

    use crate::contact::gaps::Gaps;
    use crate::contact::settle::Limits;
    use crate::search::escape::Escape;
    use crate::search::grow::Growth;
    use crate::search::same::Shape;

    #[test]
    fn trial() {
        let mut pairs: Vec<(String, TriangleMesh, TriangleMesh)> = Vec::new();
        for s in 0..8 {
            let f = shapes::random_fit(s).unwrap();
            pairs.push((
                format!("{} {} {:.3}", f.kind, f.through, 1e3 * f.clearance),
                f.fixed,
                f.moving,
            ));
        }
        for c in [4e-5, 1e-4, 4e-4] {
            let (a, b) = shapes::dovetail(c).unwrap();
            pairs.push((format!("dovetail {c}"), a, b));
            let (a, b) = shapes::spool_in_slot(c).unwrap();
            pairs.push((format!("spool {c}"), a, b));
            let (a, b) = shapes::bayonet(c).unwrap();
            pairs.push((format!("bayonet {c}"), a, b));
            let (a, b) = shapes::captive_ball(c, 5e-4).unwrap();
            pairs.push((format!("ball {c}"), a, b));
            for right_handed in [true, false] {
                let t = shapes::Thread {
                    pitch: 0.002,
                    radius: 0.005,
                    depth: 0.0008,
                    right_handed,
                    segments: 64,
                };
                let a = t.bolt(0.012, [0.008, 0.003]).unwrap();
                let b = t.nut([0.001, 0.006], 0.016, c).unwrap();
                pairs.push((format!("nut {c} {right_handed}"), a, b));
            }
        }
        let only = std::env::var("ONLY").unwrap_or_default();
        for (name, a, b) in pairs.into_iter().filter(|p| p.0.contains(&only)) {
            let q = DQuat::from_scaled_axis(DVec3::new(0.4, -1.3, 0.9));
            let pf = Pose::new(q, DVec3::new(0.01, -0.02, 0.03));
            let pm = Pose::new(
                DQuat::from_scaled_axis(DVec3::new(-1.4, 0.3, 2.0)),
                DVec3::new(-0.02, 0.01, 0.01),
            );
            let a = a.transformed(pf.rotation, pf.translation);
            let b = b.transformed(pm.rotation, pm.translation);
            let goal = pf * pm.inverse();
            let radius = b.radius_about(b.centroid());
            let began = Instant::now();
            let gaps = Gaps::new(Arc::new(a), Arc::new(b), radius / 40.0);
            let escape = Escape::new(&gaps);
            let shape = Shape::new(&gaps);
            let made = began.elapsed();
            let tolerance = 1e-3 * radius;
            let growth = Growth {
                gaps: &gaps,
                escape: &escape,
                shape: &shape,
                limits: Limits {
                    level: tolerance,
                    tolerance,
                },
                step: radius / 30.0,
                deadline: Instant::now() + Duration::from_secs(60),
                others: 0.5,
                stop: &|| false,
            };
            let grown = growth.run(&goal);
            let lengths: Vec<_> = grown
                .ways
                .iter()
                .map(|w| (w.poses.len(), pf.rotation.conjugate() * w.exit.direction))
                .collect();
            println!(
                "{name}: {} points, depth {:.1e}, made {:.2} s, {} nodes {} looks {:.2} s exhausted {} {:?} closest {:?}",
                gaps.points(),
                gaps.depth(&goal),
                made.as_secs_f64(),
                grown.nodes,
                grown.looked,
                began.elapsed().as_secs_f64(),
                grown.exhausted,
                lengths,
                grown.closest.map(|c| c.1)
            );
        }
    }
}
