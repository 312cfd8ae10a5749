//! The voxelizer against closed forms: volumes, winding numbers and counts that follow from geometry alone.
//!
//! The numbers E1 to E13 and B4 are those of the project's validation suite.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};
use jetsam::mesh::{Mesh, MeshFault};
use jetsam::voxelize::{
    Align, Resolution, Rule, VoxelizeError, VoxelizeOptions, Voxels, WindingTree, sample_surface, solid_angle,
    voxelize, winding_number,
};

const RULES: [Rule; 2] = [Rule::Parity, Rule::Winding];

/// A small generator of repeatable numbers in [0, 1).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn vec(&mut self) -> DVec3 {
        DVec3::new(self.roll(), self.roll(), self.roll())
    }
    fn turn(&mut self) -> DQuat {
        let v = self.vec() * 6.0;
        DQuat::from_euler(EulerRot::ZYX, v.x, v.y, v.z)
    }
    fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, (self.roll() * (i + 1) as f64) as usize);
        }
    }
}

/// World-aligned options of a given spacing and offset.
fn world(rule: Rule, spacing: f64, offset: DVec3) -> VoxelizeOptions {
    VoxelizeOptions {
        rule,
        resolution: Resolution::Spacing(spacing),
        offset,
        align: Align::World,
        ..VoxelizeOptions::default()
    }
}

fn fill(mesh: &Mesh, options: &VoxelizeOptions) -> Voxels {
    voxelize(mesh, options).expect("a good mesh")
}

fn volume(v: &Voxels) -> f64 {
    v.len() as f64 * v.spacing.powi(3)
}

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found}, expected {expected} +- {tolerance}");
}

/// The order p of error ~ n^-p from first to last, by least squares in the logarithms.
fn order(n: &[f64], error: &[f64]) -> f64 {
    let (x, y): (Vec<f64>, Vec<f64>) = (n.iter().map(|v| v.ln()).collect(), error.iter().map(|v| v.ln()).collect());
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (mx, my) = (mean(&x), mean(&y));
    let sxy: f64 = x.iter().zip(&y).map(|(a, b)| (a - mx) * (b - my)).sum();
    -sxy / x.iter().map(|a| (a - mx).powi(2)).sum::<f64>()
}

// B4 ----------------------------------------------------------------------------------------------------------------

#[test]
fn b4_mass_properties_are_exact() {
    let (a, b, c) = (2.0, 1.4, 0.8);
    let at = DVec3::new(3.0, -2.0, 5.0);
    let turn = DQuat::from_euler(EulerRot::ZYX, 0.3, -1.1, 2.0);
    let half = DVec3::new(a, b, c) / 2.0;
    let cuboid = Mesh::cuboid(-half, half).transformed(DAffine3::from_rotation_translation(turn, at));
    let mass = cuboid.mass_properties();
    let m = a * b * c;
    close(mass.volume, m, 1e-12 * m, "volume");
    assert!(mass.com.distance(at) < 1e-12 * at.length());
    let diagonal = DVec3::new(b * b + c * c, a * a + c * c, a * a + b * b) * (m / 12.0);
    let r = DMat3::from_quat(turn);
    let expected = r * DMat3::from_diagonal(diagonal) * r.transpose();
    let error = (mass.inertia - expected).to_cols_array().iter().fold(0.0f64, |e, x| e.max(x.abs()));
    assert!(error < 1e-12 * m, "inertia off by {error}");

    // A regular octahedron of corner distance 1: V = 4/3, I = V/5 about each axis.
    let mass = Mesh::octahedron(at, 1.0).mass_properties();
    close(mass.volume, 4.0 / 3.0, 1e-12, "octahedron");
    for axis in 0..3 {
        close(mass.inertia.col(axis)[axis], 4.0 / 15.0, 1e-12, "octahedron's inertia");
    }
    // Inside out: negative.
    close(Mesh::octahedron(at, 1.0).inverted().mass_properties().volume, -4.0 / 3.0, 1e-12, "inverted");
}

#[test]
fn b4_curved_meshes_tend_to_the_closed_forms() {
    // Inscribed polyhedra: the error falls with the square of the edge.
    let (major, minor) = (0.5, 0.2);
    let mut errors = Vec::new();
    for n in [64, 128] {
        let mass = Mesh::torus(major, minor, 2 * n, n).mass_properties();
        errors.push((mass.volume / 0.394_784 - 1.0).abs());
        close(mass.inertia.z_axis.z / mass.volume, 0.28, 2e-3, "torus I_z/m");
        close(mass.inertia.x_axis.x / mass.volume, 0.15, 2e-3, "torus I_x/m");
    }
    assert!(errors[1] < 2e-3 && errors[0] / errors[1] > 3.5, "{errors:?}");
    let ball = Mesh::ball(DVec3::ONE, 1.0, 5).mass_properties();
    close(ball.volume, 4.0 / 3.0 * PI, 5e-3, "ball");
    close(ball.inertia.y_axis.y / ball.volume, 0.4, 2e-3, "ball's inertia");
    let cylinder = Mesh::cylinder(0.5, 2.0, 256).mass_properties();
    close(cylinder.volume, 0.5 * PI, 1e-3, "cylinder");
    assert!(cylinder.com.distance(DVec3::Z) < 1e-12);
}

/// Root mean square over 24 random offsets of the relative errors of volume and inertia per mass of the cells.
fn rms(mesh: &Mesh, n: u32, across: f64, turned: bool) -> (f64, f64) {
    let exact = mesh.mass_properties();
    let mut dice = Dice(u64::from(n) + 7);
    let (mut dv, mut di) = (0.0, 0.0);
    for _ in 0..24 {
        let spacing = across / f64::from(n);
        let rotation = if turned { dice.turn() } else { DQuat::IDENTITY };
        let options = VoxelizeOptions { rotation, ..world(Rule::Winding, spacing, dice.vec()) };
        let voxels = fill(mesh, &options);
        dv += (volume(&voxels) / exact.volume - 1.0).powi(2);
        let points = voxels.points();
        let com = points.iter().sum::<DVec3>() / points.len() as f64;
        let trace = points.iter().map(|p| 2.0 * p.distance_squared(com)).sum::<f64>() / points.len() as f64;
        let expected = (exact.inertia.x_axis.x + exact.inertia.y_axis.y + exact.inertia.z_axis.z) / exact.volume;
        di += (trace / expected - 1.0).powi(2);
    }
    ((dv / 24.0).sqrt(), (di / 24.0).sqrt())
}

