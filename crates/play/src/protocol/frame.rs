//! The message that a page gets sixty times a second.

use fft_correlate::{Pose, Wrench};
use glam::DVec3;
use haptic::flags;

/// Length of a [`Frame`] on the wire.
pub const FRAME_BYTES: usize = 216;

/// First byte of a frame.
const KIND: u8 = 1;

/// What a page sees of the loop at one moment. Poses are those of the moving part in the scene,
/// metres; little-endian on the wire, at the offsets that `docs/play.md` lists.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Frame {
    /// The page that gets it holds the hand.
    pub is_hand: bool,
    /// Bits of [`flags`] of this tick.
    pub flags: u16,
    /// Which session it is of; counts from 1.
    pub session: u32,
    /// The loop's clock, seconds.
    pub time: f64,
    /// When the tick began, milliseconds since 1970.
    pub wall: f64,
    /// Where the hand would have the part.
    pub hand: Pose,
    /// Where the part is.
    pub object: Pose,
    /// On the hand, about the grip, in the scene's frame, N and N·m.
    pub wrench: Wrench,
    /// Of the scene at `object`, joules.
    pub energy: f64,
    /// 1 inside the source's domain, 0 outside.
    pub coverage: f64,
    /// Strength of the force, 0 ..= 1.
    pub gain: f64,
    /// Travel from the entrance along the insertion path, metres.
    pub depth: f64,
    /// Ticks per second over the last second.
    pub rate: f64,
    /// Computing time of a tick, µs: mean over the last second, worst of the last thousand.
    pub latency: [f64; 2],
    /// Start after its deadline, µs, likewise.
    pub lateness: [f64; 2],
    /// Length of the recording, seconds.
    pub recorded: f64,
    /// Ticks so far.
    pub ticks: u64,
    /// Deadlines left out so far.
    pub missed: u64,
    /// What the hand is doing: 0 nothing, 1 hold, 2 collision, 3 snap, 4 replay,
    /// 5 the insertion path.
    pub doing: u8,
    /// Pages that watch, the hand's included.
    pub pages: u8,
    /// A page holds the hand.
    pub is_held: bool,
    /// The recorder is recording.
    pub is_recording: bool,
    /// Ticks so far in which each of [`flags::NAMES`] was set.
    pub flagged: [u64; flags::NAMES.len()],
}

impl Frame {
    /// As it goes over the wire.
    pub fn bytes(&self) -> [u8; FRAME_BYTES] {
        let mut out = FrameWriter::new();
        out.put(&[KIND, u8::from(self.is_hand)]);
        out.put(&self.flags.to_le_bytes());
        out.put(&self.session.to_le_bytes());
        out.put(&self.time.to_le_bytes());
        out.put(&self.wall.to_le_bytes());
        for pose in [&self.hand, &self.object] {
            out.vector(pose.translation);
            for q in pose.rotation.to_array() {
                out.float(q);
            }
        }
        out.vector(self.wrench.force);
        out.vector(self.wrench.torque);
        let [latency, lateness] = [self.latency, self.lateness];
        for value in [
            self.energy,
            self.coverage,
            self.gain,
            self.depth,
            self.rate,
            latency[0],
            latency[1],
            lateness[0],
            lateness[1],
            self.recorded,
        ] {
            out.float(value);
        }
        out.count(self.ticks);
        out.count(self.missed);
        let [held, recording] = [self.is_held, self.is_recording].map(u8::from);
        out.put(&[self.doing, self.pages, held, recording]);
        for count in self.flagged {
            out.count(count);
        }
        out.bytes
    }
}

struct FrameWriter {
    bytes: [u8; FRAME_BYTES],
    length: usize,
}

impl FrameWriter {
    fn new() -> Self {
        Self {
            bytes: [0; FRAME_BYTES],
            length: 0,
        }
    }

    fn put(&mut self, part: &[u8]) {
        self.bytes[self.length..self.length + part.len()].copy_from_slice(part);
        self.length += part.len();
    }

    fn float(&mut self, value: f64) {
        self.put(&(value as f32).to_le_bytes());
    }

    fn vector(&mut self, v: DVec3) {
        for x in v.to_array() {
            self.float(x);
        }
    }

    /// A count; more than 2³² are shown as that.
    fn count(&mut self, value: u64) {
        self.put(&u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// The offsets that `docs/play.md` and the page's reader state.
    #[test]
    fn every_field_is_where_the_page_reads_it() {
        let mut flagged = [0; flags::NAMES.len()];
        flagged[14] = 77;
        let frame = Frame {
            is_hand: true,
            flags: 0x0201,
            session: 3,
            time: 1.5,
            wall: 2.5e12,
            hand: Pose::new(DQuat::IDENTITY, DVec3::new(1.0, 2.0, 3.0)),
            object: Pose::new(DQuat::from_rotation_z(0.5), DVec3::new(4.0, 5.0, 6.0)),
            wrench: Wrench {
                force: DVec3::new(7.0, 8.0, 9.0),
                torque: DVec3::new(10.0, 11.0, 12.0),
            },
            energy: 13.0,
            coverage: 14.0,
            gain: 15.0,
            depth: 16.0,
            rate: 17.0,
            latency: [18.0, 19.0],
            lateness: [20.0, 21.0],
            recorded: 22.0,
            ticks: 1 << 40,
            missed: 24,
            doing: 25,
            pages: 26,
            is_held: true,
            is_recording: false,
            flagged,
        };
        let bytes = frame.bytes();
        let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let count = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!(bytes[..8], [1, 1, 0x01, 0x02, 3, 0, 0, 0]);
        assert_eq!(f64::from_le_bytes(bytes[8..16].try_into().unwrap()), 1.5);
        assert_eq!(
            f64::from_le_bytes(bytes[16..24].try_into().unwrap()),
            2.5e12
        );
        assert_eq!([float(24), float(32), float(48)], [1.0, 3.0, 1.0]);
        assert_eq!([float(52), float(60)], [4.0, 6.0]);
        assert_eq!(float(72), 0.25_f64.sin() as f32);
        assert_eq!([float(80), float(92), float(104)], [7.0, 10.0, 13.0]);
        assert_eq!([float(116), float(120), float(124)], [16.0, 17.0, 18.0]);
        assert_eq!([float(136), float(140)], [21.0, 22.0]);
        assert_eq!([count(144), count(148)], [u32::MAX, 24]);
        assert_eq!(bytes[152..156], [25, 26, 1, 0]);
        assert_eq!(count(212), 77);
    }
}
