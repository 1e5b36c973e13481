//! Pairs whose only way apart is known: a dovetail, a spool in a slot round a corner, a ball that
//! cannot leave.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, dvec2};

use super::profiled::{Profile, profiled, widened};
use super::solids::{circle, named_prism, out_of_range};
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Chords around round walls.
const CHORDS: u32 = 64;

fn check(part: &str, clearance: f64) -> Result<(), MeshError> {
    if (5e-6..=5e-4).contains(&clearance) {
        return Ok(());
    }
    Err(out_of_range(part, "clearance", "5e-6 .. 5e-4 m", clearance))
}

/// A block with a groove that widens inwards (fixed) and the slider in it (moving), both 16 mm long:
/// they part along z only, either way. `clearance` (metres) lies between all walls; the identity is the
/// assembled pose.
///
/// # Errors
/// If the clearance is not 0.005 .. 0.5 mm.
pub fn dovetail(clearance: f64) -> Result<(TriangleMesh, TriangleMesh), MeshError> {
    check("dovetail", clearance)?;
    let slider = [(-5.0, 0.0), (5.0, 0.0), (3.0, 5.0), (-3.0, 5.0)];
    let slider = slider.map(|(x, y)| 1e-3 * dvec2(x, y)).to_vec();
    let [foot_left, foot_right, head_right, head_left] =
        [0, 1, 2, 3].map(|i| widened(&slider, clearance)[i]);
    // The groove's mouth is where the slider's upper face is.
    let cut = |foot: DVec2, head: DVec2| foot.lerp(head, (0.005 - foot.y) / (head.y - foot.y));
    let block = [
        dvec2(-0.009, -0.004),
        dvec2(0.009, -0.004),
        dvec2(0.009, 0.005),
        cut(foot_right, head_right),
        foot_right,
        foot_left,
        cut(foot_left, head_left),
        dvec2(-0.009, 0.005),
    ];
    let fixed = named_prism("dovetail groove", &block, &[], 0.016)?;
    let moving = named_prism("dovetail slider", &slider, &[], 0.016)?;
    Ok((fixed, moving))
}

/// A plate across z with a slot in the shape of an L (fixed), and a spool whose stem lies at the end
/// of the slot, a flange above and below the plate (moving): out of it the spool goes 8 mm along -x,
/// then 9 mm along -y. `clearance` (metres) lies between all walls; the identity is the assembled pose.
///
/// # Errors
/// If the clearance is not 0.005 .. 0.5 mm.
pub fn spool_in_slot(clearance: f64) -> Result<(TriangleMesh, TriangleMesh), MeshError> {
    check("spool", clearance)?;
    let (stem, half) = (0.002, 0.0015);
    let w = stem + clearance;
    let (x, y) = (0.010, 0.008);
    // The middle of the slot: from the lower edge at x = -4 mm up to y = 1 mm, then to x = 4 mm.
    let (left, right, up) = (-0.004, 0.004, 0.001);
    let plate = [
        (-x, -y),
        (left - w, -y),
        (left - w, up + w),
        (right + w, up + w),
        (right + w, up - w),
        (left + w, up - w),
        (left + w, -y),
        (x, -y),
        (x, y),
        (-x, y),
    ]
    .map(DVec2::from);
    let fixed = named_prism("slotted plate", &plate, &[], 2.0 * half)?;
    let (inner, outer) = (half + clearance, half + clearance + 0.0015);
    let outline = circle(stem, CHORDS).into_iter();
    let spool = Profile {
        outline: outline.map(|p| p + dvec2(right, up)).collect(),
        levels: [
            [-outer, 0.0015],
            [-inner, 0.0015],
            [-inner, 0.0],
            [inner, 0.0],
            [inner, 0.0015],
            [outer, 0.0015],
        ]
        .to_vec(),
    };
    Ok((fixed, profiled(&spool, None)?))
}

