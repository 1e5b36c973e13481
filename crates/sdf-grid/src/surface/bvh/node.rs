//! Nodes of the tree, and the stack of walks through it.

use glam::DVec3;

use crate::mesh::aabb::Aabb;
use crate::surface::moments::Moments;

/// Depth of the tree at most: [`MAX_SAH_DEPTH`] levels of any balance, then halving of at most
/// 2^32 triangles. Fixed stacks rely on it.
const MAX_DEPTH: usize = MAX_SAH_DEPTH + 32;
/// Levels that are split where it costs least, whatever the balance.
pub(super) const MAX_SAH_DEPTH: usize = 64;

/// A node: its box and moments cover `faces[first..first + count]`. What searches look at comes
/// first and is one cache line.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub(crate) bounds: Aabb,
    pub(crate) first: u32,
    pub(crate) count: u32,
    /// Index of the second child (the first follows its parent); 0 for a leaf.
    pub(crate) second: u32,
    pub(crate) moments: Moments,
}

impl Node {
    pub(crate) fn is_leaf(&self) -> bool {
        self.second == 0
    }

    pub(crate) fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Squared distance of `q` from the box, zero inside.
    pub(crate) fn distance_squared(&self, q: DVec3) -> f64 {
        let gap = (self.bounds.min - q).max(q - self.bounds.max);
        gap.max(DVec3::ZERO).length_squared()
    }
}

/// A fixed stack for depth-first walks: every level leaves at most one node waiting.
pub(crate) struct Stack<T> {
    items: [T; MAX_DEPTH + 2],
    len: usize,
}

impl<T: Copy + Default> Stack<T> {
    pub(crate) fn new() -> Self {
        Self {
            items: [T::default(); MAX_DEPTH + 2],
            len: 0,
        }
    }

    pub(crate) fn push(&mut self, item: T) {
        self.items[self.len] = item;
        self.len += 1;
    }

    pub(crate) fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        Some(self.items[self.len])
    }
}
