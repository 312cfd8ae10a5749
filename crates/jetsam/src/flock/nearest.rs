//! E25, topological neighbours: the k nearest, however far (Ballerini et al. 2008). Ties go to the lower id.
//!
//! In: agents in cells. Out: indices of the nearest, nearest first, with the shift that brings a periodic image into place. Shells of
//! cells are searched outwards until none farther out can be nearer.

use crate::interact::cells::{Cells, Grid};
use crate::laws::flock;
use crate::state::Record;

/// One neighbour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Squared distance (m^2).
    pub r_sq: f32,
    /// Its id.
    pub id: u32,
    /// Where it stands.
    pub index: usize,
    /// What is added to its position for the shortest way on periodic axes (m).
    pub shift: [f32; 3],
}

/// Where to look.
#[derive(Clone, Copy)]
pub struct Among<'a> {
    /// Cells of all flocks.
    pub grid: &'a Grid,
    /// For each flock looked at: where its cells begin, and its first agent.
    pub flocks: &'a [(&'a Cells, usize)],
    /// All agents.
    pub records: &'a [Record],
    /// Their ids.
    pub id: &'a [u32],
}

/// The `k` nearest to agent `me` that are in its `view` (see `in_view`), nearest first.
pub fn nearest(among: Among, me: usize, k: usize, view: Option<f32>, found: &mut Vec<Near>) {
    found.clear();
    let grid = among.grid;
    let own = &among.records[me];
    let cell = grid.coordinates(own.x);
    // how far an axis has to be searched: periodic cells are met once
    let span: [(i32, i32); 3] = std::array::from_fn(|a| match grid.period[a] {
        p if p > 0.0 => (-(grid.cells[a] - 1) / 2, grid.cells[a] / 2),
        _ => (-cell[a], grid.cells[a] - 1 - cell[a]),
    });
    let last = span.iter().map(|s| (-s.0).max(s.1)).max().unwrap_or(0);
    for shell in 0..=last {
        let range = |a: usize| span[a].0.max(-shell)..=span[a].1.min(shell);
        for dz in range(2) {
            for dy in range(1) {
                for dx in range(0) {
                    if dx.abs().max(dy.abs()).max(dz.abs()) == shell {
                        let at = [cell[0] + dx, cell[1] + dy, cell[2] + dz];
                        look(among, own, me, k, view, at, found);
                    }
                }
            }
        }
        // whoever is beyond the shell is at least this far away
        let beyond = (0..3)
            .filter(|&a| span[a].0 < -shell || span[a].1 > shell)
            .map(|a| shell as f32 / grid.inverse[a])
            .fold(f32::INFINITY, f32::min);
        if found.len() == k && found[k - 1].r_sq < 0.9999 * beyond * beyond {
            break;
        }
    }
}

