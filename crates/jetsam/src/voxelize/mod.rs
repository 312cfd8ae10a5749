//! Chapter 1: a mesh becomes particles.
//!
//! In: any [`Mesh`] and [`VoxelizeOptions`]. Out: [`Voxels`], one bit per cell of a regular lattice, the particle positions
//! they stand for, and a [`VoxelReport`] of what was found wrong with the mesh and how well the particles fill it.
//! Called for every body, fluid and static of shape `mesh` when a scene is read, and by `jetsam voxelize`.
//!
//! The article (Young & Erlebacher) cuts the mesh into slices and lets each pass through the surface switch cells on or
//! off. That is [`Rule::Parity`]. It is right for one closed surface and for nothing else: a part that overlaps another
//! leaves a cavity, a hole leaks along its whole column. [`Rule::Winding`] counts instead how often the surface goes round
//! a cell (the generalised winding number) and gives the solid a person expects. On clean closed meshes both agree to
//! the last cell.
//!
//! The chapter's parts: `lattice` places the cells, `raster` finds exactly where rows pass through triangles, `fill` turns
//! that into cells by either rule, `fill_gpu` does the parity rule on the GPU, `voxelizer` chooses between them, `rim` and `tree` know the winding number of open meshes, `thin` rescues what is thinner
//! than a cell, `surface` samples surfaces instead of solids.

mod bits;
mod fill;
#[cfg(feature = "gpu")]
mod fill_gpu;
mod lattice;
mod options;
mod raster;
mod report;
mod rim;
mod surface;
mod thin;
mod tree;
mod voxelizer;

use std::time::Instant;

use glam::{DAffine3, DVec3};

use crate::mesh::{Mesh, topology};
use fill::Shape;
use lattice::{Lattice, Placed};
use rim::{Rim, Side};
use voxelizer::Ran;

pub use bits::BitGrid;
pub use options::{Align, Backend, Resolution, Rule, VoxelizeError, VoxelizeOptions};
pub use report::VoxelReport;
pub use surface::sample_surface;
pub use tree::{WindingTree, solid_angle, winding_number};
pub use voxelizer::Voxelizer;

/// A mesh as cells of a regular lattice.
#[derive(Clone, Debug)]
pub struct Voxels {
    /// Distance between neighbouring cell centres, in mesh units.
    pub spacing: f64,
    /// Centre of cell (0, 0, 0), before `frame`.
    pub origin: DVec3,
    /// Cells along x, y, z.
    pub dims: [u32; 3],
    /// Which cells are solid.
    pub bits: BitGrid,
    /// From the lattice's axes to the world: the identity for [`Align::World`], the placement for [`Align::Body`].
    pub frame: DAffine3,
    /// What was found.
    pub report: VoxelReport,
}

impl Voxels {
    /// Number of solid cells, which is the number of particles.
    pub fn len(&self) -> usize {
        self.report.particles as usize
    }

    /// Whether no cell is solid.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether cell (i, j, k) is solid; false outside the grid.
    pub fn contains(&self, i: i64, j: i64, k: i64) -> bool {
        self.bits.get(i, j, k)
    }

    /// Centre of cell (i, j, k) in the world.
    pub fn center(&self, cell: [u32; 3]) -> DVec3 {
        let local = self.origin + DVec3::from_array(cell.map(f64::from)) * self.spacing;
        self.frame.transform_point3(local)
    }

    /// The centres of all solid cells in the world, x fastest, then y, then z.
    pub fn points(&self) -> Vec<DVec3> {
        let mut points = Vec::with_capacity(self.len());
        points.extend(self.bits.iter().map(|cell| self.center(cell)));
        points
    }
}

/// Turns the mesh into cells, on the CPU; a [`Voxelizer`] does it on other backends.
///
/// # Errors
/// The mesh has no triangles, an index out of range or a vertex that is not finite; an option is out of range; the cells
/// would be more than `options.max_cells`. Memory is checked before it is taken.
pub fn voxelize(mesh: &Mesh, options: &VoxelizeOptions) -> Result<Voxels, VoxelizeError> {
    Voxelizer::default().voxelize(mesh, options)
}

fn run(on: &Voxelizer, mesh: &Mesh, options: &VoxelizeOptions) -> Result<Voxels, VoxelizeError> {
    let started = Instant::now();
    mesh.check().map_err(VoxelizeError::Mesh)?;
    options.check()?;
    let placed = Placed::new(mesh, options);
    let longest = (placed.hi - placed.lo).max_element();
    if longest <= 0.0 {
        return Err(VoxelizeError::Point);
    }
    let mut solid = match options.resolution {
        Resolution::Spacing(spacing) => attempt(on, mesh, &placed, options, spacing, 0)?,
        Resolution::Across(cells) => attempt(on, mesh, &placed, options, longest / f64::from(cells), 0)?,
        Resolution::Particles(wanted) => search(on, mesh, &placed, options, wanted)?,
    };
    let report = report::write(mesh, &placed, options, &mut solid, started);
    let Solid { lattice: Lattice { spacing, origin, dims }, bits, .. } = solid;
    Ok(Voxels { spacing, origin, dims, bits, frame: placed.frame, report })
}

