//! The force of an energy on a simulated body, which takes no more energy out of it than it holds.
//!
//! A force that is found where a body is, and held for a step, throws a light body about: over a
//! step of a millisecond 5 N give one of a gram 5 m/s. Here the body's own inertia is the spring of
//! the virtual coupling: the step ends where energy and inertia together are least,
//!
//! ```text
//! x' = argmin E(x) + |x - f|²/2,   lengths by the square root of inertia over dt²
//! ```
//!
//! with `f` where the body would get without the force. That is the implicit Euler step, which
//! stands in a kink instead of jumping over it. Where the energy bends down it could still gain; so
//! work and energy are counted with the body's true velocities, and a step that would end with more
//! of both than there was ends slower.

use fft_correlate::{EnergySource, Pose, Response, Scratch, Twist, Wrench};
use glam::DVec3;

use crate::path::bundle::Bundle;
use crate::path::metric::{Inertia, Metric, Six, dot};

/// Times the field is asked for the least point of a step, at most.
const ASKS: u32 = 6;

/// Joules by which the model of the energy may be wrong there.
const GOOD_MODEL: f64 = 1e-8;

/// Joules that a step may gain by rounding before it is slowed down.
const ROUNDING: f64 = 1e-12;

/// A body and the step that it is about to take.
///
/// See the example of [`BodyForce`].
#[derive(Debug, Clone, Copy)]
pub struct BodyState {
    /// Of the moving part, in the frame of the fixed one.
    pub part: Pose,
    /// The body's centre of mass, metres, the moving part's frame.
    pub center: DVec3,
    /// Of the centre against the fixed part, in its frame, m/s and rad/s.
    pub twist: Twist,
    /// What the twist would be after the step without this force.
    pub free: Twist,
    /// Twist per second by a wrench at the centre, torque and angular part first: the inverse of
    /// the body's inertia, of which a fixed part that moves, too, has its share.
    pub mobility: [[f64; 6]; 6],
    /// Seconds of the step.
    pub dt: f64,
    /// Seconds since the last one; 0 for the same step again.
    pub elapsed: f64,
}

/// The wrench that pushes a body over a step.
///
/// See the example of [`BodyForce`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BodyStep {
    /// About the body's centre, in the fixed part's frame.
    pub wrench: Wrench,
    /// Energy where the step leads, joules.
    pub energy: f64,
    /// Coverage there.
    pub coverage: f64,
    /// Times the energy source was asked.
    pub evaluations: u32,
}

/// The force of an energy on one body, step by step.
///
/// ```
/// use fft_correlate::*;
/// use glam::DVec3;
/// use haptic::{BodyForce, BodyState};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let model = ScoreModel { gamma: 1e3, ..ScoreModel::GUIDED };
/// let pair = builder.build(&hole, &peg, &model, &Silent)?;
/// let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
/// // A body of 0.1 kg and 4e-5 kg m² at rest, 3 mm out of the fit; a step of 1 ms.
/// let inverse = [25e3, 25e3, 25e3, 10.0, 10.0, 10.0];
/// let body = BodyState {
///     part: Pose::from_translation(DVec3::Z * 0.003),
///     center: DVec3::ZERO,
///     twist: Twist::default(),
///     free: Twist::default(),
///     mobility: std::array::from_fn(|i| std::array::from_fn(|j| inverse[i] * f64::from(i == j))),
///     dt: 1e-3,
///     elapsed: 0.0,
/// };
/// let step = BodyForce::new(source.scratch()).step(&source, &body);
/// // It is drawn back in, to where the energy is lower.
/// let before = source.evaluate(&body.part, &mut source.scratch());
/// assert!(step.wrench.force.z < -0.1 && step.energy < before.energy, "{step:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct BodyForce {
    bundle: Bundle,
    scratch: Scratch,
    last: Option<LastStep>,
    /// Joules that body and field hold more than they did.
    surplus: f64,
}

