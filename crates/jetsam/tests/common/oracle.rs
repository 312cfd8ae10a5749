//! The oracle: all pairs, double precision, formulas written down once more; and the cases it judges on any backend.

use super::scene;
use glam::DVec3;
use jetsam::World;
use jetsam::assemble::Assembly;
use jetsam::random;
use jetsam::scene::Density;
use jetsam::state::Kind;
use std::f64::consts::PI;

/// Makes a world of an assembly, on some backend.
pub type Run = fn(Assembly) -> World;

/// One particle of the oracle.
struct P {
    kind: Kind,
    x: DVec3,
    v: DVec3,
    volume: f64,
    /// Where densities are integrated.
    density: f64,
    /// Inverse mass of what it belongs to: its own for fluid, the body's for bodies.
    inverse_mass: f64,
}

fn wendland(s: f64) -> f64 {
    if s < 1.0 { (1.0 - s).powi(4) * (4.0 * s + 1.0) } else { 0.0 }
}

fn wendland_slope(s: f64) -> f64 {
    if s < 1.0 { -20.0 * s * (1.0 - s).powi(3) } else { 0.0 }
}

/// Sums over the infinite cubic lattice (square if `flat`) of W and of -x dW/dx, for H = 1 and spacing `a`.
fn calibration(a: f64, norm: f64, flat: bool) -> (f64, f64) {
    let n = (1.0 / a).ceil() as i32;
    let depth = if flat { 0 } else { n };
    let cell = if flat { a * a } else { a * a * a };
    let (mut s, mut c) = (0.0, 0.0);
    for i in -n..=n {
        for j in -depth..=depth {
            for k in -n..=n {
                let x = DVec3::new(i.into(), j.into(), k.into()) * a;
                let r = x.length();
                s += norm * wendland(r) * cell;
                if r > 0.0 {
                    c -= norm * wendland_slope(r) * x.x * x.x / r * cell;
                }
            }
        }
    }
    (s, c)
}

/// Density, its rate and acceleration of every fluid particle, force on every particle of bodies, by all pairs.
struct Oracle {
    density: Vec<f64>,
    rate: Vec<f64>,
    force: Vec<DVec3>,
}

