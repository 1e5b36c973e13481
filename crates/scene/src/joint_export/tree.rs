//! What is written: parts in a tree, each with its joint to the part that it hangs from.

use std::collections::BTreeSet;
use std::path::PathBuf;

use fft_correlate::Pose;
use fft_correlate::mating::Joint;
use sdf_grid::TriangleMesh;

use super::motion::Series;
use super::pair::DockedPair;
use crate::solids::write::{file_name, unique_name};

/// A part of a tree.
///
/// See the example of [`PartTree`].
#[derive(Debug, Clone)]
pub struct JointedPart<'a> {
    /// What its link or body is called; parts of one name are numbered.
    pub name: String,
    /// In its own frame, metres.
    pub mesh: &'a TriangleMesh,
    /// The part that it hangs from, which stands before it; none if it stays where it is.
    pub parent: Option<usize>,
    /// From its own frame to its parent's own frame; without a parent to the scene.
    pub pose: Pose,
    /// The joint to its parent at that pose, parent's own frame; of no meaning without one.
    pub joint: Joint,
}

/// Parts that hang from each other by joints.
///
/// ```
/// use fft_correlate::{Pose, mating::{Joint, JointKind}};
/// use glam::DVec3;
/// use pegfit_scene::{JointedPart, PartTree, write_tree_urdf};
/// use sdf_grid::shapes::PegInHole;
///
/// let (hole, peg) = PegInHole::Circular.pair(1e-4)?;
/// let joint = Joint { kind: JointKind::Cylindrical, axis: DVec3::Z, ..Joint::default() };
/// let part = |name: &str, mesh, parent| JointedPart {
///     name: name.into(),
///     mesh,
///     parent,
///     pose: Pose::IDENTITY,
///     joint: joint.clone(),
/// };
/// let parts = vec![part("hole", &hole, None), part("peg", &peg, Some(0))];
/// # let folder = tempfile::tempdir()?;
/// let file = folder.path().join("peg.urdf");
/// write_tree_urdf(&PartTree { name: "peg in hole", parts, kept: vec![] }, &file)?;
/// let text = std::fs::read_to_string(&file)?;
/// assert!(text.contains("<link name=\"hole\">") && text.contains("type=\"prismatic\""));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PartTree<'a> {
    /// What the whole is called.
    pub name: &'a str,
    /// Parents before what hangs from them.
    pub parts: Vec<JointedPart<'a>>,
    /// Files that meshes written beside a description must not replace.
    pub kept: Vec<PathBuf>,
}

/// A description in the making.
pub(super) struct Model<'a> {
    pub(super) name: String,
    /// The link that is the scene.
    pub(super) root: String,
    pub(super) links: Vec<Link<'a>>,
    pub(super) kept: &'a [PathBuf],
    /// What is said of joint positions of zero.
    pub(super) at_zero: &'static str,
}

/// A part as link or body.
pub(super) struct Link<'a> {
    pub(super) label: String,
    /// What the names of its joints begin with.
    joints: String,
    /// What its mesh file is called after that of the description.
    pub(super) file: String,
    pub(super) mesh: &'a TriangleMesh,
    pub(super) parent: Option<usize>,
    pub(super) pose: Pose,
    pub(super) joint: &'a Joint,
    /// Its joint as motions in series.
    pub(super) series: Series,
}

impl Link<'_> {
    /// The name of one of its joints, or of a link between them.
    pub(super) fn labelled(&self, what: &str) -> String {
        format!("{}-{what}", self.joints)
    }
}

impl<'a> From<&'a DockedPair<'a>> for Model<'a> {
    fn from(pair: &'a DockedPair<'a>) -> Self {
        let name = label(pair.name);
        let link = |what: &str, mesh, parent, pose, series| Link {
            label: format!("{name}-{what}"),
            joints: name.clone(),
            file: what.to_owned(),
            mesh,
            parent,
            pose,
            joint: pair.joint,
            series,
        };
        let reach = reach([pair.fixed, pair.moving]);
        let series = Series::new(pair.joint, &pair.pose, reach);
        Self {
            links: vec![
                link("fixed", pair.fixed, None, pair.placed, Series::default()),
                link("moving", pair.moving, Some(0), pair.pose, series),
            ],
            root: format!("{name}-root"),
            name,
            kept: &pair.kept,
            at_zero: "At joint positions of zero the moving part lies where it docked.",
        }
    }
}

impl<'a> From<&'a PartTree<'a>> for Model<'a> {
    fn from(tree: &'a PartTree<'a>) -> Self {
        let name = label(tree.name);
        let root = format!("{name}-root");
        let (mut labels, mut files) = (BTreeSet::from([root.clone()]), BTreeSet::new());
        let link = |(i, part): (usize, &'a JointedPart<'a>)| {
            // A part that stands before its parent would make a circle.
            let parent = part.parent.filter(|p| *p < i);
            let label = unique_name(&mut labels, &label(&part.name));
            let series = parent.map(|p| {
                let reach = reach([tree.parts[p].mesh, part.mesh]);
                Series::new(&part.joint, &part.pose, reach)
            });
            Link {
                joints: label.clone(),
                file: file_name(&mut files, &part.name),
                label,
                mesh: part.mesh,
                parent,
                pose: part.pose,
                joint: &part.joint,
                series: series.unwrap_or_default(),
            }
        };
        Self {
            links: tree.parts.iter().enumerate().map(link).collect(),
            name,
            root,
            kept: &tree.kept,
            at_zero: "At joint positions of zero all parts lie as they are assembled.",
        }
    }
}

/// A name without characters that XML cannot hold.
fn label(name: &str) -> String {
    let kept = |c: char| match c {
        '\t' | '\n' | '\r' => ' ',
        c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '_',
        c => c,
    };
    name.chars().map(kept).collect()
}

/// More than any displacement along which two parts touch, metres.
fn reach(parts: [&TriangleMesh; 2]) -> f64 {
    parts.iter().map(|mesh| mesh.bounds().diagonal()).sum()
}