/// The step before.
#[derive(Debug, Clone, Copy)]
struct LastStep {
    at: Pose,
    twist: Twist,
    energy: f64,
    wrench: Wrench,
}

/// A step that may be taken.
struct Candidate {
    /// After the step.
    twist: Twist,
    response: Response,
}

impl BodyForce {
    /// Of a source; `scratch` is its own.
    pub fn new(scratch: Scratch) -> Self {
        Self {
            bundle: Bundle::new(Metric::new(1.0, 1.0, false)),
            scratch,
            last: None,
            surplus: 0.0,
        }
    }

    /// Forgets what was: the body was put somewhere else.
    pub fn release(&mut self) {
        self.bundle.clear();
        self.last = None;
        self.surplus = 0.0;
    }

    /// Of a field that is not finite there is nothing to be felt.
    fn reset_step(&mut self) -> BodyStep {
        self.release();
        BodyStep::default()
    }

    /// The wrench for the next step. It is zero where the energy is level before and after it, and
    /// where the source gives a number that is not finite.
    pub fn step(&mut self, source: &dyn EnergySource, body: &BodyState) -> BodyStep {
        let mut asked = 0;
        let Self {
            bundle, scratch, ..
        } = self;
        let mut field = |at: &Pose| {
            asked += 1;
            let arm = at.rotation * body.center;
            let part = Pose {
                rotation: at.rotation,
                translation: at.translation - arm,
            };
            let answer = source.evaluate(&part, scratch);
            (answer.energy.is_finite() && answer.wrench.is_finite()).then(|| Response {
                wrench: answer.wrench.about(arm),
                ..answer
            })
        };
        let here = Pose {
            rotation: body.part.rotation,
            translation: body.part.apply(body.center),
        };
        let inertia = Inertia::new(&body.mobility, body.dt);
        let Some(start) = field(&here) else {
            return self.reset_step();
        };
        if let Some(last) = self.last.filter(|_| body.elapsed > 0.0) {
            self.surplus = settle(self.surplus, &last, &here, body, &inertia, &start);
        }
        let step = Step {
            body,
            inertia,
            here,
            start,
            surplus: self.surplus,
        };
        let Some(found) = step
            .least(bundle, &mut field)
            .and_then(|found| step.paid(found, &mut field))
        else {
            return self.reset_step();
        };
        let wrench = step.wrench(&found.twist);
        if is_level(&start, &found.response) {
            self.surplus = 0.0;
        }
        self.last = Some(LastStep {
            at: here,
            twist: body.twist,
            energy: start.energy,
            wrench,
        });
        BodyStep {
            wrench,
            energy: found.response.energy,
            coverage: found.response.coverage,
            evaluations: asked,
        }
    }
}

/// The surplus after the step before, by the velocities that the body really had. A body that is
/// not where its velocity took it was put there, which is nobody's work.
fn settle(
    surplus: f64,
    last: &LastStep,
    here: &Pose,
    body: &BodyState,
    inertia: &Inertia,
    now: &Response,
) -> f64 {
    let moved = last.at.twist_to(here);
    let rate = body.twist * body.elapsed;
    let change = (body.twist - last.twist) * body.elapsed;
    let near = |off: DVec3, by: DVec3, whole: DVec3| {
        off.length() <= 1e-9 + by.length() + 1e-3 * whole.length()
    };
    // Another step than was foretold, as within RK4, is not accounted for.
    if (body.elapsed - body.dt).abs() > 1e-6 * body.dt
        || !near(moved.linear - rate.linear, change.linear, rate.linear)
        || !near(moved.angular - rate.angular, change.angular, rate.angular)
    {
        return 0.0;
    }
    let twists = [&last.twist, &body.twist];
    let gained = gain(inertia, &last.wrench, twists, body.elapsed);
    (surplus + gained + now.energy - last.energy).max(0.0)
}

