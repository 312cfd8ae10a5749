//! What the user chooses about a picture.

use crate::Sprite;
use crate::color::Map;

/// How fluids are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fluid {
    /// As balls.
    #[default]
    Balls,
    /// As points of a few pixels.
    Points,
    /// As water: a surface found in screen space.
    Surface,
    /// As small pictures that face the eye.
    Sprites,
    /// Not at all.
    Hidden,
}

impl Fluid {
    /// All of them, with their names.
    pub const ALL: [(Fluid, &str); 5] = [
        (Fluid::Balls, "balls"),
        (Fluid::Points, "points"),
        (Fluid::Surface, "surface"),
        (Fluid::Sprites, "sprites"),
        (Fluid::Hidden, "hidden"),
    ];
}

/// How rigid and static bodies are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bodies {
    /// As their meshes, where they have one.
    #[default]
    Meshes,
    /// As their particles.
    Particles,
}

/// What colours show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorBy {
    /// Speed (m/s).
    #[default]
    Speed,
    /// Relative density.
    Density,
    /// Pressure (Pa).
    Pressure,
    /// Fluid, rigid or static.
    Kind,
    /// Each fluid and each body its own.
    Owner,
}

impl ColorBy {
    /// All of them, with names and units.
    pub const ALL: [(ColorBy, &str, &str); 5] = [
        (ColorBy::Speed, "speed", "m/s"),
        (ColorBy::Density, "density", "rho/rho_0"),
        (ColorBy::Pressure, "pressure", "Pa"),
        (ColorBy::Kind, "kind", ""),
        (ColorBy::Owner, "owner", ""),
    ];

    /// Name and unit.
    pub fn text(self) -> (&'static str, &'static str) {
        let (_, name, unit) = Self::ALL[self as usize];
        (name, unit)
    }
}

/// How the surface of a fluid is smoothed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Smoothing {
    /// Not at all.
    None,
    /// The narrow-range filter (Truong and Yuksel 2018).
    #[default]
    NarrowRange,
    /// A bilateral filter.
    Bilateral,
    /// Curvature flow (van der Laan, Green and Sainz 2009).
    CurvatureFlow,
}

impl Smoothing {
    /// All of them, with their names.
    pub const ALL: [(Smoothing, &str); 4] = [
        (Smoothing::NarrowRange, "narrow range"),
        (Smoothing::Bilateral, "bilateral"),
        (Smoothing::CurvatureFlow, "curvature flow"),
        (Smoothing::None, "none"),
    ];
}

/// What arrows show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Arrows {
    /// Velocity: the way at this velocity.
    #[default]
    Velocity,
    /// Acceleration, the force on a particle over its mass: the way from rest.
    Force,
}

impl Arrows {
    /// All of them, with their names.
    pub const ALL: [(Arrows, &str); 2] = [(Arrows::Velocity, "velocity"), (Arrows::Force, "force")];
}

/// Lines that show how things move. Fluid as balls or sprites is drawn smaller where there are any: they would not be seen in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lines {
    /// None.
    #[default]
    None,
    /// Where some particles and agents were.
    Trails,
    /// Along the velocity of the fluid at this instant.
    Streamlines,
}

impl Lines {
    /// All of them, with their names.
    pub const ALL: [(Lines, &str); 3] =
        [(Lines::None, "none"), (Lines::Trails, "trails"), (Lines::Streamlines, "streamlines")];
}

/// All choices.
#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// How fluids are drawn.
    pub fluid: Fluid,
    /// How bodies are drawn.
    pub bodies: Bodies,
    /// What colours show.
    pub color: ColorBy,
    /// The scale of colours.
    pub map: Map,
    /// Ends of the scale in the unit of `color`; chosen by the scene when absent.
    pub range: Option<[f32; 2]>,
    /// How the surface is smoothed.
    pub smoothing: Smoothing,
    /// Passes of smoothing.
    pub passes: u32,
    /// Radius of a ball of fluid in spacings; chosen by the scene when absent.
    pub radius: Option<f32>,
    /// Water swallows a beam's red to 1/e in `1 / clarity` of a typical depth: 0 is glass.
    pub murk: f32,
    /// Arrows: as long as the way of their particle in this time (s); 0 for none.
    pub arrows: f32,
    /// What they show.
    pub arrows_of: Arrows,
    /// Every so many particles has an arrow.
    pub arrow_every: u32,
    /// Lines that show how things move.
    pub lines: Lines,
    /// What stands for a particle of fluid drawn as sprites.
    pub sprite: Sprite,
    /// Whether the sun throws shadows.
    pub shadows: bool,
    /// Edge of the sun's depth map in texels.
    pub shadow_size: u32,
    /// Looks at the surroundings of a pixel for the darkness of crevices: 0 for none.
    pub crevices: u32,
    /// Whether the edges of the domain are drawn.
    pub edges: bool,
    /// Samples of a pixel along each side.
    pub samples: u32,
    /// Pixels of a sample along each side: more than one for a quick, coarse picture.
    pub coarse: u32,
    /// Distance of the eyes in the picture's depth, for two pictures side by side; 0 for one picture.
    pub stereo: f32,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            fluid: Fluid::default(),
            bodies: Bodies::default(),
            color: ColorBy::default(),
            map: Map::default(),
            range: None,
            smoothing: Smoothing::default(),
            passes: 2,
            radius: None,
            murk: 1.0,
            arrows: 0.0,
            arrows_of: Arrows::default(),
            arrow_every: 1,
            lines: Lines::default(),
            sprite: Sprite::default(),
            shadows: true,
            shadow_size: 2048,
            crevices: 14,
            edges: true,
            samples: 2,
            coarse: 1,
            stereo: 0.0,
        }
    }
}

/// Distance of the eyes as a fraction of the distance to what is looked at.
pub const STEREO: f32 = 0.04;

impl Style {
    /// Ends of the scale of colours for a scene.
    pub fn scale(&self, show: &crate::Show) -> [f32; 2] {
        self.range.unwrap_or(match self.color {
            ColorBy::Density => [0.9, 1.1],
            ColorBy::Pressure => [0.0, show.pressure],
            _ => [0.0, show.fast],
        })
    }

    /// Whether the particles have to be on the host: lines are made there, and what the forces on bodies' particles amount to.
    pub fn at_home(&self) -> bool {
        self.lines != Lines::None || self.arrows > 0.0 && self.arrows_of == Arrows::Force
    }

    /// Exponent of the scale: slow water is told apart better than fast water.
    pub fn gamma(&self) -> f32 {
        if self.color == ColorBy::Speed { crate::paint::SLOW } else { 1.0 }
    }
}
