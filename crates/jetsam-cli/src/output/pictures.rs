//! Pictures of a world: `frame_00000.png` and so on, and the video made of them.

use super::video::Video;
use super::{Writer, frame_path};
use glam::{DQuat, DVec3, Vec3};
use jetsam::scene::Wall;
use jetsam::state::Kind;
use jetsam::{FrameStats, Scene, World};
use jetsam_view::{Ball, Camera, Facet, Image, Line, Options, box_edges, color, facets, render};
use miette::IntoDiagnostic;
use std::path::{Path, PathBuf};

const WIDTH: usize = 1280;
const HEIGHT: usize = 720;
/// Radius of a ball in spacings: neighbours overlap a little, so that water looks closed.
const RADIUS: f64 = 0.56;
/// The same where agents swim, who would not be seen in closed water.
const SHEER: f64 = 0.14;
/// Speed shown white, as a fraction of the largest speed the scene can reach.
const FAST: f64 = 0.8;
/// Length of a dart in sizes of an agent; in radii of the flock where agents have no size.
const DART: [f32; 2] = [4.0, 0.14];
/// Flocks of more agents than this are drawn darker: they are seen against the sky, by how dense they are.
const MANY: f32 = 3000.0;
/// Below 1: slow water is told apart better than fast water.
const SLOW: f32 = 0.7;
const EDGES: [f32; 3] = [0.24, 0.26, 0.29];
const STONE: [f32; 3] = [0.42, 0.38, 0.33];

/// Draws every frame.
pub struct Pictures {
    folder: Option<PathBuf>,
    video: Option<Video>,
    painter: Painter,
}

impl Pictures {
    /// Pictures as files, as a video, or both.
    pub fn create(folder: &Path, files: bool, video: bool, scene: &Scene, world: &World) -> miette::Result<Self> {
        let name = folder.file_name().unwrap_or("video".as_ref());
        let path = folder.join(name).with_extension("mp4");
        let rate = scene.run.frames_per_second;
        let video = video.then(|| Video::create(path, WIDTH, HEIGHT, rate)).transpose()?;
        Ok(Self { folder: files.then(|| folder.into()), video, painter: Painter::new(scene, world) })
    }
}

impl Writer for Pictures {
    fn write(&mut self, world: &World, stats: &FrameStats) -> miette::Result<()> {
        let image = self.painter.paint(world);
        if let Some(folder) = &self.folder {
            image.save_png(frame_path(folder, stats.frame, "png")).into_diagnostic()?;
        }
        self.video.as_mut().map_or(Ok(()), |video| video.write(&image))
    }

    fn finish(&mut self) -> miette::Result<()> {
        self.video.as_mut().map_or(Ok(()), Video::finish)
    }
}

/// Knows how a scene is shown; keeps what does not change between frames.
struct Painter {
    camera: Camera,
    edges: Vec<Line>,
    ground: Option<f32>,
    /// How each body is drawn, in its own frame about the centre of mass.
    looks: Vec<Look>,
}

enum Look {
    Hidden,
    Balls([f32; 3]),
    Mesh(Vec<Facet>),
}

impl Painter {
    fn new(scene: &Scene, world: &World) -> Self {
        let flat = scene.world.dimensions == 2;
        let (mut min, mut max) = (DVec3::from(scene.domain.min), DVec3::from(scene.domain.max));
        if flat {
            (min.y, max.y) = (0.0, 0.0);
        }
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
                Camera::framing(min - margin, max + margin, from, 0.5, WIDTH as f32 / HEIGHT as f32)
            }
        };
        let bounded = scene.domain.walls.iter().any(|w| *w != Wall::Open);
        let solid_floor = !flat && scene.domain.walls[2] == Wall::Solid && scene.world.gravity[2] < 0.0;
        Self {
            camera,
            edges: if bounded { box_edges(min, max, EDGES).into() } else { Vec::new() },
            ground: solid_floor.then_some(min.z),
            looks: looks(world),
        }
    }

    fn paint(&self, world: &World) -> Image {
        let (mut balls, mut shells) = (Vec::new(), Vec::new());
        let (p, bodies) = (&world.state().particles, &world.state().bodies.body);
        let radius = (RADIUS * world.model().spacing) as f32;
        let swimmers = world.model().flocks.iter().any(|f| f.keep_to_fluids);
        let drop = if swimmers { (SHEER * world.model().spacing) as f32 } else { radius };
        let fast = (FAST * world.model().largest_speed) as f32;
        for r in &p.record[p.segment(Kind::Fluid)] {
            let speed = Vec3::from(r.v).length();
            balls.push(Ball { center: r.x.into(), radius: drop, color: color::water((speed / fast).powf(SLOW)) });
        }
        for i in p.segment(Kind::Rigid).chain(p.segment(Kind::Static)) {
            if let Look::Balls(color) = self.looks[p.owner[i] as usize] {
                balls.push(Ball { center: p.record[i].x.into(), radius, color });
            }
        }
        for (body, look) in bodies.iter().zip(&self.looks) {
            if let Look::Mesh(own) = look {
                shells.extend(own.iter().map(|f| moved(f, body.q, body.x)));
            }
        }
        shells.extend(darts(world));
        let options = Options { facets: &shells, lines: &self.edges, ground: self.ground, ..Options::default() };
        render(&balls, &self.camera, WIDTH, HEIGHT, &options)
    }
}