/// The kinetic energy that a body gained from `before` to `after` in `dt` seconds, less the work of
/// all forces but `wrench` over the way that it went, `after dt`: with inertia `M` and the change
/// `c` of its velocity it is `wrench · after dt - c M c / 2`.
fn gain(inertia: &Inertia, wrench: &Wrench, [before, after]: [&Twist; 2], dt: f64) -> f64 {
    let change = Metric::Inertia(*inertia).scaled(&((*after - *before) * dt));
    wrench.dot(after) * dt - 0.5 * dot(&change, &change)
}

/// Whether there is nothing to be felt from one place to the other.
fn is_level(a: &Response, b: &Response) -> bool {
    a.energy == b.energy && a.wrench == Wrench::ZERO && b.wrench == Wrench::ZERO
}

/// One step and what is known of it.
struct Step<'a> {
    body: &'a BodyState,
    inertia: Inertia,
    /// The centre now, with the part's rotation.
    here: Pose,
    start: Response,
    surplus: f64,
}

impl Step<'_> {
    /// The step to where energy and inertia together are least. `None` if the field is not finite.
    fn least(
        &self,
        bundle: &mut Bundle,
        field: &mut impl FnMut(&Pose) -> Option<Response>,
    ) -> Option<Candidate> {
        let (metric, dt) = (Metric::Inertia(self.inertia), self.body.dt);
        let ahead = self.here.perturbed(&(self.body.free * dt));
        bundle.measure_by(metric);
        bundle.rebase(&ahead);
        let back: Six = metric.scaled(&ahead.twist_to(&self.here));
        bundle.add(self.here, back, self.start.energy, &self.start.wrench);
        for ask in 1.. {
            let y = bundle.proximal_point();
            let by = metric.twist(&y);
            let at = ahead.perturbed(&by);
            let response = field(&at)?;
            let miss = response.energy - bundle.value(&y);
            bundle.add(at, y, response.energy, &response.wrench);
            if miss.abs() < GOOD_MODEL || ask >= ASKS {
                return Some(Candidate {
                    twist: self.body.free + by * (1.0 / dt),
                    response,
                });
            }
        }
        None
    }

    /// The wrench that ends the step with `twist`.
    fn wrench(&self, twist: &Twist) -> Wrench {
        self.inertia
            .wrench(&((*twist - self.body.free) * self.body.dt))
    }

    /// What body and field would hold more after a step than they did, but for the work of other
    /// forces, joules.
    fn excess(&self, step: &Candidate) -> f64 {
        let (wrench, dt) = (self.wrench(&step.twist), self.body.dt);
        self.surplus
            + gain(&self.inertia, &wrench, [&self.body.twist, &step.twist], dt)
            + step.response.energy
            - self.start.energy
    }

    /// The step itself, or a slower one the same way that brings nothing; standing still costs all
    /// that there is. `None` if the field is not finite.
    fn paid(
        &self,
        step: Candidate,
        field: &mut impl FnMut(&Pose) -> Option<Response>,
    ) -> Option<Candidate> {
        let excess = self.excess(&step);
        if is_level(&self.start, &step.response) || excess <= ROUNDING {
            return Some(step);
        }
        let metric = Metric::Inertia(self.inertia);
        let y = metric.scaled(&(step.twist * self.body.dt));
        let moves = 0.5 * dot(&y, &y);
        let mut taken = excess;
        while taken < moves {
            let twist = step.twist * (1.0 - taken / moves).sqrt();
            let response = field(&self.here.perturbed(&(twist * self.body.dt)))?;
            let slower = Candidate { twist, response };
            if self.excess(&slower) <= ROUNDING {
                return Some(slower);
            }
            taken *= 2.0;
        }
        Some(Candidate {
            twist: Twist::default(),
            response: self.start,
        })
    }
}

#[cfg(test)]
#[path = "body_force_tests.rs"]
mod tests;
