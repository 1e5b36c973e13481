//! The force of a source on a simulated body, for simulations that step by themselves.

use std::sync::{Mutex, PoisonError};

use fft_correlate::Twist;
use glam::DVec3;
use haptic::{BodyForce, BodyState};
use pyo3::prelude::*;

use crate::failure::raised::{Failure, Kind};
use crate::poses;
use crate::source::any::AnySource;
use crate::source::source_class::Source;
use crate::work::run::guarded;

/// Force and torque about the centre, energy and coverage where the step leads, and how often the
/// source was asked.
type Step = ([f64; 3], [f64; 3], f64, f64, u32);

/// A force that takes no more energy out of a body's motion than there is.
#[pyclass(frozen, module = "pegfit._core", name = "BodyForce")]
pub(crate) struct PyBodyForce {
    source: AnySource,
    state: Mutex<BodyForce>,
}

#[pymethods]
impl PyBodyForce {
    #[new]
    fn new(source: &Source) -> Result<Self, Failure> {
        let source = source.get()?;
        let scratch = source.as_source().scratch();
        Ok(Self {
            source,
            state: Mutex::new(BodyForce::new(scratch)),
        })
    }

    /// One step of a body: the moving part's pose against the fixed one, the body's centre in its
    /// frame, twist (angular first) now and after the step without this force, the inverse of its
    /// inertia, and the seconds of the step and since the last one.
    #[expect(
        clippy::too_many_arguments,
        reason = "numbers from Python, named there"
    )]
    fn step(
        &self,
        py: Python<'_>,
        pose: [f64; 7],
        center: [f64; 3],
        twist: [f64; 6],
        free: [f64; 6],
        mobility: [[f64; 6]; 6],
        dt: f64,
        elapsed: f64,
    ) -> Result<Step, Failure> {
        let numbers = twist.iter().chain(&free).chain(mobility.as_flattened());
        let finite = |x: &f64| x.is_finite();
        if !(numbers.chain(&center).all(finite) && dt > 0.0 && dt.is_finite()) {
            let expected = "finite numbers and a step longer than 0";
            let found = format!("{twist:?}, {free:?}, {mobility:?}, {dt} s");
            return Err(Failure::found(Kind::Device, "motion", expected, found));
        }
        let body = BodyState {
            part: poses::pose(&pose, 0)?,
            center: DVec3::from_array(center),
            twist: motion(&twist),
            free: motion(&free),
            mobility,
            dt,
            elapsed,
        };
        py.detach(|| {
            guarded(|| {
                let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
                let step = state.step(self.source.as_source(), &body);
                Ok((
                    step.wrench.force.to_array(),
                    step.wrench.torque.to_array(),
                    step.energy,
                    step.coverage,
                    step.evaluations,
                ))
            })
        })
    }

    /// Forgets what was.
    fn release(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.release();
    }
}

fn motion(twist: &[f64; 6]) -> Twist {
    let [a, b, c, x, y, z] = *twist;
    Twist {
        angular: DVec3::new(a, b, c),
        linear: DVec3::new(x, y, z),
    }
}
