//! How fluids begin: velocities given by formulas, places displaced by formulas and at random.

use super::fluid::Drop;
use crate::error::Result;
use crate::formula::{Expression, Scope};
use crate::interact::cells::Grid;
use crate::random;
use crate::scene::{Formula, Scene, Wall};
use glam::DVec3;

/// Stream of random numbers for the jitter of fluid 0; the others follow.
const JITTER: u64 = 0x6a69_7474_6572;

/// The formulas of every fluid's beginning, ready to be evaluated.
pub(super) struct Starts(Vec<Start>);

struct Start {
    velocity: [Expression; 3],
    displace: Option<[Expression; 3]>,
}

impl Scene {
    /// Reads the formulas of every fluid's beginning.
    pub(super) fn starts(&self) -> Result<Starts> {
        let scope = Scope::of(self)?;
        let field = |path: String, formulas: &[Formula; 3]| -> Result<[Expression; 3]> {
            let one = |a: usize| scope.compile(self, &format!("{path}.{a}"), &formulas[a], &["x", "y", "z"]);
            Ok([one(0)?, one(1)?, one(2)?])
        };
        let all = self.fluid.iter().enumerate().map(|(index, f)| {
            let displace = f.displace.as_ref().map(|d| field(format!("fluid.{index}.displace"), d)).transpose()?;
            Ok(Start { velocity: field(format!("fluid.{index}.velocity"), &f.velocity)?, displace })
        });
        Ok(Starts(all.collect::<Result<_>>()?))
    }
}

impl Starts {
    /// Gives every particle the velocity its fluid has at its place.
    pub(super) fn set_velocities(&self, scene: &Scene, fluid: &mut [Drop]) -> Result<()> {
        for drop in fluid {
            drop.v = at(&self.0[drop.fluid as usize].velocity, drop.x, scene);
            if !drop.v.is_finite() {
                return Err(not_finite(scene, drop.fluid as usize, drop.x, "velocity"));
            }
        }
        Ok(())
    }

    /// Where a particle of a fluid goes from its place on the lattice.
    pub(super) fn displaced(&self, scene: &Scene, fluid: usize, x: DVec3, grid: &Grid) -> Result<DVec3> {
        let Some(formulas) = &self.0[fluid].displace else { return Ok(x) };
        let mut to = x + at(formulas, x, scene);
        if !to.is_finite() {
            return Err(not_finite(scene, fluid, x, "displace"));
        }
        wrap(&mut to, grid);
        Ok(to)
    }

    /// Moves particles at random as far as the scene asks for: by less than the way to a wall.
    pub(super) fn jitter(&self, scene: &Scene, fluid: &mut [Drop], grid: &Grid) {
        let flat = if scene.world.dimensions == 2 { 0.0 } else { 1.0 };
        for (index, drop) in fluid.iter_mut().enumerate() {
            let jitter = scene.fluid[drop.fluid as usize].jitter;
            if jitter > 0.0 {
                let stream = JITTER + u64::from(drop.fluid);
                let draw = |a: u64| 2.0 * random::uniform(scene.world.seed, stream, 3 * index as u64 + a) - 1.0;
                drop.x += jitter * scene.resolution.spacing * DVec3::new(draw(0), flat * draw(1), draw(2));
                wrap(&mut drop.x, grid);
            }
        }
    }
}

/// Three formulas at a place; in 2D nothing points along y.
fn at(formulas: &[Expression; 3], x: DVec3, scene: &Scene) -> DVec3 {
    let value = |a: usize| formulas[a].eval(&x.to_array());
    DVec3::new(value(0), if scene.world.dimensions == 2 { 0.0 } else { value(1) }, value(2))
}

/// Brings a place on periodic axes back into the domain.
fn wrap(x: &mut DVec3, grid: &Grid) {
    for a in (0..3).filter(|&a| grid.walls[a] == Wall::Periodic) {
        x[a] = grid.min[a] + (x[a] - grid.min[a]).rem_euclid(grid.max[a] - grid.min[a]);
    }
}

fn not_finite(scene: &Scene, fluid: usize, x: DVec3, key: &str) -> Box<crate::Error> {
    let path = format!("fluid.{fluid}.{key}");
    let message = format!("`{path}` is not finite at {:?}", x.to_array());
    scene.error(&path, message, "look for a division by zero, a root or logarithm of a negative number")
}