#[test]
fn b4_cells_approach_the_solid() {
    let half = DVec3::new(1.0, 0.7, 0.4);
    let cuboid = Mesh::cuboid(-half, half);
    for (n, aligned, turned) in [(8, 1.7e-1, 1.9e-2), (16, 7.1e-2, 4.9e-3), (32, 3.7e-2, 2e-3), (64, 2.3e-2, 1e-3)] {
        let dv = rms(&cuboid, n, 2.0, false).0;
        assert!(dv <= 2.0 * aligned, "aligned box n={n}: {dv}");
        let dv = rms(&cuboid, n, 2.0, true).0;
        assert!(dv <= 2.0 * turned, "turned box n={n}: {dv}");
    }
    let torus = Mesh::torus(0.75, 0.25, 128, 64);
    for (n, v, i) in [(16, 4e-2, 1.6e-2), (32, 1.3e-2, 4e-3), (64, 4e-3, 8.4e-4)] {
        let (dv, di) = rms(&torus, n, 2.0, false);
        assert!(dv <= 2.0 * v && di <= 2.0 * i, "torus n={n}: {dv} {di}");
    }
}

#[test]
fn b4_centre_of_mass_is_within_an_eighth_of_a_cell() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 4);
    let mut dice = Dice(3);
    for n in [8, 16, 32] {
        for _ in 0..8 {
            let h = 2.0 / f64::from(n);
            let offset = dice.vec();
            let points = fill(&ball, &world(Rule::Winding, h, offset)).points();
            let com = points.iter().sum::<DVec3>() / points.len() as f64;
            assert!(com.distance(offset) <= 0.125 * h, "n={n}: {}", com.distance(offset) / h);
        }
    }
}

// E1 ----------------------------------------------------------------------------------------------------------------

#[test]
fn e1_volume_of_a_ball() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 5);
    assert_eq!(ball.triangles.len(), 20_480);
    let (mut n, mut errors) = (Vec::new(), Vec::new());
    for (across, v, i) in [(16, 3e-3, 5.7e-3), (32, 7.9e-4, 1.7e-3), (64, 2.3e-4, 4.7e-4), (128, 1.5e-4, 1.6e-4)] {
        let (dv, di) = rms(&ball, across, 2.0, false);
        assert!(dv <= 2.0 * v && di <= 2.0 * i, "n={across}: {dv} {di}");
        n.push(f64::from(across));
        errors.push(dv);
    }
    let p = order(&n, &errors);
    assert!(p >= 1.7, "order {p} of {errors:?}");
}

// E2, E3: everything on the lattice ---------------------------------------------------------------------------------

#[test]
fn e2_box_on_cell_centres_counts_once() {
    for rule in RULES {
        for (h, n) in [(0.1, 7), (1.0, 1), (0.3, 16), (1.0 / 3.0, 65)] {
            let mut first: Option<Vec<[u32; 3]>> = None;
            for shift in [DVec3::ZERO, DVec3::new(3.0, -5.0, 11.0), DVec3::new(-100.0, 40.0, -7.0)] {
                // Cell centres lie at odd multiples of h/2: so do all six faces.
                let lo = (shift + 0.5) * h;
                let mesh = Mesh::cuboid(lo, lo + f64::from(n) * h);
                let voxels = fill(&mesh, &world(rule, h, DVec3::ZERO));
                assert_eq!(voxels.len(), (n * n * n) as usize, "{rule:?} h={h} n={n} shift={shift}");
                let cells: Vec<_> = voxels.bits.iter().collect();
                // The lower faces are in, the upper ones are not.
                assert!(voxels.center(cells[0]).distance(lo) < 1e-9);
                let least = cells[0];
                let pattern: Vec<_> = cells.iter().map(|c| [0, 1, 2].map(|i| c[i] - least[i])).collect();
                assert_eq!(first.get_or_insert_with(|| pattern.clone()), &pattern);
            }
        }
    }
}

/// Cells whose centre is farther than `h`·1e-6 from the surface must be as the winding number says.
fn agrees_with_winding_number(mesh: &Mesh, voxels: &Voxels, what: &str) {
    let [nx, ny, nz] = voxels.dims;
    for cell in (0..nx * ny * nz).map(|n| [n % nx, n / nx % ny, n / (nx * ny)]) {
        let p = voxels.center(cell);
        if distance(mesh, p) > 1e-6 * voxels.spacing {
            let inside = winding_number(mesh, p).abs() > 0.5;
            let found = voxels.contains(cell[0].into(), cell[1].into(), cell[2].into());
            assert_eq!(found, inside, "{what}: cell {cell:?}");
        }
    }
}

/// Distance from a point to the nearest triangle.
fn distance(mesh: &Mesh, p: DVec3) -> f64 {
    let one = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize] - p);
        let n = (b - a).cross(c - a);
        let foot = n * (a.dot(n) / n.length_squared());
        let within = [(a, b), (b, c), (c, a)].iter().all(|(u, v)| (*v - *u).cross(foot - *u).dot(n) >= 0.0);
        let side = |u: DVec3, v: DVec3| {
            let t = (-u.dot(v - u) / (v - u).length_squared()).clamp(0.0, 1.0);
            (u + (v - u) * t).length()
        };
        if within { foot.length() } else { side(a, b).min(side(b, c)).min(side(c, a)) }
    };
    mesh.triangles.iter().map(one).fold(f64::INFINITY, f64::min)
}