/// One filled lattice, and what was learnt on the way.
struct Solid {
    lattice: Lattice,
    bits: BitGrid,
    count: u64,
    watertight: bool,
    boundary_edges: usize,
    nonmanifold_edges: usize,
    flipped_triangles: usize,
    flipped_shells: usize,
    /// The largest number of times the surface goes round a cell.
    overlap: i32,
    /// Rows decided by winding number although the rule is parity.
    mended_rows: usize,
    ran: Ran,
}

/// Fills the lattice of one spacing.
fn attempt(
    on: &Voxelizer,
    mesh: &Mesh,
    placed: &Placed,
    options: &VoxelizeOptions,
    spacing: f64,
    shift: u8,
) -> Result<Solid, VoxelizeError> {
    let lattice = placed.lattice(spacing, shift, options)?;
    let vertices = lattice.snap(mesh, placed);
    let welded = topology::weld(vertices.iter().copied());
    let mut triangles = topology::distinct(&mesh.triangles, &welded);
    let in_cells: Vec<DVec3> = vertices.iter().map(|v| rim::in_cells(*v)).collect();
    let topology = topology::Topology::new(&triangles, &in_cells);
    for (t, _) in triangles.iter_mut().zip(&topology.turn).filter(|(_, turn)| **turn) {
        t.swap(1, 2);
    }
    let shape = Shape { vertices, triangles };
    let mut solid = Solid {
        bits: lattice.grid(),
        lattice,
        count: 0,
        watertight: topology.watertight,
        boundary_edges: topology.boundary_edges,
        nonmanifold_edges: topology.nonmanifold_edges,
        flipped_triangles: topology.flipped_triangles,
        flipped_shells: topology.flipped_shells,
        overlap: 0,
        mended_rows: 0,
        ran: on.plan(options.rule),
    };
    match options.rule {
        Rule::Winding => solid.overlap = fill::winding(&shape, &rim_of(&shape), &mut solid.bits, None),
        Rule::Parity => {
            let odd = on.parity(&shape, &mut solid.bits, &mut solid.ran)?;
            solid.mended_rows = odd.len();
            if !odd.is_empty() {
                fill::winding(&shape, &rim_of(&shape), &mut solid.bits, Some(&odd));
            }
        }
    }
    if options.thin {
        thin::rescue(&shape, &mut solid.bits);
    }
    if let Some(thickness) = options.shell {
        thin::hollow(&mut solid.bits, thickness / spacing);
    }
    solid.count = solid.bits.count();
    Ok(solid)
}

fn rim_of(shape: &Shape) -> Rim {
    let side = |(a, b, weight): (u32, u32, i32)| {
        let (a, b) = if weight > 0 { (a, b) } else { (b, a) };
        Side { a: shape.vertices[a as usize], b: shape.vertices[b as usize], weight: weight.abs() }
    };
    let sides = topology::uncancelled(&shape.triangles, shape.vertices.len());
    Rim::new(sides.into_iter().map(side).collect())
}

/// Looks for the spacing that gives the wanted number of particles within 2 %. The number falls with the cube of the
/// spacing but for the grain of the lattice; on a body the lattice can also be shifted by half a cell.
fn search(
    on: &Voxelizer,
    mesh: &Mesh,
    placed: &Placed,
    options: &VoxelizeOptions,
    wanted: u64,
) -> Result<Solid, VoxelizeError> {
    let goal = wanted as f64;
    let size = placed.hi - placed.lo;
    let volume = mesh.mass_properties().volume.abs();
    let body = if volume > 0.0 { volume } else { size.element_product() };
    let mut spacing = (body / goal).cbrt();
    if spacing <= 0.0 {
        spacing = size.max_element() / goal.cbrt();
    }
    let error = |s: &Solid| (s.count as f64 / goal - 1.0).abs();
    let mut best: Option<Solid> = None;
    for round in 0..40 {
        // Eight rounds of plain correction; then shifted lattices and small steps around the best.
        let shift = if round < 8 || options.align == Align::World { 0 } else { round % 8 };
        if let Some(best) = best.as_ref().filter(|_| round >= 8) {
            let step = f64::from(round / 8) * 0.01 * if round % 2 == 0 { 1.0 } else { -1.0 };
            spacing = best.lattice.spacing * (1.0 + step);
        }
        let solid = attempt(on, mesh, placed, options, spacing, shift)?;
        let ratio = (solid.count.max(1) as f64 / goal).clamp(0.02, 50.0);
        // A shell's particles grow with the square of the resolution, not the cube.
        spacing *= ratio.powf(if options.shell.is_some() { 0.4 } else { 1.0 / 3.0 });
        if best.as_ref().is_none_or(|b| error(&solid) < error(b)) {
            best = Some(solid);
        }
        if best.as_ref().is_some_and(|b| error(b) <= 0.02) {
            break;
        }
    }
    best.ok_or(VoxelizeError::Point)
}
