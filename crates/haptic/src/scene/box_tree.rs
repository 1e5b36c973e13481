//! Which of many boxes hold a point: a binary tree, so that boxes elsewhere are not looked at.

use glam::DVec3;
use sdf_grid::Aabb;

/// Boxes in a leaf.
const LEAF: usize = 4;

/// A tree over boxes, built once.
#[derive(Debug, Clone, Default)]
pub(crate) struct BoxTree {
    nodes: Vec<Node>,
    /// Box and its index, in the order of the leaves.
    items: Vec<(Aabb, usize)>,
}

/// Nodes lie in the order of a walk that enters first children first.
#[derive(Debug, Clone)]
struct Node {
    bounds: Aabb,
    /// The node after this one's subtree.
    skip: usize,
    /// Range of [`BoxTree::items`]; empty in an inner node.
    items: std::ops::Range<usize>,
}

impl BoxTree {
    /// A tree over `boxes`; a box is named by its index.
    pub(crate) fn new(boxes: &[Aabb]) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            items: boxes.iter().copied().zip(0..).collect(),
        };
        if !boxes.is_empty() {
            tree.build(0, boxes.len());
        }
        tree
    }

    fn build(&mut self, first: usize, last: usize) {
        let items = &mut self.items[first..last];
        let bounds = items[1..].iter().fold(items[0].0, |b, i| b.union(&i.0));
        let node = self.nodes.len();
        let leaf = items.len() <= LEAF;
        self.nodes.push(Node {
            bounds,
            skip: 0,
            items: if leaf { first..last } else { 0..0 },
        });
        if !leaf {
            let axis = longest_axis(&bounds);
            let half = items.len() / 2;
            items.select_nth_unstable_by(half, |a, b| {
                a.0.center()[axis].total_cmp(&b.0.center()[axis])
            });
            self.build(first, first + half);
            self.build(first + half, last);
        }
        self.nodes[node].skip = self.nodes.len();
    }

    /// Calls `found` with the index of every box that holds `point`; allocates nothing.
    pub(crate) fn visit(&self, point: DVec3, mut found: impl FnMut(usize)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !node.bounds.contains(point) {
                at = node.skip;
                continue;
            }
            for (bounds, index) in &self.items[node.items.clone()] {
                if bounds.contains(point) {
                    found(*index);
                }
            }
            at += 1;
        }
    }
}

fn longest_axis(bounds: &Aabb) -> usize {
    let size = bounds.size();
    (0..3)
        .max_by(|&a, &b| size[a].total_cmp(&size[b]))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    fn point(rng: &mut SmallRng, size: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| rng.random_range(-size..size)))
    }

    #[test]
    fn finds_the_boxes_that_a_search_of_all_finds() {
        let mut rng = SmallRng::seed_from_u64(3);
        for count in [0, 1, 4, 5, 64, 333] {
            let boxes: Vec<Aabb> = (0..count)
                .map(|_| {
                    let center = point(&mut rng, 1.0);
                    let half = point(&mut rng, 0.3).abs();
                    Aabb {
                        min: center - half,
                        max: center + half,
                    }
                })
                .collect();
            let tree = BoxTree::new(&boxes);
            let mut met = 0;
            for _ in 0..500 {
                let p = point(&mut rng, 1.2);
                let mut seen = Vec::new();
                tree.visit(p, |i| seen.push(i));
                seen.sort_unstable();
                let all: Vec<usize> = (0..count).filter(|&i| boxes[i].contains(p)).collect();
                assert_eq!(seen, all);
                met += seen.len();
            }
            assert!(count < 5 || met > 0);
        }
    }

    #[test]
    fn equal_and_empty_boxes_are_kept_apart() {
        let flat = Aabb {
            min: DVec3::ZERO,
            max: DVec3::ZERO,
        };
        let tree = BoxTree::new(&[flat; 9]);
        let mut seen = 0;
        tree.visit(DVec3::ZERO, |_| seen += 1);
        assert_eq!(seen, 9);
        tree.visit(DVec3::X, |_| seen += 1);
        assert_eq!(seen, 9);
    }
}
