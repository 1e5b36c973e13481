//! Half turns about the axes of the lattice: rotations that differ by one share most of the work of
//! a correlation ([`crate::Correlator::score_half_turns`]). Weighted sums over a few near rotations,
//! which a table keeps at a rotation node.

use std::collections::HashMap;

use glam::DQuat;

/// A half turn about an axis of the fixed frame through the pivot, or none: the four form a group
/// and take lattice nodes to lattice nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HalfTurn {
    /// No turn.
    None,
    /// By 180 degrees about x.
    X,
    /// By 180 degrees about y.
    Y,
    /// By 180 degrees about z.
    Z,
}

impl HalfTurn {
    /// All four; `ALL[turn as usize] == turn`.
    pub const ALL: [Self; 4] = [Self::None, Self::X, Self::Y, Self::Z];

    /// The turn as a unit quaternion.
    pub fn rotation(self) -> DQuat {
        match self {
            Self::None => DQuat::IDENTITY,
            Self::X => DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0),
            Self::Y => DQuat::from_xyzw(0.0, 1.0, 0.0, 0.0),
            Self::Z => DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0),
        }
    }

    /// The axes along which it takes a displacement to its opposite.
    pub(crate) fn flips(self) -> [bool; 3] {
        match self {
            Self::None => [false; 3],
            Self::X => [false, true, true],
            Self::Y => [true, false, true],
            Self::Z => [true, true, false],
        }
    }
}

/// Rotations of a list that differ by half turns.
#[derive(Debug, Clone, PartialEq)]
pub struct HalfTurnGroup {
    /// The rotation that the turns follow: that of the first member.
    pub rotation: DQuat,
    /// Turns and the rotations' places in the list; the first turn is [`HalfTurn::None`].
    pub members: Vec<(HalfTurn, usize)>,
}

/// Rotations whose components agree to this, up to the sign of all, are one: those of grids do to
/// 1e-15, and others are farther apart than this.
const SAME: f64 = 1e-9;

/// Groups the rotations of a list (unit quaternions) such that those of a group differ by half
/// turns; every place occurs once, in groups of one where there is nothing to share. Groups stand
/// in the order of their first members and depend on the list alone. Takes about 200 bytes per
/// rotation meanwhile.
pub fn half_turn_groups(rotations: &[DQuat]) -> Vec<HalfTurnGroup> {
    groups_where(rotations, |_, _, _| true)
}

/// The same, joining only what `joins`: the first member's place, a turn, and the other's place.
pub(crate) fn groups_where(
    rotations: &[DQuat],
    joins: impl Fn(usize, HalfTurn, usize) -> bool,
) -> Vec<HalfTurnGroup> {
    let mut places: HashMap<[i64; 4], Vec<usize>> = HashMap::with_capacity(rotations.len());
    for (place, q) in rotations.iter().enumerate() {
        places
            .entry(q.to_array().map(cell))
            .or_default()
            .push(place);
    }
    let mut taken = vec![false; rotations.len()];
    let mut groups = Vec::new();
    for (first, &rotation) in rotations.iter().enumerate() {
        if std::mem::replace(&mut taken[first], true) {
            continue;
        }
        let mut members = vec![(HalfTurn::None, first)];
        for turn in &HalfTurn::ALL[1..] {
            let wanted = turn.rotation() * rotation;
            let mut found = cells_near(wanted)
                .chain(cells_near(-wanted))
                .flat_map(|key| places.get(&key).into_iter().flatten().copied());
            let is_partner = |place: &usize| {
                !taken[*place] && same(rotations[*place], wanted) && joins(first, *turn, *place)
            };
            if let Some(place) = found.find(is_partner) {
                taken[place] = true;
                members.push((*turn, place));
            }
        }
        groups.push(HalfTurnGroup { rotation, members });
    }
    groups
}

/// Cells hold everything that counts as the same but what lies at their faces.
fn cell(v: f64) -> i64 {
    (v / (1e3 * SAME)).floor() as i64
}

/// The cells in which a quaternion may lie that is the same as `q`, sign included.
fn cells_near(q: DQuat) -> impl Iterator<Item = [i64; 4]> {
    let [low, high] = [-SAME, SAME].map(|d| q.to_array().map(|v| cell(v + d)));
    (0..16u8).filter_map(move |bits| {
        let chosen = |axis: usize| bits >> axis & 1 == 1;
        // Where both are one cell it is named once.
        let new = (0..4).all(|axis| !chosen(axis) || high[axis] != low[axis]);
        new.then(|| std::array::from_fn(|axis| if chosen(axis) { high[axis] } else { low[axis] }))
    })
}

/// Whether two quaternions are one rotation.
pub(crate) fn same(a: DQuat, b: DQuat) -> bool {
    let near = |b: DQuat| (a - b).to_array().iter().all(|d| d.abs() < SAME);
    near(b) || near(-b)
}

/// A weighted sum of what is asked for at each of a few rotations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationSum {
    terms: [(DQuat, f64); Self::MOST],
    count: usize,
}

