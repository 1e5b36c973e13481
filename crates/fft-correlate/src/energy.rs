//! Energy sources: the energy and wrench at a pose, for the haptic loop and every scorer.

use std::any::Any;
use std::sync::Arc;

use crate::geometry::placement::Placement;
use crate::geometry::se3::{Pose, Wrench};

/// Energy, its negative gradient, and how far the pose is covered by the source.
///
/// See the example of [`DirectEvaluator`](crate::DirectEvaluator).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Response {
    /// `E = -gamma Re f`, joules (eq_6).
    pub energy: f64,
    /// Force and torque on the moving part, about its origin, fixed frame (eq_9a, eq_9b).
    pub wrench: Wrench,
    /// 1 inside the source's domain, falling smoothly to 0 outside, where the energy has gone to
    /// the source's far value and the wrench to zero. 0 ..= 1.
    pub coverage: f64,
}

/// Working memory of one thread for one source; made once, reused for every evaluation.
///
/// What is inside is the source's own business: [`EnergySource::scratch`] puts a value of a type of
/// its own in, and the source's other methods take it out by that type. The default one is empty,
/// for a source that needs none.
///
/// See the example of [`EnergySource`].
#[derive(Debug, Default)]
pub struct Scratch {
    inside: Option<TypedValue>,
}

/// A value, and the name of its type for the message when another one is asked for.
#[derive(Debug)]
struct TypedValue {
    value: Box<dyn Any + Send>,
    name: &'static str,
}

impl Scratch {
    /// Working memory that holds `value`.
    pub fn new<T: Send + 'static>(value: T) -> Self {
        let (value, name) = (Box::new(value), std::any::type_name::<T>());
        Self {
            inside: Some(TypedValue { value, name }),
        }
    }

    /// What [`Scratch::new`] put in; neither allocates nor locks.
    ///
    /// # Panics
    /// If it is of another type: the scratch was made by another source.
    pub fn get<T: 'static>(&self) -> &T {
        let inside = self.inside.as_ref();
        let value = inside.and_then(|i| i.value.downcast_ref());
        value.unwrap_or_else(|| refuse::<T>(inside.map(|i| i.name)))
    }

    /// What [`Scratch::new`] put in, to be changed; neither allocates nor locks.
    ///
    /// # Panics
    /// If it is of another type: the scratch was made by another source.
    pub fn get_mut<T: 'static>(&mut self) -> &mut T {
        let name = self.inside.as_ref().map(|i| i.name);
        let value = self.inside.as_mut().and_then(|i| i.value.downcast_mut());
        value.unwrap_or_else(|| refuse::<T>(name))
    }
}

#[cold]
fn refuse<T>(found: Option<&str>) -> ! {
    let (expected, found) = (std::any::type_name::<T>(), found.unwrap_or("nothing"));
    panic!("the scratch of another source: expected {expected}, found {found}")
}

/// Anything that gives energy and wrench at a pose: a table, a direct evaluator, a sum of several.
///
/// The wrench is minus the gradient of the energy under [`Pose::perturbed`]. `evaluate` allocates
/// nothing, takes no lock, and returns finite numbers for every valid pose. The exception is a
/// source that loads what a pose needs when it is asked ([`crate::WatchedTiles`]): it is no source
/// for a loop in real time, and [`EnergySource::has_failed`] says whether loading has failed.
///
/// Give a scratch only to the source that made it. A source whose answer depends on its scratch
/// panics on a scratch of another source, naming both types ([`Scratch::get_mut`]); a source that
/// needs none does not look at it.
///
/// ```
/// use fft_correlate::{EnergySource, Pose, Response, Scratch};
///
/// /// Remembers how often each thread has asked.
/// struct Counted;
///
/// struct Count(u64);
///
/// impl EnergySource for Counted {
///     fn scratch(&self) -> Scratch {
///         Scratch::new(Count(0))
///     }
///
///     fn evaluate(&self, _: &Pose, scratch: &mut Scratch) -> Response {
///         let count = scratch.get_mut::<Count>();
///         count.0 += 1;
///         Response { energy: count.0 as f64, ..Response::default() }
///     }
/// }
///
/// let mut scratch = Counted.scratch();
/// Counted.evaluate(&Pose::IDENTITY, &mut scratch);
/// assert_eq!(Counted.evaluate(&Pose::IDENTITY, &mut scratch).energy, 2.0);
/// ```
pub trait EnergySource: Send + Sync {
    /// Working memory for [`EnergySource::evaluate`], one per thread.
    fn scratch(&self) -> Scratch;

    /// Energy, wrench and coverage at `pose`.
    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response;

    /// Takes over changes of the source since the last call and returns by how much they changed
    /// the response at `pose` (new minus old); `None` if nothing changed, as always for a source
    /// that never changes. Between two calls `evaluate` is one function of the pose. Like
    /// `evaluate` it allocates nothing and takes no lock.
    fn refresh(&self, _pose: &Pose, _scratch: &mut Scratch) -> Option<Response> {
        None
    }

    /// Whether all that the response depends on, at `pose` and a little around it, is in memory.
    /// True for a source that is always whole. Where it is false the response may be that of a
    /// pose far away, without notice of where that begins. Like `evaluate` it allocates nothing
    /// and takes no lock.
    fn is_loaded(&self, _pose: &Pose, _scratch: &Scratch) -> bool {
        true
    }

