//! Interpolation of a table's energy and its exact gradient.

use glam::DVec3;

use crate::energy::Response;
use crate::geometry::se3::{Pose, Wrench};
use crate::geometry::taps::{Edge, Reach, Taps};
use crate::pair::contact::Contact;
use crate::rotations::atlas::MARGIN;
use crate::rotations::chart::Chart;
use crate::rotations::grid::Site;
use crate::table::plan::Plan;
use crate::table::rows::Rows;
use crate::table::stencil::{RotationTap, Stencil};

/// An interpolated value and its slopes per node, above the far energy, joules.
#[derive(Debug, Clone, Copy)]
struct Reading {
    energy: f64,
    translation: DVec3,
    rotation: [f64; 3],
}

/// What is read at a place, above the far energy.
struct Read {
    /// Joules.
    energy: f64,
    /// Slopes per node.
    translation: DVec3,
    /// Slopes by a turn of what is read, joules per radian.
    turn: DVec3,
}

impl Read {
    /// One everywhere.
    const ONE: Self = Self {
        energy: 1.0,
        translation: DVec3::ZERO,
        turn: DVec3::ZERO,
    };

    fn new(reading: &Reading, site: &Site<'_>) -> Self {
        Self {
            energy: reading.energy,
            translation: reading.translation,
            turn: (0..3)
                .map(|k| reading.rotation[k] * site.gradients[k])
                .sum::<DVec3>(),
        }
    }
}

/// Where a patch is read.
struct Place<'a> {
    site: &'a Site<'a>,
    /// The moving part's arm from its origin to the pivot, fixed frame, metres.
    arm: DVec3,
    displacement: &'a Displacement,
    spacing: f64,
}

impl Place<'_> {
    /// Adds the patch's share of what is read, as far as it counts here, to an energy and its
    /// wrench, differentiated as a product.
    fn add(&self, read: &Read, to: &mut Response) {
        let (site, reach) = (self.site, &self.displacement.reach);
        let [cx, cy, cz] = reach.each_ref().map(|r| r.weight);
        let [sx, sy, sz] = reach.each_ref().map(|r| r.weight_slope);
        let window_weight = cx * cy * cz;
        let window_gradient = DVec3::new(sx * cy * cz, cx * sy * cz, cx * cy * sz);
        let weight = site.weight * window_weight;
        let slope = DVec3::from_array(reach.each_ref().map(|r| r.slope));
        let by_displacement = (weight * read.translation * slope
            + site.weight * read.energy * window_gradient)
            / self.spacing;
        let by_turn =
            weight * site.turn_back(read.turn) + window_weight * read.energy * site.weight_gradient;
        let force = -by_displacement;
        let wrench = site.pull_back(&Wrench {
            torque: self.arm.cross(force) - by_turn,
            force,
        });
        let value = weight * read.energy;
        to.energy += site.share * value;
        to.wrench += wrench * site.share;
        to.wrench.torque -= value * site.share_gradient;
    }

    /// Whether what is read is read at the query's own pose.
    fn is_inside(&self) -> bool {
        self.site.rest.is_none() && self.displacement.reach.iter().all(Reach::is_inside)
    }
}

/// Where and how the translation axes are read for one displacement.
struct Displacement {
    taps: [Taps; 3],
    reach: [Reach; 3],
}

/// A table's plan and the energies of it that are in memory, to be read.
#[derive(Clone, Copy)]
pub(super) struct Reader<'t> {
    pub(super) plan: &'t Plan,
    pub(super) rows: &'t Rows,
}

impl<'t> Reader<'t> {
    /// Energy, wrench and coverage at a pose ([`super::energy_table::EnergyTable::respond`]).
    pub(super) fn respond(&self, pose: &Pose) -> Response {
        let far = Response {
            energy: self.plan.spec.far_energy,
            ..Response::default()
        };
        let (mut response, mut whole) = (far, true);
        // How far the answer is the table's, with its slopes as a wrench.
        let mut covered = Response::default();
        if pose.is_valid() {
            self.plan.grid.visit(pose, |site| {
                whole &= self.add(&site, &mut response, &mut covered).is_some();
            });
        }
        if !whole {
            return far;
        }
        self.add_contact(pose, &covered, &mut response);
        response
    }

    /// Asks the processor to fetch what a query at `pose` will read.
    pub(super) fn prefetch(&self, pose: &Pose) {
        if !pose.is_valid() {
            return;
        }
        self.plan.grid.visit(pose, |site| {
            let Some((_, displacement)) = self.place(&site) else {
                return;
            };
            let mut taps = [RotationTap::default(); 64];
            let Some((count, _)) = self.rotation_taps(site.chart, &site.taps, &mut taps) else {
                return;
            };
            let [_, ty, _] = &displacement.taps;
            let groups = if ty.nodes[3] / 4 > ty.nodes[0] / 4 {
                2
            } else {
                1
            };
            self.stencil(&displacement.taps, groups)
                .prefetch(&taps[..count]);
        });
    }

