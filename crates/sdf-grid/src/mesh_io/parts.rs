//! Which triangles of a file are a solid of their own.
//!
//! Files divide surfaces for other reasons than that they are parts: by material, by smoothing, by
//! the condition that a simulation sets on a face. Only what is closed by itself is a part; what is
//! open belongs to what it meets.

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::ledger::LedgerKind;
use super::soup::Soup;
use crate::mesh::aabb::Aabb;
use crate::mesh::measure::{face_area, volume, winding_number};
use crate::mesh::topology::{DisjointSets, Edge, Topology};

/// Share of a surface that may be missing of a part, as repair accepts.
const OPEN: f64 = 0.1;

/// Share of the area of a file that may lie in open scraps beside its closed bodies.
const SCRAPS: f64 = 0.01;

/// Below this fraction of area times diagonal a surface encloses nothing.
const FLAT: f64 = 1e-9;

/// Files with more bodies are read as one solid.
const MOST_BODIES: usize = 4096;

/// Limit of face visits, per face of the file, in finding which body lies in which.
const MOST_LOOKS: usize = 64;

/// Names that a joined part shows.
const MOST_NAMES: usize = 3;

/// Joins the solids of a file that are no parts by themselves, called `item` in the ledger: open
/// ones whose open edges meet, other open ones all together, and cavities with what is around them.
pub(super) fn join_open(soup: &mut Soup, item: &str) {
    if soup.solids().len() < 2 {
        return;
    }
    let (corners, count) = welded(soup);
    let topology = Topology::new(&corners, count);
    let of = soup.solid_of_each();
    let mut surfaces = PartBuilder::new(soup, &topology, of, soup.names.len());
    surfaces.join_meeting();
    surfaces.join_torn();
    surfaces.join_hollows(|part| part.volume < 0.0);
    let names = soup.names.clone();
    let (of, roots) = surfaces.finish();
    let joined = names.len() - roots.len();
    let reason = "it is not closed by itself: taken together with what it meets";
    soup.ledger
        .add_many(LedgerKind::Assumed, item, reason, joined as u64);
    if of.windows(2).all(|pair| pair[0] == pair[1]) {
        return soup.unite();
    }
    if joined > 0 {
        let called = |members: &Vec<usize>| {
            let shown = members.iter().take(MOST_NAMES);
            let shown: Vec<&str> = shown.map(|&m| names[m].as_str()).collect();
            let more = if members.len() > MOST_NAMES {
                " + ..."
            } else {
                ""
            };
            shown.join(" + ") + more
        };
        soup.divide(roots.iter().map(called).collect(), &of);
    }
}

/// Joins solids of the same name if one of them is open: the file continues a solid that it began
/// before. Closed solids of the same name are copies of a part.
pub(super) fn join_namesakes(soup: &mut Soup) {
    let names = soup.names.clone();
    let mut first: FxHashMap<&str, usize> = FxHashMap::default();
    for (i, name) in names.iter().enumerate() {
        first.entry(name).or_insert(i);
    }
    if first.len() == names.len() {
        return;
    }
    let (corners, count) = welded(soup);
    let topology = Topology::new(&corners, count);
    let of = soup.solid_of_each();
    let mut surfaces = PartBuilder::new(soup, &topology, of, names.len());
    let open: Vec<&str> = (surfaces.parts().iter())
        .filter(|part| part.open)
        .map(|part| names[part.members[0]].as_str())
        .collect();
    for (i, name) in names.iter().enumerate() {
        if open.contains(&name.as_str()) {
            surfaces.join(first[name.as_str()], i);
        }
    }
    let (of, roots) = surfaces.finish();
    let called = |members: &Vec<usize>| members.first().map_or("", |&m| &names[m]).to_owned();
    soup.divide(roots.iter().map(called).collect(), &of);
}

/// Makes a solid of each body of a file that names none, if it has several closed ones.
pub(super) fn divide_bodies(soup: &mut Soup) {
    let solids = soup.solids();
    if solids.len() > 1 {
        return;
    }
    let (corners, count) = welded(soup);
    let topology = Topology::new(&corners, count);
    let (of, count) = topology.components();
    if !(2..=MOST_BODIES).contains(&count) {
        return;
    }
    let mut surfaces = PartBuilder::new(soup, &topology, of, count);
    surfaces.join_meeting();
    if !surfaces.join_scraps() || !surfaces.join_hollows(|_| true) {
        return;
    }
    let (of, roots) = surfaces.finish();
    let bodies = roots.len();
    if bodies < 2 {
        return;
    }
    let reason = "each closed body is one, as the file tells none apart";
    soup.ledger
        .add_many(LedgerKind::Assumed, "solid", reason, bodies as u64);
    let called = |i: usize| match solids.first() {
        Some(solid) if !solid.name.is_empty() => format!("{}/{}", solid.name, i + 1),
        _ => String::new(),
    };
    soup.divide((0..bodies).map(called).collect(), &of);
}

