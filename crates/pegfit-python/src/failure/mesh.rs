//! Meshes and density fields that cannot be had.

use sdf_grid::{CacheError, DensityError, KernelError, LatticeError, MeshError};

use super::raised::{Failure, Kind};

impl From<MeshError> for Failure {
    fn from(error: MeshError) -> Self {
        let said = Self::of(Kind::Mesh, &error);
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
                    format!("solid {wanted:?}"),
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
        let said = Self::of(Kind::Scene, &error);
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
        Self::of(Kind::Scene, &error).about("sigma", "0.03 to 0.5", error.found)
    }
}

impl From<LatticeError> for Failure {
    fn from(error: LatticeError) -> Self {
        let said = Self::of(Kind::Scene, &error);
        match error {
            LatticeError::Spacing { found } => said.about("spacing", "positive and finite", found),
            LatticeError::Bounds { found } => said.about("bounds", "finite numbers", found),
            LatticeError::Size { shape, limit } => said.about(
                "nodes",
                format!("at least 1 per axis and at most {limit} in all"),
                format!("{shape:?}"),
            ),
        }
    }
}

impl From<CacheError> for Failure {
    fn from(error: CacheError) -> Self {
        let said = Self::of(Kind::General, &error);
        (said.about("cache", "a folder", &error.source)).in_file(error.path.display())
    }
}
