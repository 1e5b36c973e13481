//! The generalized winding number of a mesh by the hierarchy, and the signs that follow from it.

use glam::DVec3;

use super::node::Stack;
use super::tree::Bvh;

/// A cluster is far once its distance exceeds this many radii; second-order terms then leave an
/// error of about 1e-3 in all.
const FAR: f64 = 3.0;

/// The same to a few hundredths in all: enough for the side of most points.
const COARSE: f64 = 1.6;

impl Bvh {
    /// Generalized winding number at `p` (metres), to about 1e-3: 1 inside a closed
    /// outward-oriented mesh, 0 outside, a half on a face.
    pub fn winding_number(&self, p: DVec3) -> f64 {
        self.winding_normalized(self.normalized(p), FAR)
    }

    /// Distance of `p` (metres) from the boundary, metres, negative where the winding number
    /// exceeds 1/2.
    pub fn signed_distance(&self, p: DVec3) -> f64 {
        let q = self.normalized(p);
        let distance = self.nearest_normalized(q).1.sqrt() / self.scale();
        if self.inside_normalized(q) {
            -distance
        } else {
            distance
        }
    }

    /// Whether the winding number exceeds 1/2, decided by the exact sum where it is near.
    pub(crate) fn inside_normalized(&self, q: DVec3) -> bool {
        for (far, room) in [(COARSE, 0.25), (FAR, 0.02)] {
            let w = self.winding_normalized(q, far);
            if (w - 0.5).abs() > room {
                return w > 0.5;
            }
        }
        self.winding_normalized(q, f64::INFINITY) > 0.5
    }

    /// The winding number to a few hundredths.
    pub(crate) fn winding_coarse(&self, q: DVec3) -> f64 {
        self.winding_normalized(q, COARSE)
    }

    fn winding_normalized(&self, q: DVec3, far: f64) -> f64 {
        let mut sum = 0.0;
        let mut stack = Stack::new();
        if !self.nodes.is_empty() {
            stack.push(0u32);
        }
        while let Some(id) = stack.pop() {
            let node = &self.nodes[id as usize];
            let m = &node.moments;
            if q.distance_squared(m.centre) > (far * m.radius).powi(2) {
                // dOmega = (r . n) dA / |r|^3.
                sum += m.far_field(q, 1.0, |u| {
                    [u.powi(-3), -3.0 * u.powi(-4), 12.0 * u.powi(-5)]
                });
            } else if node.is_leaf() {
                sum += node
                    .range()
                    .map(|i| self.faces[i].solid_angle(q))
                    .sum::<f64>();
            } else {
                stack.push(id + 1);
                stack.push(node.second);
            }
        }
        -sum / (4.0 * std::f64::consts::PI)
    }
}
