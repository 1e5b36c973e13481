//! Signed distance and density on a small regular patch of points.
//!
//! Distances and density integrals go through packets of 2 x 2 x 4 points. Points so near to the
//! boundary that single precision would show go through the f64 tree code one by one.

use num_complex::{Complex32, Complex64};

use super::adaptive_interpolation::{Attempt, SmoothBlock};
use super::blocks::{Anchors, Brick, Patch};
use super::sign_propagation::Signs;
use crate::field::packet::density::{PacketDensity, Traversal};
use crate::field::packet::points::{LANES, Lanes};
use crate::field::point::density::{PointDensity, UnitDensity};
use crate::surface::bvh::tree::Bvh;

/// Values on a patch, C order. Reused from patch to patch.
#[derive(Debug, Default)]
pub(crate) struct PatchValues {
    /// Signed distance, normalized; zero on the boundary and only there.
    pub(crate) distance: Vec<f32>,
    /// The unit part of the side that the point is on; nothing on the boundary.
    density: Vec<Complex32>,
    /// Both parts of points on the boundary, by place.
    boundary: Vec<(usize, UnitDensity)>,
    /// Which points already have sign and density.
    done: Vec<bool>,
    /// Interpolated densities.
    filled: Vec<Complex32>,
    bricks: Vec<Brick>,
    /// The size of the face nearest to each brick.
    faces: Vec<f32>,
    signs: Signs,
    traversal: Traversal,
}

/// Evaluates patches.
pub(crate) struct PatchDensity<'a> {
    bvh: &'a Bvh,
    smooth: SmoothBlock,
    packets: PacketDensity<'a>,
    points: PointDensity<'a>,
    /// Points nearer to the boundary than this, in units of half the packet's diagonal, are taken
    /// in f64.
    near: f32,
    /// Outside, beyond this normalized distance, the density is not computed (zero).
    horizon: f32,
    /// Step to either side of the boundary for points on it, normalized.
    step: f64,
}

impl<'a> PatchDensity<'a> {
    pub(crate) fn new(
        bvh: &'a Bvh,
        packets: PacketDensity<'a>,
        points: PointDensity<'a>,
        horizon: f64,
        step: f64,
        [tolerance, sigma]: [f64; 2],
    ) -> Self {
        let horizon = horizon as f32;
        Self {
            bvh,
            smooth: SmoothBlock::new(tolerance, sigma),
            packets,
            points,
            // Packet coordinates are rounded to 1e-7 of the half diagonal: so much of the distance
            // may pass into the density at the few points that are this near.
            near: (2e-7 / tolerance).max(1e-3) as f32,
            horizon,
            step,
        }
    }

    /// Fills `values`. `hint` is a leaf-order face near the patch, updated; `anchors` are as
    /// [`Signs::propagate`] wants them.
    pub(crate) fn evaluate(
        &self,
        patch: &Patch,
        anchors: Option<Anchors<'_>>,
        hint: &mut usize,
        values: &mut PatchValues,
    ) {
        values.reset(patch.len());
        // Results must not depend on which patch came before on this thread.
        values.traversal.restart();
        let mut bricks = std::mem::take(&mut values.bricks);
        patch.cut(&mut bricks);
        values.faces.clear();
        for brick in &bricks {
            self.measure(patch, brick, hint, values);
            values.faces.push(self.packets.size_of_face(*hint));
        }
        let PatchValues {
            distance,
            done,
            signs,
            ..
        } = values;
        signs.propagate(self.bvh, patch, anchors, |flat| done[flat], distance);
        if self.may_be_smooth(patch, values) {
            self.integrate_smooth(patch, values);
        } else {
            self.integrate_all(patch, &bricks, values);
        }
        values.bricks = bricks;
    }

    /// Whether every density of a block is wanted, none is known, none lies beyond the boundary
    /// from another, and distances vary smoothly.
    fn may_be_smooth(&self, patch: &Patch, values: &PatchValues) -> bool {
        let inside = values.distance[0] < 0.0;
        SmoothBlock::covers(patch.shape)
            && values
                .distance
                .iter()
                .zip(&values.done)
                .all(|(d, done)| !done && *d < self.horizon && (*d < 0.0) == inside)
            && self.smooth.is_promising(&values.distance, patch.spacing)
    }

    /// Some densities of a block, and the rest interpolated if that agrees, else computed.
    fn integrate_smooth(&self, patch: &Patch, values: &mut PatchValues) {
        let compute = |nodes: &[[usize; LANES]], values: &mut PatchValues| {
            for flat in nodes {
                self.integrate(&patch.brick(*flat), values);
            }
        };
        let mut filled = std::mem::take(&mut values.filled);
        let attempt = |attempt: &Attempt| {
            compute(&attempt.nodes, values);
            self.smooth.fill(attempt, &values.density, &mut filled)
        };
        if self.smooth.attempts.iter().any(attempt) {
            std::mem::swap(&mut values.density, &mut filled);
        } else {
            compute(&self.smooth.rest, values);
        }
        values.filled = filled;
    }

    /// Unsigned distances of a brick; everything for points too near for packets.
    fn measure(&self, patch: &Patch, brick: &Brick, hint: &mut usize, values: &mut PatchValues) {
        let Brick {
            flat: brick,
            points,
        } = brick;
        let distances = self.packets.distances(points, hint);
        let near = self.near * points.half_diagonal();
        for lane in 0..LANES {
            let flat = brick[lane];
            if distances[lane] > near {
                values.distance[flat] = distances[lane];
            } else if !values.done[flat] {
                let position = patch.position(patch.unravel(flat));
                let (distance, density) = self.points.evaluate(position, self.step);
                values.set(flat, distance as f32, density);
            }
        }
    }

