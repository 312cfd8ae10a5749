//! `jetsam check`: what a scene amounts to, without running it.

use crate::terminal::{print, print_json, seconds, table};
use crate::{Outcome, args};
use jetsam::model::{DtBound, Model};
use jetsam::scene::Pressure;
use jetsam::state::Kind;
use jetsam::{Scene, World};
use serde::Serialize;
use std::f64::consts::PI;

/// Everything `check` says.
#[derive(Serialize)]
struct Findings {
    scene: String,
    title: String,
    dimensions: u32,
    spacing: f64,
    support: f64,
    fluid: usize,
    rigid_particles: usize,
    static_particles: usize,
    bodies: usize,
    static_bodies: usize,
    agents: usize,
    neighbours: f64,
    pressure: Pressure,
    /// Whether the scene left the choice of it open.
    pressure_auto: bool,
    seconds: f64,
    dt: f64,
    dt_bound: DtBound,
    steps: f64,
    largest_speed: f64,
    sound_speed: f64,
    margins: Vec<Margin>,
    warnings: Vec<String>,
}

/// A dimensionless number of the step, and the limit it must stay below.
#[derive(Serialize)]
struct Margin {
    name: &'static str,
    value: f64,
    limit: f64,
    meaning: &'static str,
}

/// Reads and assembles a scene, and says what came out.
pub fn check(args: &args::Check) -> miette::Result<Outcome> {
    let mut scene = args.input.open()?;
    scene.solver.settle = 0.0;
    let world = World::from_scene(&scene).map_err(|e| *e)?;
    jetsam::validate::check_scene(&scene, &world).map_err(|e| *e)?;
    let findings = find(&args.input.scene, &scene, &world);
    if args.json {
        print_json(&findings);
    } else {
        print(&describe(&findings));
    }
    Ok(Outcome::Fine)
}

fn find(name: &str, scene: &Scene, world: &World) -> Findings {
    let (model, ledger, bodies) = (world.model(), world.ledger(), &world.state().bodies.body);
    // the run as a whole: at the largest speed the scene can reach, not the present one
    let (dt, dt_bound) = model.largest_dt(model.largest_speed, ledger.acceleration);
    let static_bodies = bodies.iter().filter(|b| b.is_static()).count();
    let count = world.state().particles.count;
    let (margins, mut warnings) = (margins(model, dt, ledger.acceleration), model.warnings.clone());
    for margin in margins.iter().filter(|m| m.value > 1.000_001 * m.limit) {
        warnings.push(format!(
            "{} = {:.3} is above its limit {:.3} ({})",
            margin.name, margin.value, margin.limit, margin.meaning
        ));
    }
    Findings {
        scene: name.into(),
        title: scene.title.clone(),
        dimensions: model.dimensions,
        spacing: model.spacing,
        support: model.support,
        fluid: count[Kind::Fluid as usize],
        rigid_particles: count[Kind::Rigid as usize],
        static_particles: count[Kind::Static as usize],
        bodies: bodies.len() - static_bodies,
        static_bodies,
        agents: world.state().agents.record.len(),
        neighbours: ledger.neighbours,
        pressure: model.solver.pressure,
        pressure_auto: scene.solver.pressure == Pressure::Auto,
        seconds: scene.run.seconds,
        dt,
        dt_bound,
        steps: (scene.run.seconds / dt).ceil(),
        largest_speed: model.largest_speed,
        sound_speed: model.sound_speed,
        margins,
        warnings,
    }
}

/// How far the step is from where it becomes unstable.
fn margins(model: &Model, dt: f64, acceleration: f64) -> Vec<Margin> {
    let mut all = Vec::new();
    let h = 0.5 * model.support;
    let mut add = |name, value: f64, limit, meaning| {
        if value.is_finite() {
            all.push(Margin { name, value, limit, meaning });
        }
    };
    if !model.fluids.is_empty() {
        let s = &model.solver;
        let viscosity = model.fluids.iter().map(|f| f64::from(f.viscosity / f.density)).fold(0.0, f64::max);
        if !model.implicit() {
            add("acoustic", dt * (model.sound_speed + model.largest_speed) / h, s.courant, "dt (c_0 + v) / h");
            add("force", dt * (acceleration / h).sqrt(), s.courant_force, "dt sqrt(a / h)");
            add("mach", model.largest_speed / model.sound_speed, 0.1, "v / c_0; above it density errors exceed 1 %");
        }
        add("viscous", dt * viscosity / (h * h), s.courant_viscous, "dt nu / h^2");
    }
    let shortest = (0..model.contacts.len())
        .map(|b| model.contact_time(b, model.contacts[b].shared_by))
        .fold(f64::INFINITY, f64::min);
    if shortest.is_finite() && !model.implicit() {
        add("contact", PI * dt / shortest, 2.0, "omega dt");
    }
    all
}

/// How pressure is found, and why so.
fn solver(f: &Findings) -> String {
    let (name, what) = match f.pressure {
        Pressure::Dfsph => ("dfsph", "implicit, steps bound by the flow"),
        Pressure::Pbf => ("pbf", "implicit, steps bound by the flow"),
        Pressure::Wcsph | Pressure::Auto => ("wcsph", "weakly compressible, steps bound by sound"),
    };
    let why =
        if f.pressure_auto { "; auto: validated throughout, for measuring; dfsph and pbf are faster" } else { "" };
    format!("{name} ({what}{why})")
}

fn describe(f: &Findings) -> String {
    let mut rows = vec![
        ("scene", format!("{} ({})", f.scene, f.title)),
        ("particles", format!("{} fluid, {} rigid, {} static", f.fluid, f.rigid_particles, f.static_particles)),
        ("bodies", format!("{} rigid, {} static", f.bodies, f.static_bodies)),
        ("agents", f.agents.to_string()),
        ("spacing", format!("{} m, support {} m, {:.1} neighbours", f.spacing, f.support, f.neighbours)),
        ("pressure", solver(f)),
        (
            "time step",
            format!("{}, bounded by {}; {} steps for {} s", seconds(f.dt), f.dt_bound.name(), f.steps, f.seconds),
        ),
        ("speeds", format!("largest {:.3} m/s, sound {:.3} m/s", f.largest_speed, f.sound_speed)),
    ];
    for m in &f.margins {
        rows.push((m.name, format!("{:.3} of {:.3}  ({})", m.value, m.limit, m.meaning)));
    }
    rows.extend(f.warnings.iter().map(|w| ("warning", w.clone())));
    table(&rows)
}