impl RotationSum {
    /// The largest number of rotations.
    pub const MOST: usize = 5;

    /// One rotation, as it is.
    pub fn one(rotation: DQuat) -> Self {
        Self {
            terms: [(rotation, 1.0); Self::MOST],
            count: 1,
        }
    }

    /// One rotation with weight `1 + n weight`, and `n` others with `-weight` each.
    ///
    /// # Panics
    /// If there are more than [`RotationSum::MOST`].
    pub(crate) fn less(rotation: DQuat, others: &[DQuat], weight: f64) -> Self {
        let mut sum = Self::one(rotation);
        sum.terms[0].1 += others.len() as f64 * weight;
        for other in others {
            sum.terms[sum.count] = (*other, -weight);
            sum.count += 1;
        }
        sum
    }

    /// Rotations and weights.
    pub fn terms(&self) -> &[(DQuat, f64)] {
        &self.terms[..self.count]
    }

    /// The first rotation.
    pub(crate) fn first(&self) -> DQuat {
        self.terms[0].0
    }

    /// Every rotation followed by a half turn.
    pub(crate) fn turned(mut self, turn: HalfTurn) -> Self {
        for (rotation, _) in &mut self.terms {
            *rotation = turn.rotation() * *rotation;
        }
        self
    }

    /// Whether both sum the same, in whatever order.
    pub(crate) fn agrees(&self, other: &Self) -> bool {
        let has = |(q, w): &(DQuat, f64)| {
            let found = |(p, v): &&(DQuat, f64)| same(*q, *p) && (w - v).abs() < 1e-9;
            other.terms().iter().any(|term| found(&term))
        };
        self.count == other.count && self.terms().iter().all(has)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotations::domain::RotationDomain;
    use crate::rotations::grid::RotationGrid;
    use glam::DVec3;

    #[test]
    fn turns_are_a_group_that_flips_what_it_says() {
        for a in HalfTurn::ALL {
            assert_eq!(HalfTurn::ALL[a as usize], a);
            for b in HalfTurn::ALL {
                let product = a.rotation() * b.rotation();
                assert!(HalfTurn::ALL.iter().any(|c| same(c.rotation(), product)));
            }
            for (axis, e) in DVec3::AXES.into_iter().enumerate() {
                let sign = if a.flips()[axis] { -1.0 } else { 1.0 };
                assert!((a.rotation() * e - sign * e).length() < 1e-15);
            }
        }
    }

    /// The cells of the full grid are turned onto each other, whatever its centre; a ball of 60
    /// degrees holds no two rotations that a half turn joins.
    #[test]
    fn every_rotation_of_a_full_grid_has_three_partners() {
        let center = DQuat::from_xyzw(0.3, -0.1, 0.7, 0.4).normalize().to_array();
        let full = |center, step_deg| RotationDomain::Full { center, step_deg };
        for domain in [full([0.0, 0.0, 0.0, 1.0], 15.0), full(center, 22.0)] {
            let grid = RotationGrid::new(&domain, None).unwrap();
            let groups = half_turn_groups(grid.nodes());
            let mut seen = vec![0; grid.nodes().len()];
            for group in &groups {
                assert_eq!(group.members.len(), 4, "{domain:?}");
                for (turn, place) in &group.members {
                    seen[*place] += 1;
                    let found = grid.nodes()[*place];
                    assert!(same(found, turn.rotation() * group.rotation));
                }
            }
            assert!(seen.iter().all(|n| *n == 1));
        }
        let ball = RotationDomain::Ball {
            center: [0.0, 0.0, 0.0, 1.0],
            angle_deg: 60.0,
            step_deg: 20.0,
        };
        let grid = RotationGrid::new(&ball, None).unwrap();
        let groups = half_turn_groups(grid.nodes());
        assert!(groups.iter().all(|g| g.members.len() == 1));
        assert_eq!(groups.len(), grid.nodes().len());
    }

    /// Equal rotations, opposite signs and rounding: each place is in one group all the same.
    #[test]
    fn duplicates_and_signs_are_no_trouble() {
        let q = DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8);
        let turned = HalfTurn::Y.rotation() * q;
        let nudged = DQuat::from_xyzw(q.x + 1e-16, q.y - 1e-16, q.z, q.w);
        let list = [q, -turned, nudged, turned, DQuat::IDENTITY];
        let groups = half_turn_groups(&list);
        let members: Vec<_> = groups.iter().map(|g| g.members.clone()).collect();
        let (none, y) = (HalfTurn::None, HalfTurn::Y);
        // Which of two equal partners comes first does not matter; the list decides.
        assert_eq!(members.len(), 3);
        assert_eq!(members[2], vec![(none, 4)]);
        for pair in &members[..2] {
            assert_eq!((pair[0].0, pair[1].0), (none, y));
        }
        let mut places: Vec<_> = members.into_iter().flatten().map(|m| m.1).collect();
        places.sort_unstable();
        assert_eq!(places, [0, 1, 2, 3, 4]);
    }
}
