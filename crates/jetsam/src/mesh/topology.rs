//! How the triangles of a mesh hang together: open and crowded edges, connected shells, faces and shells that are
//! turned the wrong way.
//!
//! In: welded triangles (corners at one place share an index). Out: a [`Topology`], and from it a [`MeshReport`].
//! Everything is linear in the number of triangles but the nesting of inverted shells.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Mesh;
use crate::voxelize::solid_angle;

/// What is wrong with a mesh, if anything.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshReport {
    /// Triangles of the file.
    pub triangles: usize,
    /// Triangles without area: two corners at one place.
    pub degenerate_triangles: usize,
    /// Whether every edge has an even number of triangles, so that inside and outside are told apart.
    pub watertight: bool,
    /// Edges with exactly one triangle: the rims of holes.
    pub boundary_edges: usize,
    /// Edges with more than two triangles.
    pub nonmanifold_edges: usize,
    /// Connected shells, across edges of exactly two triangles.
    pub shells: usize,
    /// Triangles turned against the majority of their shell.
    pub flipped_triangles: usize,
    /// Closed shells that are inside out, the walls of cavities not counted.
    pub flipped_shells: usize,
    /// Volume inside by the divergence theorem, as the faces are turned in the file.
    pub volume: f64,
    /// Total area.
    pub area: f64,
}

impl Mesh {
    /// Says what is wrong with the mesh. Corners at exactly one place count as one vertex. A mesh that fails
    /// [`Mesh::check`] may not be passed in.
    pub fn report(&self) -> MeshReport {
        let welded = weld(self.vertices.iter().map(|v| v.to_array().map(|x| (x + 0.0).to_bits() as i64)));
        let triangles = distinct(&self.triangles, &welded);
        let topology = Topology::new(&triangles, &self.vertices);
        MeshReport {
            triangles: self.triangles.len(),
            degenerate_triangles: self.triangles.len() - triangles.len(),
            watertight: topology.watertight,
            boundary_edges: topology.boundary_edges,
            nonmanifold_edges: topology.nonmanifold_edges,
            shells: topology.shells,
            flipped_triangles: topology.flipped_triangles,
            flipped_shells: topology.flipped_shells,
            volume: self.mass_properties().volume,
            area: self.area(),
        }
    }
}

/// For every key, the index of the first equal key.
pub(crate) fn weld(keys: impl ExactSizeIterator<Item = [i64; 3]>) -> Vec<u32> {
    let mut seen: HashMap<[i64; 3], u32, BuildHasherDefault<KeyHasher>> =
        HashMap::with_capacity_and_hasher(keys.len(), BuildHasherDefault::default());
    keys.zip(0..).map(|(key, index)| *seen.entry(key).or_insert(index)).collect()
}

/// A hash for vertex keys: multiply and fold; an attacker gains nothing but a slow load.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }
    fn write_u64(&mut self, v: u64) {
        let product = u128::from(self.0 ^ v).wrapping_mul(0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835);
        self.0 = (product >> 64) as u64 ^ product as u64;
    }
    fn write_usize(&mut self, _: usize) {}
}

