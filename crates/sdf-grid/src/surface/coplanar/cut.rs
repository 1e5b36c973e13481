//! Long faces cut across.

use crate::surface::face::Piece;

/// Faces whose longest edge, squared, exceeds their area this many times are cut across.
const LONG: f64 = 8.0;

/// By how much areas may differ where sides move by `flat`.
pub(super) fn slack(face: &Piece, flat: f64) -> f64 {
    let around: f64 = (0..face.count()).map(|k| face.edge(k).length()).sum();
    1e-9 * face.area + flat * around
}

/// Faces, flat up to `flat`, in pieces that are not long, after `cuts` cuts one after the other at
/// most. Cuts go through the middles of long edges, so that those of neighbours meet.
pub(super) fn cut_across(faces: Vec<Piece>, cuts: u32, flat: f64) -> Vec<Piece> {
    if cuts == 0 || !faces.iter().any(|f| long_edge(f).is_some()) {
        return faces;
    }
    let (mut done, mut waiting) = (Vec::with_capacity(2 * faces.len()), Vec::new());
    for face in faces {
        waiting.push((face, cuts));
        while let Some((f, cuts)) = waiting.pop() {
            let pieces = long_edge(&f).filter(|_| cuts > 0).map(|k| halves(&f, k));
            match pieces {
                Some([Some(a), Some(b)]) if (a.area + b.area - f.area).abs() <= slack(&f, flat) => {
                    waiting.extend([(a, cuts - 1), (b, cuts - 1)]);
                }
                _ => done.push(f),
            }
        }
    }
    done
}

/// The longest edge of a face that is drawn out along it.
fn long_edge(f: &Piece) -> Option<usize> {
    let length = |k: usize| f.edge(k).length_squared();
    let longest = (0..f.count()).fold(0, |a, k| if length(k) > length(a) { k } else { a });
    (length(longest) > LONG * f.area).then_some(longest)
}

/// A face cut from the middle of its longest edge to that of the opposite edge, of a triangle to
/// that of the next longest edge.
fn halves(f: &Piece, longest: usize) -> [Option<Piece>; 2] {
    let corner = |k: usize| f.corners[(longest + k) % f.count()];
    let middle = |k: usize| 0.5 * (corner(k) + corner(k + 1));
    let (from, [a, b, c]) = (middle(0), [0, 1, 2].map(corner));
    let triangle = |corners| Piece::triangle(corners, f.source);
    let quadrangle = |corners| Piece::quadrangle(corners, f.source);
    if f.count() == 4 {
        let (to, d) = (middle(2), corner(3));
        return [quadrangle([a, from, to, d]), quadrangle([from, b, c, to])];
    }
    let [next, last] = [1, 2].map(|k| f.edge((longest + k) % 3).length_squared());
    if next > last {
        let to = middle(1);
        [triangle([from, b, to]), quadrangle([a, from, to, c])]
    } else {
        let to = middle(2);
        [triangle([a, from, to]), quadrangle([from, b, c, to])]
    }
}