/// The corners of each triangle, those at one position under one number, and the count of numbers.
fn welded(soup: &Soup) -> (Vec<[u32; 3]>, usize) {
    let mut known: FxHashMap<[u64; 3], u32> = FxHashMap::default();
    let of_vertex: Vec<u32> = (0..)
        .zip(&soup.vertices)
        .map(|(i, v)| {
            *known
                .entry((*v + 0.0).to_array().map(f64::to_bits))
                .or_insert(i)
        })
        .collect();
    // A corner without a vertex meets nothing; repair refuses it.
    let mut count = soup.vertices.len() as u32;
    let mut at = |v: u32| {
        of_vertex.get(v as usize).copied().unwrap_or_else(|| {
            count += 1;
            count - 1
        })
    };
    let corners = soup.triangles.iter().map(|t| t.map(&mut at)).collect();
    (corners, count as usize)
}

/// Pieces of surface that are being joined to parts.
struct PartBuilder<'a> {
    soup: &'a Soup,
    /// Adjacency of its triangles, vertices at one position taken as one.
    topology: &'a Topology<'a>,
    /// The piece of each triangle.
    of: Vec<usize>,
    sets: DisjointSets,
    pieces: usize,
}

/// Pieces that were joined.
struct Part {
    members: Vec<usize>,
    triangles: Vec<[u32; 3]>,
    bounds: Aabb,
    area: f64,
    /// Signed.
    volume: f64,
    /// An edge of it is used more in one direction than in the other.
    open: bool,
    /// Sum of its area vectors over its area: of a surface with one hole, that hole's share.
    missing: f64,
}

impl<'a> PartBuilder<'a> {
    fn new(soup: &'a Soup, topology: &'a Topology<'a>, of: Vec<usize>, pieces: usize) -> Self {
        Self {
            soup,
            topology,
            of,
            sets: DisjointSets::new(pieces),
            pieces,
        }
    }

    fn join(&mut self, a: usize, b: usize) {
        self.sets.join(a, b);
    }

    /// At an edge, each set of pieces that uses it more in one direction than in the other.
    fn open_at(&mut self, edge: &Edge<'_>) -> Vec<usize> {
        let mut net: Vec<(usize, i32)> = Vec::new();
        for half in edge.half_edges() {
            let set = self.sets.root(self.of[half.face()]);
            let [from, to] = self.topology.ends(*half);
            let step = if from < to { 1 } else { -1 };
            match net.iter_mut().find(|n| n.0 == set) {
                Some(found) => found.1 += step,
                None => net.push((set, step)),
            }
        }
        let open = net.into_iter().filter(|n| n.1 != 0);
        open.map(|n| n.0).collect()
    }

    /// Joins pieces that are open at the same edge.
    fn join_meeting(&mut self) {
        for edge in self.topology.edges() {
            let open = self.open_at(&edge);
            for pair in open.windows(2) {
                self.sets.join(pair[0], pair[1]);
            }
        }
    }

    /// Joins everything that is open if some of it is too open to be a part.
    fn join_torn(&mut self) {
        let parts = self.parts();
        let open: Vec<&Part> = parts.iter().filter(|part| part.open).collect();
        if open
            .iter()
            .any(|part| part.missing > OPEN || part.volume == 0.0)
        {
            for pair in open.windows(2) {
                self.sets.join(pair[0].members[0], pair[1].members[0]);
            }
        }
    }

    /// Joins open or flat scraps with the largest body; false if they are too much for that.
    fn join_scraps(&mut self) -> bool {
        let parts = self.parts();
        let scrap = |part: &&Part| part.open || part.volume == 0.0;
        let area = |part: &Part| part.area;
        let scraps: f64 = parts.iter().filter(scrap).map(area).sum();
        let all: f64 = parts.iter().map(area).sum();
        let largest = parts
            .iter()
            .filter(|part| !scrap(part))
            .max_by(|a, b| a.volume.abs().total_cmp(&b.volume.abs()));
        let Some(largest) = largest.filter(|_| scraps <= SCRAPS * all) else {
            return false;
        };
        for part in parts.iter().filter(scrap) {
            self.sets.join(part.members[0], largest.members[0]);
        }
        true
    }

