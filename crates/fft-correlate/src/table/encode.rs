//! From energies to the numbers a table stores, coefficients of splines, and back.

use half::f16;
use ndarray::ArrayViewMut3;
use sdf_grid::Lattice;

use crate::geometry::half_turn::HalfTurn;
use crate::geometry::taps::Prefilter;
use crate::rotations::grid::RotationGrid;
use crate::sweep::NodeEnergies;
use crate::table::spec::{Storage, TableError, TableSpec};

/// What all rotation nodes of a table share, found by probing a few of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Probe {
    /// Joules per stored unit; a power of two.
    pub(crate) unit: f64,
    /// Distance from the far energy that does not count, joules.
    pub(crate) negligible: f64,
}

/// Largest magnitude of probed energies after scaling: 2^9, which leaves a factor of 2^7 up to the
/// largest half-precision number and one of 2^23 down to the smallest normal one.
const PROBE_EXPONENT: i32 = 9;

/// Computes a few rotation nodes, fixed by the grid alone so that every rank finds the same. The
/// unit brings the largest energy to at most `2^PROBE_EXPONENT`.
pub(crate) fn probe<P: NodeEnergies>(
    spec: &TableSpec,
    grid: &RotationGrid,
    producer: &P,
) -> Result<Probe, TableError> {
    let n = grid.nodes().len();
    let mut rows = vec![n / 2, 0, n / 4, 3 * n / 4, n - 1];
    rows.sort_unstable();
    rows.dedup();
    let (mut scratch, mut joules) = (producer.scratch(), vec![0f32; spec.window.len()]);
    let mut splines = Prefilter::default();
    let mut largest = 0f32;
    for row in rows {
        let out = ArrayViewMut3::from_shape(spec.window.shape(), &mut joules[..]);
        let out = out.expect("the buffer has the window's length");
        let sum = grid.node_sum(row);
        producer.sums(&sum, &[HalfTurn::None], &mut scratch, &mut [out]);
        to_joules(&spec.window, producer.unit(), row, &mut joules)?;
        splines.apply(spec.window.shape(), &mut joules);
        largest = joules.iter().fold(largest, |m, e| m.max(e.abs()));
    }
    let exponent = f64::from(largest).log2().ceil() as i32;
    Ok(Probe {
        unit: match largest {
            0.0 => 1.0,
            _ => 2f64.powi(exponent - PROBE_EXPONENT),
        },
        negligible: spec.storage.leave_out * f64::from(largest),
    })
}

/// Turns the energies of a rotation node, which must be finite, from a producer's unit to joules.
fn to_joules(
    window: &Lattice,
    unit: f32,
    row: usize,
    energies: &mut [f32],
) -> Result<(), TableError> {
    for (flat, e) in energies.iter_mut().enumerate() {
        *e *= unit;
        if !e.is_finite() {
            return Err(TableError::NotFinite {
                row,
                index: window.unravel(flat),
                found: *e,
            });
        }
    }
    Ok(())
}

/// Stored numbers of one rotation node, C order.
#[derive(Debug, Clone, Default)]
pub(crate) struct EncodedNode {
    pub(crate) codes: Vec<u16>,
    /// Bricks in which every energy is the far energy, and all bricks.
    pub(crate) bricks: [usize; 2],
    pub(crate) splines: Prefilter,
}

/// Encodes energies in a producer's unit, which become coefficients; those of bricks that are left
/// out become the far energy.
pub(crate) fn encode(
    spec: &TableSpec,
    probe: &Probe,
    row: usize,
    unit: f32,
    energies: &mut [f32],
    out: &mut EncodedNode,
) -> Result<(), TableError> {
    to_joules(&spec.window, unit, row, energies)?;
    let joules = energies;
    out.splines.apply(spec.window.shape(), joules);
    out.bricks = leave_out(spec, probe, joules);
    out.codes.resize(joules.len(), 0);
    for (&e, code) in joules.iter().zip(&mut out.codes) {
        *code = half(f64::from(e) / probe.unit).ok_or(TableError::Overflow {
            row,
            found: e,
            limit: f16::MAX.to_f64() * probe.unit,
        })?;
    }
    Ok(())
}

/// Half-precision bits. Numbers too small to be normal (2^-23 of the largest probed energy) become
/// zero, so that decoding never meets a subnormal.
fn half(value: f64) -> Option<u16> {
    let half = f16::from_f64(value);
    (!half.is_infinite()).then(|| if half.is_normal() { half.to_bits() } else { 0 })
}

/// The code of the far energy.
pub(crate) fn far_code(spec: &TableSpec, unit: f64) -> u16 {
    // Through single precision, as energies come.
    half(f64::from(spec.far_energy as f32) / unit).unwrap_or(0)
}

/// Sets bricks without an energy of note to the far energy. Returns how many there are now of
/// those, and of all.
fn leave_out(spec: &TableSpec, probe: &Probe, joules: &mut [f32]) -> [usize; 2] {
    let (shape, far) = (spec.window.shape(), spec.far_energy as f32);
    let bricks = shape.map(|n| n.div_ceil(Storage::BRICK));
    let mut empty = 0;
    for bx in 0..bricks[0] {
        for by in 0..bricks[1] {
            for bz in 0..bricks[2] {
                let range =
                    |b: usize, n: usize| b * Storage::BRICK..((b + 1) * Storage::BRICK).min(n);
                let rows = range(bx, shape[0])
                    .flat_map(|x| range(by, shape[1]).map(move |y| (x * shape[1] + y) * shape[2]));
                let along = range(bz, shape[2]);
                let span = |row: usize| row + along.start..row + along.end;
                let matters = rows.clone().any(|row| {
                    joules[span(row)]
                        .iter()
                        .any(|&e| f64::from((e - far).abs()) > probe.negligible)
                });
                if !matters {
                    empty += 1;
                    rows.for_each(|row| joules[span(row)].fill(far));
                }
            }
        }
    }
    [empty, bricks.iter().product()]
}
