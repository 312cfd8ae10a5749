//! E7 and E8: surface tension and vorticity confinement.

mod common;

use common::scene;
use jetsam::World;
use jetsam::state::Kind;

/// Difference of the second moments along z and x over their sum.
fn stretch(world: &World) -> f64 {
    let (mut x, mut z) = (0.0, 0.0);
    for r in world.fluid() {
        x += f64::from(r.x[0]).powi(2);
        z += f64::from(r.x[2]).powi(2);
    }
    (z - x) / (z + x)
}

/// Half periods of a drop of radius 0.3 in the plane that was set swinging, for surface tension `sigma`.
fn half_period(sigma: f64) -> f64 {
    let text = format!(
        "[world]\ndimensions = 2\ngravity = [0, 0, 0]\n[domain]\nmin = [-1, 0, -1]\nmax = [1, 0, 1]\n\
         walls = [\"open\", \"open\", \"open\"]\n[resolution]\nspacing = 0.0125\n[solver]\nartificial_viscosity = 0.01\n\
         support = 2.5\ndensity = \"continuity\"\nnegative_pressure = true\nsound_speed = {}\n\
         [[fluid]]\ndensity = 1\nviscosity = 0\nsurface_tension = {sigma}\nstart = \"lattice\"\n\
         shape = {{ sphere = {{ center = [0, 0, 0], radius = 0.3 }} }}\n",
        40.0 * sigma.sqrt()
    );
    let mut assembly = scene(&text).assemble().unwrap();
    let n = assembly.state.particles.count[Kind::Fluid as usize];
    for record in &mut assembly.state.particles.record[..n] {
        let rate = (0.4 * sigma.sqrt()) as f32;
        record.v = [-rate * record.x[0], 0.0, rate * record.x[2]];
    }
    let mut world = World::new(assembly);
    let (mut before, mut crossings) = (stretch(&world), Vec::new());
    while crossings.len() < 3 {
        world.advance(world.time() + 0.01 / sigma.sqrt(), |_, report| report.trouble.is_none());
        let now = stretch(&world);
        if before * now < 0.0 {
            crossings.push(world.time());
        }
        before = now;
        assert!(world.time() < 4.0 / sigma.sqrt(), "the drop does not swing: {crossings:?}");
    }
    assert!(world.momentum_residual() < 1e-4, "{}", world.momentum_residual());
    0.5 * (crossings[2] - crossings[0])
}

#[test]
fn a_stretched_drop_swings_at_its_surface_tension() {
    // Rayleigh in two dimensions: omega^2 = n (n^2 - 1) sigma / (rho R^3), n = 2
    let sigma = 0.1;
    let expected = std::f64::consts::PI / (6.0 * sigma / 0.3f64.powi(3)).sqrt();
    let reached = half_period(sigma) / expected;
    println!("half a period is {reached:.3} of Rayleigh's");
    assert!((reached - 1.0).abs() < 0.15, "{reached}");
}

#[test]
fn confinement_gives_swirl_back() {
    // four vortices in a periodic square, damped by artificial viscosity
    let energy = |confinement: f64| {
        let text = format!(
            "[world]\ndimensions = 2\ngravity = [0, 0, 0]\n[domain]\nmin = [0, 0, 0]\nmax = [1, 0, 1]\n\
             walls = [\"periodic\", \"open\", \"periodic\"]\n[resolution]\nspacing = 0.025\n[solver]\nsound_speed = 10\n\
             vorticity = {confinement}\n[[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [1, 0, 1] }} }}\n"
        );
        let mut assembly = scene(&text).assemble().unwrap();
        let n = assembly.state.particles.count[Kind::Fluid as usize];
        for record in &mut assembly.state.particles.record[..n] {
            let [x, _, z] = record.x.map(|c| std::f32::consts::TAU * c);
            record.v = [-x.cos() * z.sin(), 0.0, x.sin() * z.cos()];
        }
        let mut world = World::new(assembly);
        world.advance(0.3, |_, report| report.trouble.is_none());
        assert!(world.momentum_residual() < 1e-5, "{}", world.momentum_residual());
        world.ledger().kinetic
    };
    let (without, with) = (energy(0.0), energy(1.0));
    println!("kinetic energy {without:.2} J without, {with:.2} J with confinement");
    assert!(with > 1.02 * without && with < 1.5 * without);
}
