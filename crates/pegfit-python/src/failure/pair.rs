//! Scenes and pairs that cannot be used, and what is asked of them.

use fft_correlate::{
    CorrelateError, DirectError, DockingError, EnergyScaleError, PairBuildError, PairError,
    PairSetupError, RotationError, TablePlanError, WellError,
};
use haptic::{ConfigError, HapticError};
use pegfit_scene::SceneError;

use super::raised::{Failure, Kind};

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let said = Self::of(Kind::Scene, &error);
        match error {
            SceneError::Mesh(inner) => (*inner).into(),
            SceneError::Table(inner) => (*inner).into(),
            SceneError::Read { path, source } => said
                .about("file", "a file that can be read", source)
                .in_file(path.display()),
            SceneError::Line(line) => said
                .about(format!("line {}", line.line), "", &line.message)
                .in_file(line.path.display()),
            SceneError::FixedPart {
                path,
                wanted,
                found,
            } => said
                .about("fixed", wanted.unwrap_or("one name".into()), found)
                .in_file(path.display()),
            SceneError::Memory {
                path,
                what,
                needed,
                limit,
            } => said
                .about(what, format!("at most {limit} bytes"), needed)
                .in_file(path.display()),
            SceneError::TooSmall {
                path,
                part,
                size,
                spacing,
                ..
            } => said
                .about(part, format!("more than {spacing} m"), size)
                .in_file(path.display()),
            SceneError::Refused { path, item, .. } => {
                let message = said.in_file(path.display());
                match item {
                    "" => message,
                    item => message.about(item, "", ""),
                }
            }
            _ => said,
        }
    }
}

impl From<PairError> for Failure {
    fn from(error: PairError) -> Self {
        let said = Self::of(Kind::Scene, &error);
        match error {
            PairError::Model(model) => said.about(model.name, model.expected, model.found),
            PairError::Mismatch {
                name,
                expected,
                found,
            } => said.about(name, expected, found),
            _ => said,
        }
    }
}

impl From<PairBuildError> for Failure {
    fn from(error: PairBuildError) -> Self {
        let said = Self::of(Kind::Scene, &error);
        match error {
            PairBuildError::Pair(inner) => inner.into(),
            PairBuildError::Kernel(inner) => inner.into(),
            PairBuildError::Lattice { source, .. } => source.into(),
            PairBuildError::Density { source, .. } => source.into(),
            PairBuildError::Contact(_) => said,
            PairBuildError::TooSmall {
                part,
                size,
                spacing,
            } => said.about(part, format!("a part larger than {spacing} m"), size),
            PairBuildError::Memory { needed, limit, .. } => {
                Self::memory(Kind::Scene, "the density fields", needed.into(), limit)
            }
        }
    }
}

impl From<PairSetupError> for Failure {
    fn from(error: PairSetupError) -> Self {
        match error {
            PairSetupError::Build(inner) => inner.into(),
            PairSetupError::Energy(inner) => inner.into(),
            PairSetupError::Cancelled => Self::of(Kind::General, &error),
        }
    }
}

impl From<TablePlanError> for Failure {
    fn from(error: TablePlanError) -> Self {
        match error {
            TablePlanError::Window(inner) => inner.into(),
            TablePlanError::Rotations(inner) => inner.into(),
            TablePlanError::Correlate(inner) => inner.into(),
            TablePlanError::Memory { needed, limit } => {
                Self::memory(Kind::Scene, "the correlation", needed.into(), limit)
            }
        }
    }
}

impl From<RotationError> for Failure {
    fn from(error: RotationError) -> Self {
        let said = Self::of(Kind::Scene, &error);
        match error {
            RotationError::Range {
                name,
                expected,
                found,
            } => said.about(name, expected, found),
            RotationError::Quaternion { name, found } => {
                said.about(name, "a unit quaternion", format!("{found:?}"))
            }
            _ => said,
        }
    }
}

impl From<DockingError> for Failure {
    fn from(error: DockingError) -> Self {
        match error {
            DockingError::Build(inner) => inner.into(),
            DockingError::Energy(inner) => inner.into(),
            DockingError::Rotations(inner) => inner.into(),
            DockingError::Window(inner) => inner.into(),
            DockingError::Pair(inner) => inner.into(),
            DockingError::Memory { needed, limit } => {
                Self::memory(Kind::Scene, "the correlation", needed.into(), limit)
            }
            other => Self::of(Kind::Scene, &other),
        }
    }
}

impl From<DirectError> for Failure {
    fn from(error: DirectError) -> Self {
        let said = Self::of(Kind::Scene, &error);
        match error {
            DirectError::Option {
                name,
                expected,
                found,
            } => said.about(name, expected, found),
            _ => said,
        }
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        let said = Self::of(Kind::Device, &error);
        said.about(error.key, error.expected, error.found)
    }
}

impl From<HapticError> for Failure {
    fn from(error: HapticError) -> Self {
        match error {
            HapticError::Config(inner) => inner.into(),
            other => Self::of(Kind::Device, &other),
        }
    }
}

impl From<EnergyScaleError> for Failure {
    fn from(error: EnergyScaleError) -> Self {
        match error {
            EnergyScaleError::PeakForce { found } => {
                Self::found(Kind::Scene, "peak_force", "positive and finite", found)
            }
            EnergyScaleError::Kernel(inner) => inner.into(),
        }
    }
}

impl From<CorrelateError> for Failure {
    fn from(error: CorrelateError) -> Self {
        Self::of(Kind::Scene, &error)
    }
}

impl From<WellError> for Failure {
    fn from(error: WellError) -> Self {
        Self::of(Kind::Scene, &error)
    }
}