    /// Where a patch reads along the translation axes: the moving part's arm from its origin to the
    /// pivot, and the place in the window, if it is in or near it.
    fn place(&self, site: &Site<'_>) -> Option<(DVec3, Displacement)> {
        let pivot = self.plan.spec.pivot();
        let arm = site.pose.rotation * pivot;
        let window = &self.plan.spec.window;
        let x = window.fractional_index(arm + site.pose.translation - pivot);
        Some((arm, self.displacement(x)?))
    }

    /// Adds one patch's share: `share * weight * (energy - far)`, differentiated as a product.
    /// `None` if what it reads is not in memory.
    fn add(&self, site: &Site<'_>, response: &mut Response, covered: &mut Response) -> Option<()> {
        let window = &self.plan.spec.window;
        let Some((arm, displacement)) = self.place(site) else {
            return Some(());
        };
        if site.weight <= 0.0 {
            return Some(());
        }
        let reading = self.read(site.chart, &site.taps, &displacement.taps)?;
        let place = Place {
            site,
            arm,
            displacement: &displacement,
            spacing: window.spacing(),
        };
        place.add(&Read::new(&reading, site), response);
        // Outside, contact is that of the pose that is read.
        match (&self.plan.spec.contact, place.is_inside()) {
            (Some(contact), false) => place.add(&self.contact_at(contact, &place), response),
            _ => place.add(&Read::ONE, covered),
        }
        let window_coverage: f64 = displacement.reach.iter().map(|r| r.coverage).product();
        let coverage = site.coverage * window_coverage;
        response.coverage += site.share * coverage * self.kept(&displacement);
        Some(())
    }

    /// What smoothing took from the energy where a place is read.
    fn contact_at(&self, contact: &Contact, place: &Place<'_>) -> Read {
        let (window, pivot) = (&self.plan.spec.window, self.plan.spec.pivot());
        let rotation = place.site.rotation();
        let at = DVec3::from_array(place.displacement.reach.each_ref().map(|r| r.at));
        let (displacement, arm) = (window.origin() + at * window.spacing(), rotation * pivot);
        let lost = contact.score(&Pose {
            rotation,
            translation: displacement + pivot - arm,
        });
        let gamma = self.plan.spec.model().gamma;
        Read {
            energy: -gamma * lost.score,
            translation: -gamma * window.spacing() * lost.gradient,
            turn: -gamma * (lost.moment - arm.cross(lost.gradient)),
        }
    }

    /// Adds what smoothing took from the energies, as far as the pose is covered.
    fn add_contact(&self, pose: &Pose, covered: &Response, response: &mut Response) {
        let Some(contact) = &self.plan.spec.contact else {
            return;
        };
        if covered.energy <= 0.0 {
            return;
        }
        let lost = contact.score(pose);
        let gamma = self.plan.spec.model().gamma;
        let (energy, share) = (-gamma * lost.score, gamma * covered.energy);
        response.energy += covered.energy * energy;
        response.wrench.force += share * lost.gradient + energy * covered.wrench.force;
        response.wrench.torque += share * lost.moment + energy * covered.wrench.torque;
    }

    fn displacement(&self, x: DVec3) -> Option<Displacement> {
        let (x, window) = (x.to_array(), &self.plan.spec.window);
        let shape = window.shape();
        let edge = Edge {
            margin: MARGIN,
            fade: [self.plan.fade_length / window.spacing(); 2],
        };
        let reach = |k: usize| Reach::new(x[k], shape[k], &edge);
        let reach = [reach(0)?, reach(1)?, reach(2)?];
        let taps = std::array::from_fn(|k| Taps::open(reach[k].at, shape[k]));
        Some(Displacement { taps, reach })
    }

    /// The interpolated energy and its slopes. Absent rotation nodes hold the far energy. `None` if
    /// a rotation node is not in memory.
    fn read(
        &self,
        chart: &Chart,
        rotation: &[Taps; 3],
        translation: &[Taps; 3],
    ) -> Option<Reading> {
        let mut taps = [RotationTap::default(); 64];
        let (count, absent) = self.rotation_taps(chart, rotation, &mut taps)?;
        let [_, ty, tz] = translation;
        let along_y = LaneWeights::new(ty, ty.nodes[0] / 4 * 4);
        let along_z = LaneWeights::new(tz, tz.nodes[0]);
        let stencil = self.stencil(translation, if along_y.long { 2 } else { 1 });
        let sums = stencil.sum(&taps[..count]);
        let total = |sum: usize, y: &[f64; 8], z: &[f64; 8]| -> f64 {
            let mut total = 0.0;
            for (group, sums) in sums.iter().enumerate().take(stencil.groups) {
                for (lane, &value) in sums[sum].iter().enumerate() {
                    total += f64::from(value) * z[lane / 4] * y[4 * group + lane % 4];
                }
            }
            total * self.plan.probe.unit
        };
        let (y, z) = (&along_y.weights, &along_z.weights);
        let far = self.plan.spec.far_energy;
        Some(Reading {
            energy: total(0, y, z) + far * absent[0] - far,
            translation: DVec3::new(
                total(1, y, z),
                total(0, &along_y.slopes, z),
                total(0, y, &along_z.slopes),
            ),
            rotation: std::array::from_fn(|k| total(2 + k, y, z) + far * absent[1 + k]),
        })
    }

