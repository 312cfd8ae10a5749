//! A frame drawn by the CPU: what machines without a GPU show.

use crate::show::{Form, Show};
use crate::{Ball, Facet, Frame, Image, Options, color, render};
use glam::{DQuat, DVec3, Vec3};
use jetsam::state::{Kind, Record};

/// Radius of a ball in spacings: neighbours overlap a little, so that water looks closed.
pub(crate) const RADIUS: f32 = 0.56;
/// The same where agents swim, who would not be seen in closed water.
pub(crate) const SHEER: f32 = 0.14;
/// Below 1: slow water is told apart better than fast water.
pub(crate) const SLOW: f32 = 0.7;

/// Draws a frame on the CPU: fluid as balls coloured by speed, bodies as `show` says.
pub fn paint(show: &Show, frame: &Frame, width: usize, height: usize) -> Image {
    let (mut balls, mut shells) = (Vec::new(), Vec::new());
    let radius = RADIUS * show.spacing;
    let drop = if show.swimmers { SHEER * show.spacing } else { radius };
    for r in &frame.record[frame.segment(Kind::Fluid)] {
        let speed = Vec3::from(r.v).length();
        balls.push(Ball { center: r.x.into(), radius: drop, color: color::water((speed / show.fast).powf(SLOW)) });
    }
    for i in frame.segment(Kind::Rigid).chain(frame.segment(Kind::Static)) {
        let look = &show.bodies[frame.tag[i][1] as usize];
        if let Form::Balls = look.form {
            balls.push(Ball { center: frame.record[i].x.into(), radius, color: look.color });
        }
    }
    for ((place, turn), look) in frame.poses.iter().zip(&show.bodies) {
        if let Form::Mesh(own) = &look.form {
            shells.extend(own.iter().map(|f| moved(f, *turn, *place, look.color)));
        }
    }
    darts(show, &frame.agents, &mut shells);
    let options = Options { facets: &shells, lines: &show.edges, ground: show.ground, ..Options::default() };
    render(&balls, &show.camera, width, height, &options)
}

fn moved(facet: &Facet, turn: DQuat, place: DVec3, color: [f32; 3]) -> Facet {
    let turn32 = turn.as_quat();
    Facet {
        corners: facet.corners.map(|c| (turn * c.as_dvec3() + place).as_vec3()),
        normals: facet.normals.map(|n| turn32 * n),
        color,
    }
}

/// Agents as darts along their velocity: two crossed triangles each.
fn darts(show: &Show, agents: &[Record], all: &mut Vec<Facet>) {
    for flock in &show.flocks {
        let length = flock.length;
        for r in &agents[flock.range.clone()] {
            let (x, along) = (Vec3::from(r.x), Vec3::from(r.v).try_normalize().unwrap_or(Vec3::X));
            let across = along.cross(Vec3::Z).try_normalize().unwrap_or(Vec3::X);
            let (tip, tail) = (x + 0.6 * length * along, x - 0.4 * length * along);
            for (side, normal) in [(across, along.cross(across)), (along.cross(across), across)] {
                let corners = [tip, tail + 0.22 * length * side, tail - 0.22 * length * side];
                all.push(Facet { corners, normals: [normal; 3], color: flock.color });
            }
        }
    }
}