/// Rows along x whose cells all differ from both neighbours in y, or both in z: the marks of a miscounted ray.
fn streaks(v: &Voxels) -> usize {
    let [nx, ny, nz] = v.dims.map(i64::from);
    let row = |j: i64, k: i64| (0..nx).map(|i| v.contains(i, j, k)).collect::<Vec<_>>();
    let differs = |a: &[bool], b: &[bool]| a.iter().zip(b).all(|(x, y)| x != y);
    let mut found = 0;
    for k in 0..nz {
        for j in 0..ny {
            let here = row(j, k);
            let y = differs(&here, &row(j - 1, k)) && differs(&here, &row(j + 1, k));
            let z = differs(&here, &row(j, k - 1)) && differs(&here, &row(j, k + 1));
            found += usize::from(y || z);
        }
    }
    found
}

#[test]
fn e3_rays_through_every_corner_and_edge() {
    let turned = Mesh::cuboid(DVec3::splat(-4.0), DVec3::splat(4.0))
        .transformed(DAffine3::from_quat(DQuat::from_rotation_z(PI / 4.0)));
    let octahedron = Mesh::octahedron(DVec3::ZERO, 8.0);
    // A ball snapped to the lattice: every corner is a cell centre, every ray hits corners and edges.
    let mut snapped = Mesh::ball(DVec3::ZERO, 9.0, 3);
    snapped.vertices.iter_mut().for_each(|v| *v = v.round());
    for (name, mesh) in [("turned box", turned), ("octahedron", octahedron), ("snapped ball", snapped)] {
        let options = |rule| world(rule, 1.0, DVec3::splat(0.5));
        let placed = mesh.transformed(DAffine3::from_translation(DVec3::splat(0.5)));
        let (parity, winding) = (fill(&mesh, &options(Rule::Parity)), fill(&mesh, &options(Rule::Winding)));
        assert_eq!(parity.bits, winding.bits, "{name}");
        agrees_with_winding_number(&placed, &parity, name);
        assert_eq!(streaks(&parity), 0, "{name}");
    }
}

#[test]
fn e3_symmetric_solids_stay_symmetric() {
    // On a lattice shifted off the symmetry planes by half a cell, mirror images are the same pattern mirrored.
    let mesh = Mesh::octahedron(DVec3::ZERO, 7.3);
    let v = fill(&mesh, &world(Rule::Parity, 1.0, DVec3::ZERO));
    let [nx, ny, nz] = v.dims.map(i64::from);
    for (i, j, k) in v.bits.iter().map(|c| (c[0].into(), c[1].into(), c[2].into())) {
        assert!(v.contains(nx - 1 - i, j, k) && v.contains(i, ny - 1 - j, k) && v.contains(i, j, nz - 1 - k));
        assert!(v.contains(j, k, i) && v.contains(j, i, k));
    }
    // With corners on cell centres the half-open rule takes each mirror pair of faces once: the lower one of each
    // pair. The count is that of half-open intervals: rows |y| + |z| < R hold 2(R - |y| - |z|) cells, R = 8.
    let v = fill(&Mesh::octahedron(DVec3::splat(0.5), 8.0), &world(Rule::Parity, 1.0, DVec3::ZERO));
    let inner: i64 = (-8i64..=8).flat_map(|y| (-8i64..=8).map(move |z| 2 * (8 - y.abs() - z.abs()).max(0))).sum();
    assert_eq!(v.len() as i64, inner);
}

// E4 to E6: shells upon and inside each other -----------------------------------------------------------------------

#[test]
fn e4_a_shell_given_twice() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 4);
    let twice = ball.clone().merged(&ball);
    let options = |rule| world(rule, 0.05, DVec3::new(0.013, 0.007, 0.011));
    assert_eq!(fill(&twice, &options(Rule::Parity)).len(), 0);
    let winding = fill(&twice, &options(Rule::Winding));
    assert_eq!(winding.bits, fill(&ball, &options(Rule::Winding)).bits);
    assert!(winding.report.nonmanifold_edges > 0 && winding.report.watertight);
    // Counted twice by the divergence theorem; the report takes the mass from the particles and says so.
    assert!(winding.report.warnings.iter().any(|w| w.contains("from the particles")));
    assert_eq!(VoxelizeOptions::default().rule, Rule::Winding);
}

#[test]
fn e5_overlapping_balls() {
    let ball = |x| Mesh::ball(DVec3::X * x, 1.0, 5);
    let both = ball(-0.5).merged(&ball(0.5));
    let options = |rule| world(rule, 2.0 / 64.0, DVec3::new(0.003, 0.011, 0.017));
    let union = 4.0 / 3.0 * PI * 2.0 - 5.0 / 12.0 * PI;
    close(union, 7.06858, 1e-5, "closed form");
    close(volume(&fill(&both, &options(Rule::Winding))), union, 0.01 * union, "union");
    close(volume(&fill(&both, &options(Rule::Parity))), 5.75959, 0.01 * 5.75959, "exclusive or");
}

#[test]
fn e6_a_ball_within_a_ball() {
    let (outer, inner) = (Mesh::ball(DVec3::ZERO, 1.0, 5), Mesh::ball(DVec3::ZERO, 0.5, 5));
    let cavity = outer.clone().merged(&inner.inverted());
    let nested = outer.clone().merged(&inner);
    let options = |rule| world(rule, 2.0 / 64.0, DVec3::new(0.003, 0.011, 0.017));
    for (mesh, rule, expected) in [
        (&cavity, Rule::Parity, 3.66519),
        (&nested, Rule::Parity, 3.66519),
        (&cavity, Rule::Winding, 3.66519),
        (&nested, Rule::Winding, 4.18879),
    ] {
        close(volume(&fill(mesh, &options(rule))), expected, 0.01 * expected, "nested balls");
    }
    // The wall of a cavity is no flipped shell, and a shell turned inside out with its cavity keeps the cavity.
    assert_eq!(cavity.report().flipped_shells, 0);
    assert_eq!(cavity.inverted().report().flipped_shells, 1);
    let v = fill(&cavity.inverted(), &options(Rule::Winding));
    assert_eq!(v.bits, fill(&cavity, &options(Rule::Winding)).bits);
}

