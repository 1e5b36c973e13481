//! Writes `fixtures/`: the paper's three peg-in-hole pairs as OBJ in metres, and a README with the
//! origin and hash of each. Run from the repository root:
//! `cargo run -p sdf-grid --example make_fixtures`.

use std::error::Error;
use std::fmt::Write;
use std::path::Path;

use sdf_grid::shapes::PegInHole;
use sdf_grid::{TriangleMesh, mesh_io};

const INTRODUCTION: &str = "\
# Fixtures

Small meshes for tests and examples. All are made by
`cargo run -p sdf-grid --example make_fixtures` from `sdf_grid::shapes`; nothing here comes from
elsewhere. Lengths are metres; the identity is the assembled pose of each hole and peg.

| file | what | triangles | volume (mm³) | BLAKE3 of the file |
|---|---|---|---|---|
";

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new("fixtures");
    std::fs::create_dir_all(folder)?;
    let mut readme = INTRODUCTION.to_owned();
    for pair in PegInHole::ALL {
        let (hole, peg) = pair.pair(0.0)?;
        let hole_text = format!(
            "block 40 x 40 x 30 mm with a {} through hole, zero clearance",
            pair.name()
        );
        let peg_text = format!("{} peg, 30 mm long", pair.name());
        for (mesh, part, what) in [(hole, "hole", hole_text), (peg, "peg", peg_text)] {
            let name = format!("{}_{part}.obj", pair.name());
            add(&mut readme, folder, &name, &what, &mesh)?;
        }
    }
    std::fs::write(folder.join("README.md"), readme)?;
    Ok(())
}

fn add(
    readme: &mut String,
    folder: &Path,
    name: &str,
    what: &str,
    mesh: &TriangleMesh,
) -> Result<(), Box<dyn Error>> {
    let path = folder.join(name);
    mesh_io::write_obj(&path, mesh)?;
    let hash = blake3::hash(&std::fs::read(&path)?);
    let volume = 1e9 * mesh.volume();
    let triangles = mesh.triangles().len();
    writeln!(
        readme,
        "| {name} | {what} | {triangles} | {volume:.3} | {hash} |"
    )?;
    Ok(())
}