fn oracle(particles: &[P], assembly: &Assembly, period: DVec3) -> Oracle {
    let m = &assembly.model;
    let integrated = m.solver.density == Density::Continuity;
    let flat = m.dimensions == 2;
    let norm = if flat { 7.0 / PI } else { 21.0 / (2.0 * PI) };
    let h = m.support;
    let d = if flat { 2 } else { 3 };
    let (s, c) = calibration(1.0 / m.solver.support, norm, flat);
    let w = |r: f64| norm / h.powi(d) * wendland(r / h) / s;
    let slope = |r: f64| norm / h.powi(d + 1) * wendland_slope(r / h) / c;
    let apart = |i: &P, j: &P| {
        let mut e = j.x - i.x;
        for a in 0..3 {
            if period[a] > 0.0 {
                e[a] -= period[a] * (e[a] / period[a]).round();
            }
        }
        e
    };
    let fluid = &m.fluids[0];
    let (rho, stiffness) = (f64::from(fluid.density), f64::from(fluid.stiffness));
    let n = particles.len();
    let mut density = vec![1.0; n];
    let mut seen: Vec<DVec3> = particles.iter().map(|p| p.v).collect();
    let (mut share, mut signed) = (vec![0.0; n], vec![0.0; n]);
    for (i, p) in particles.iter().enumerate().filter(|(_, p)| p.kind == Kind::Fluid) {
        let summed: f64 = particles.iter().map(|q| q.volume * w(apart(p, q).length())).sum();
        density[i] = if integrated { p.density.max(summed - 0.03) } else { summed };
        signed[i] = stiffness / 7.0 * (density[i].powi(7) - 1.0) / density[i].powi(2);
        share[i] = signed[i].max(0.0);
    }
    for (i, p) in particles.iter().enumerate().filter(|(_, p)| p.kind != Kind::Fluid) {
        let (mut total, mut weight, mut flow) = (0.0, 0.0, DVec3::ZERO);
        for (j, q) in particles.iter().enumerate().filter(|(_, q)| q.kind == Kind::Fluid) {
            let e = apart(p, q);
            total += w(e.length()) * (share[j] - rho * m.gravity.dot(e));
            weight += w(e.length());
            flow += w(e.length()) * q.v;
        }
        // no slip: what viscosity sees is the fluid's velocity, mirrored at the body's
        seen[i] = if weight > 0.0 { 2.0 * p.v - flow / weight } else { p.v };
        share[i] = if weight > 0.0 { (total / weight).max(0.0) } else { 0.0 };
    }
    assert!(m.no_slip || particles.iter().all(|p| p.kind == Kind::Fluid));
    let softening = 0.01 * (0.5 * h).powi(2);
    // continuity and, among fluids, diffusion of the excess over what rest under gravity asks for
    let rate = (0..n)
        .map(|i| {
            let p = &particles[i];
            let mut total = 0.0;
            for (j, q) in particles.iter().enumerate().filter(|&(j, _)| j != i && p.kind == Kind::Fluid) {
                let e = apart(p, q);
                let r = e.length();
                if r >= h {
                    continue;
                }
                let gradient = -slope(r) / r * e;
                total += q.volume * (p.v - q.v).dot(gradient);
                if q.kind == Kind::Fluid {
                    let squeezed = 0.5 * (signed[i] + signed[j]) / stiffness;
                    let excess = signed[j] - signed[i] - rho * m.gravity.dot(e) * (1.0 - 3.0 * squeezed);
                    let psi = 2.0 * excess / stiffness * e / (r * r);
                    total += m.solver.density_diffusion * 0.5 * h * m.sound_speed * q.volume * psi.dot(gradient);
                }
            }
            total
        })
        .collect();
    let force = (0..n)
        .map(|i| {
            let p = &particles[i];
            let mut f = DVec3::ZERO;
            for (j, q) in particles.iter().enumerate() {
                let fluids = (p.kind == Kind::Fluid) as u32 + (q.kind == Kind::Fluid) as u32;
                let e = apart(p, q);
                let r = e.length();
                if i == j || r >= h || fluids == 0 {
                    continue;
                }
                let v = q.v - p.v;
                let gradient = -slope(r) / r * e; // of W_ij by x_i
                let volumes = p.volume * q.volume;
                f -= volumes * (share[i] + share[j]) * gradient;
                // Morris: mu_i + mu_j, walls take the fluid's
                let mu = 2.0 * f64::from(fluid.viscosity);
                f += volumes * mu * e.dot(gradient) / (r * r + softening) * (seen[j] - seen[i]);
                if fluids == 1 && r < m.spacing && share[if p.kind == Kind::Fluid { i } else { j }] <= 0.0 {
                    // E16 for spray: k = m* (u / overlap)^2, eta = 2 zeta sqrt(k m*), restitution 0.3, along the normal
                    let reduced = 1.0 / (p.inverse_mass + q.inverse_mass);
                    let k = reduced * (m.largest_speed / (m.solver.contact_overlap * m.spacing)).powi(2);
                    let ln_e = 0.3f64.ln();
                    let eta = 2.0 * -ln_e / (PI * PI + ln_e * ln_e).sqrt() * (k * reduced).sqrt();
                    let n = e / r;
                    f += -k * (m.spacing - r) * n + eta * v.dot(n) * n;
                }
                if fluids == 2 && v.dot(e) < 0.0 {
                    let eta = m.solver.artificial_viscosity * rho * m.sound_speed * 0.5 * h;
                    f += volumes * eta * v.dot(e) / (r * r + softening) * gradient;
                }
            }
            f
        })
        .collect();
    Oracle { density, rate, force }
}