    /// All densities of a patch whose signed distances are known.
    fn integrate_all(&self, patch: &Patch, bricks: &[Brick], values: &mut PatchValues) {
        for (i, brick) in bricks.iter().enumerate() {
            let distances = self.wanted_distances(brick, values);
            if needs_single_points(&distances, values.faces[i], self.packets.fine()) {
                self.integrate_each(patch, brick, &distances, values);
            } else {
                self.integrate(brick, values);
            }
        }
    }

    /// Densities of the points of a brick one by one.
    fn integrate_each(
        &self,
        patch: &Patch,
        brick: &Brick,
        distances: &Lanes,
        values: &mut PatchValues,
    ) {
        for (lane, (flat, distance)) in brick.flat.into_iter().zip(*distances).enumerate() {
            // Points are repeated where the patch ends.
            if distance > 0.0 && !brick.flat[..lane].contains(&flat) {
                let point = patch.position(patch.unravel(flat));
                let integral = self
                    .packets
                    .integral(point, distance, &mut values.traversal);
                values.set_integral(flat, integral);
            }
        }
    }

    /// Distances of the points of a brick whose density is wanted and unknown, zero elsewhere.
    fn wanted_distances(&self, brick: &Brick, values: &PatchValues) -> Lanes {
        brick.flat.map(|flat| {
            if !values.done[flat] && values.distance[flat] < self.horizon {
                values.distance[flat].abs()
            } else {
                0.0
            }
        })
    }

    /// Densities of a brick whose signed distances are known.
    fn integrate(&self, brick: &Brick, values: &mut PatchValues) {
        let distances = self.wanted_distances(brick, values);
        let Brick {
            flat: brick,
            points,
        } = brick;
        if distances.iter().all(|d| *d == 0.0) {
            return;
        }
        let [re, im] = self
            .packets
            .integrals(points, &distances, &mut values.traversal);
        for lane in 0..LANES {
            let flat = brick[lane];
            if distances[lane] > 0.0 {
                values.set_integral(flat, [re[lane], im[lane]]);
            }
        }
    }
}

impl PatchValues {
    fn reset(&mut self, len: usize) {
        self.distance.clear();
        self.distance.resize(len, 0.0);
        self.density.clear();
        self.density.resize(len, Complex32::ZERO);
        self.boundary.clear();
        self.done.clear();
        self.done.resize(len, false);
    }

    /// Sets a point for good.
    fn set(&mut self, flat: usize, distance: f32, density: UnitDensity) {
        if distance == 0.0 {
            self.boundary.push((flat, density));
        } else {
            self.density[flat] = to_single_precision(density.combined(1.0, 1.0));
        }
        self.distance[flat] = distance;
        self.done[flat] = true;
    }

    /// Sets the density of a point from the integral there.
    fn set_integral(&mut self, flat: usize, [re, im]: [f32; 2]) {
        let integral = Complex32::new(re, im);
        let inside = self.distance[flat] < 0.0;
        self.density[flat] = if inside { -integral } else { integral.conj() };
    }

    /// Whether the density at a point differs from that of its neighbours on the same side along
    /// every axis by at most `share`.
    pub(crate) fn is_even(&self, patch: &Patch, flat: usize, share: f32) -> bool {
        let (index, own) = (patch.unravel(flat), self.density[flat]);
        let most = share * share * own.norm_sqr();
        let [_, ny, nz] = patch.shape;
        let strides = [ny * nz, nz, 1];
        (0..3).all(|axis| {
            let before = (index[axis] > 0).then(|| flat - strides[axis]);
            let after = (index[axis] + 1 < patch.shape[axis]).then(|| flat + strides[axis]);
            let same = |n: &usize| self.distance[*n] * self.distance[flat] > 0.0;
            let mut near = before.into_iter().chain(after).filter(same).peekable();
            near.peek().is_some() && near.all(|n| (self.density[n] - own).norm_sqr() <= most)
        })
    }

    /// Exterior and interior part at a point.
    pub(crate) fn parts(&self, flat: usize) -> [Complex32; 2] {
        let (own, none) = (self.density[flat], Complex32::ZERO);
        match self.distance[flat] {
            d if d > 0.0 => [own, none],
            d if d < 0.0 => [none, own],
            _ => {
                let found = self.boundary.iter().find(|(place, _)| *place == flat);
                let both = found.map(|(_, d)| *d).unwrap_or_default();
                [both.exterior, both.interior].map(to_single_precision)
            }
        }
    }
}

/// Distances in a packet may differ by this factor.
const EVEN: f32 = 4.0;

/// Whether the points of a packet have parted: it adds clusters that are small enough for its
/// nearest point, as far as the reach of its farthest. Next to a boundary of many small faces those
/// are thousands, where one point needs a hundred. `face` is the size of the faces near, of which
/// there are few up to `fine` times that; `distances` are zero where no density is wanted.
fn needs_single_points(distances: &Lanes, face: f32, fine: f32) -> bool {
    let most = distances.iter().fold(0f32, |a, d| a.max(*d));
    let wanted = |d: &&f32| **d > 0.0;
    let least = distances.iter().filter(wanted).fold(most, |a, d| a.min(*d));
    most > EVEN * least.max(face) && most > fine * face
}

fn to_single_precision(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}
