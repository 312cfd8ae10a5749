//! Constants of a flock, derived from its `[[flock]]`.

use crate::scene::{Flock, FlockModel, Relation};
use glam::{DVec3, Vec3};

/// Constants of a flock. Rates have `T = R / U` in them.
#[derive(Clone, Debug)]
pub struct FlockConstants {
    /// Name of the species.
    pub name: String,
    /// The laws.
    pub model: FlockModel,
    /// First agent, counted over all flocks: ids of the flock go on from here.
    pub first: usize,
    /// Number of agents.
    pub count: usize,
    /// Largest radius at which others of a school are perceived (m).
    pub radius: f32,
    /// Radius of separation, or of Couzin's repulsion (m).
    pub separation_radius: f32,
    /// Radius of alignment, or of Couzin's orientation (m).
    pub alignment_radius: f32,
    /// Radius of cohesion, or of Couzin's attraction (m).
    pub cohesion_radius: f32,
    /// How far they see what they flee or chase (m).
    pub sight: f32,
    /// `cos |cos|` of half the field of view; `None` when they see all around.
    pub view: Option<f32>,
    /// Topological neighbours (E25), 0 for metric.
    pub neighbours: usize,
    /// Speeds and turns.
    pub limits: Limits,
    /// Rates and weights of steering.
    pub weights: Weights,
    /// Place they seek (m), and the distance below which they slow down (m).
    pub goal: Option<(Vec3, f32)>,
    /// Flock whose first agent they follow, and how far behind (m).
    pub leader: Option<(usize, f32)>,
    /// What they do about each flock, in the order of the scene.
    pub relations: Vec<Relation>,
    /// What agents that push are made of; `None` for those that only look.
    pub matter: Option<Matter>,
    /// Whether they stay in fluids.
    pub keep_to_fluids: bool,
    /// Whether they flee bodies.
    pub flee_bodies: bool,
    /// Whether they flee fluids.
    pub flee_fluids: bool,
    /// How far ahead they look (s).
    pub look_ahead: f32,
    /// Width of the margins of solid and of open sides (m).
    pub margin: [f32; 2],
    /// Noise (rad).
    pub noise: f64,
    /// Time between decisions (s), 0 for every step.
    pub tau: f64,
    /// Radius of an agent (m).
    pub size: f32,
    /// Seed of its random numbers.
    pub seed: u64,
}

/// What an agent is made of that pushes and is pushed (E27, E28).
#[derive(Clone, Copy, Debug)]
pub struct Matter {
    /// Mass (kg; kg/m in 2D).
    pub mass: f32,
    /// Half the coefficient of drag times the cross-section (m^2; m in 2D).
    pub half_area: f32,
}

/// Speeds and turns (SI).
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Cruising speed `U` (m/s).
    pub speed: f32,
    /// Smallest speed (m/s).
    pub slowest: f32,
    /// Largest speed (m/s).
    pub fastest: f32,
    /// Largest rate of turning (rad/s), infinite if there is none.
    pub turn: f64,
    /// Largest steering (m/s^2).
    pub acceleration: f32,
}

/// Weights turned into rates.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Separation (m/s^2).
    pub separation: f32,
    /// Alignment (1/s).
    pub alignment: f32,
    /// Cohesion (1/s^2).
    pub cohesion: f32,
    /// Return to the cruising speed (1/s).
    pub cruise: f32,
    /// Wander (m/s^2).
    pub wander: f32,
    /// Time in which the direction of wandering changes (s).
    pub wander_time: f64,
    /// Seeking the goal (1/s).
    pub seek: f32,
    /// Following the leader (1/s).
    pub follow: f32,
    /// Fleeing (1/s).
    pub flee: f32,
    /// Chasing (1/s).
    pub chase: f32,
    /// Steering round obstacles and away from sides (m/s^2).
    pub avoid: f32,
}

/// Streams of random numbers of one flock; those of bodies' copies are far below.
const STREAM: u64 = 1 << 32;

