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
                return Err(not_finite(scene, drop, "velocity"));
            }
        }
        Ok(())
    }

    /// Moves particles as the scene asks for; whether any did.
    pub(super) fn displace(&self, scene: &Scene, fluid: &mut [Drop], grid: &Grid) -> Result<bool> {
        let mut moved = false;
        for (index, drop) in fluid.iter_mut().enumerate() {
            let f = &scene.fluid[drop.fluid as usize];
            let before = drop.x;
            if let Some(formulas) = &self.0[drop.fluid as usize].displace {
                drop.x += at(formulas, before, scene);
            }
            if f.jitter > 0.0 {
                let stream = JITTER + u64::from(drop.fluid);
                let draw = |a: u64| 2.0 * random::uniform(scene.world.seed, stream, 3 * index as u64 + a) - 1.0;
                let flat = if scene.world.dimensions == 2 { 0.0 } else { 1.0 };
                let random = DVec3::new(draw(0), flat * draw(1), draw(2));
                drop.x += f.jitter * scene.resolution.spacing * random;
            }
            moved |= drop.x != before;
            if !drop.x.is_finite() {
                return Err(not_finite(scene, drop, "displace"));
            }
            keep_inside(scene, drop, grid)?;
        }
        Ok(moved)
    }
}

/// Three formulas at a place; in 2D nothing points along y.
fn at(formulas: &[Expression; 3], x: DVec3, scene: &Scene) -> DVec3 {
    let value = |a: usize| formulas[a].eval(&x.to_array());
    DVec3::new(value(0), if scene.world.dimensions == 2 { 0.0 } else { value(1) }, value(2))
}

fn keep_inside(scene: &Scene, drop: &mut Drop, grid: &Grid) -> Result<()> {
    for a in (0..3).filter(|&a| !(scene.world.dimensions == 2 && a == 1)) {
        let (min, max) = (grid.min[a], grid.max[a]);
        if grid.walls[a] == Wall::Periodic {
            drop.x[a] = min + (drop.x[a] - min).rem_euclid(max - min);
        } else if drop.x[a] < min || drop.x[a] > max {
            let name = ["x", "y", "z"][a];
            let message = format!("a particle is displaced to {name} = {:.4} m, outside the domain", drop.x[a]);
            let path = format!("fluid.{}.displace", drop.fluid);
            return Err(scene.error(&path, message, "displace it less, or enlarge the domain"));
        }
    }
    Ok(())
}

fn not_finite(scene: &Scene, drop: &Drop, key: &str) -> Box<crate::Error> {
    let path = format!("fluid.{}.{key}", drop.fluid);
    let message = format!("`{path}` is not finite at {:?}", drop.x.to_array());
    scene.error(&path, message, "look for a division by zero, a root or logarithm of a negative number")
}