    /// Joins closed shells that are chosen and lie within an odd number of others with the smallest
    /// of these; false if telling takes too long.
    fn join_hollows(&mut self, chosen: impl Fn(&Part) -> bool) -> bool {
        let parts = self.parts();
        let mut budget = MOST_LOOKS * self.of.len();
        let mut pairs = Vec::new();
        for (i, inner) in parts.iter().enumerate() {
            if inner.open || inner.volume == 0.0 || !chosen(inner) {
                continue;
            }
            let mut around: Vec<&Part> = Vec::new();
            for (k, outer) in parts.iter().enumerate() {
                let larger = outer.volume.abs() > inner.volume.abs();
                if k == i || outer.open || !larger || !outer.holds(inner) {
                    continue;
                }
                let Some(left) = budget.checked_sub(outer.triangles.len()) else {
                    return false;
                };
                budget = left;
                if outer.surrounds(self.soup, inner) {
                    around.push(outer);
                }
            }
            let tightest = (around.iter()).min_by(|a, b| {
                let size = |part: &Part| part.volume.abs();
                size(a).total_cmp(&size(b))
            });
            if let Some(outer) = tightest.filter(|_| around.len() % 2 == 1) {
                pairs.push((inner.members[0], outer.members[0]));
            }
        }
        for (a, b) in pairs {
            self.sets.join(a, b);
        }
        true
    }

    /// The joined pieces so far, those without triangles left out.
    fn parts(&mut self) -> Vec<Part> {
        let mut triangles: FxHashMap<usize, Vec<[u32; 3]>> = FxHashMap::default();
        for (t, &piece) in self.of.iter().enumerate() {
            let root = self.sets.root(piece);
            let named = self.soup.triangles[t];
            // A corner without a vertex is refused by repair.
            if named
                .iter()
                .all(|&v| (v as usize) < self.soup.vertices.len())
            {
                triangles.entry(root).or_default().push(named);
            }
        }
        let mut open = vec![false; self.pieces];
        for edge in self.topology.edges() {
            for set in self.open_at(&edge) {
                open[set] = true;
            }
        }
        let mut members: FxHashMap<usize, Vec<usize>> = FxHashMap::default();
        for piece in 0..self.pieces {
            members
                .entry(self.sets.root(piece))
                .or_default()
                .push(piece);
        }
        let mut roots: Vec<usize> = triangles.keys().copied().collect();
        roots.sort_unstable();
        let joined = roots.into_iter().map(|root| {
            let triangles = triangles.remove(&root).unwrap_or_default();
            let members = members.remove(&root).unwrap_or_default();
            Part::new(self.soup, members, triangles, open[root])
        });
        joined.collect()
    }

    /// The part of each triangle and the pieces of each part.
    fn finish(self) -> (Vec<usize>, Vec<Vec<usize>>) {
        let (set_of, members) = self.sets.numbered();
        (
            self.of.iter().map(|&piece| set_of[piece]).collect(),
            members,
        )
    }
}

impl Part {
    fn new(soup: &Soup, members: Vec<usize>, triangles: Vec<[u32; 3]>, open: bool) -> Self {
        let corners = |t: &[u32; 3]| t.map(|v| soup.vertices[v as usize]);
        let bounds = Aabb::around(triangles.iter().flat_map(corners));
        let area: f64 = triangles.iter().map(|t| face_area(corners(t))).sum();
        let vectors = triangles.iter().map(corners);
        let net: DVec3 = vectors.map(|[a, b, c]| (b - a).cross(c - a) / 2.0).sum();
        let enclosed = volume(&soup.vertices, &triangles);
        let flat = enclosed.abs() <= FLAT * area * bounds.diagonal();
        Self {
            members,
            triangles,
            area,
            volume: if flat { 0.0 } else { enclosed },
            bounds,
            open,
            missing: net.length() / area.max(f64::MIN_POSITIVE),
        }
    }

    /// Whether another part lies in the box around this one.
    fn holds(&self, inner: &Self) -> bool {
        self.bounds.contains(inner.bounds.min) && self.bounds.contains(inner.bounds.max)
    }

    /// Whether another part lies in this one: whether the middle of its first face does.
    fn surrounds(&self, soup: &Soup, inner: &Self) -> bool {
        let corners = |t: &[u32; 3]| t.map(|v| soup.vertices[v as usize]);
        let [a, b, c] = corners(&inner.triangles[0]);
        let point = (a + b + c) / 3.0;
        winding_number(self.triangles.iter().map(corners), point).abs() > 0.5
    }
}
