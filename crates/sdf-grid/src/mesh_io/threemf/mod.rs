//! 3MF: a zip archive with XML models in it.
//!
//! Read through the `zip` and `quick-xml` crates in one pass over each model, because the 3MF
//! crates there are build the whole document in memory first, or keep coordinates in single
//! precision. Meshes, components, build items, the production extension's parts in other files and
//! slicers' settings of parts are read; materials and everything else that is no boundary is listed.

mod package;
mod slicer;

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::rc::Rc;

use glam::DMat4;

use self::package::{Kind, Model, Object, Package, Placement};
use self::slicer::{Part, Purpose};
use crate::mesh::error::MeshError;
use crate::mesh_io::ledger::LedgerKind;
use crate::mesh_io::soup::{Soup, syntax};
use crate::mesh_io::unit::LengthUnit;
use crate::text::quoted;

/// Reads every item that the file asks to build. An item of one mesh is a solid, named after its
/// object; of several, each is, named after the item's object and its own: `box/lid`.
pub(super) fn parse(file: &str, bytes: &[u8]) -> Result<Soup, MeshError> {
    let mut package = Package::open(file, bytes)?;
    let root = package.root()?;
    let slicer = slicer::read(file, &mut package)?;
    ItemReader::new(file, package, root, slicer).run()
}

/// Most objects placed, counting each as often as it is placed: components of components can
/// multiply them beyond any bound.
const MOST_PLACED: usize = 1_000_000;

/// Components within components; deeper nesting, or an object that holds itself, is refused.
const DEEPEST: usize = 100;

/// Most solids of one item; an item of more is one solid.
const MOST_SOLIDS: usize = 4096;

/// Where something is placed.
struct Frame {
    /// To the item's frame, in the root's unit.
    transform: DMat4,
    /// Of the model that places it, in the root's unit.
    unit: f64,
    depth: usize,
    /// The slicer's settings for it.
    part: Option<Part>,
}

/// A mesh of an item and where it is put.
struct Leaf {
    model: Rc<Model>,
    path: Rc<str>,
    object: u32,
    /// To the item's frame, in the root's unit.
    transform: DMat4,
    /// Of the model's unit, in the root's unit.
    unit: f64,
    /// The slicer's settings for the component.
    part: Option<Part>,
}

/// Unfolds the items of a build, whose objects refer to one another, into a soup.
struct ItemReader<'a> {
    file: &'a str,
    package: Package<'a>,
    root: Rc<str>,
    slicer: slicer::Objects,
    /// Unit of the root model.
    unit: LengthUnit,
    /// The models read so far, by their path in the archive.
    models: HashMap<Rc<str>, Rc<Model>>,
    /// Objects that are part of what is built.
    built: HashSet<(Rc<str>, u32)>,
    soup: Soup,
    placed: usize,
}

impl<'a> ItemReader<'a> {
    fn new(file: &'a str, package: Package<'a>, root: String, slicer: slicer::Objects) -> Self {
        Self {
            file,
            package,
            root: root.trim_start_matches('/').into(),
            slicer,
            unit: LengthUnit::default(),
            models: HashMap::new(),
            built: HashSet::new(),
            soup: Soup::default(),
            placed: 0,
        }
    }

    fn run(mut self) -> Result<Soup, MeshError> {
        let root = Rc::clone(&self.root);
        let (path, model) = self.model(&root)?;
        self.unit = model.unit;
        self.soup.unit = Some(model.unit);
        for item in &model.items {
            let path = item.path.as_deref().map_or(Rc::clone(&path), Rc::from);
            let mut leaves = Vec::new();
            let begun = self.soup.names.len();
            let frame = Frame {
                transform: DMat4::IDENTITY,
                unit: 1.0,
                depth: 0,
                part: None,
            };
            let cuts = self.collect(&path, item, frame, &mut leaves)?;
            self.add(&path, item, leaves)?;
            let solids = begun..self.soup.names.len();
            for place in cuts {
                self.lose_cut(solids.clone(), &place);
            }
        }
        self.list(&model);
        Ok(self.soup)
    }

    /// A part that is cut out of solids.
    fn lose_cut(&mut self, solids: Range<usize>, place: &str) {
        let reason = "it is cut out of the other parts of its object";
        self.soup
            .record_loss(Some(solids), place, "a negative part", reason);
    }

