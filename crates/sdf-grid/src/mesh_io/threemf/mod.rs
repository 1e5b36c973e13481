//! 3MF: a zip archive with XML models in it.
//!
//! Read through the `zip` and `quick-xml` crates in one pass over each model, because the 3MF
//! crates there are build the whole document in memory first, or keep coordinates in single
//! precision. Meshes, components, build items and the production extension's parts in other files
//! are read; materials, slices, beams and everything else that is not a boundary is skipped.

mod model;
mod package;

use std::collections::HashMap;
use std::rc::Rc;

use glam::DMat4;

use super::soup::{Soup, syntax};
use crate::mesh::error::MeshError;
use model::{Kind, Model, Placed};
use package::Package;

/// Most objects placed, counting each as often as it is placed: components of components can
/// multiply them beyond any bound.
const MOST_PLACED: usize = 1_000_000;

/// Components within components; deeper nesting, or an object that holds itself, is refused.
const DEEPEST: usize = 100;

/// Reads every item that the file asks to build; each is a solid, named after its object.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut package = Package::open(file, bytes)?;
    let root = package.root()?;
    let mut unfolding = Unfolding {
        file,
        models: HashMap::new(),
        soup: Soup::default(),
        placed: 0,
        package,
    };
    let model = unfolding.model(&root)?;
    unfolding.soup.unit = Some(model.unit);
    for item in &model.items {
        let path = item.path.as_deref().unwrap_or(&root);
        let name = match unfolding.model(path)?.objects.get(&item.object) {
            Some(object) if object.solid => object.name.clone(),
            // Support structures and the like are no part of the solid.
            Some(_) => continue,
            None => String::new(),
        };
        unfolding.soup.begin_solid(&name);
        unfolding.place(path, item, DMat4::IDENTITY, 0)?;
    }
    Ok(unfolding.soup)
}

/// From objects that refer to one another to a soup.
struct Unfolding<'a> {
    file: &'a str,
    package: Package<'a>,
    /// The models read so far, by their path in the archive.
    models: HashMap<String, Rc<Model>>,
    soup: Soup,
    placed: usize,
}

impl Unfolding<'_> {
    fn model(&mut self, path: &str) -> Result<Rc<Model>, MeshError> {
        if let Some(model) = self.models.get(path) {
            return Ok(Rc::clone(model));
        }
        let model = Rc::new(model::parse(self.file, path, self.package.read(path)?)?);
        self.models.insert(path.to_owned(), Rc::clone(&model));
        Ok(model)
    }

    /// Adds an object and what it is made of.
    fn place(
        &mut self,
        path: &str,
        what: &Placed,
        above: DMat4,
        depth: usize,
    ) -> Result<(), MeshError> {
        let place = || format!("{path}, object {}", what.object);
        self.placed += 1;
        if self.placed > MOST_PLACED || depth > DEEPEST {
            let expected = format!("at most {DEEPEST} levels and {MOST_PLACED} objects placed");
            return Err(syntax(self.file, place(), expected, "more"));
        }
        let model = self.model(path)?;
        let Some(object) = model.objects.get(&what.object) else {
            return Err(syntax(self.file, place(), "an object of that id", "none"));
        };
        let transform = above * what.transform;
        match &object.kind {
            Kind::Mesh {
                vertices,
                triangles,
            } => {
                self.soup
                    .check_room(self.file, vertices.len().max(triangles.len()))?;
                let first = self.soup.vertices.len() as u32;
                let moved = vertices.iter().map(|&v| transform.transform_point3(v));
                self.soup.vertices.extend(moved);
                let mirrored = transform.determinant() < 0.0;
                let named = triangles.iter().map(|t| {
                    let [a, b, c] = t.map(|v| first + v);
                    if mirrored { [a, c, b] } else { [a, b, c] }
                });
                self.soup.triangles.extend(named);
                Ok(())
            }
            Kind::Components(components) => components.iter().try_for_each(|component| {
                let path = component.path.as_deref().unwrap_or(path);
                self.place(path, component, transform, depth + 1)
            }),
        }
    }
}
