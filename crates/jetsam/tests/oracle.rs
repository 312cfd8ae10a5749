//! The step against an oracle: all pairs, double precision, formulas written down once more.

mod common;

use common::oracle::{self, placed};
use common::scene;
use glam::DMat3;
use jetsam::World;

#[test]
fn a_disturbed_block_in_the_open() {
    oracle::a_disturbed_block_in_the_open(World::new);
}

#[test]
fn a_periodic_box() {
    oracle::a_periodic_box(World::new);
}

#[test]
fn a_box_with_walls_and_a_body() {
    oracle::a_box_with_walls_and_a_body(World::new);
}

#[test]
fn density_integrated() {
    oracle::density_integrated(World::new);
}

#[test]
fn neighbours_on_faces_of_cells_and_at_the_edge_of_the_support() {
    oracle::neighbours_on_faces_of_cells_and_at_the_edge_of_the_support(World::new);
}

#[test]
fn all_particles_in_one_cell() {
    oracle::all_particles_in_one_cell(World::new);
}

#[test]
fn a_position_that_is_not_finite_is_reported() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut assembly = scene(&placed(&[[0.0; 3], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]])).assemble().unwrap();
        assembly.state.particles.record[1].x[2] = bad;
        let world = World::new(assembly);
        assert_eq!((world.ledger().nonfinite, world.ledger().fluid), (1, 2));
        assert!(world.state().particles.density[..2].iter().all(|d| d.is_finite()));
    }
}

#[test]
fn rotated_inertia_is_that_of_the_rotated_body() {
    // E20: I^-1 in world axes against the sum over the particles of a turned box
    let text = "[domain]\nmin = [-1, -1, -1]\nmax = [1, 1, 1]\n[resolution]\nspacing = 0.02\n\
         [[rigid]]\nshape = { box = { min = [-0.1, -0.15, -0.3], max = [0.1, 0.15, 0.3] } }\ndensity = 1000\n\
         rotation = [1, 2, 3, 40]\n";
    let assembly = scene(text).assemble().unwrap();
    let body = &assembly.state.bodies.body[0];
    let m = body.mass / body.slots.len() as f64;
    let mut inertia = DMat3::ZERO;
    for slot in body.slots.clone() {
        let r = body.q * assembly.state.bodies.offset[slot];
        let outer = DMat3::from_cols(r * r.x, r * r.y, r * r.z);
        inertia += (DMat3::IDENTITY * (r.length_squared() + 0.02 * 0.02 / 6.0) - outer) * m;
    }
    let product = inertia * body.inverse_inertia_at(body.q);
    let error = (product - DMat3::IDENTITY).to_cols_array().iter().map(|e| e.abs()).fold(0.0, f64::max);
    assert!(error < 1e-3, "{error}");
}
