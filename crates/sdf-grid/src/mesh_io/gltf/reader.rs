//! From nodes to solids.

use glam::{DMat4, DQuat, DVec3};
use gltf::accessor::DataType;
use gltf::mesh::{Mode, Semantic};
use gltf::{Accessor, Document, Mesh, Node, Primitive};

use super::accessor::Numbers;
use super::extensions::{INSTANCES, QUANTIZED};
use crate::mesh::error::MeshError;
use crate::mesh_io::soup::{Soup, syntax};
use crate::mesh_io::unit::LengthUnit;

/// Nodes below one another; deeper trees are refused.
const DEEPEST: usize = 1000;

/// Kinds of numbers that coordinates may be.
const EXACT: [DataType; 1] = [DataType::F32];
const COARSE: [DataType; 5] = [
    DataType::F32,
    DataType::I8,
    DataType::U8,
    DataType::I16,
    DataType::U16,
];

pub(super) struct GltfReader<'a> {
    document: &'a Document,
    numbers: Numbers<'a>,
    soup: Soup,
    /// Nodes seen: each may be placed once only.
    visited: Vec<bool>,
    /// Kinds of numbers that positions may be.
    positions: &'static [DataType],
}

impl<'a> GltfReader<'a> {
    pub(super) fn new(document: &'a Document, numbers: Numbers<'a>) -> Self {
        let quantized = document.extensions_used().any(|name| name == QUANTIZED);
        Self {
            document,
            numbers,
            soup: Soup {
                unit: Some(LengthUnit::M),
                ..Soup::default()
            },
            visited: vec![false; document.nodes().len()],
            positions: if quantized { &COARSE } else { &EXACT },
        }
    }

    pub(super) fn finish(mut self) -> Soup {
        let left = self.visited.iter().filter(|seen| !**seen).count();
        self.soup.ignore("node", "it is not in the scene", left);
        self.soup
    }

    /// Adds the meshes of a node and of those below it.
    pub(super) fn place(
        &mut self,
        node: &Node<'_>,
        above: DMat4,
        depth: usize,
    ) -> Result<(), MeshError> {
        let (file, place) = (self.numbers.file, format!("node {}", node.index()));
        if std::mem::replace(&mut self.visited[node.index()], true) {
            return Err(syntax(file, place, "one place in the tree", "several"));
        }
        if depth > DEEPEST {
            let expected = format!("at most {DEEPEST} nodes above it");
            return Err(syntax(file, place, expected, "more"));
        }
        let columns = node.transform().matrix().map(|c| c.map(f64::from));
        let transform = above * DMat4::from_cols_array_2d(&columns);
        if let Some(mesh) = node.mesh() {
            let instances = self.instances(node, &place)?;
            if instances.len() > 1 || node.extension_value(INSTANCES).is_some() {
                self.soup.read("instance", instances.len());
            }
            for instance in instances {
                self.add_solid(node, &mesh, transform * instance)?;
            }
        }
        node.children()
            .try_for_each(|child| self.place(&child, transform, depth + 1))
    }

