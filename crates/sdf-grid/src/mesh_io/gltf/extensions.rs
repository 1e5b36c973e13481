//! Extensions of glTF, by their names.

use crate::mesh::error::MeshError;
use crate::mesh_io::soup::syntax;

/// Coordinates as whole numbers.
pub(super) const QUANTIZED: &str = "KHR_mesh_quantization";

/// A mesh in many places.
pub(super) const INSTANCES: &str = "EXT_mesh_gpu_instancing";

/// What is asked for instead of a compressed mesh.
pub(super) const UNCOMPRESSED: &str =
    "a mesh that is not compressed (export it without compression)";

/// Compressed meshes and buffers.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";
const COMPRESSION: [&str; 4] = [
    DRACO,
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_mesh_compression_meshopt",
];

/// Beginnings of the names of extensions that change no solid.
const LOOKS: [&str; 12] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "EXT_materials_",
    "ADOBE_materials_",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "KHR_audio",
];

/// Whether what an extension adds is read here.
pub(super) fn is_read(name: &str) -> bool {
    [QUANTIZED, INSTANCES].contains(&name)
}

/// Refuses a file that cannot be read without an extension that is not read here.
pub(super) fn check(file: &str, required: &[String]) -> Result<(), MeshError> {
    let looks = |name: &str| LOOKS.iter().any(|look| name.starts_with(look));
    let unknown = required.iter().find(|name| !is_read(name) && !looks(name));
    let Some(name) = unknown else { return Ok(()) };
    let expected = match COMPRESSION.contains(&name.as_str()) {
        true => UNCOMPRESSED.to_owned(),
        false => format!("no other extension that changes solids than {QUANTIZED} and {INSTANCES}"),
    };
    Err(syntax(file, "extensionsRequired", expected, name))
}
