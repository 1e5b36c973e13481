//! Requests of a page: a few bytes each; anything else closes its connection.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use haptic::Script;

/// Farthest from the origin that a pose may be, metres.
const FARTHEST: f64 = 1e3;

/// What a page asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Request {
    /// Heartbeat: the page is still there.
    Heartbeat,
    /// The hand should go to a pose of the part and hold it.
    Hold(Pose),
    /// The hand should let go of the part.
    LetGo,
    /// The hand should do what a script says.
    Script(Script),
    /// The hand should be at a pose at once.
    Place(Pose),
    /// This page wants to be the hand.
    Take,
    /// Another pair of parts.
    Choose(u8),
    /// Start a new recording, or end it.
    Record(bool),
    /// Replay the recording.
    Replay,
    /// Look for the poses in which the part fits.
    Dock,
    /// The hand should follow the insertion path.
    Follow,
}

impl Request {
    /// Longest request, bytes.
    pub const LONGEST: usize = 29;

    /// Reads a request: a byte that says which, and what belongs to it, nothing more.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (&kind, rest) = bytes.split_first()?;
        Some(match (kind, rest) {
            (0, []) => Self::Heartbeat,
            (1, _) => Self::Hold(pose(rest)?),
            (2, []) => Self::LetGo,
            (3, [0]) => Self::Script(Script::Collision),
            (3, [1]) => Self::Script(Script::Snap),
            (4, _) => Self::Place(pose(rest)?),
            (5, []) => Self::Take,
            (6, [pair]) => Self::Choose(*pair),
            (7, [on @ (0 | 1)]) => Self::Record(*on == 1),
            (8, []) => Self::Replay,
            (9, []) => Self::Dock,
            (10, []) => Self::Follow,
            _ => return None,
        })
    }

    /// As a page would send it.
    pub fn bytes(&self) -> Vec<u8> {
        let posed = |kind: u8, pose: &Pose| {
            let ([x, y, z], q) = (pose.translation.to_array(), pose.rotation.to_array());
            let numbers = [x, y, z].into_iter().chain(q);
            let bytes = numbers.flat_map(|v| (v as f32).to_le_bytes());
            std::iter::once(kind).chain(bytes).collect()
        };
        match self {
            Self::Heartbeat => vec![0],
            Self::Hold(pose) => posed(1, pose),
            Self::LetGo => vec![2],
            Self::Script(script) => vec![3, u8::from(*script != Script::Collision)],
            Self::Place(pose) => posed(4, pose),
            Self::Take => vec![5],
            Self::Choose(pair) => vec![6, *pair],
            Self::Record(on) => vec![7, u8::from(*on)],
            Self::Replay => vec![8],
            Self::Dock => vec![9],
            Self::Follow => vec![10],
        }
    }
}

/// Seven little-endian f32: x y z qx qy qz qw.
fn pose(bytes: &[u8]) -> Option<Pose> {
    let bytes: &[u8; 28] = bytes.try_into().ok()?;
    let mut numbers = [0.0; 7];
    for (number, four) in numbers.iter_mut().zip(bytes.chunks_exact(4)) {
        *number = f64::from(f32::from_le_bytes(four.try_into().ok()?));
    }
    let [x, y, z, qx, qy, qz, qw] = numbers;
    let (place, turn) = (DVec3::new(x, y, z), DQuat::from_xyzw(qx, qy, qz, qw));
    let near = place.is_finite() && place.abs().max_element() < FARTHEST;
    // Of a number that is not finite no length is near one.
    let good = near && (turn.length() - 1.0).abs() < 1e-3;
    good.then(|| Pose::new(turn.normalize(), place))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_request_is_read_as_it_was_written() {
        let pose = Pose::new(DQuat::from_rotation_x(1.0), DVec3::new(0.5, -0.25, 2.0));
        for request in [
            Request::Heartbeat,
            Request::Hold(pose),
            Request::LetGo,
            Request::Script(Script::Collision),
            Request::Script(Script::Snap),
            Request::Place(pose),
            Request::Take,
            Request::Choose(2),
            Request::Record(true),
            Request::Record(false),
            Request::Replay,
            Request::Dock,
            Request::Follow,
        ] {
            let bytes = request.bytes();
            assert!(bytes.len() <= Request::LONGEST);
            let read = Request::read(&bytes).unwrap();
            match (read, request) {
                (Request::Hold(a), Request::Hold(b)) | (Request::Place(a), Request::Place(b)) => {
                    // Single precision on the wire.
                    assert!((a.translation - b.translation).length() < 1e-6);
                    assert!(a.angle_to(&b) < 1e-3);
                }
                _ => assert_eq!(read, request),
            }
            // A byte too many, a byte too few.
            assert_eq!(Request::read(&[&bytes[..], &[0]].concat()), None);
            if bytes.len() > 1 {
                assert_eq!(Request::read(&bytes[..bytes.len() - 1]), None);
            }
        }
    }

    #[test]
    fn garbage_is_nothing() {
        assert_eq!(Request::read(&[]), None);
        for kind in 11..=255 {
            assert_eq!(Request::read(&[kind]), None);
        }
        for bytes in [&[3, 2][..], &[3, 9], &[7, 2], &[6], &[1, 0, 0]] {
            assert_eq!(Request::read(bytes), None, "{bytes:?}");
        }
        for bad in [f32::NAN, f32::INFINITY, -1e9] {
            let mut bytes = Request::Hold(Pose::IDENTITY).bytes();
            bytes[1..5].copy_from_slice(&bad.to_le_bytes());
            assert_eq!(Request::read(&bytes), None, "{bad}");
        }
        let mut bytes = Request::Hold(Pose::IDENTITY).bytes();
        bytes[25..29].copy_from_slice(&0.9f32.to_le_bytes());
        assert_eq!(Request::read(&bytes), None);
    }
}