// E7: wrong faces ---------------------------------------------------------------------------------------------------

#[test]
fn e7_flipped_faces_and_soup() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 4);
    let cube = Mesh::cuboid(DVec3::splat(-0.9), DVec3::splat(0.9));
    for mesh in [ball, cube] {
        for rule in RULES {
            let options = world(rule, 0.04, DVec3::new(0.003, 0.011, 0.017));
            let clean = fill(&mesh, &options);
            let flip = |mut m: Mesh, t: usize| {
                m.triangles[t].swap(0, 1);
                m
            };
            let soup = mesh.unwelded();
            for (name, broken) in [
                ("inverted", mesh.inverted()),
                ("one flipped", flip(mesh.clone(), 7)),
                ("three flipped", flip(flip(flip(mesh.clone(), 7), 1), 11)),
                ("soup", soup.clone()),
                ("soup with one flipped", flip(soup, 3)),
            ] {
                assert_eq!(fill(&broken, &options).bits, clean.bits, "{rule:?} {name}");
            }
        }
        assert_eq!(mesh.report().flipped_triangles, 0);
        let mut one = mesh.clone();
        one.triangles[5].swap(1, 2);
        assert_eq!((one.report().flipped_triangles, one.report().flipped_shells), (1, 0));
        assert_eq!(mesh.inverted().report().flipped_shells, 1);
        assert!(mesh.unwelded().report().watertight);
    }
    // The winding number itself, unmended, is off by twice the solid angle of the flipped triangle.
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 2);
    let mut flipped = ball.clone();
    flipped.triangles[9].swap(0, 1);
    let p = DVec3::new(0.2, -0.1, 0.3);
    let [a, b, c] = ball.triangles[9].map(|v| ball.vertices[v as usize] - p);
    close(winding_number(&flipped, p), 1.0 - 2.0 * solid_angle(a, b, c) / (4.0 * PI), 1e-12, "flipped triangle");
}

#[test]
fn e7_one_of_two_overlapping_shells_inside_out() {
    let (big, small) = (Mesh::ball(DVec3::ZERO, 1.0, 4), Mesh::ball(DVec3::X, 0.4, 3));
    let options = world(Rule::Winding, 0.05, DVec3::new(0.003, 0.011, 0.017));
    let clean = fill(&big.clone().merged(&small), &options);
    let broken = fill(&big.merged(&small.inverted()), &options);
    assert_eq!(broken.bits, clean.bits);
    assert_eq!((clean.report.flipped_shells, broken.report.flipped_shells), (0, 1));
}

// E8: holes ---------------------------------------------------------------------------------------------------------

#[test]
fn e8_winding_numbers_of_open_meshes() {
    let hemisphere = Mesh::open_ball(1.0, FRAC_PI_2, 64, 128);
    close(winding_number(&hemisphere, DVec3::ZERO), 0.5, 1e-12, "hemisphere's centre");
    // Solid angle of the opening, a disk of radius 1 at distance d: 2π(1 - d/√(1+d²)). For d = 1/2 inside, w = .7236.
    close(winding_number(&hemisphere, DVec3::Z * -0.5), 0.7236, 2e-4, "in the hemisphere");
    let capless = Mesh::open_ball(1.0, 10f64.to_radians(), 64, 360);
    close(winding_number(&capless, DVec3::ZERO), 0.992_404, 1e-6, "ball without its cap");
    let mut open_cube = Mesh::cuboid(DVec3::splat(-1.0), DVec3::ONE);
    open_cube.triangles.truncate(10);
    close(winding_number(&open_cube, DVec3::ZERO), 5.0 / 6.0, 1e-12, "cube without a face");
}

#[test]
fn e8_the_tree_is_right_to_a_hundredth() {
    let mut dice = Dice(11);
    let mut soup = Mesh::torus_knot(2, 3, 1.0, 0.25, 200, 16);
    soup.triangles.retain(|_| dice.roll() < 0.9);
    let tree = WindingTree::new(&soup);
    for _ in 0..400 {
        let p = (dice.vec() - 0.5) * DVec3::new(3.4, 3.4, 1.6);
        close(tree.winding(p, 2.0), winding_number(&soup, p), 1e-2, "tree");
    }
}

#[test]
fn e8_open_balls_are_filled() {
    // The cap cut off has height 1 - cos 10°, and the opening faces x, the direction of the rows.
    let ball = Mesh::open_ball(1.0, 10f64.to_radians(), 96, 192)
        .transformed(DAffine3::from_quat(DQuat::from_rotation_y(FRAC_PI_2)));
    for rule in RULES {
        let options = world(rule, 2.0 / 64.0, DVec3::new(0.003, 0.011, 0.017));
        let v = fill(&ball, &options);
        close(volume(&v), 4.0 / 3.0 * PI, 0.01 * 4.2, "open ball");
        assert!(!v.report.watertight && v.report.boundary_edges == 192);
        assert!(v.report.warnings.iter().any(|w| w.contains("open")));
        assert_eq!(v.report.warnings.iter().any(|w| w.contains("through a hole")), rule == Rule::Parity);
        let placed = ball.transformed(DAffine3::from_translation(options.offset));
        if rule == Rule::Winding {
            let coarse = VoxelizeOptions { resolution: Resolution::Across(13), ..options };
            agrees_with_winding_number(&placed, &fill(&ball, &coarse), "open ball");
        }
    }
    let mut open_cube = Mesh::cuboid(DVec3::splat(-1.0), DVec3::ONE);
    open_cube.triangles.truncate(10);
    let v = fill(&open_cube, &VoxelizeOptions { resolution: Resolution::Across(21), ..Default::default() });
    assert!(v.contains(10, 10, 10));
    agrees_with_winding_number(&open_cube, &v, "open cube");
}

