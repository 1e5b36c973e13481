//! The formats that are read from bytes alone.

/// A mesh format that is read from bytes alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// STL, binary or ASCII.
    Stl,
    /// PLY, binary or ASCII.
    Ply,
    /// glTF 2.0, JSON or binary.
    Gltf,
    /// 3D Manufacturing Format.
    ThreeMf,
}
