//! How a scene is shown: camera, what is drawn of each body, colours. In: a scene and its world at the beginning. Out: what
//! both renderers draw by.

use crate::{Camera, Facet, Line, box_edges, color, facets};
use glam::{DVec3, Vec3};
use jetsam::mesh::Mesh;
use jetsam::scene::Wall;
use jetsam::{Scene, World};
use std::collections::HashMap;
use std::sync::Arc;

/// Speed shown white, as a fraction of the largest speed the scene can reach.
const FAST: f32 = 0.8;
/// Length of a dart in sizes of an agent; in radii of the flock where agents have no size.
const DART: [f32; 2] = [4.0, 0.14];
/// Flocks of more agents than this are drawn darker: they are seen against the sky, by how dense they are.
const MANY: f32 = 3000.0;
const EDGES: [f32; 3] = [0.24, 0.26, 0.29];
const STONE: [f32; 3] = [0.42, 0.38, 0.33];

/// How a scene is shown; does not change between frames.
#[derive(Clone, Debug)]
pub struct Show {
    /// The scene's own camera, or one that sees the whole domain.
    pub camera: Camera,
    /// Corners of the domain (m).
    pub bounds: [Vec3; 2],
    /// Axes along which what leaves on one side comes back on the other.
    pub periodic: [bool; 3],
    /// Edges of the domain, where it has walls.
    pub edges: Vec<Line>,
    /// Height of the ground (m), where there is one.
    pub ground: Option<f32>,
    /// Distance of neighbouring particles (m).
    pub spacing: f32,
    /// Speed shown brightest (m/s).
    pub fast: f32,
    /// Pressure shown brightest (Pa).
    pub pressure: f32,
    /// Whether agents swim in fluid, and want to be seen there.
    pub swimmers: bool,
    /// 2 or 3.
    pub dimensions: u32,
    /// Colour of each fluid.
    pub fluids: Vec<[f32; 3]>,
    /// How each body is drawn.
    pub bodies: Vec<Look>,
    /// How the agents of each flock are drawn.
    pub flocks: Vec<Dart>,
}

/// How a body is drawn.
#[derive(Clone, Debug)]
pub struct Look {
    /// Name of the body.
    pub name: String,
    /// Linear red, green and blue.
    pub color: [f32; 3],
    /// Whether nothing moves it.
    pub fixed: bool,
    /// Radius about the centre of mass (m).
    pub radius: f32,
    /// What is drawn.
    pub form: Form,
}

/// What is drawn of a body.
#[derive(Clone, Debug)]
pub enum Form {
    /// Nothing.
    Hidden,
    /// Its particles.
    Balls,
    /// Its mesh, about the centre of mass; copies share it.
    Mesh(Arc<Vec<Facet>>),
}

/// How the agents of a flock are drawn.
#[derive(Clone, Debug)]
pub struct Dart {
    /// Agents of the flock.
    pub range: std::ops::Range<usize>,
    /// Linear red, green and blue.
    pub color: [f32; 3],
    /// Length (m).
    pub length: f32,
}

impl Show {
    /// How to show a scene in pictures of an aspect (width / height).
    pub fn new(scene: &Scene, world: &World, aspect: f32) -> Self {
        let flat = scene.world.dimensions == 2;
        let model = world.model();
        let (mut min, mut max) = (DVec3::from(scene.domain.min), DVec3::from(scene.domain.max));
        if flat {
            (min.y, max.y) = (0.0, 0.0);
        }
        let depth = (max.z - min.z) * model.gravity.length();
        let (min, max) = (min.as_vec3(), max.as_vec3());
        let camera = match &scene.camera {
            Some(c) => Camera {
                eye: DVec3::from(c.eye).as_vec3(),
                target: DVec3::from(c.target).as_vec3(),
                up: Vec3::Z,
                fov_y: c.fov.to_radians() as f32,
            },
            None => {
                let from = if flat { Vec3::NEG_Y } else { Vec3::new(0.55, -1.0, 0.4) };
                let margin = 0.04 * (max - min);
                Camera::framing(min - margin, max + margin, from, 0.5, aspect)
            }
        };
        let bounded = scene.domain.walls.iter().any(|w| *w != Wall::Open);
        let solid_floor = !flat && scene.domain.walls[2] == Wall::Solid && scene.world.gravity[2] < 0.0;
        let heaviest = model.fluids.iter().map(|f| f.density).fold(0.0, f32::max);
        Self {
            camera,
            bounds: [min, max],
            periodic: scene.domain.walls.map(|wall| wall == Wall::Periodic),
            edges: if bounded { box_edges(min, max, EDGES).into() } else { Vec::new() },
            ground: solid_floor.then_some(min.z),
            spacing: model.spacing as f32,
            fast: FAST * model.largest_speed as f32,
            pressure: (0.3 * depth as f32 * heaviest).max(1e-3),
            swimmers: model.flocks.iter().any(|f| f.keep_to_fluids),
            dimensions: scene.world.dimensions,
            fluids: (0..model.fluids.len()).map(|k| color::water(0.15 + 0.3 * k as f32)).collect(),
            bodies: looks(world),
            flocks: model.flocks.iter().map(dart).collect(),
        }
    }
}

fn dart(flock: &jetsam::flock::FlockConstants) -> Dart {
    let shade = (MANY / flock.count as f32).min(1.0).sqrt();
    Dart {
        range: flock.range(),
        color: color::of_name(&flock.name).map(|c| shade * c),
        length: if flock.size > 0.0 { DART[0] * flock.size } else { DART[1] * flock.radius },
    }
}

/// Walls are not drawn; a body given as a mesh is drawn as that mesh, any other as its particles.
fn looks(world: &World) -> Vec<Look> {
    let mut known: HashMap<(*const Mesh, [u64; 3]), Arc<Vec<Facet>>> = HashMap::new();
    let bodies = world.state().bodies.body.iter().zip(world.meshes());
    let look = |(body, mesh): (&jetsam::state::Body, &Option<(Arc<Mesh>, DVec3)>)| {
        let color = if body.is_static() { STONE } else { color::of_name(&body.name) };
        let form = match mesh {
            Some((mesh, center)) => {
                let key = (Arc::as_ptr(mesh), center.to_array().map(f64::to_bits));
                Form::Mesh(known.entry(key).or_insert_with(|| Arc::new(about(mesh, *center))).clone())
            }
            None if body.is_static() && body.name == "walls" => Form::Hidden,
            None => Form::Balls,
        };
        let offsets = &world.state().bodies.offset[body.slots.clone()];
        let radius = offsets.iter().map(|o| o.length()).fold(0.0, f64::max) as f32;
        Look { name: body.name.clone(), color, fixed: body.is_static(), radius, form }
    };
    bodies.map(look).collect()
}

fn about(mesh: &Mesh, center: DVec3) -> Vec<Facet> {
    let vertices: Vec<Vec3> = mesh.vertices.iter().map(|v| (*v - center).as_vec3()).collect();
    facets(&vertices, &mesh.triangles, [1.0; 3])
}