/// Walls are not drawn; a body given as a mesh is drawn as that mesh, any other as its particles.
fn looks(world: &World) -> Vec<Look> {
    let bodies = world.state().bodies.body.iter().zip(world.meshes());
    let look = |(body, mesh): (&jetsam::state::Body, &Option<(std::sync::Arc<jetsam::mesh::Mesh>, DVec3)>)| {
        let color = if body.is_static() { STONE } else { color::of_name(&body.name) };
        match mesh {
            Some((mesh, center)) => {
                let vertices: Vec<Vec3> = mesh.vertices.iter().map(|v| (*v - *center).as_vec3()).collect();
                Look::Mesh(facets(&vertices, &mesh.triangles, color))
            }
            None if body.is_static() && body.name == "walls" => Look::Hidden,
            None => Look::Balls(color),
        }
    };
    bodies.map(look).collect()
}

fn moved(facet: &Facet, turn: DQuat, place: DVec3) -> Facet {
    let turn32 = turn.as_quat();
    Facet {
        corners: facet.corners.map(|c| (turn * c.as_dvec3() + place).as_vec3()),
        normals: facet.normals.map(|n| turn32 * n),
        color: facet.color,
    }
}

/// Agents as darts along their velocity: two crossed triangles each.
fn darts(world: &World) -> Vec<Facet> {
    let mut all = Vec::new();
    let agents = &world.state().agents;
    for flock in &world.model().flocks {
        let shade = (MANY / flock.count as f32).min(1.0).sqrt();
        let color = color::of_name(&flock.name).map(|c| shade * c);
        let length = if flock.size > 0.0 { DART[0] * flock.size } else { DART[1] * flock.radius };
        for r in &agents.record[flock.range()] {
            let (x, along) = (Vec3::from(r.x), Vec3::from(r.v).try_normalize().unwrap_or(Vec3::X));
            let across = along.cross(Vec3::Z).try_normalize().unwrap_or(Vec3::X);
            let (tip, tail) = (x + 0.6 * length * along, x - 0.4 * length * along);
            for (side, normal) in [(across, along.cross(across)), (along.cross(across), across)] {
                let corners = [tip, tail + 0.22 * length * side, tail - 0.22 * length * side];
                all.push(Facet { corners, normals: [normal; 3], color });
            }
        }
    }
    all
}

/// A picture of a solid made of points, for `voxelize --series`.
pub fn of_points(points: &[DVec3], spacing: f64) -> Image {
    let radius = (0.5 * spacing) as f32;
    let tips = points.iter().map(|p| p.as_vec3());
    let (min, max) = tips.clone().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let (min, max) = if points.is_empty() { (Vec3::ZERO, Vec3::ONE) } else { (min - radius, max + radius) };
    let margin = 0.05 * (max - min);
    let camera =
        Camera::framing(min - margin, max + margin, Vec3::new(0.5, -1.0, 0.35), 0.5, WIDTH as f32 / HEIGHT as f32);
    let balls: Vec<Ball> = tips.map(|center| Ball { center, radius, color: color::of_name("mesh") }).collect();
    render(&balls, &camera, WIDTH, HEIGHT, &Options { ground: Some(min.z), ..Options::default() })
}
