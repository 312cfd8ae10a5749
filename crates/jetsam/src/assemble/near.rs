//! Points found by place: for the beginning of a run only.

use glam::DVec3;
use std::collections::HashMap;

/// Points found by place: for the beginning of a run only.
pub(super) struct Near {
    radius: f64,
    cells: HashMap<[i64; 3], Vec<(DVec3, u32)>>,
}

impl Near {
    pub(super) fn new(radius: f64) -> Self {
        Self { radius, cells: HashMap::new() }
    }

    pub(super) fn of(radius: f64, points: impl Iterator<Item = DVec3>) -> Self {
        let mut near = Self::new(radius);
        points.for_each(|p| near.insert(p));
        near
    }

    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    fn key(&self, p: DVec3) -> [i64; 3] {
        (p / self.radius).floor().as_i64vec3().to_array()
    }

    pub(super) fn insert(&mut self, p: DVec3) {
        self.insert_tagged(p, 0);
    }

    pub(super) fn insert_tagged(&mut self, p: DVec3, tag: u32) {
        self.cells.entry(self.key(p)).or_default().push((p, tag));
    }

    /// Whether a point is closer than the radius; `except` skips points of that tag.
    pub(super) fn has(&self, p: DVec3, except: Option<u32>) -> bool {
        let mut found = false;
        self.each(p, |r, tag| found |= r < self.radius && except != Some(tag));
        found
    }

    /// Sum of a function of the distance over the points within the radius, in order of insertion.
    pub(super) fn sum(&self, p: DVec3, f: impl Fn(f64) -> f64) -> f64 {
        let mut total = 0.0;
        self.each(p, |r, _| {
            if r < self.radius {
                total += f(r);
            }
        });
        total
    }

    /// Calls `f(d, tag)` with the vector to each point in the cells around.
    pub(super) fn around(&self, p: DVec3, mut f: impl FnMut(DVec3, u32)) {
        let c = self.key(p);
        for k in -1..=1 {
            for j in -1..=1 {
                for i in -1..=1 {
                    for &(q, tag) in self.cells.get(&[c[0] + i, c[1] + j, c[2] + k]).into_iter().flatten() {
                        f(q - p, tag);
                    }
                }
            }
        }
    }

    fn each(&self, p: DVec3, mut f: impl FnMut(f64, u32)) {
        self.around(p, |d, tag| f(d.length(), tag));
    }
}