#[test]
fn e8_a_torn_soup_is_what_the_winding_number_says() {
    // More rim than the strips are summed for: the tree takes over, and must not change a single cell.
    let mut dice = Dice(5);
    let mut soup = Mesh::torus(0.8, 0.35, 48, 24).transformed(DAffine3::from_quat(Dice(9).turn()));
    soup.triangles.retain(|_| dice.roll() < 0.75);
    soup.triangles.iter_mut().for_each(|t| {
        if dice.roll() < 0.05 {
            t.swap(0, 1)
        }
    });
    let options = VoxelizeOptions { resolution: Resolution::Across(28), ..Default::default() };
    let v = fill(&soup, &options);
    // Flipped faces that hang together with their neighbours are mended first; so they are here.
    let mut mended = Mesh::torus(0.8, 0.35, 48, 24).transformed(DAffine3::from_quat(Dice(9).turn()));
    let mut dice = Dice(5);
    mended.triangles.retain(|_| dice.roll() < 0.75);
    let expected = fill(&mended, &options);
    agrees_with_winding_number(&mended, &expected, "torn torus");
    let different = v.bits.words().iter().zip(expected.bits.words()).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
    assert!(f64::from(different) < 0.01 * expected.len() as f64, "{different} of {} cells", expected.len());
}

// E9: thin parts ----------------------------------------------------------------------------------------------------

/// Number of 6-connected groups of solid cells.
fn pieces(v: &Voxels) -> usize {
    let mut left: std::collections::HashSet<[i64; 3]> = v.bits.iter().map(|c| c.map(i64::from)).collect();
    let mut count = 0;
    while let Some(&start) = left.iter().next() {
        count += 1;
        left.remove(&start);
        let mut pending = vec![start];
        while let Some(c) = pending.pop() {
            for (axis, step) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
                let mut next = c;
                next[axis] += step;
                if left.remove(&next) {
                    pending.push(next);
                }
            }
        }
    }
    count
}

#[test]
fn e9_a_plate_of_three_tenths_of_a_cell() {
    let plate = Mesh::cuboid(DVec3::new(-10.0, -10.0, -0.15), DVec3::new(10.0, 10.0, 0.15));
    let mut dice = Dice(1);
    let (mut hits, trials) = (0, 200);
    for _ in 0..trials {
        let options = world(Rule::Winding, 1.0, dice.vec());
        let v = fill(&plate, &options);
        let layers = v.bits.iter().map(|c| c[2]).collect::<std::collections::HashSet<_>>().len();
        assert!(layers <= 1);
        hits += layers;
        let off = !(0.8..=1.25).contains(&(volume(&v) / plate.mass_properties().volume));
        assert!(off && v.report.warnings.iter().any(|w| w.contains("volume")), "{:?}", v.report.warnings);
        let thin = fill(&plate, &VoxelizeOptions { thin: true, ..options });
        assert!(thin.len() >= 400 && pieces(&thin) == 1, "{} cells", thin.len());
    }
    // Three tenths, within three standard deviations of the binomial.
    close(f64::from(hits as u32) / f64::from(trials), 0.3, 3.0 * (0.21f64 / f64::from(trials)).sqrt(), "hits");
}

#[test]
fn e9_tilted_plates_stay_whole() {
    let plate = Mesh::cuboid(DVec3::new(-8.0, -8.0, -0.15), DVec3::new(8.0, 8.0, 0.15));
    let mut dice = Dice(2);
    for _ in 0..40 {
        let options = VoxelizeOptions { rotation: dice.turn(), thin: true, ..world(Rule::Winding, 1.0, dice.vec()) };
        let v = fill(&plate, &options);
        assert_eq!(pieces(&v), 1);
        // No ray along the plate's normal gets through: every place of the plate has a cell within its reach.
        let points = v.points();
        for n in 0..15 * 15 {
            let local = DVec3::new(f64::from(n % 15) - 7.0, f64::from(n / 15) - 7.0, 0.0);
            let p = options.rotation * local + options.offset;
            assert!(points.iter().any(|q| (*q - p).abs().max_element() <= 0.66), "a hole at {local}");
        }
    }
}

#[test]
fn e9_thick_bodies_are_left_alone() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 4);
    let options = VoxelizeOptions { resolution: Resolution::Across(24), ..Default::default() };
    let thin = VoxelizeOptions { thin: true, ..options.clone() };
    let (plain, kept) = (fill(&ball, &options), fill(&ball, &thin));
    let added = kept.len() - plain.len();
    assert!((added as f64) < 0.01 * plain.len() as f64, "{added} cells more than {}", plain.len());
}

// E10: pathological input -------------------------------------------------------------------------------------------

#[test]
fn e10_degenerate_triangles_change_nothing() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 3);
    for rule in RULES {
        let options = world(rule, 0.07, DVec3::new(0.003, 0.011, 0.017));
        let clean = fill(&ball, &options);
        let mut dirty = ball.clone();
        let n = dirty.vertices.len() as u32;
        dirty.vertices.extend([DVec3::ZERO, DVec3::X * 0.5, DVec3::X * 0.25]);
        // Zero area: twice the same corner, three corners at one place.
        dirty.triangles.extend([[0, 0, 5], [3, 3, 3], [n, n, n + 1]]);
        assert_eq!(fill(&dirty, &options).bits, clean.bits);
        // A needle of 1 to 1e6 that closes on itself (both sides) encloses nothing.
        dirty.vertices.push(DVec3::new(0.25, 0.5e-6, 0.0));
        dirty.triangles.extend([[n, n + 1, n + 3], [n, n + 3, n + 1]]);
        assert_eq!(fill(&dirty, &options).bits, clean.bits);
    }
    // A single triangle, a line, a point: errors or nothing, no panic.
    let single = Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2]] };
    assert!(fill(&single, &VoxelizeOptions::default()).is_empty());
    let line = Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0], triangles: vec![[0, 1, 2]] };
    assert!(fill(&line, &VoxelizeOptions::default()).is_empty());
    let point = Mesh { vertices: vec![DVec3::ONE], triangles: vec![[0, 0, 0]] };
    assert_eq!(voxelize(&point, &VoxelizeOptions::default()).unwrap_err(), VoxelizeError::Point);
}