impl FlockConstants {
    /// Constants of the flock that is number `index` in the scene and whose agents begin with number `first`. `relations` and
    /// `leader` name flocks by their number.
    pub fn new(
        flock: &Flock,
        index: usize,
        first: usize,
        relations: Vec<Relation>,
        leader: Option<usize>,
        dimensions: u32,
        seed: u64,
    ) -> Self {
        let f = flock;
        let (u, r) = (f.speed, f.radius);
        let t = r / u;
        let force = u / t;
        let or = |v: Option<f64>, other: f64| v.unwrap_or(other) as f32;
        let radii = [
            or(f.separation_radius, if f.model == FlockModel::Couzin { r } else { 0.4 * r }),
            or(f.alignment_radius, r),
            or(f.cohesion_radius, r),
        ];
        let radius = if f.model == FlockModel::Vicsek { radii[1] } else { radii.into_iter().fold(0.0, f32::max) };
        let half = (0.5 * f.field_of_view).to_radians().cos();
        let constant = f.model != FlockModel::Reynolds;
        let is = |key: &str, relation| f.meets.get(key) == Some(&relation);
        let section = if dimensions == 2 { 2.0 * f.size } else { std::f64::consts::PI * f.size * f.size };
        Self {
            name: name(flock),
            model: f.model,
            first,
            count: f.count as usize,
            radius,
            separation_radius: radii[0],
            alignment_radius: radii[1],
            cohesion_radius: radii[2],
            sight: or(f.sight, r),
            view: (f.field_of_view < 360.0).then_some((half * half.abs()) as f32),
            neighbours: f.neighbours as usize,
            limits: Limits {
                speed: u as f32,
                slowest: if constant { u as f32 } else { or(f.speed_min, 0.5 * u) },
                fastest: if constant { u as f32 } else { or(f.speed_max, 1.5 * u) },
                turn: f.turn.map_or(f64::INFINITY, f64::to_radians),
                acceleration: f.acceleration.map_or(f32::MAX, |a| a as f32),
            },
            weights: Weights {
                separation: (f.separation * force) as f32,
                alignment: (f.alignment / t) as f32,
                cohesion: (f.cohesion / (t * t)) as f32,
                cruise: (f.cruise / t) as f32,
                wander: (f.wander * force) as f32,
                wander_time: t,
                seek: (f.seek / t) as f32,
                follow: (f.follow / t) as f32,
                flee: (f.flee / t) as f32,
                chase: (f.chase / t) as f32,
                avoid: (f.avoid * force) as f32,
            },
            goal: f.goal.map(|g| (DVec3::from(g).as_vec3(), f.arrive as f32)),
            leader: leader.map(|l| (l, or(f.follow_distance, r))),
            relations,
            matter: f.mass.map(|m| Matter { mass: m as f32, half_area: (0.5 * f.drag * section) as f32 }),
            keep_to_fluids: is("fluids", Relation::School),
            flee_bodies: is("bodies", Relation::Flee),
            flee_fluids: is("fluids", Relation::Flee),
            look_ahead: or(f.look_ahead, t),
            margin: [or(f.margin, r), or(f.margin, 0.0)],
            noise: f.noise,
            tau: f.tau.unwrap_or(match f.model {
                FlockModel::Reynolds => 0.0,
                FlockModel::Couzin => 0.1,
                FlockModel::Vicsek => 1.0,
            }),
            size: f.size as f32,
            seed: crate::random::word(seed, STREAM, index as u64),
        }
    }

    /// The agents of the flock in the arrays.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.count
    }

    /// How far an agent's centre stays from the particles of bodies (m), which lie `spacing` apart.
    pub fn clearance(&self, spacing: f32) -> f32 {
        (self.size + 0.5 * spacing).max(1.25 * spacing)
    }

    /// Distance from a body's particle below which an agent of mass is pushed (m), when contacts may overlap by the fraction `overlap` of
    /// the `spacing`: outside the distance at which it is held.
    pub fn contact(&self, spacing: f64, overlap: f64) -> f64 {
        f64::from(self.clearance(spacing as f32)) + if self.matter.is_some() { overlap * spacing } else { 0.0 }
    }

    /// How far away an agent of flock `other` can be that matters (m). Topological neighbours have no such bound.
    pub fn reach(&self, other: usize) -> f32 {
        match self.relations[other] {
            Relation::School if self.neighbours == 0 => self.radius,
            Relation::Flee | Relation::Chase => self.sight,
            Relation::School | Relation::Ignore => 0.0,
        }
    }

    /// Largest step for which steering is smooth (s): a quarter of the smallest radius.
    pub fn largest_dt(&self) -> f64 {
        let w = &self.weights;
        let smallest = [self.separation_radius, self.alignment_radius, self.cohesion_radius]
            .into_iter()
            .zip([w.separation, w.alignment, w.cohesion])
            .filter(|(radius, weight)| *radius > 0.0 && *weight > 0.0)
            .map(|(radius, _)| radius)
            .fold(self.radius, f32::min);
        if self.model == FlockModel::Reynolds {
            f64::from(0.25 * smallest / self.limits.fastest)
        } else {
            f64::INFINITY
        }
    }
}

/// Name of a flock.
pub fn name(flock: &Flock) -> String {
    flock.name.clone().unwrap_or_else(|| "flock".into())
}
