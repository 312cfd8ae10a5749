//! A closed triangle mesh in memory: checks it and writes it. Used by the programs that make the meshes of `scenes/meshes`.

use glam::DVec3;
use std::collections::HashMap;
use std::fmt::Write;

/// Triangles are counter-clockwise seen from outside.
pub struct Solid {
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Solid {
    /// The three corners of each triangle.
    fn corners(&self) -> impl Iterator<Item = [DVec3; 3]> {
        self.triangles.iter().map(|t| t.map(|i| self.vertices[i as usize]))
    }

    /// Enclosed volume by the divergence theorem: positive when the triangles face outward.
    pub fn volume(&self) -> f64 {
        self.corners().map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    /// Lower and upper corner of the bounding box.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.vertices.iter().fold(empty, |(low, high), v| (low.min(*v), high.max(*v)))
    }

    /// Whether the mesh is one closed, consistently oriented 2-manifold without slivers; the error says what is wrong.
    ///
    /// Each directed edge must occur once, with its opposite once; the triangles round a vertex must form a single
    /// fan; all must hang together; the volume must be positive.
    pub fn check(&self) -> Result<(), String> {
        let mut next = HashMap::new(); // directed edge -> the corner opposite to it
        for (t, triangle) in self.triangles.iter().enumerate() {
            let [a, b, c] = *triangle;
            for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
                if next.insert((from, to), opposite).is_some() {
                    return Err(format!("triangle {t}: edge {from}-{to} occurs twice in the same direction"));
                }
            }
        }
        if let Some((from, to)) = next.keys().find(|(from, to)| !next.contains_key(&(*to, *from))) {
            return Err(format!("edge {from}-{to} is open"));
        }

        let mut valence = vec![0; self.vertices.len()];
        let mut spoke = vec![None; self.vertices.len()];
        for (from, to) in next.keys() {
            valence[*from as usize] += 1;
            spoke[*from as usize] = Some(*to);
        }
        for (v, first) in spoke.iter().enumerate() {
            let first = first.ok_or_else(|| format!("vertex {v} is unused"))?;
            let (mut fan, mut to) = (1, next[&(v as u32, first)]);
            while to != first {
                (fan, to) = (fan + 1, next[&(v as u32, to)]);
            }
            if fan != valence[v] {
                return Err(format!("vertex {v} joins two fans of triangles"));
            }
        }

        // Neighbours of vertex 0, their neighbours, and so on: all there is, if the mesh is one piece.
        let mut neighbours = vec![Vec::new(); self.vertices.len()];
        next.keys().for_each(|(from, to)| neighbours[*from as usize].push(*to));
        let (mut reached, mut queue) = (vec![false; self.vertices.len()], vec![0]);
        while let Some(v) = queue.pop() {
            if !std::mem::replace(&mut reached[v as usize], true) {
                queue.extend(&neighbours[v as usize]);
            }
        }
        if let Some(v) = reached.iter().position(|r| !r) {
            return Err(format!("vertex {v} belongs to a second piece"));
        }

        // A triangle's least height against its longest edge: 0.87 for an equilateral one.
        for (t, [a, b, c]) in self.corners().enumerate() {
            let longest = [b - a, c - b, a - c].map(|e| e.length_squared()).into_iter().fold(0.0, f64::max);
            if (b - a).cross(c - a).length() < 0.01 * longest {
                return Err(format!("triangle {t} is a sliver"));
            }
        }
        if self.volume() <= 0.0 {
            return Err("the triangles face inward".into());
        }
        Ok(())
    }

    /// Checks the mesh, writes it as Wavefront OBJ with `decimals` decimals below the comment `title`, and prints its figures.
    pub fn save_obj(&self, path: &str, title: &str, decimals: usize) -> Result<(), Box<dyn std::error::Error>> {
        self.check()?;
        let mut text = format!("# {title}\n");
        for v in &self.vertices {
            writeln!(text, "v {:.decimals$} {:.decimals$} {:.decimals$}", v.x, v.y, v.z)?;
        }
        for [a, b, c] in &self.triangles {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1)?;
        }
        std::fs::write(path, &text)?;

        let (low, high) = self.bounds();
        let (triangles, vertices) = (self.triangles.len(), self.vertices.len());
        println!("{path}: {triangles} triangles, {vertices} vertices, {} bytes", text.len());
        println!("  volume {:.5}, from {low:.3} to {high:.3}, watertight", self.volume());
        Ok(())
    }
}
