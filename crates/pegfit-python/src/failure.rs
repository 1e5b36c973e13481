//! Errors for Python: named, with their evidence.

use std::error::Error;

use fft_correlate::table::TableSetupError;
use fft_correlate::tolerance::ToleranceError;
use fft_correlate::{
    BakeError, CorrelateError, DirectError, DockingError, EnergyScaleError, PairBuildError,
    PairError, PairSetupError, RotationError, StoreError, TableError, TablePlanError, TileError,
    WellError,
};
use haptic::{ConfigError, HapticError};
use pegfit_scene::SceneError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sdf_grid::text::{quoted, shown_lines};
use sdf_grid::{CacheError, DensityError, KernelError, LatticeError, MeshError};

mod errors {
    pyo3::import_exception!(pegfit._errors, PegfitError);
    pyo3::import_exception!(pegfit._errors, MeshError);
    pyo3::import_exception!(pegfit._errors, SceneError);
    pyo3::import_exception!(pegfit._errors, PoseError);
    pyo3::import_exception!(pegfit._errors, TableError);
    pyo3::import_exception!(pegfit._errors, DeviceError);
}

/// Which of the package's exceptions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    General,
    Mesh,
    Scene,
    Pose,
    Table,
    Device,
}

/// A failed call: the message, and what it is made of as far as that is known.
#[derive(Debug)]
pub(crate) struct Failure {
    kind: Kind,
    message: String,
    evidence: Box<Evidence>,
}

#[derive(Debug, Default)]
struct Evidence {
    file: Option<String>,
    item: Option<String>,
    expected: Option<String>,
    found: Option<String>,
}

impl Failure {
    /// What an error says, with all that caused it.
    pub(crate) fn from_error(kind: Kind, error: &dyn Error) -> Self {
        let mut message = error.to_string();
        let mut cause = error.source();
        while let Some(inner) = cause {
            let said = inner.to_string();
            // A transparent error repeats its source.
            if !message.ends_with(&said) {
                message = format!("{message}: {said}");
            }
            cause = inner.source();
        }
        Self {
            kind,
            message,
            evidence: Box::default(),
        }
    }

    /// `item: expected this, found that`.
    pub(crate) fn found(
        kind: Kind,
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        let (item, expected, found) = (item.into(), expected.into(), found.to_string());
        let said = Self {
            kind,
            message: format!("{item}: expected {expected}, found {found}"),
            evidence: Box::default(),
        };
        said.about(item, expected, found)
    }

    /// A computation that would need more memory than it may use.
    pub(crate) fn memory(kind: Kind, what: &str, needed: u128, limit: u64) -> Self {
        let expected = format!("at most {limit} bytes of memory");
        Self::found(kind, what, expected, format!("a need of {needed}"))
    }

    /// A mistake in pegfit itself.
    pub(crate) fn internal(panic: &(dyn std::any::Any + Send)) -> Self {
        let said = (panic.downcast_ref::<&str>().map(ToString::to_string))
            .or_else(|| panic.downcast_ref::<String>().cloned());
        Self {
            message: format!("a mistake in pegfit itself: {}", said.unwrap_or_default()),
            ..Self::found(Kind::General, "pegfit", "no mistake", "a panic")
        }
    }

    /// The same, about a file.
    pub(crate) fn in_file(mut self, file: impl ToString) -> Self {
        let file = file.to_string();
        if !self.message.contains(&file) {
            self.message = format!("{file}: {}", self.message);
        }
        self.evidence.file = Some(file);
        self
    }

    /// The same message, with the evidence that it is made of.
    pub(crate) fn about(
        mut self,
        item: impl ToString,
        expected: impl ToString,
        found: impl ToString,
    ) -> Self {
        self.evidence.item = Some(item.to_string());
        self.evidence.expected = Some(expected.to_string());
        self.evidence.found = Some(found.to_string());
        self
    }

    fn raise(self, py: Python<'_>) -> PyResult<PyErr> {
        let class = match self.kind {
            Kind::General => py.get_type::<errors::PegfitError>(),
            Kind::Mesh => py.get_type::<errors::MeshError>(),
            Kind::Scene => py.get_type::<errors::SceneError>(),
            Kind::Pose => py.get_type::<errors::PoseError>(),
            Kind::Table => py.get_type::<errors::TableError>(),
            Kind::Device => py.get_type::<errors::DeviceError>(),
        };
        let Evidence {
            file,
            item,
            expected,
            found,
        } = *self.evidence;
        let evidence = PyDict::new(py);
        evidence.set_item("file", file)?;
        evidence.set_item("item", item)?;
        evidence.set_item("expected", expected)?;
        evidence.set_item("found", found)?;
        // Names in it come from files.
        let message = shown_lines(&self.message);
        Ok(PyErr::from_value(class.call((message,), Some(&evidence))?))
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| failure.raise(py).unwrap_or_else(|error| error))
    }
}

