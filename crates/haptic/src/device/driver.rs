//! What the makers' drivers share: shared libraries, loaded when a device is opened and never when
//! pegfit is built, and the axes of their frames.

use std::error::Error;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};

use fft_correlate::{Pose, Twist};
use glam::{DQuat, DVec3};
use libloading::Library;

use crate::device::contract::DeviceError;

/// Where to find a driver, and the help if it is missing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DriverSource {
    /// What its maker calls it.
    pub(crate) name: &'static str,
    /// File names and paths, tried in turn; a name without a folder is searched in the system's
    /// library path.
    pub(crate) files: &'static [&'static str],
    /// Environment variable that names the file instead.
    pub(crate) variable: &'static str,
    /// What to install, from where.
    pub(crate) help: &'static str,
    /// The versions that have every function needed.
    pub(crate) versions: &'static str,
}

impl DriverSource {
    /// The file that the environment names, if any.
    pub(crate) fn file_in_env(&self) -> Option<PathBuf> {
        let file = std::env::var_os(self.variable)?;
        (!file.is_empty()).then(|| file.into())
    }

    fn not_installed(&self, why: &str) -> DeviceError {
        DeviceError::NotInstalled {
            name: self.name.to_owned(),
            reason: format!("{why}; {}, or set {} to its file", self.help, self.variable),
        }
    }
}

/// A loaded driver. It stays loaded until the process ends: drivers keep threads of their own,
/// which would be left without code.
#[derive(Debug)]
pub(crate) struct Driver {
    wanted: DriverSource,
    file: PathBuf,
    library: ManuallyDrop<Library>,
}

impl Driver {
    /// Loads `file`, or the first of the files wanted that can be loaded.
    pub(crate) fn load(wanted: DriverSource, file: Option<PathBuf>) -> Result<Self, DeviceError> {
        let files: Vec<PathBuf> = match file {
            Some(file) => vec![file],
            None => wanted.files.iter().map(PathBuf::from).collect(),
        };
        let mut said = Vec::new();
        for file in files {
            // SAFETY: loading runs the initialisers of a driver that the user has installed or
            // named; nothing else can be known of it here.
            match unsafe { Library::new(&file) } {
                Ok(library) => {
                    return Ok(Self {
                        wanted,
                        file,
                        library: ManuallyDrop::new(library),
                    });
                }
                Err(error) => said.push(loader_message(&error, &file)),
            }
        }
        Err(wanted.not_installed(&said.join("; ")))
    }

    /// The function of this name.
    ///
    /// # Safety
    /// `F` must be the type of a pointer to that function.
    pub(crate) unsafe fn function<F: Copy>(&self, name: &str) -> Result<F, DeviceError> {
        // SAFETY: the caller vouches for the type; the library is never unloaded.
        let found = unsafe { self.library.get::<F>(name) };
        found.map(|symbol| *symbol).map_err(|_| {
            let wanted = &self.wanted;
            wanted.not_installed(&format!(
                "{} has no function {name}: pegfit needs {}",
                self.file.display(),
                wanted.versions
            ))
        })
    }
}

/// The loader's own words, the innermost cause, which name the file once.
fn loader_message(error: &dyn Error, file: &Path) -> String {
    let mut inmost = error;
    while let Some(cause) = inmost.source() {
        inmost = cause;
    }
    let (said, file) = (inmost.to_string(), file.display().to_string());
    match said.starts_with(&file) {
        true => said,
        false => format!("{file}: {said}"),
    }
}

/// Turns a maker's axes into ours. Rotations are turned along with them, so that a handle that is
/// unturned for the maker is unturned for us.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axes(DQuat);

impl Axes {
    /// x right, y away from the user, z up: ours.
    pub(crate) const OURS: Self = Self(DQuat::IDENTITY);

    /// x right, y up, z towards the user: a quarter turn about x.
    pub(crate) const Y_UP: Self = Self(DQuat::from_xyzw(
        std::f64::consts::FRAC_1_SQRT_2,
        0.0,
        0.0,
        std::f64::consts::FRAC_1_SQRT_2,
    ));

    /// x towards the user, y right, z up: a quarter turn back about z.
    pub(crate) const X_TO_USER: Self = Self(DQuat::from_xyzw(
        0.0,
        0.0,
        -std::f64::consts::FRAC_1_SQRT_2,
        std::f64::consts::FRAC_1_SQRT_2,
    ));

    /// A maker's pose, metres, in our frame.
    pub(crate) fn pose(self, rotation: DQuat, translation: DVec3) -> Pose {
        Pose {
            rotation: (self.0 * rotation * self.0.conjugate()).normalize(),
            translation: self.0 * translation,
        }
    }

    /// A maker's velocities, rad/s and m/s, in our frame.
    pub(crate) fn twist(self, angular: DVec3, linear: DVec3) -> Twist {
        Twist {
            angular: self.0 * angular,
            linear: self.0 * linear,
        }
    }

    /// A vector of ours, a force or a torque, in the maker's frame.
    pub(crate) fn to_maker(self, vector: DVec3) -> DVec3 {
        self.0.conjugate() * vector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_go_where_they_are_said_to() {
        let (right, away, up) = (DVec3::X, DVec3::Y, DVec3::Z);
        for (axes, x, y, z) in [
            (Axes::OURS, right, away, up),
            (Axes::Y_UP, right, up, -away),
            (Axes::X_TO_USER, -away, right, up),
        ] {
            for (theirs, ours) in [(DVec3::X, x), (DVec3::Y, y), (DVec3::Z, z)] {
                let moved = axes.pose(DQuat::IDENTITY, theirs).translation;
                assert!((moved - ours).length() < 1e-15, "{axes:?} {theirs}");
                assert!((axes.to_maker(ours) - theirs).length() < 1e-15);
                // A turn about one of their axes is the same turn about ours.
                let turned = axes.pose(DQuat::from_axis_angle(theirs, 0.3), DVec3::ZERO);
                let expected = DQuat::from_axis_angle(ours, 0.3);
                assert!(turned.rotation.angle_between(expected) < 1e-7);
            }
        }
    }
}