/// The triangles in welded indices, without those of fewer than three distinct corners.
pub(crate) fn distinct(triangles: &[[u32; 3]], welded: &[u32]) -> Vec<[u32; 3]> {
    let mapped = triangles.iter().map(|t| t.map(|v| welded[v as usize]));
    mapped.filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

/// One side of a triangle, stored with its lower vertex.
#[derive(Clone, Copy)]
struct Side {
    other: u32,
    triangle: u32,
    /// Whether the triangle runs from the lower to the higher vertex.
    forward: bool,
}

/// What the edges tell, and which triangles to turn.
pub(crate) struct Topology {
    pub watertight: bool,
    pub boundary_edges: usize,
    pub nonmanifold_edges: usize,
    pub shells: usize,
    pub flipped_triangles: usize,
    pub flipped_shells: usize,
    /// Whether a triangle must be turned to make its shell consistent and right side out; empty: none.
    pub turn: Vec<bool>,
}

impl Topology {
    /// Of triangles in welded indices with three distinct corners.
    pub fn new(triangles: &[[u32; 3]], at: &[DVec3]) -> Topology {
        let (start, mut sides) = sides_by_vertex(triangles, at.len());
        let (mut boundary_edges, mut nonmanifold_edges, mut odd) = (0, 0, 0);
        let mut pairs = Vec::with_capacity(triangles.len() * 3 / 2);
        for vertex in 0..at.len() {
            let bucket = &mut sides[start[vertex] as usize..start[vertex + 1] as usize];
            bucket.sort_unstable_by_key(|s| s.other);
            for edge in bucket.chunk_by(|a, b| a.other == b.other) {
                odd += edge.len() % 2;
                match edge {
                    [_] => boundary_edges += 1,
                    [a, b] => pairs.push((a.triangle, b.triangle, a.forward == b.forward)),
                    _ => nonmanifold_edges += 1,
                }
            }
        }
        let mut topology = Topology {
            watertight: odd == 0 && !triangles.is_empty(),
            boundary_edges,
            nonmanifold_edges,
            shells: 0,
            flipped_triangles: 0,
            flipped_shells: 0,
            turn: Vec::new(),
        };
        topology.orient(triangles, at, &pairs);
        topology
    }

    /// Finds the shells, turns the minority of each, then the shells that are inside out.
    fn orient(&mut self, triangles: &[[u32; 3]], at: &[DVec3], pairs: &[(u32, u32, bool)]) {
        let mut forest = Forest::new(triangles.len());
        for &(a, b, against) in pairs {
            forest.join(a, b, against);
        }
        // Per shell, indexed by its root: triangles, those against the root, signed volume, open or not.
        let mut shells: HashMap<u32, Shell> = HashMap::new();
        let mut open = vec![3u8; triangles.len()];
        for &(a, b, _) in pairs {
            open[a as usize] -= 1;
            open[b as usize] -= 1;
        }
        let center = at.first().copied().unwrap_or_default();
        let mut label = Vec::with_capacity(triangles.len());
        for (i, t) in triangles.iter().enumerate() {
            let (root, against) = forest.find(i as u32);
            label.push((root, against));
            let [a, b, c] = t.map(|v| at[v as usize] - center);
            let shell = shells.entry(root).or_default();
            shell.count += 1;
            shell.against += usize::from(against);
            shell.volume += if against { -1.0 } else { 1.0 } * a.dot(b.cross(c));
            shell.closed &= open[i] == 0;
            for v in t {
                shell.stretch(at[*v as usize]);
            }
        }
        for (&root, shell) in &mut shells {
            shell.twisted = forest.twisted[root as usize];
            let minority = 2 * shell.against > shell.count || 2 * shell.against == shell.count && shell.volume < 0.0;
            shell.turn = minority;
            if minority {
                shell.against = shell.count - shell.against;
                shell.volume = -shell.volume;
            }
        }
        self.shells = shells.len();
        self.flipped_triangles = shells.values().filter(|s| !s.twisted).map(|s| s.against).sum();
        self.turn_shells(triangles, at, &label, &mut shells);
        let turned = |&(root, against): &(u32, bool)| {
            let shell = &shells[&root];
            !shell.twisted && against != shell.turn
        };
        if self.flipped_triangles + self.flipped_shells > 0 {
            self.turn = label.iter().map(turned).collect();
        }
    }

    /// A closed shell of negative volume is inside out, unless it lies inside another (its six outermost corners
    /// do): then it is the wall of a cavity. A cavity's wall turns when the shell around it turns.
    fn turn_shells(
        &mut self,
        triangles: &[[u32; 3]],
        at: &[DVec3],
        label: &[(u32, bool)],
        shells: &mut HashMap<u32, Shell>,
    ) {
        let mut roots: Vec<u32> = shells.iter().filter(|(_, s)| s.closed && !s.twisted).map(|(r, _)| *r).collect();
        roots.sort_unstable();
        let work = roots.len() as u64 * triangles.len() as u64;
        if roots.iter().all(|r| shells[r].volume >= 0.0) || roots.len() > 1 && work > 200_000_000 {
            return;
        }
        let slot: HashMap<u32, usize> = roots.iter().zip(0..).map(|(r, i)| (*r, i)).collect();
        let within = |r: &u32| -> Vec<bool> {
            let corners = shells[r].extremes;
            let mut angle = vec![[0.0; 6]; roots.len()];
            for (t, (root, against)) in triangles.iter().zip(label) {
                if let Some(&i) = slot.get(root).filter(|_| roots.len() > 1 && root != r) {
                    for (sum, p) in angle[i].iter_mut().zip(corners) {
                        let [a, b, c] = t.map(|v| at[v as usize] - p);
                        *sum += if *against { -1.0 } else { 1.0 } * solid_angle(a, b, c);
                    }
                }
            }
            angle.iter().map(|sums| sums.iter().all(|s| s.abs() > std::f64::consts::TAU)).collect()
        };
        // around[r][s]: whether shell s goes round shell r.
        let around: Vec<Vec<bool>> = roots.iter().map(within).collect();
        let outermost: Vec<bool> = around.iter().map(|a| a.iter().all(|inside| !inside)).collect();
        for (i, r) in roots.iter().enumerate() {
            let inverted = |k: usize| outermost[k] && shells[&roots[k]].volume < 0.0;
            let flip = inverted(i) || (0..roots.len()).any(|k| around[i][k] && inverted(k));
            self.flipped_shells += usize::from(inverted(i));
            shells.entry(*r).and_modify(|s| s.flip = flip);
        }
        for shell in shells.values_mut() {
            shell.turn ^= shell.flip;
        }
    }
}

/// What is gathered about a connected shell.
struct Shell {
    count: usize,
    against: usize,
    volume: f64,
    closed: bool,
    /// No consistent orientation exists (a Moebius strip, or a flaw): left as it is.
    twisted: bool,
    /// The corners that reach farthest along -x, -y, -z, +x, +y, +z.
    extremes: [DVec3; 6],
    turn: bool,
    flip: bool,
}

impl Default for Shell {
    fn default() -> Self {
        Shell {
            count: 0,
            against: 0,
            volume: 0.0,
            closed: true,
            twisted: false,
            extremes: [DVec3::NAN; 6],
            turn: false,
            flip: false,
        }
    }
}

impl Shell {
    fn stretch(&mut self, p: DVec3) {
        for axis in 0..3 {
            let (low, high) = (self.extremes[axis][axis], self.extremes[axis + 3][axis]);
            if low.is_nan() || p[axis] < low {
                self.extremes[axis] = p;
            }
            if high.is_nan() || p[axis] > high {
                self.extremes[axis + 3] = p;
            }
        }
    }
}

/// All triangle sides, gathered by their lower vertex (counting sort): start indices and sides.
fn sides_by_vertex(triangles: &[[u32; 3]], vertices: usize) -> (Vec<u32>, Vec<Side>) {
    let sides_of = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let mut start = vec![0u32; vertices + 2];
    for (a, b) in triangles.iter().flat_map(sides_of) {
        start[a.min(b) as usize + 2] += 1;
    }
    for i in 2..start.len() {
        start[i] += start[i - 1];
    }
    let mut sides = vec![Side { other: 0, triangle: 0, forward: false }; 3 * triangles.len()];
    for (i, t) in triangles.iter().enumerate() {
        for (a, b) in sides_of(t) {
            let slot = &mut start[a.min(b) as usize + 1];
            sides[*slot as usize] = Side { other: a.max(b), triangle: i as u32, forward: a < b };
            *slot += 1;
        }
    }
    start.pop();
    (start, sides)
}

/// The sides that do not cancel, from lower to higher vertex: how often they run that way minus how often the other.
pub(crate) fn uncancelled(triangles: &[[u32; 3]], vertices: usize) -> Vec<(u32, u32, i32)> {
    let (start, mut sides) = sides_by_vertex(triangles, vertices);
    let mut rim = Vec::new();
    for vertex in 0..vertices {
        let bucket = &mut sides[start[vertex] as usize..start[vertex + 1] as usize];
        bucket.sort_unstable_by_key(|s| s.other);
        for edge in bucket.chunk_by(|a, b| a.other == b.other) {
            let net: i32 = edge.iter().map(|s| if s.forward { 1 } else { -1 }).sum();
            if net != 0 {
                rim.push((vertex as u32, edge[0].other, net));
            }
        }
    }
    rim
}

/// Union-find with a relative orientation on each link.
struct Forest {
    parent: Vec<u32>,
    /// Whether an element is turned against its parent.
    against: Vec<bool>,
    twisted: Vec<bool>,
}

impl Forest {
    fn new(n: usize) -> Forest {
        Forest { parent: (0..n as u32).collect(), against: vec![false; n], twisted: vec![false; n] }
    }

    /// The root of `i`, and whether `i` is turned against it. Halves the path on its way.
    fn find(&mut self, mut i: u32) -> (u32, bool) {
        let mut turned = false;
        loop {
            let p = self.parent[i as usize];
            if p == i {
                return (i, turned);
            }
            let grand = self.parent[p as usize];
            if grand != p {
                self.parent[i as usize] = grand;
                self.against[i as usize] ^= self.against[p as usize];
            }
            turned ^= self.against[i as usize];
            i = self.parent[i as usize];
        }
    }

    fn join(&mut self, a: u32, b: u32, against: bool) {
        let ((ra, ta), (rb, tb)) = (self.find(a), self.find(b));
        let relation = against ^ ta ^ tb;
        if ra == rb {
            self.twisted[ra as usize] |= relation;
        } else {
            // The lower index becomes the root: the result does not depend on the order of joins.
            let (root, child) = (ra.min(rb), ra.max(rb));
            self.parent[child as usize] = root;
            self.against[child as usize] = relation;
            self.twisted[root as usize] |= self.twisted[child as usize];
        }
    }
}