/// Runs the library's evaluation on an assembly and compares density and forces with the oracle.
fn compare(text: &str, disturb: impl Fn(&mut Assembly), period: DVec3, run: Run) {
    let make = || {
        let mut assembly = scene(text).assemble().unwrap_or_else(|e| panic!("{e}"));
        disturb(&mut assembly);
        assembly
    };
    let assembly = make();
    let p = &assembly.state.particles;
    let particles: Vec<P> = Kind::ALL
        .into_iter()
        .flat_map(|kind| p.segment(kind).map(move |i| (kind, i)))
        .map(|(kind, i)| {
            let r = p.record[i];
            let inverse_mass = match kind {
                Kind::Fluid => 1.0 / f64::from(assembly.model.fluids[0].mass),
                _ => 1.0 / assembly.state.bodies.body[p.owner[i] as usize].mass,
            };
            P {
                kind,
                x: DVec3::from(r.x.map(f64::from)),
                v: DVec3::from(r.v.map(f64::from)),
                volume: r.volume.into(),
                density: p.density.get(i).map_or(1.0, |&d| d.into()),
                inverse_mass,
            }
        })
        .collect();
    let expected = oracle(&particles, &assembly, period);
    let mass = f64::from(assembly.model.fluids[0].mass);
    let gravity = assembly.model.gravity;
    let world = run(make());
    let got = &world.state().particles;
    let largest = expected.force.iter().map(|f| f.length()).fold(1e-30, f64::max);
    let fastest_rate = expected.rate.iter().map(|r| r.abs()).fold(1e-30, f64::max);
    let mut checked = 0;
    let mut on_bodies = world.state().forces_on_bodies();
    for kind in Kind::ALL {
        let first = p.first[kind as usize];
        for i in got.segment(kind) {
            // ids of fluids and slots of bodies are places in the assembly's order
            let slot = got.id[i] as usize - if kind == Kind::Static { assembly.state.bodies.rigid_slots } else { 0 };
            let k = first + slot;
            let push = if kind == Kind::Fluid { got.push[i] } else { on_bodies.next().unwrap() };
            let push = DVec3::from(push.map(f64::from));
            let force = if kind == Kind::Fluid { mass * (push - gravity) } else { push };
            let error = (force - expected.force[k]).length() / largest;
            assert!(error < 3e-5, "{kind:?} {k}: force {force} {}, off by {error}", expected.force[k]);
            if kind == Kind::Fluid {
                let error = f64::from(got.density[i]) / expected.density[k] - 1.0;
                assert!(error.abs() < 2e-6, "{k}: density {} {}", got.density[i], expected.density[k]);
                if !got.rate.is_empty() {
                    let error = (f64::from(got.carry[i][3]) - expected.rate[k]) / fastest_rate;
                    assert!(error.abs() < 3e-5, "{k}: rate {} {}", got.carry[i][3], expected.rate[k]);
                }
            }
            checked += 1;
        }
    }
    assert_eq!(checked, particles.len());
}

/// Moves fluid particles by up to `by` and gives them random velocities.
fn jitter(assembly: &mut Assembly, by: f64, speed: f64) {
    let flat = assembly.model.dimensions == 2;
    let grid = assembly.model.grid.clone();
    let n = assembly.state.particles.count[0];
    for (i, r) in assembly.state.particles.record[..n].iter_mut().enumerate() {
        for a in 0..3 {
            if flat && a == 1 {
                continue;
            }
            r.x[a] += (by * (random::uniform(1, a as u64, i as u64) - 0.5)) as f32;
            r.v[a] = (speed * (random::uniform(2, a as u64, i as u64) - 0.5)) as f32;
        }
        grid.wrap(&mut r.x);
    }
}