/// Keeps the nearest of a cell.
fn look(among: Among, own: &Record, me: usize, k: usize, view: Option<f32>, mut at: [i32; 3], found: &mut Vec<Near>) {
    let grid = among.grid;
    for a in 0..3 {
        if grid.period[a] > 0.0 {
            at[a] = at[a].rem_euclid(grid.cells[a]);
        }
    }
    for &(cells, first) in among.flocks {
        for j in cells.row(at[0], at[0], at[1], at[2]) {
            let index = first + j;
            if index == me {
                continue;
            }
            let other = &among.records[index];
            let shift: [f32; 3] = std::array::from_fn(|a| match grid.period[a] {
                p if p > 0.0 => -p * ((other.x[a] - own.x[a]) / p).round(),
                _ => 0.0,
            });
            let d: [f32; 3] = std::array::from_fn(|a| other.x[a] + shift[a] - own.x[a]);
            let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let r_sq = dot(d, d);
            if view.is_some_and(|bound| flock::in_view(dot(own.v, d), r_sq, dot(own.v, own.v), bound) == 0.0) {
                continue;
            }
            let new = Near { r_sq, id: among.id[index], index, shift };
            let place = found.partition_point(|n| (n.r_sq, n.id) < (new.r_sq, new.id));
            if place < k {
                found.truncate(k - 1);
                found.insert(place, new);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flock::perception::grid_about;
    use crate::random::uniform;
    use crate::scene::Wall;
    use glam::DVec3;

    /// Ids of the k nearest of every agent, by cells and by sorting all.
    fn lists(x: &[[f32; 3]], walls: Wall, width: f64, k: usize) -> (Vec<Vec<u32>>, Vec<Vec<u32>>) {
        let domain = Grid::new(DVec3::ZERO, DVec3::ONE, [walls; 3], 3, width, 0.0);
        let records: Vec<Record> = x.iter().map(|&x| Record { x, ..Record::default() }).collect();
        let grid = grid_about(&domain, &records, 3, [width; 3]);
        let mut cells = Cells::default();
        let n = cells.sort(&grid, &records, None);
        assert_eq!(n, records.len());
        let order: Vec<u32> = cells.order[..n].iter().map(|o| o.load(std::sync::atomic::Ordering::Relaxed)).collect();
        let sorted: Vec<Record> = order.iter().map(|&o| records[o as usize]).collect();
        let (mut by_cells, mut by_sorting) = (vec![vec![]; n], vec![vec![]; n]);
        let mut found = Vec::new();
        for i in 0..n {
            let among = Among { grid: &grid, flocks: &[(&cells, 0)], records: &sorted, id: &order };
            nearest(among, i, k, None, &mut found);
            by_cells[order[i] as usize] = found.iter().map(|n| n.id).collect();
            let square = |j: usize| {
                (0..3)
                    .map(|a| {
                        let mut d = x[j][a] - x[i][a];
                        if walls == Wall::Periodic {
                            d -= d.round();
                        }
                        d * d
                    })
                    .fold(0.0, |s, d| s + d)
            };
            let mut all: Vec<usize> = (0..n).filter(|&j| j != i).collect();
            all.sort_by(|&a, &b| square(a).total_cmp(&square(b)).then(a.cmp(&b)));
            by_sorting[i] = all[..k.min(n - 1)].iter().map(|&j| j as u32).collect();
        }
        (by_cells, by_sorting)
    }

    #[test]
    fn the_nearest_seven_are_those_of_a_sort() {
        let random: Vec<[f32; 3]> = (0..400).map(|i| [0, 1, 2].map(|a| uniform(5, a, i) as f32)).collect();
        // a lattice: ties everywhere, broken by id (multiples of 1/8 are exact)
        let lattice: Vec<[f32; 3]> = (0..512).map(|i| [i % 8, i / 8 % 8, i / 64].map(|c| c as f32 / 8.0)).collect();
        // a tight knot and one far away
        let mut knot: Vec<[f32; 3]> = random.iter().map(|x| x.map(|c| 0.01 * c)).collect();
        knot.push([0.9, 0.9, 0.9]);
        for walls in [Wall::Open, Wall::Periodic] {
            for (name, x) in [("random", &random), ("lattice", &lattice), ("knot", &knot)] {
                for width in [0.05, 0.2, 2.0] {
                    let (by_cells, by_sorting) = lists(x, walls, width, 7);
                    for (i, (a, b)) in by_cells.iter().zip(&by_sorting).enumerate() {
                        assert_eq!(a, b, "{name}, {walls:?}, cells of {width}: agent {i}");
                    }
                }
            }
        }
    }

    #[test]
    fn neighbours_do_not_depend_on_density() {
        let x: Vec<[f32; 3]> = (0..300).map(|i| [0, 1, 2].map(|a| 0.25 * uniform(6, a, i) as f32)).collect();
        // a power of two and D4's factor of three
        for factor in [4.0, 3.0] {
            let wide: Vec<[f32; 3]> = x.iter().map(|x| x.map(|c| factor * c)).collect();
            assert_eq!(lists(&x, Wall::Open, 0.05, 7).0, lists(&wide, Wall::Open, 0.05, 7).0);
        }
    }
}