/// A block with a round pocket (fixed) and a ball of 4 mm radius in it (moving), which the pocket's
/// mouth is too narrow for by `lip` all round: it does not come out. `clearance` (metres) lies between
/// pocket and ball; the identity is the assembled pose.
///
/// # Errors
/// If the clearance is not 0.005 .. 0.5 mm or the lip not 0.05 .. 2 mm.
pub fn captive_ball(clearance: f64, lip: f64) -> Result<(TriangleMesh, TriangleMesh), MeshError> {
    check("captive ball", clearance)?;
    if !(5e-5..=2e-3).contains(&lip) {
        return Err(out_of_range("captive ball", "lip", "5e-5 .. 2e-3 m", lip));
    }
    let radius = 0.004;
    let pocket = radius + clearance;
    let mouth = radius - lip;
    let outline = circle(mouth, CHORDS);
    // From the mouth down to the floor of the pocket; the outline's corners widen by chords.
    let chord = (std::f64::consts::PI / f64::from(CHORDS)).cos();
    let start = (mouth / pocket).acos();
    let floor = -(FRAC_PI_2 - 0.04);
    let levels = (0..=24).map(|i| {
        let angle = start + (floor - start) * f64::from(i) / 24.0;
        [pocket * angle.sin(), (pocket * angle.cos() - mouth) * chord]
    });
    let levels: Vec<_> = levels.collect();
    let top = levels[0][0];
    let block = Profile {
        outline: [(-7e-3, -6e-3), (7e-3, -6e-3), (7e-3, 6e-3), (-7e-3, 6e-3)]
            .map(DVec2::from)
            .to_vec(),
        levels: vec![[-0.007, 0.0], [top, 0.0]],
    };
    let hole = Profile { outline, levels };
    let fixed = profiled(&block, Some(&hole))?;
    let ball = Profile {
        outline: circle(radius, CHORDS),
        levels: (0..=40)
            .map(|i| {
                // Short of the poles, where the outline would shrink to a point.
                let angle = (FRAC_PI_2 - 0.05) * (f64::from(i) / 20.0 - 1.0);
                [radius * angle.sin(), radius * (angle.cos() - 1.0) * chord]
            })
            .collect(),
    };
    Ok((fixed, profiled(&ball, None)?))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::surface::bvh::tree::Bvh;

    /// Points along the edges of a part: walls may cross where no vertex lies.
    fn points(part: &TriangleMesh) -> Vec<DVec3> {
        const PIECES: u32 = 8;
        let edge = |[a, b]: [u32; 2]| {
            let [a, b] = [a, b].map(|v| part.vertices()[v as usize]);
            (0..PIECES).map(move |i| a.lerp(b, f64::from(i) / f64::from(PIECES)))
        };
        let edges = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let all = part.triangles().iter().flat_map(edges);
        all.flat_map(edge).collect()
    }

    /// Least signed distance of points of either part from the other at a displacement.
    fn least(parts: &(TriangleMesh, TriangleMesh), shift: DVec3) -> f64 {
        let (fixed, moving) = (Bvh::build(&parts.0), Bvh::build(&parts.1));
        let there = points(&parts.1);
        let there = there.iter().map(|p| fixed.signed_distance(*p + shift));
        let back = points(&parts.0);
        let back = back.iter().map(|p| moving.signed_distance(*p - shift));
        there.chain(back).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn parts_are_apart_along_their_way_and_nowhere_else() {
        let clearance = 1e-4;
        let slack = 1.2e-5;
        let [x, y, z] = DVec3::AXES;
        let pair = dovetail(clearance).unwrap();
        let free: [DVec3; 3] = [DVec3::ZERO, 0.004 * z, -0.011 * z];
        assert!(free.iter().all(|s| least(&pair, *s) > clearance - slack));
        // Ends of both parts are flush: past each other.
        let across = [x, y, -y].map(|s| 0.002 * s + 0.003 * z);
        assert!(across.iter().all(|s| least(&pair, *s) < -1e-4));
        let pair = spool_in_slot(clearance).unwrap();
        let free: [DVec3; 4] = [DVec3::ZERO, -0.003 * x, -0.008 * x, -0.008 * x - 0.005 * y];
        for shift in free {
            let found = least(&pair, shift);
            assert!(found > clearance - slack, "{shift}: {found}");
        }
        let blocked = [0.002 * x, 0.002 * y, 0.001 * z, -0.004 * x - 0.003 * y];
        for shift in blocked {
            let found = least(&pair, shift);
            assert!(found < -1e-4, "{shift}: {found}");
        }
    }

    #[test]
    fn the_ball_has_its_play_and_no_more() {
        for (clearance, lip) in [(5e-5, 3e-4), (4e-4, 1e-3)] {
            let pair = captive_ball(clearance, lip).unwrap();
            let at_rest = least(&pair, DVec3::ZERO);
            // Facets of both.
            assert!(at_rest > clearance - 2.5e-5, "{at_rest}");
            // Its widest circle in the mouth.
            let mouth = ((0.004 + clearance).powi(2) - (0.004 - lip).powi(2)).sqrt();
            let stuck = least(&pair, mouth * DVec3::Z);
            assert!(stuck < -0.5 * lip, "{stuck}");
        }
        assert!(captive_ball(1e-4, 0.003).is_err());
    }
}