impl From<MeshError> for Failure {
    fn from(error: MeshError) -> Self {
        let said = Self::from_error(Kind::Mesh, &error);
        match error {
            MeshError::Read { path, source } | MeshError::Write { path, source } => said
                .about("file", "a file that can be used", source)
                .in_file(path.display()),
            MeshError::Format {
                path,
                expected,
                found,
            } => (said.about("ending", expected, found)).in_file(path.display()),
            MeshError::Converter {
                path,
                converter,
                expected,
                found,
            } => said
                .about(converter.display(), expected, found)
                .in_file(path.display()),
            MeshError::Syntax {
                file,
                place,
                expected,
                found,
            } => said.about(place, expected, found).in_file(file),
            MeshError::Solid {
                file,
                wanted,
                matches,
                found,
            } => said
                .about(
                    format!("solid {}", quoted(&wanted)),
                    "one",
                    format!("{matches} of that name among {found}"),
                )
                .in_file(file),
            MeshError::Unit { expected, found } => said.about("unit", expected, found),
            other => remaining(said, other),
        }
    }
}

/// Of what is in a mesh.
fn remaining(said: Failure, error: MeshError) -> Failure {
    match error {
        MeshError::TooLarge {
            part,
            item,
            limit,
            found,
        } => (said.about(item, format!("at most {limit}"), found)).in_file(part),
        MeshError::NonFiniteVertex {
            part,
            vertex,
            limit,
            found,
        } => said
            .about(
                format!("vertex {vertex}"),
                format!("finite coordinates within {limit:e} m"),
                found,
            )
            .in_file(part),
        MeshError::IndexOutOfRange {
            part,
            triangle,
            expected,
            found,
        } => said
            .about(
                format!("triangle {triangle}"),
                format!("vertex indices below {expected}"),
                found,
            )
            .in_file(part),
        MeshError::Empty {
            part, triangles, ..
        } => said
            .about(
                "triangles",
                "at least one with an area",
                format!("none among {triangles}"),
            )
            .in_file(part),
        MeshError::Open {
            part, limit, found, ..
        } => said
            .about(
                "missing share of the area",
                format!("at most {limit}"),
                found,
            )
            .in_file(part),
        other => of_shape(said, other),
    }
}

/// Of what a file holds, of options, and of what is made.
fn of_shape(said: Failure, error: MeshError) -> Failure {
    match error {
        MeshError::OutOfRange {
            part,
            item,
            expected,
            found,
        } => said.about(item, expected, found).in_file(part),
        MeshError::Foreign {
            file,
            expected,
            found,
            ..
        } => said.about("content", expected, found).in_file(file),
        MeshError::Unread { file, place, found } => said
            .about(place, "what can be read of a solid", found)
            .in_file(file),
        MeshError::NoSolid { path, found } => said
            .about("solids", "at least one", found)
            .in_file(path.display()),
        MeshError::Polygon {
            part,
            polygon,
            found,
        } => said
            .about(format!("polygon {polygon}"), "a simple polygon", found)
            .in_file(part),
        _ => said,
    }
}

impl From<DensityError> for Failure {
    fn from(error: DensityError) -> Self {
        let said = Self::from_error(Kind::Scene, &error);
        match error {
            DensityError::Option {
                name,
                expected,
                found,
            } => said.about(name, expected, found),
            DensityError::Memory { bytes } => {
                said.about("memory", format!("{bytes} bytes"), "less")
            }
            _ => said,
        }
    }
}

impl From<KernelError> for Failure {
    fn from(error: KernelError) -> Self {
        Self::from_error(Kind::Scene, &error).about("sigma", "0.03 to 0.5", error.found)
    }
}

impl From<LatticeError> for Failure {
    fn from(error: LatticeError) -> Self {
        let said = Self::from_error(Kind::Scene, &error);
        match error {
            LatticeError::Spacing { found } => said.about("spacing", "positive and finite", found),
            LatticeError::Bounds { found } => said.about("bounds", "finite numbers", found),
            LatticeError::Size { shape, limit } => said.about(
                "nodes",
                format!("at least 1 per axis and at most {limit} in all"),
                shape.map(|n| n.to_string()).join(" x "),
            ),
        }
    }
}