    /// Whether an answer could not be had, as of a source that loads what it needs. All numbers of
    /// such an answer, and of all later ones, are NaN, and its coverage is 0.
    fn has_failed(&self) -> bool {
        false
    }
}

impl<S: EnergySource + ?Sized> EnergySource for Arc<S> {
    fn scratch(&self) -> Scratch {
        (**self).scratch()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        (**self).evaluate(pose, scratch)
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        (**self).refresh(pose, scratch)
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        (**self).is_loaded(pose, scratch)
    }

    fn has_failed(&self) -> bool {
        (**self).has_failed()
    }
}

/// A source of the shapes' poses, evaluated at poses of the scene. Wrenches are along the scene's
/// axes, about the origin of the moving part.
///
/// ```
/// use fft_correlate::*;
/// use glam::DVec3;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
/// // A scene that puts the hole at x = 1 m: there the peg fits.
/// let at_hole = Pose::from_translation(DVec3::X);
/// let scene = InScene::new(source, Placement::of_fixed(at_hole));
/// let fit = scene.source().evaluate(&Pose::IDENTITY, &mut scene.scratch());
/// assert_eq!(scene.evaluate(&at_hole, &mut scene.scratch()).energy, fit.energy);
/// assert_eq!(scene.evaluate(&Pose::IDENTITY, &mut scene.scratch()).energy, 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct InScene<S> {
    source: S,
    placement: Placement,
}

impl<S> InScene<S> {
    /// `source` as seen from the scene that places its shapes so.
    pub fn new(source: S, placement: Placement) -> Self {
        Self { source, placement }
    }

    /// The source of the shapes' poses.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// Where the scene puts the shapes.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    fn to_scene(&self, pose: &Pose, response: Response) -> Response {
        Response {
            wrench: self.placement.wrench_to_scene(pose, &response.wrench),
            ..response
        }
    }
}

impl<S: EnergySource> EnergySource for InScene<S> {
    fn scratch(&self) -> Scratch {
        self.source.scratch()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        let shapes = self.placement.to_shapes(pose);
        self.to_scene(pose, self.source.evaluate(&shapes, scratch))
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        let change = self
            .source
            .refresh(&self.placement.to_shapes(pose), scratch);
        change.map(|response| self.to_scene(pose, response))
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        self.source
            .is_loaded(&self.placement.to_shapes(pose), scratch)
    }

    fn has_failed(&self) -> bool {
        self.source.has_failed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::se3::{Twist, Wrench};
    use glam::{DQuat, DVec3};

    #[test]
    fn a_scratch_gives_back_what_was_put_in() {
        let mut scratch = Scratch::new(vec![1.5f32]);
        scratch.get_mut::<Vec<f32>>().push(2.5);
        assert_eq!(*scratch.get::<Vec<f32>>(), [1.5, 2.5]);
    }

    #[test]
    #[should_panic(expected = "expected alloc::vec::Vec<f64>, found alloc::vec::Vec<f32>")]
    fn a_scratch_of_another_type_is_refused_by_name() {
        Scratch::new(vec![1.5f32]).get_mut::<Vec<f64>>();
    }

    #[test]
    #[should_panic(expected = "expected f64, found nothing")]
    fn an_empty_scratch_holds_nothing() {
        Scratch::default().get::<f64>();
    }

    /// `E = |t|² + t·(R x)`, whose wrench depends on every part of the pose.
    struct Spring;

    impl EnergySource for Spring {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let (t, axis) = (pose.translation, pose.rotation * DVec3::X);
            Response {
                energy: t.length_squared() + t.dot(axis),
                wrench: Wrench {
                    torque: -axis.cross(t),
                    force: -2.0 * t - axis,
                },
                coverage: 0.25,
            }
        }
    }

    #[test]
    fn the_wrench_in_the_scene_is_minus_the_gradient_there() {
        let turn = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
        let placement = Placement {
            fixed: Pose::new(turn(0.4, -1.1, 0.7), DVec3::new(0.3, -0.2, 0.9)),
            moving: Pose::new(turn(-0.8, 0.2, 2.1), DVec3::new(-0.1, 0.5, 0.4)),
        };
        let source = InScene::new(Spring, placement);
        let mut scratch = source.scratch();
        let pose = Pose::new(turn(0.9, 0.3, -0.5), DVec3::new(0.2, 0.1, -0.7));
        let answer = source.evaluate(&pose, &mut scratch);
        assert_eq!(answer.coverage, 0.25);
        let h = 1e-5;
        for k in 0..6 {
            let mut v = [0.0; 6];
            v[k] = h;
            let step = Twist {
                angular: DVec3::new(v[0], v[1], v[2]),
                linear: DVec3::new(v[3], v[4], v[5]),
            };
            let mut at = |t: &Twist| source.evaluate(&pose.perturbed(t), &mut scratch).energy;
            let slope = (at(&step) - at(&-step)) / (2.0 * h);
            // Central differences of order h²; numbers of order one.
            let error = slope + answer.wrench.dot(&(step * (1.0 / h)));
            assert!(error.abs() < 1e-8, "{k}: {error}");
        }
    }
}
