//! A failed call and the exception that it becomes.

use std::error::Error;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use sdf_grid::text::shown_lines;

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
    pub(crate) fn of(kind: Kind, error: &dyn Error) -> Self {
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
