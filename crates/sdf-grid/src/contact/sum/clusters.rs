//! Samples in clusters of sixteen, in a tree of balls.

use glam::{DVec3, Vec3};

use super::lanes::{LANES, Lanes};
use crate::contact::samples::SurfaceSample;

/// Clusters are at most this large, in units of the reach: what is near one of them is listed for
/// all.
const MOST_RADIUS: f64 = 1.6;

/// Normals count as much as places this far apart, in units of the reach.
const NORMALS: f64 = 0.3;

/// Sixteen samples; lengths are in units of the reach.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct Cluster {
    /// From the ball's centre.
    pub(super) position: [Lanes; 3],
    pub(super) normal: [Lanes; 3],
    pub(super) area: Lanes,
    /// Half the side of a square as large.
    pub(super) half: Lanes,
}

/// A ball that holds samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    /// Metres, in the part's frame.
    pub(super) centre: DVec3,
    /// Metres, and in units of the reach, enlarged by more than rounding takes from it.
    pub(super) radius: f64,
    pub(super) in_reaches: f32,
    /// The ball to look at next if this one is out of reach.
    pub(super) next: u32,
    /// The cluster that it holds, or [`Ball::MANY`].
    pub(super) cluster: u32,
}

impl Ball {
    /// No cluster of its own: those of the balls up to `next`.
    pub(super) const MANY: u32 = u32::MAX;
}

/// All samples.
#[derive(Debug, Clone)]
pub(super) struct Clusters {
    /// Each before those in it.
    pub(super) balls: Vec<Ball>,
    pub(super) clusters: Vec<Cluster>,
    /// The largest radius of a cluster, metres.
    pub(super) radius: f64,
}

impl Clusters {
    pub(super) fn new(samples: &mut [SurfaceSample], reach: f64) -> Self {
        let mut clusters = Self {
            balls: Vec::new(),
            clusters: Vec::new(),
            radius: 0.0,
        };
        clusters.divide(samples, reach);
        clusters
    }

    /// Adds samples and the balls that hold them.
    fn divide(&mut self, samples: &mut [SurfaceSample], reach: f64) {
        let low = samples.iter().map(|s| s.position).reduce(DVec3::min);
        let high = samples.iter().map(|s| s.position).reduce(DVec3::max);
        let (Some(low), Some(high)) = (low, high) else {
            return;
        };
        let centre = 0.5 * (low + high);
        let distances = samples.iter().map(|s| s.position.distance(centre));
        let radius = distances.fold(0.0, f64::max);
        let place = self.balls.len();
        let few = samples.len() <= LANES;
        let single = few && (radius <= MOST_RADIUS * reach || samples.len() == 1);
        self.balls.push(Ball {
            centre,
            radius,
            in_reaches: (radius / reach) as f32 * (1.0 + 1e-5),
            next: 0,
            cluster: if single {
                self.clusters.len() as u32
            } else {
                Ball::MANY
            },
        });
        if single {
            self.clusters.push(Cluster::new(samples, centre, reach));
            self.radius = self.radius.max(radius);
        } else {
            let middle = halved(samples, reach);
            let (a, b) = samples.split_at_mut(middle);
            self.divide(a, reach);
            self.divide(b, reach);
        }
        self.balls[place].next = self.balls.len() as u32;
    }

    /// Memory that is held, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.balls.as_slice()) + size_of_val(self.clusters.as_slice())
    }
}

/// Orders samples so that those before the place returned are apart from those behind: across the
/// longest side of their box, of places and of normals.
fn halved(samples: &mut [SurfaceSample], reach: f64) -> usize {
    let key = |s: &SurfaceSample, k: usize| match k {
        0..3 => s.position[k],
        _ => s.area.normalize_or_zero()[k - 3] * NORMALS * reach,
    };
    let extent = |k: usize| {
        let range = samples.iter().map(|s| key(s, k));
        let range = range.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        range.1 - range.0
    };
    let longest = (0..6).map(|k| (extent(k), k));
    let (_, k) = longest.fold((-1.0, 0), |a, b| if b.0 > a.0 { b } else { a });
    // Full clusters where there are several.
    let half = samples.len() / 2;
    let middle = match samples.len() > LANES {
        true => half.next_multiple_of(LANES).min(samples.len() - 1),
        false => half,
    };
    samples.select_nth_unstable_by(middle, |a, b| key(a, k).total_cmp(&key(b, k)));
    middle
}

impl Cluster {
    /// Lanes without a sample have no area.
    fn new(samples: &[SurfaceSample], centre: DVec3, reach: f64) -> Self {
        let zero = [0.0; LANES];
        let mut cluster = Self {
            position: [zero; 3],
            normal: [[0.0; LANES], [0.0; LANES], [1.0; LANES]],
            area: zero,
            half: zero,
        };
        for (lane, s) in samples.iter().enumerate() {
            let at: Vec3 = ((s.position - centre) / reach).as_vec3();
            let area = s.area.length() / (reach * reach);
            let normal = s.area.normalize_or_zero();
            for k in 0..3 {
                cluster.position[k][lane] = at[k];
                cluster.normal[k][lane] = normal[k] as f32;
            }
            cluster.area[lane] = area as f32;
            cluster.half[lane] = (0.5 * area.sqrt()) as f32;
        }
        cluster
    }
}