#[test]
fn e10_bad_input_is_an_error_value() {
    let options = VoxelizeOptions::default();
    let mut ball = Mesh::ball(DVec3::ZERO, 1.0, 1);
    let mesh_fault = |m: &Mesh| match voxelize(m, &options).unwrap_err() {
        VoxelizeError::Mesh(fault) => fault,
        other => panic!("{other}"),
    };
    ball.vertices[3].y = f64::NAN;
    assert_eq!(mesh_fault(&ball), MeshFault::NotFinite { vertex: 3 });
    assert_eq!(mesh_fault(&Mesh::default()), MeshFault::Empty);
    ball.vertices[3].y = 0.0;
    ball.triangles[2][1] = 1000;
    assert_eq!(mesh_fault(&ball), MeshFault::IndexOutOfRange { triangle: 2, vertices: 42 });

    let ball = Mesh::ball(DVec3::ZERO, 1.0, 1);
    for bad in [
        Resolution::Spacing(0.0),
        Resolution::Spacing(-1.0),
        Resolution::Spacing(f64::NAN),
        Resolution::Across(0),
        Resolution::Particles(0),
    ] {
        let options = VoxelizeOptions { resolution: bad, ..VoxelizeOptions::default() };
        assert!(matches!(voxelize(&ball, &options), Err(VoxelizeError::Option { .. })), "{bad:?}");
    }
    for align in [Align::Body, Align::World] {
        for h in [1e-4, 1e-9, 1e-300] {
            let options = VoxelizeOptions {
                resolution: Resolution::Spacing(h),
                align,
                max_cells: 1_000_000,
                ..VoxelizeOptions::default()
            };
            match voxelize(&ball, &options) {
                Err(VoxelizeError::TooManyCells { fits, .. }) if h > 1e-12 => {
                    let again = VoxelizeOptions { resolution: Resolution::Spacing(fits), ..options };
                    assert!(voxelize(&ball, &again).is_ok(), "a spacing of {fits} was said to fit");
                }
                Err(VoxelizeError::TooManyCells { .. }) => {}
                other => panic!("{other:?}"),
            }
        }
    }
}

#[test]
fn e10_scale_does_not_matter() {
    let knot = Mesh::torus_knot(2, 3, 1.0, 0.3, 120, 12);
    for rule in RULES {
        for align in [Align::Body, Align::World] {
            let at = |scale: f64| {
                let mesh = knot.transformed(DAffine3::from_scale(DVec3::splat(scale)));
                let options = VoxelizeOptions { align, ..world(rule, 0.05 * scale, DVec3::splat(0.01 * scale)) };
                fill(&mesh, &options).bits
            };
            let plain = at(1.0);
            assert!(plain.count() > 1000);
            assert_eq!(at(1e8), plain);
            assert_eq!(at(1e-8), plain);
        }
    }
}

// E11: determinism --------------------------------------------------------------------------------------------------

#[test]
fn e11_same_bits_for_any_order_and_any_number_of_threads() {
    let mut dice = Dice(42);
    let mut torn = Mesh::torus_knot(2, 3, 1.0, 0.3, 240, 20);
    torn.triangles.retain(|_| dice.roll() < 0.9);
    let whole = Mesh::torus_knot(2, 3, 1.0, 0.3, 240, 20);
    for (mesh, across) in [(whole, 64), (torn, 32)] {
        for rule in RULES {
            let options = VoxelizeOptions { rule, resolution: Resolution::Across(across), ..Default::default() };
            let reference = fill(&mesh, &options);
            for threads in [1, 2, 8] {
                let mut shuffled = mesh.clone();
                dice.shuffle(&mut shuffled.triangles);
                for t in &mut shuffled.triangles {
                    t.rotate_left((dice.roll() * 3.0) as usize);
                }
                let mut names: Vec<u32> = (0..shuffled.vertices.len() as u32).collect();
                dice.shuffle(&mut names);
                let mut vertices = shuffled.vertices.clone();
                for (old, new) in names.iter().enumerate() {
                    vertices[*new as usize] = shuffled.vertices[old];
                }
                shuffled.vertices = vertices;
                shuffled.triangles.iter_mut().flatten().for_each(|v| *v = names[*v as usize]);
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                let again = pool.install(|| fill(&shuffled, &options));
                assert_eq!(again.bits, reference.bits, "{rule:?}, {threads} threads");
                assert_eq!(again.points(), reference.points());
            }
        }
    }
}

// E12: slices along x, y or z ---------------------------------------------------------------------------------------

#[test]
fn e12_the_direction_of_slices_does_not_matter() {
    let shapes = [
        Mesh::ball(DVec3::ZERO, 1.0, 5),
        Mesh::torus_knot(2, 3, 0.6, 0.2, 240, 20),
        Mesh::cuboid(DVec3::splat(-1.0), DVec3::new(1.0, 0.7, 0.4)),
    ];
    for mesh in shapes {
        for rule in RULES {
            let offset = DVec3::new(0.0031, 0.0117, 0.0173);
            let plain = fill(&mesh, &world(rule, 2.0 / 64.0, offset));
            // Rows run along x: turning the mesh round the diagonal turns the slices.
            for turns in 1..3 {
                let turn = |v: DVec3| (0..turns).fold(v, |v, _| DVec3::new(v.y, v.z, v.x));
                let mut turned = mesh.clone();
                turned.vertices.iter_mut().for_each(|v| *v = turn(*v));
                let other = fill(&turned, &world(rule, 2.0 / 64.0, turn(offset)));
                assert_eq!(other.len(), plain.len());
                let back = |c: [u32; 3]| (0..3 - turns).fold(c, |[x, y, z], _| [y, z, x]);
                assert!(other.bits.iter().map(back).all(|c| plain.contains(c[0].into(), c[1].into(), c[2].into())));
            }
        }
    }
}

// E13: the monkey's eyes --------------------------------------------------------------------------------------------