impl From<CacheError> for Failure {
    fn from(error: CacheError) -> Self {
        let said = Self::from_error(Kind::General, &error);
        (said.about("cache", "a folder", &error.source)).in_file(error.path.display())
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let said = Self::from_error(Kind::Scene, &error);
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
        let said = Self::from_error(Kind::Scene, &error);
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
        let said = Self::from_error(Kind::Scene, &error);
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

impl From<TileError> for Failure {
    fn from(error: TileError) -> Self {
        match error {
            TileError::Setup(inner) => inner.into(),
            TileError::Direct(inner) => inner.into(),
            TileError::Threads { .. } => Self::from_error(Kind::General, &error),
        }
    }
}

impl From<PairSetupError> for Failure {
    fn from(error: PairSetupError) -> Self {
        match error {
            PairSetupError::Build(inner) => inner.into(),
            PairSetupError::Energy(inner) => inner.into(),
            PairSetupError::Cancelled => Self::from_error(Kind::General, &error),
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
        let said = Self::from_error(Kind::Scene, &error);
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
            other => Self::from_error(Kind::Scene, &other),
        }
    }
}

impl From<DirectError> for Failure {
    fn from(error: DirectError) -> Self {
        let said = Self::from_error(Kind::Scene, &error);
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
        let said = Self::from_error(Kind::Device, &error);
        said.about(error.key, error.expected, error.found)
    }
}

impl From<HapticError> for Failure {
    fn from(error: HapticError) -> Self {
        match error {
            HapticError::Config(inner) => inner.into(),
            other => Self::from_error(Kind::Device, &other),
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
        Self::from_error(Kind::Scene, &error)
    }
}

impl From<WellError> for Failure {
    fn from(error: WellError) -> Self {
        Self::from_error(Kind::Scene, &error)
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        let said = Self::from_error(Kind::Table, &error);
        match error {
            StoreError::Missing { path } => {
                (said.about("table", "a table", "nothing")).in_file(path.display())
            }
            StoreError::Url { url, reason } => {
                (said.about("url", "a store", reason)).in_file(url.display())
            }
            StoreError::Io { path, source } => said
                .about("file", "a file that can be used", source)
                .in_file(path.display()),
            StoreError::Metadata { path, item, reason } => said
                .about(item, "that of an energy table", reason)
                .in_file(path.display()),
            StoreError::Version {
                path,
                expected,
                found,
            } => (said.about("table format", expected, found)).in_file(path.display()),
            StoreError::Different { path, difference } => said
                .about(&difference.key, &difference.stored, &difference.given)
                .in_file(path.display()),
            StoreError::Busy { path } => said
                .about("table", "one that nobody else bakes", "a bake under way")
                .in_file(path.display()),
            StoreError::Incomplete {
                path,
                missing,
                rotations,
                ..
            } => said
                .about(
                    "rotation nodes",
                    format!("{rotations}, all of them"),
                    format!("{missing} missing: it is being baked, or was interrupted"),
                )
                .in_file(path.display()),
            StoreError::Damaged { path, key, reason } => {
                (said.about(key, "an intact chunk", reason)).in_file(path.display())
            }
            StoreError::Table(inner) => inner.into(),
        }
    }
}

impl From<TableError> for Failure {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Memory { needed, limit, .. } => {
                Self::memory(Kind::Table, "the table", needed, limit)
            }
            TableError::Rotations(inner) => inner.into(),
            other => Self::from_error(Kind::Table, &other),
        }
    }
}

impl From<BakeError> for Failure {
    fn from(error: BakeError) -> Self {
        let said = Self::from_error(Kind::Table, &error);
        match error {
            BakeError::Store(inner) => inner.into(),
            BakeError::Exists { path } => said
                .about(
                    "table",
                    "nothing, or resume=True to go on with it",
                    "a table",
                )
                .in_file(path.display()),
            _ => said,
        }
    }
}

impl From<TableSetupError> for Failure {
    fn from(error: TableSetupError) -> Self {
        match error {
            TableSetupError::Build(inner) => inner.into(),
            TableSetupError::Store(inner) => inner.into(),
        }
    }
}

impl From<ToleranceError> for Failure {
    fn from(error: ToleranceError) -> Self {
        let said = Self::from_error(Kind::Table, &error);
        match error {
            ToleranceError::Missed { asked, reached, .. } => {
                said.about("tolerance", format!("at least {reached}"), asked)
            }
            ToleranceError::Pair(inner) => inner.into(),
            ToleranceError::Plan(inner) => inner.into(),
            ToleranceError::Table(inner) => inner.into(),
            ToleranceError::Direct(inner) => inner.into(),
            ToleranceError::Threads(inner) => inner.into(),
            ToleranceError::Cancelled => said,
        }
    }
}