    /// Where a node's mesh is in its frame: once, unless the node lists instances.
    fn instances(&mut self, node: &Node<'_>, place: &str) -> Result<Vec<DMat4>, MeshError> {
        let Some(extension) = node.extension_value(INSTANCES) else {
            return Ok(vec![DMat4::IDENTITY]);
        };
        let place = format!("{place}, {INSTANCES}");
        let file = self.numbers.file;
        let attributes = extension.get("attributes").and_then(|a| a.as_object());
        let mut count = None;
        let mut find = |name: &str| -> Result<Option<Accessor<'a>>, MeshError> {
            let Some(index) = attributes.and_then(|a| a.get(name)) else {
                return Ok(None);
            };
            let index = index.as_u64().and_then(|i| usize::try_from(i).ok());
            let accessor = index.and_then(|i| self.document.accessors().nth(i));
            let Some(accessor) = accessor else {
                return Err(syntax(
                    file,
                    &place,
                    format!("an accessor as {name}"),
                    "none",
                ));
            };
            let expected = *count.get_or_insert(accessor.count());
            if accessor.count() != expected {
                let expected = format!("{expected} values of {name}");
                let found = accessor.count().to_string();
                return Err(syntax(file, &place, expected, found));
            }
            Ok(Some(accessor))
        };
        let (at, turned, sized) = (find("TRANSLATION")?, find("ROTATION")?, find("SCALE")?);
        let count = count.unwrap_or(0);
        self.soup.check_room(file, count)?;
        let turns = [DataType::F32, DataType::I8, DataType::I16];
        let at = at.map(|a| self.numbers.vectors::<3>(&a, &EXACT, &place));
        let turned = turned.map(|a| self.numbers.vectors::<4>(&a, &turns, &place));
        let sized = sized.map(|a| self.numbers.vectors::<3>(&a, &EXACT, &place));
        let (at, turned, sized) = (at.transpose()?, turned.transpose()?, sized.transpose()?);
        let instance = |i: usize| {
            let at = at.as_ref().map_or(DVec3::ZERO, |v| DVec3::from_array(v[i]));
            let turn = turned.as_ref().map_or(DQuat::IDENTITY, |v| {
                let length = v[i].iter().map(|x| x * x).sum::<f64>().sqrt();
                DQuat::from_array(v[i].map(|x| x / length))
            });
            let size = sized
                .as_ref()
                .map_or(DVec3::ONE, |v| DVec3::from_array(v[i]));
            DMat4::from_scale_rotation_translation(size, turn, at)
        };
        Ok((0..count).map(instance).collect())
    }

    fn add_solid(
        &mut self,
        node: &Node<'_>,
        mesh: &Mesh<'_>,
        transform: DMat4,
    ) -> Result<(), MeshError> {
        let name = node.name().or(mesh.name()).unwrap_or_default();
        let solid = self.soup.begin_solid(name);
        self.soup.read("mesh", 1);
        for primitive in mesh.primitives() {
            let place = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
            self.add(&primitive, transform, &place)?;
        }
        let mut lose = |item: &str, reason: &str| {
            let place = format!("node {} {name:?}", node.index());
            self.soup.lose(Some(solid..solid + 1), place, item, reason);
        };
        if node.skin().is_some() {
            lose("a skin", "joints move the vertices");
        }
        let weights = node.weights().or(mesh.weights()).unwrap_or_default();
        if weights.iter().any(|w| *w != 0.0) {
            lose("morph targets with weights", "they move the vertices");
        } else {
            let targets = mesh.primitives().map(|p| p.morph_targets().count()).sum();
            self.soup
                .ignore("morph target", "its weight is zero", targets);
        }
        Ok(())
    }

    /// Adds a primitive; points and lines say nothing about the solid.
    fn add(
        &mut self,
        primitive: &Primitive<'_>,
        transform: DMat4,
        place: &str,
    ) -> Result<(), MeshError> {
        let file = self.numbers.file;
        let mode = primitive.mode();
        if !matches!(
            mode,
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            let item = format!("primitive of {mode:?}");
            self.soup.ignore(&item, "it encloses no volume", 1);
            return Ok(());
        }
        for (semantic, _) in primitive.attributes() {
            if semantic != Semantic::Positions {
                let item = format!("attribute {}", semantic.to_string());
                let reason = "it does not say where the surface is";
                self.soup.ignore(&item, reason, 1);
            }
        }
        let positions = primitive
            .get(&Semantic::Positions)
            .ok_or_else(|| syntax(file, place, "positions", "none"))?;
        self.soup.check_room(file, positions.count())?;
        let (first, count) = (self.soup.vertices.len() as u32, positions.count());
        let found = self
            .numbers
            .vectors::<3>(&positions, self.positions, place)?;
        let placed = found
            .into_iter()
            .map(|p| transform.transform_point3(p.into()));
        self.soup.vertices.extend(placed);
        let indices = match primitive.indices() {
            Some(accessor) => self.numbers.indices(&accessor, count, place)?,
            None => (0..count as u32).collect(),
        };
        let mirrored = transform.determinant() < 0.0;
        let before = self.soup.triangles.len();
        for corners in triangles(mode, &indices) {
            let [a, b, c] = corners.map(|i| first + i);
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            self.soup.triangles.push(corners);
        }
        let added = self.soup.triangles.len() - before;
        self.soup.read("triangle", added);
        self.soup.check_room(file, added)
    }
}

/// The triangles of a primitive, all the same way round.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let strip = indices.windows(3).enumerate();
            let turned = |(i, w): (usize, &[u32])| match i % 2 {
                0 => [w[0], w[1], w[2]],
                _ => [w[1], w[0], w[2]],
            };
            strip.map(turned).collect()
        }
        Mode::TriangleFan => {
            let rim = indices.windows(2).skip(1);
            rim.map(|w| [indices[0], w[0], w[1]]).collect()
        }
        _ => indices.as_chunks().0.to_vec(),
    }
}