#[test]
fn e13_overlapping_parts_leave_no_cavities() {
    let eye = |y: f64| Mesh::ball(DVec3::new(0.85, y, 0.2), 0.25, 4);
    let head = Mesh::ball(DVec3::ZERO, 1.0, 5);
    let monkey = head.merged(&eye(-0.35)).merged(&eye(0.35));
    let options = |rule| world(rule, 0.03, DVec3::new(0.003, 0.011, 0.017));
    let (parity, winding) = (fill(&monkey, &options(Rule::Parity)), fill(&monkey, &options(Rule::Winding)));
    // Two lenses of two balls: V = π(R+r-d)²(d²+2dr-3r²+2dR+6rR-3R²)/12d each; the union has them once, the
    // exclusive or not at all.
    let (r1, r2, d) = (1.0, 0.25, DVec3::new(0.85, 0.35, 0.2).length());
    let lens = PI * (r1 + r2 - d).powi(2) * (d * d + 2.0 * d * (r1 + r2) - 3.0 * (r1 - r2) * (r1 - r2)) / (12.0 * d);
    let missing = (winding.len() - parity.len()) as f64 * 0.03f64.powi(3);
    close(missing, 2.0 * lens, 0.05 * 2.0 * lens, "cavities");
    let union = 4.0 / 3.0 * PI * (1.0 + 2.0 * r2.powi(3)) - 2.0 * lens;
    close(volume(&winding), union, 0.01 * union, "union");
    assert!(winding.report.warnings.iter().any(|w| w.contains("overlap")));
}

// Rules, resolution, placement, shells, surfaces --------------------------------------------------------------------

#[test]
fn rules_agree_on_clean_closed_meshes() {
    let mut dice = Dice(77);
    let shapes = [
        Mesh::torus_knot(2, 3, 1.0, 0.3, 600, 30),
        Mesh::torus(0.75, 0.25, 64, 32),
        Mesh::cylinder(0.5, 1.3, 37),
        Mesh::ball(DVec3::ZERO, 1.0, 4),
        Mesh::cuboid(DVec3::ZERO, DVec3::new(1.0, 2.0, 0.5)),
    ];
    for mesh in &shapes {
        assert!(mesh.report().watertight && mesh.mass_properties().volume > 0.0);
        for across in [5, 17, 64, 131] {
            let options = |rule| VoxelizeOptions {
                rule,
                resolution: Resolution::Across(across),
                rotation: Dice(u64::from(across)).turn(),
                offset: Dice(u64::from(across) + 1).vec(),
                align: Align::World,
                ..Default::default()
            };
            let (parity, winding) = (fill(mesh, &options(Rule::Parity)), fill(mesh, &options(Rule::Winding)));
            assert_eq!(parity.bits, winding.bits);
        }
        let options =
            VoxelizeOptions { rotation: dice.turn(), resolution: Resolution::Across(9), ..Default::default() };
        let placed = fill(mesh, &options);
        let turned = mesh.transformed(DAffine3::from_quat(options.rotation));
        agrees_with_winding_number(&turned, &placed, "turned lattice");
    }
}

#[test]
fn a_wanted_number_of_particles_is_met() {
    let shapes = [
        Mesh::ball(DVec3::ZERO, 1.0, 4),
        Mesh::torus_knot(2, 3, 1.0, 0.3, 240, 20),
        Mesh::cuboid(DVec3::ZERO, DVec3::ONE),
        Mesh::ball(DVec3::ZERO, 1.0, 3).merged(&Mesh::ball(DVec3::X, 1.0, 3)),
        Mesh::open_ball(1.0, 1.0, 24, 48),
    ];
    for (n, mesh) in shapes.iter().enumerate() {
        for wanted in [20_000u64, 100_000] {
            for align in [Align::Body, Align::World] {
                let options =
                    VoxelizeOptions { resolution: Resolution::Particles(wanted), align, ..Default::default() };
                let v = fill(mesh, &options);
                let met = (v.len() as f64 / wanted as f64 - 1.0).abs() <= 0.02;
                // A cube with a corner on the world's lattice only has cubes of whole numbers.
                let impossible = n == 2 && align == Align::World;
                assert!(met || impossible, "shape {n}, {align:?}: {} of {wanted}", v.len());
                assert_eq!(met, !v.report.warnings.iter().any(|w| w.contains("no lattice")));
            }
        }
    }
    // A cube cannot be cut into 90 cells: said, not hidden.
    let options = VoxelizeOptions { resolution: Resolution::Particles(90), ..Default::default() };
    let v = fill(&shapes[2], &options);
    assert!(v.len() == 90 || v.report.warnings.iter().any(|w| w.contains("no lattice")));
}

#[test]
fn placement_moves_particles_and_mass_alike() {
    let half = DVec3::new(1.0, 0.7, 0.4);
    let cuboid = Mesh::cuboid(-half, half);
    let (rotation, offset) = (Dice(8).turn(), DVec3::new(5.0, -3.0, 2.0));
    for align in [Align::Body, Align::World] {
        let options =
            VoxelizeOptions { rotation, offset, align, resolution: Resolution::Spacing(0.1), ..Default::default() };
        let v = fill(&cuboid, &options);
        let points = v.points();
        let com = points.iter().sum::<DVec3>() / points.len() as f64;
        assert!(com.distance(offset) < 0.02, "{align:?}");
        for p in &points {
            assert!(((rotation.inverse() * (*p - offset)).abs() - half).max_element() < 1e-6);
        }
        let r = DMat3::from_quat(rotation);
        let expected = r * cuboid.mass_properties().inertia * r.transpose();
        close(v.report.inertia[0], expected.x_axis.x, 1e-12, "I_xx");
        close(v.report.inertia[3], expected.y_axis.x, 1e-12, "I_xy");
        assert!(DVec3::from_array(v.report.com).distance(offset) < 1e-12);
        if align == Align::Body {
            assert_eq!(v.len(), 20 * 14 * 8);
        }
    }
}