    /// The model at a path, which may begin with a slash, and its path without.
    fn model(&mut self, path: &str) -> Result<(Rc<str>, Rc<Model>), MeshError> {
        let path: Rc<str> = path.trim_start_matches('/').into();
        if let Some(model) = self.models.get(&path) {
            return Ok((path, Rc::clone(model)));
        }
        let model = Rc::new(package::parse_model(
            self.file,
            &path,
            self.package.read(&path)?,
        )?);
        self.models.insert(Rc::clone(&path), Rc::clone(&model));
        if !model.unit_stated {
            let reason = format!("millimeter, as 3MF has it: {path} states none");
            self.soup.ledger.add(LedgerKind::Assumed, "unit", &reason);
        }
        self.soup.read(&format!("model in {}", model.unit), 1);
        for extension in &model.extensions {
            let place = format!("{path}, requiredextensions");
            let reason = "the file can only be read with this extension";
            self.soup.record_loss(None, place, extension, reason);
        }
        for resource in &model.resources {
            self.soup.ignore(resource, "it is no object", 1);
        }
        Ok((path, model))
    }

    /// One of a model's unit, in the root's.
    fn scale(&self, model: &Model) -> f64 {
        match model.unit == self.unit {
            true => 1.0,
            false => model.unit.in_metres() / self.unit.in_metres(),
        }
    }

    /// Finds the meshes of what is placed; returns where parts are that a slicer cuts out of it.
    fn collect(
        &mut self,
        path: &str,
        what: &Placement,
        frame: Frame,
        leaves: &mut Vec<Leaf>,
    ) -> Result<Vec<String>, MeshError> {
        let place = || format!("{path}, object {}", what.object);
        self.placed += 1;
        if self.placed > MOST_PLACED || frame.depth > DEEPEST {
            let expected = format!("at most {DEEPEST} levels and {MOST_PLACED} objects placed");
            return Err(syntax(self.file, place(), expected, "more"));
        }
        let (path, model) = self.model(path)?;
        let Some(object) = model.objects.get(&what.object) else {
            return Err(syntax(self.file, place(), "an object of that id", "none"));
        };
        self.built.insert((Rc::clone(&path), what.object));
        if let Some(reason) = object.left_out() {
            self.soup.ignore("object", &reason, 1);
            return Ok(Vec::new());
        }
        match frame.part.as_ref().map(|part| (part.purpose, &part.word)) {
            Some((Purpose::Negative, _)) => return Ok(vec![place()]),
            Some((Purpose::Setting, word)) => {
                self.ignore_setting(word);
                return Ok(Vec::new());
            }
            _ => {}
        }
        let transform = frame.transform * scaled(what.transform, frame.unit);
        let unit = self.scale(&model);
        let Kind::Components(components) = &object.kind else {
            leaves.push(Leaf {
                object: what.object,
                transform,
                unit,
                part: frame.part,
                path,
                model: Rc::clone(&model),
            });
            return Ok(Vec::new());
        };
        let mut cuts = Vec::new();
        for component in components {
            let slicer = self.slicer.get(&what.object).filter(|_| path == self.root);
            let below = Frame {
                transform,
                unit,
                depth: frame.depth + 1,
                part: slicer.and_then(|s| s.components.get(&component.object).cloned()),
            };
            let model = component.path.as_deref().unwrap_or(&path);
            cuts.extend(self.collect(model, component, below, leaves)?);
        }
        Ok(cuts)
    }

    fn ignore_setting(&mut self, word: &str) {
        let item = format!("part of type {word}");
        self.soup.ignore(&item, "it is a setting for printing", 1);
    }

    /// Adds the meshes of an item as solids.
    fn add(&mut self, path: &str, item: &Placement, leaves: Vec<Leaf>) -> Result<(), MeshError> {
        if leaves.is_empty() {
            return Ok(());
        }
        let (_, model) = self.model(path)?;
        let object = model.objects.get(&item.object);
        let name = object.map_or("", |object| object.name.as_str());
        self.soup.read("item", 1);
        self.soup.read("object", leaves.len());
        let (several, too_many) = (leaves.len() > 1, leaves.len() > MOST_SOLIDS);
        if too_many {
            let reason = format!("one solid, as it has more than {MOST_SOLIDS} meshes");
            self.soup.ledger.add(LedgerKind::Assumed, "item", &reason);
            self.soup.begin_solid(name);
        }
        for leaf in leaves {
            let object = &leaf.model.objects[&leaf.object];
            if !too_many {
                let named = leaf.part.as_ref().map(|part| part.name.as_str());
                let own = named.filter(|name| !name.is_empty());
                let own = own.unwrap_or(&object.name);
                let solid = match (name, own) {
                    (name, own) if several => joined(name, own, leaf.object),
                    ("", own) => own.to_owned(),
                    (name, _) => name.to_owned(),
                };
                self.soup.begin_solid(&solid);
            }
            self.add_leaf(&leaf, object)?;
        }
        Ok(())
    }

