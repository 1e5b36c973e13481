//! Points of packets whose distances from the boundary differ much, in packets of their own.
//!
//! A packet adds clusters that are small enough for its nearest point, as far as the reach of its farthest.
//! Next to a boundary of many small faces those are thousands, where points at like distances
//! need tens.

use super::fast::{LANES, Lanes};
use super::patch::{Brick, Patch, along_curve};

/// Distances in a packet may differ by this factor.
const EVEN: f32 = 4.0;

/// In units of the faces near: up to this distance faces are few, and more packets only see them more often.
const FINE: f32 = 12.0;

/// New packets may be longer than the least distance in them by this factor: else their points have
/// no clusters in common.
const COMPACT: f32 = 5.0;

/// Bits of a place along [`along_curve`].
const CURVE: u32 = 9;

/// Points put aside, to be taken in new packets.
#[derive(Debug, Default)]
pub(crate) struct Regroup {
    aside: Vec<Aside>,
}

#[derive(Debug, Clone, Copy)]
struct Aside {
    /// The octave of the distance, then the place along a compact curve.
    key: u32,
    flat: u32,
    /// Distance, at least the size of the faces near.
    distance: f32,
}

impl Regroup {
    /// Puts the points of a brick aside if their distances differ too much. `face` is the size of the faces near
    /// it; `distances` are zero where no density is wanted.
    pub(crate) fn takes(
        &mut self,
        patch: &Patch,
        brick: &Brick,
        distances: &Lanes,
        face: f32,
    ) -> bool {
        let most = distances.iter().fold(0f32, |a, d| a.max(*d));
        let wanted = |d: &&f32| **d > 0.0;
        let least = distances.iter().filter(wanted).fold(most, |a, d| a.min(*d));
        if most <= EVEN * least.max(face) || most <= FINE * face {
            return false;
        }
        for (lane, distance) in distances.iter().enumerate() {
            let flat = brick.flat[lane];
            // Points are repeated where the patch ends.
            if *distance > 0.0 && !brick.flat[..lane].contains(&flat) {
                // Clusters smaller than a face there are none.
                let distance = distance.max(face);
                let octave = distance.to_bits() >> (f32::MANTISSA_DIGITS - 1);
                self.aside.push(Aside {
                    key: octave << CURVE | along_curve(patch.unravel(flat)) as u32,
                    flat: flat as u32,
                    distance,
                });
            }
        }
        true
    }

    /// Calls `f` with packets of the points put aside, the last point repeated at the end of each, and
    /// forgets them.
    pub(crate) fn empty(&mut self, patch: &Patch, mut f: impl FnMut([usize; LANES])) {
        self.aside.sort_unstable_by_key(|p| p.key);
        let mut rest = &self.aside[..];
        while !rest.is_empty() {
            let (packet, after) = rest.split_at(length(patch, rest));
            let last = packet.len() - 1;
            f(std::array::from_fn(|lane| {
                packet[lane.min(last)].flat as usize
            }));
            rest = after;
        }
        self.aside.clear();
    }
}

/// How many of these points, sorted by their keys, make the next packet.
fn length(patch: &Patch, points: &[Aside]) -> usize {
    let octave = points[0].key >> CURVE;
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    let mut least = f32::INFINITY;
    for (i, point) in points.iter().take(LANES).enumerate() {
        let index = patch.unravel(point.flat as usize);
        let mut squared = 0;
        for k in 0..3 {
            low[k] = low[k].min(index[k]);
            high[k] = high[k].max(index[k]);
            squared += (high[k] - low[k]).pow(2);
        }
        least = least.min(point.distance);
        let long = (squared as f32).sqrt() * patch.spacing as f32;
        if point.key >> CURVE != octave || long > COMPACT * least {
            return i;
        }
    }
    points.len().min(LANES)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Of a patch across the boundary of tiny faces every wanted point is in one packet, with others at like
    /// distances not far away.
    #[test]
    fn points_come_back_once_in_even_compact_packets() {
        let patch = Patch {
            origin: DVec3::splat(-0.4),
            spacing: 0.1,
            shape: [8, 7, 5],
        };
        let distance = |flat: usize| {
            let p = patch.position(patch.unravel(flat));
            // Some are not wanted.
            if flat % 13 == 5 {
                0.0
            } else {
                (p.x + 0.2 * p.y + 0.03).abs() as f32
            }
        };
        let (mut bricks, mut regroup) = (Vec::new(), Regroup::default());
        patch.cut(&mut bricks);
        let mut kept = Vec::new();
        for brick in &bricks {
            let distances = brick.flat.map(distance);
            if !regroup.takes(&patch, brick, &distances, 1e-3) {
                kept.extend(brick.flat.iter().copied().filter(|f| distance(*f) > 0.0));
            }
        }
        kept.sort_unstable();
        kept.dedup();
        let mut packets = Vec::new();
        regroup.empty(&patch, |packet| packets.push(packet));
        assert!(!kept.is_empty() && !packets.is_empty());
        for packet in &packets {
            let all = packet.map(distance);
            let least = all.iter().fold(f32::INFINITY, |a, d| a.min(*d));
            assert!(all.iter().all(|d| *d < 2.0 * least), "{all:?}");
            let first = patch.position(patch.unravel(packet[0]));
            let away = |f: &usize| patch.position(patch.unravel(*f)).distance(first) as f32;
            assert!(packet.iter().all(|f| away(f) <= COMPACT * least));
        }
        let mut found = kept;
        for packet in &packets {
            // Only the last point is repeated, and only within its packet.
            let mut packet = packet.to_vec();
            packet.dedup();
            found.extend(packet);
        }
        found.sort_unstable();
        let all = 0..patch.len();
        assert_eq!(
            found,
            all.filter(|f| distance(*f) > 0.0).collect::<Vec<_>>()
        );
        regroup.empty(&patch, |_| panic!("nothing is left"));
    }

    /// Among faces as large as the distances bricks stay as they are.
    #[test]
    fn large_faces_leave_bricks_alone() {
        let patch = Patch {
            origin: DVec3::ZERO,
            spacing: 0.1,
            shape: [2, 2, 4],
        };
        let mut bricks = Vec::new();
        patch.cut(&mut bricks);
        let distances = std::array::from_fn(|lane| 0.01 + 0.1 * lane as f32);
        let mut regroup = Regroup::default();
        assert!(!regroup.takes(&patch, &bricks[0], &distances, 0.2));
        assert!(regroup.takes(&patch, &bricks[0], &distances, 0.02));
    }
}