#[test]
fn mass_from_particles_is_that_of_the_cubes() {
    // A box without one face, cut into cubes that fill it exactly: the particles' mass is the box's own.
    let mut open = Mesh::cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0));
    let whole = open.mass_properties();
    open.triangles.truncate(11);
    let v = fill(&open, &VoxelizeOptions { resolution: Resolution::Across(20), ..Default::default() });
    assert!(v.report.warnings.iter().any(|w| w.contains("from the particles")));
    if v.len() == 20 * 10 * 10 {
        assert!(DVec3::from_array(v.report.com).distance(whole.com) < 1e-12);
        close(v.report.inertia[1], whole.inertia.y_axis.y, 1e-12, "I_yy");
    } else {
        assert!(v.len() > 1900, "{}", v.len());
        close(v.report.inertia[1], whole.inertia.y_axis.y, 0.06, "I_yy");
    }
}

#[test]
fn shells_are_hollow() {
    let cuboid = Mesh::cuboid(DVec3::ZERO, DVec3::splat(10.0));
    for (thickness, layers) in [(1.0, 1), (2.0, 2), (3.2, 3), (100.0, 5)] {
        let options =
            VoxelizeOptions { resolution: Resolution::Across(10), shell: Some(thickness), ..Default::default() };
        let core: usize = 10 - 2 * layers;
        assert_eq!(fill(&cuboid, &options).len(), 1000 - core.pow(3), "thickness {thickness}");
    }
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 5);
    let options = VoxelizeOptions { shell: Some(0.2), ..world(Rule::Winding, 0.02, DVec3::splat(0.003)) };
    let expected = 4.0 / 3.0 * PI * (1.0 - 0.8f64.powi(3));
    close(volume(&fill(&ball, &options)), expected, 0.05 * expected, "hollow ball");
}

#[test]
fn what_fuzzing_found_in_shells_and_samples() {
    // A sliver far longer than its area's root: sample points far apart in units of their spacing.
    let sliver =
        Mesh { vertices: vec![DVec3::ZERO, DVec3::X * 1e9, DVec3::new(1e9, 1e-30, 0.0)], triangles: vec![[0, 1, 2]] };
    assert_eq!(sample_surface(&sliver, 1e8, 1).expect("a point").len(), 1);
    // A shell as thick as the grid is long, on a needle of a body: no list of offsets of that size, no loop over it.
    let needle = Mesh::cuboid(DVec3::ZERO, DVec3::new(1.0, 1e-4, 1e-4));
    let options = VoxelizeOptions { resolution: Resolution::Across(30_000), shell: Some(0.5), ..Default::default() };
    assert_eq!(fill(&needle, &options).len(), 30_000 * 9);
}

#[test]
fn surface_samples_are_evenly_spread() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 4);
    let spacing = 0.1;
    let sample = |seed| sample_surface(&ball, spacing, seed).expect("a good mesh");
    let points = sample(1);
    // As many as there are squares of that spacing on the surface.
    close(points.len() as f64, ball.area() / (spacing * spacing), 1.0, "number");
    // The densest packing of so many points has a spacing of √(2/√3) = 1.075; a good blue-noise sample keeps
    // two thirds of that as its least distance.
    let mut nearest: Vec<f64> = Vec::new();
    for (i, p) in points.iter().enumerate() {
        close(p.length(), 1.0, 0.01, "on the sphere");
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        nearest.push(others.map(|(_, q)| p.distance(*q) / spacing).fold(9.0, f64::min));
    }
    let mean = nearest.iter().sum::<f64>() / nearest.len() as f64;
    let least = nearest.iter().copied().fold(9.0, f64::min);
    assert!(least > 0.65 && mean > 0.78 && mean < 1.075, "least {least}, mean {mean}");
    let mut dice = Dice(4);
    for _ in 0..500 {
        let p = (dice.vec() - 0.5).normalize();
        assert!(points.iter().any(|q| q.distance(p) < spacing), "a hole at {p}");
    }
    assert_eq!(sample(1), points);
    assert_ne!(sample(2), points);
    // No place of a box is left out: not its edges, not its corners.
    let cuboid = Mesh::cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 0.5));
    let points = sample_surface(&cuboid, spacing, 1).expect("a good mesh");
    for corner in &cuboid.vertices {
        assert!(points.iter().any(|q| q.distance(*corner) < spacing), "nothing near {corner}");
    }
    assert!(matches!(sample_surface(&ball, 0.0, 1), Err(VoxelizeError::Option { .. })));
    assert!(matches!(sample_surface(&ball, 1e-9, 1), Err(VoxelizeError::TooManyPoints { .. })));
    assert!(matches!(sample_surface(&Mesh::default(), 1.0, 1), Err(VoxelizeError::Mesh(_))));
}

#[test]
fn the_report_has_the_fields_scripts_rely_on() {
    let v = fill(&Mesh::ball(DVec3::ZERO, 1.0, 3), &VoxelizeOptions::default());
    let json = serde_json::to_value(&v.report).expect("json");
    for field in [
        "particles",
        "spacing",
        "triangles",
        "volume_mesh",
        "volume_particles",
        "com",
        "inertia",
        "watertight",
        "boundary_edges",
        "nonmanifold_edges",
        "flipped_shells",
        "rule",
        "millis",
        "backend",
    ] {
        assert!(json.get(field).is_some_and(|v| !v.is_null()), "{field}");
    }
    assert_eq!((json["rule"].as_str(), json["backend"].as_str()), (Some("winding"), Some("cpu")));
    assert_eq!((json["inertia"].as_array().map(Vec::len), json["com"].as_array().map(Vec::len)), (Some(6), Some(3)));
}

#[cfg(not(feature = "gpu"))]
#[test]
fn without_its_feature_a_gpu_is_refused() {
    use jetsam::gpu::{GpuError, devices};
    use jetsam::voxelize::{Backend, Voxelizer};
    assert!(devices().is_empty() && Voxelizer::new(Backend::Auto).is_ok());
    assert_eq!(Voxelizer::new(Backend::Gpu).err(), Some(VoxelizeError::Gpu(GpuError::NotBuilt)));
}