    /// The rotation nodes to read, into `taps`; how many, and the weights of the absent ones.
    /// `None` if one is not in memory.
    fn rotation_taps(
        &self,
        chart: &Chart,
        [tx, ty, tz]: &[Taps; 3],
        taps: &mut [RotationTap<'t>; 64],
    ) -> Option<(usize, [f64; 4])> {
        let [_, ny, nz] = chart.shape;
        let (mut count, mut absent) = (0, [0f64; 4]);
        for i in 0..4 {
            for j in 0..4 {
                let both = [
                    tx.weights[i] * ty.weights[j],
                    tx.slopes[i] * ty.weights[j],
                    tx.weights[i] * ty.slopes[j],
                ];
                if both == [0.0; 3] {
                    continue;
                }
                let nodes = &chart.rows[(tx.nodes[i] * ny + ty.nodes[j]) * nz..][..nz];
                for k in 0..4 {
                    let (w, s) = (tz.weights[k], tz.slopes[k]);
                    if w == 0.0 && s == 0.0 {
                        continue;
                    }
                    let weights = [both[0] * w, both[1] * w, both[2] * w, both[0] * s];
                    let slot = nodes[tz.nodes[k]];
                    if slot == Chart::ABSENT {
                        for (sum, w) in absent.iter_mut().zip(weights) {
                            *sum += w;
                        }
                        continue;
                    }
                    let codes = self.rows.get(slot as usize, self.plan.layout.length())?;
                    taps[count] = RotationTap {
                        codes,
                        weights: weights.map(|w| w as f32),
                    };
                    count += 1;
                }
            }
        }
        Some((count, absent))
    }

    fn stencil(&self, [tx, ty, tz]: &[Taps; 3], groups: usize) -> Stencil {
        let first = ty.nodes[0] / 4;
        let run = |group: usize, s: usize| {
            let group = if group < groups { first + group } else { first };
            self.plan.layout.run(tx.nodes[s], group, tz.nodes[0])
        };
        Stencil {
            runs: std::array::from_fn(|group| std::array::from_fn(|s| run(group, s))),
            groups,
            weights: tx.weights.map(|w| w as f32),
            slopes: tx.slopes.map(|w| w as f32),
        }
    }

    /// Share of the nodes around a displacement that were not left out, changing linearly between
    /// nodes; 1 where everything is kept.
    fn kept(&self, displacement: &Displacement) -> f64 {
        if self.plan.layout.is_dense() {
            return 1.0;
        }
        let shape = self.plan.spec.window.shape();
        let cell: [usize; 3] = std::array::from_fn(|k| {
            let last = shape[k].saturating_sub(2) as f64;
            displacement.reach[k].at.floor().clamp(0.0, last) as usize
        });
        let part: [f64; 3] =
            std::array::from_fn(|k| (displacement.reach[k].at - cell[k] as f64).clamp(0.0, 1.0));
        (0..8)
            .map(|corner| {
                let upper: [bool; 3] = std::array::from_fn(|k| corner >> k & 1 == 1);
                let node =
                    std::array::from_fn(|k| (cell[k] + usize::from(upper[k])).min(shape[k] - 1));
                let weight = |k: usize| if upper[k] { part[k] } else { 1.0 - part[k] };
                let held = f64::from(u8::from(self.plan.layout.holds(node)));
                held * weight(0) * weight(1) * weight(2)
            })
            .sum::<f64>()
            .min(1.0)
    }
}

/// Weights of up to 8 successive nodes of an axis, of which a query reads 4.
struct LaneWeights {
    weights: [f64; 8],
    slopes: [f64; 8],
    /// More than the first four nodes are read.
    long: bool,
}

impl LaneWeights {
    /// For nodes from `first` on; absent nodes of the taps repeat one with weight 0.
    fn new(taps: &Taps, first: usize) -> Self {
        let mut lanes = Self {
            weights: [0.0; 8],
            slopes: [0.0; 8],
            long: taps.nodes[3] >= first + 4,
        };
        for s in 0..4 {
            let lane = taps.nodes[s] - first;
            lanes.weights[lane] += taps.weights[s];
            lanes.slopes[lane] += taps.slopes[s];
        }
        lanes
    }
}

#[cfg(test)]
#[path = "query_tests.rs"]
mod tests;