fn box_scene(dimensions: u32, walls: &str, extra: &str) -> String {
    format!(
        "[world]\ndimensions = {dimensions}\n[domain]\nmin = [-0.3, -0.3, -0.3]\nmax = [0.3, 0.3, 0.3]\n\
         walls = [\"{walls}\", \"{walls}\", \"{walls}\"]\n[resolution]\nspacing = 0.05\n[solver]\nsound_speed = 20\n\
         [[fluid]]\nshape = {{ box = {{ min = [-0.3, -0.3, -0.3], max = [0.3, 0.3, 0.3] }} }}\nviscosity = 2.0\n\
         start = \"lattice\"\n{extra}"
    )
}

/// A case of the oracle.
pub fn a_disturbed_block_in_the_open(run: Run) {
    for dimensions in [2, 3] {
        compare(&box_scene(dimensions, "open", ""), |a| jitter(a, 0.03, 2.0), DVec3::ZERO, run);
    }
}

/// A case of the oracle.
pub fn a_periodic_box(run: Run) {
    for dimensions in [2, 3] {
        compare(&box_scene(dimensions, "periodic", ""), |a| jitter(a, 0.03, 2.0), DVec3::splat(0.6), run);
    }
}

/// A case of the oracle.
pub fn a_box_with_walls_and_a_body(run: Run) {
    let body = "[[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.13 } }\ndensity = 500\n";
    for dimensions in [2, 3] {
        compare(&box_scene(dimensions, "solid", body), |a| jitter(a, 0.02, 2.0), DVec3::ZERO, run);
    }
}

/// A case of the oracle.
pub fn density_integrated(run: Run) {
    let body = "[[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.13 } }\ndensity = 500\n";
    for dimensions in [2, 3] {
        let text = box_scene(dimensions, "solid", body);
        let text = text.replace("[solver]", "[solver]\ndensity = \"continuity\"");
        let disturb = |a: &mut Assembly| {
            jitter(a, 0.02, 2.0);
            let n = a.state.particles.density.len();
            let density = (0..n as u64).map(|i| 1.01 + 0.02 * (random::uniform(3, 0, i) - 0.5) as f32);
            a.state.particles.density = density.collect();
        };
        compare(&text, disturb, DVec3::ZERO, run);
    }
}

/// Places given one by one, in a domain of whole cells of width 1 (spacing 0.5).
pub fn placed(points: &[[f64; 3]]) -> String {
    format!(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-2, -2, -2]\nmax = [2, 2, 2]\nwalls = [\"open\", \"open\", \"open\"]\n\
         [resolution]\nspacing = 0.5\n[solver]\nsound_speed = 20\n[[fluid]]\nshape = {{ points = {points:?} }}\n\
         start = \"lattice\"\nviscosity = 2.0\n"
    )
}

/// A case of the oracle.
pub fn neighbours_on_faces_of_cells_and_at_the_edge_of_the_support(run: Run) {
    // at distance H exactly, on faces and corners of cells, at negative places, at the domain's upper corner
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [-1.0, -1.0, -1.0],
        [-0.5, -1.0, -1.0],
        [2.0, 2.0, 2.0],
        [1.5, 2.0, 2.0],
        [2.0, 1.25, 2.0],
        [-2.0, -2.0, -2.0],
        [-2.0, -2.0, -1.5],
        [0.0, 0.0, 0.999],
    ];
    compare(&placed(&points), |_| (), DVec3::ZERO, run);
}

/// A case of the oracle.
pub fn all_particles_in_one_cell(run: Run) {
    let points: Vec<[f64; 3]> = (0..200).map(|i| [0, 1, 2].map(|a| 0.05 + 0.9 * random::uniform(5, a, i))).collect();
    compare(&placed(&points), |a| squeeze_onto(a, &points), DVec3::ZERO, run);
}

/// Puts the particles at given places, closer than the scene would allow.
fn squeeze_onto(assembly: &mut Assembly, points: &[[f64; 3]]) {
    let records = &mut assembly.state.particles.record;
    for (r, p) in records.iter_mut().zip(points) {
        r.x = p.map(|c| c as f32);
    }
}