    /// Adds a mesh, to the solid that was begun last.
    fn add_leaf(&mut self, leaf: &Leaf, object: &Object) -> Result<(), MeshError> {
        let Kind::Mesh {
            vertices,
            triangles,
        } = &object.kind
        else {
            return Ok(());
        };
        let solid = self.soup.names.len().saturating_sub(1);
        let place = format!("{}, object {}", leaf.path, leaf.object);
        for element in &object.unread {
            let reason = "an element that makes the shape another one";
            self.soup
                .record_loss(Some(solid..solid + 1), &place, element, reason);
        }
        if let Some(part) = leaf.part.as_ref().filter(|p| p.purpose == Purpose::Unknown) {
            let item = format!("a part of type {}", quoted(&part.word));
            let reason = "what it is for is not known";
            self.soup
                .record_loss(Some(solid..solid + 1), &place, &item, reason);
        }
        let room = vertices.len().max(triangles.len());
        self.soup.check_room(self.file, room)?;
        let first = self.soup.vertices.len() as u32;
        let moved = vertices
            .iter()
            .map(|&v| leaf.transform.transform_point3(leaf.unit * v));
        self.soup.vertices.extend(moved);
        let mirrored = leaf.transform.determinant() < 0.0;
        let placed = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| first + v);
            if mirrored { [a, c, b] } else { [a, b, c] }
        };
        let slicer = self.slicer.get(&leaf.object);
        let runs = slicer.filter(|s| *leaf.path == *self.root && !s.runs.is_empty());
        let Some(runs) = runs.map(|s| s.runs.clone()) else {
            self.soup.triangles.extend(triangles.iter().map(placed));
            return Ok(());
        };
        let triangles: Vec<[u32; 3]> = triangles.iter().map(placed).collect();
        self.add_runs(&runs, &triangles, &place);
        Ok(())
    }

    /// Adds the triangles of one mesh that a slicer divides into parts. What is in no run is
    /// material.
    fn add_runs(&mut self, runs: &[(usize, usize, Part)], triangles: &[[u32; 3]], place: &str) {
        let base = self.soup.names.len().saturating_sub(1);
        let name = self.soup.names.get(base).cloned().unwrap_or_default();
        let mut material = vec![true; triangles.len()];
        let materials = runs.iter().filter(|r| r.2.purpose == Purpose::Material);
        let several = materials.count() > 1;
        let mut cuts = 0;
        for (i, (first, last, part)) in runs.iter().enumerate() {
            let end = triangles.len().min(last.saturating_add(1));
            let run = *first.min(&end)..end;
            material[run.clone()].fill(false);
            match part.purpose {
                Purpose::Material if several => {
                    let solid = joined(&name, &part.name, i as u32 + 1);
                    self.soup.begin_solid(&solid);
                    self.soup.triangles.extend(&triangles[run]);
                }
                Purpose::Material => self.soup.triangles.extend(&triangles[run]),
                Purpose::Negative => cuts += 1,
                Purpose::Setting => self.ignore_setting(&part.word),
                Purpose::Unknown => {
                    let item = format!("a part of type {}", quoted(&part.word));
                    let solids = base..self.soup.names.len();
                    let reason = "what it is for is not known";
                    self.soup.record_loss(Some(solids), place, &item, reason);
                }
            }
        }
        let rest = triangles.iter().zip(&material).filter(|(_, kept)| **kept);
        if rest.clone().next().is_some() {
            self.soup.resume_solid(base);
        }
        self.soup.triangles.extend(rest.map(|(t, _)| *t));
        for _ in 0..cuts {
            self.lose_cut(base..self.soup.names.len(), place);
        }
    }

    /// Counts the objects of the root model that nothing places.
    fn list(&mut self, root: &Model) {
        let built = |id: &&u32| !self.built.contains(&(Rc::clone(&self.root), **id));
        let left = root.objects.keys().filter(built).count();
        self.soup.ignore("object", "no item builds it", left);
    }
}

/// Name of a solid of an assembly.
fn joined(name: &str, own: &str, number: u32) -> String {
    match (name, own) {
        ("", "") => String::new(),
        ("", own) => own.to_owned(),
        (name, "") => format!("{name}/{number}"),
        (name, own) => format!("{name}/{own}"),
    }
}

/// A transform whose translation is in another unit.
fn scaled(transform: DMat4, unit: f64) -> DMat4 {
    let mut scaled = transform;
    scaled.w_axis = (unit * transform.w_axis.truncate()).extend(1.0);
    scaled
}
