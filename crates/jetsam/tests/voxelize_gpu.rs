//! The parity rule on the GPU against its twin on the CPU: the same grid, bit for bit (E11).
//!
//! Needs a device, if only Mesa's software driver; without one the tests show as ignored, and with `JETSAM_REQUIRE_GPU=1` in
//! the environment they fail.

use std::f64::consts::{FRAC_PI_2, PI};
use std::process::ExitCode;
use std::sync::LazyLock;

use glam::{DAffine3, DQuat, DVec3, EulerRot};
use jetsam::gpu::{GpuError, devices};
use jetsam::mesh::Mesh;
use jetsam::voxelize::{Align, Backend, Resolution, Rule, VoxelizeError, VoxelizeOptions, Voxelizer, Voxels, voxelize};
use libtest_mimic::{Arguments, Trial, run};

fn main() -> ExitCode {
    let tests: [(&str, fn()); 14] = [
        ("e1_balls", e1_balls),
        ("e2_boxes_on_cell_centres", e2_boxes_on_cell_centres),
        ("e3_rays_through_every_corner", e3_rays_through_every_corner),
        ("e4_to_e6_shells", e4_to_e6_shells),
        ("e7_wrong_faces", e7_wrong_faces),
        ("e8_holes", e8_holes),
        ("e9_thin_parts", e9_thin_parts),
        ("e10_pathological_input", e10_pathological_input),
        ("e11_shuffled_triangles", e11_shuffled_triangles),
        ("e12_e13_turned_and_merged", e12_e13_turned_and_merged),
        ("tetrahedra_on_the_lattice", tetrahedra_on_the_lattice),
        ("the_longest_rows", the_longest_rows),
        ("more_slices_than_a_pass_holds", more_slices_than_a_pass_holds),
        ("faults_are_errors", faults_are_errors),
    ];
    let absent = devices().is_empty();
    let required = std::env::var("JETSAM_REQUIRE_GPU").is_ok_and(|v| v == "1");
    let trial = |name, test: fn()| {
        Trial::test(name, move || {
            test();
            Ok(())
        })
    };
    let everywhere: [(&str, fn()); 2] =
        [("the_kernels_are_valid", the_kernels_are_valid), ("backends_are_reported", backends_are_reported)];
    let on_devices = tests.into_iter().map(|(name, test)| trial(name, test).with_ignored_flag(absent && !required));
    let mut trials: Vec<Trial> = everywhere.map(|(name, test)| trial(name, test)).into();
    trials.extend(on_devices);
    run(&Arguments::from_args(), trials).exit_code()
}

static GPU: LazyLock<Voxelizer> = LazyLock::new(|| Voxelizer::new(Backend::Gpu).unwrap_or_else(|e| panic!("{e}")));

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
}

/// Both backends by the parity rule: the same cells and the same report.
fn same(mesh: &Mesh, options: &VoxelizeOptions, what: &str) -> Voxels {
    let options = VoxelizeOptions { rule: Rule::Parity, ..options.clone() };
    let cpu = voxelize(mesh, &options).expect("a good mesh");
    let gpu = GPU.voxelize(mesh, &options).expect("a good device");
    assert_eq!(cpu.dims, gpu.dims, "{what}");
    let differ = cpu.bits.iter().zip(gpu.bits.iter()).find(|(a, b)| a != b);
    assert!(cpu.bits == gpu.bits, "{what}: first at {differ:?} of {:?}", cpu.dims);
    assert_eq!(cpu.report.warnings, gpu.report.warnings, "{what}");
    assert_eq!(cpu.report.backend, "cpu");
    assert!(gpu.report.backend.starts_with("gpu: "), "{}", gpu.report.backend);
    gpu
}

/// World-aligned options of a given spacing and offset.
fn world(spacing: f64, offset: DVec3) -> VoxelizeOptions {
    VoxelizeOptions {
        resolution: Resolution::Spacing(spacing),
        offset,
        align: Align::World,
        ..VoxelizeOptions::default()
    }
}

fn across(cells: u32) -> VoxelizeOptions {
    VoxelizeOptions { resolution: Resolution::Across(cells), ..VoxelizeOptions::default() }
}

fn the_kernels_are_valid() {
    use wgpu::naga::{front::wgsl, valid};
    let source = include_str!("../src/voxelize/parity.wgsl");
    let module = wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    // No capability beyond the least a device has.
    let mut validator = valid::Validator::new(valid::ValidationFlags::all(), valid::Capabilities::empty());
    if let Err(e) = validator.validate(&module) {
        panic!("{}", e.emit_to_string(source));
    }
    assert_eq!(module.entry_points.len(), 2);
}

fn backends_are_reported() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 2);
    let parity = VoxelizeOptions { rule: Rule::Parity, ..across(8) };
    // A software driver is never picked unasked.
    let auto = Voxelizer::new(Backend::Auto).expect("never fails");
    let v = auto.voxelize(&ball, &parity).expect("a good mesh");
    let hardware = devices().iter().any(|d| d.is_hardware());
    assert_eq!(v.report.backend.starts_with("gpu: "), hardware);
    assert!(v.report.warnings.is_empty());
    match Voxelizer::new(Backend::Gpu) {
        Ok(gpu) => {
            // The winding rule has no twin yet, and says so to those who asked for one.
            let v = gpu.voxelize(&ball, &across(8)).expect("a good mesh");
            assert_eq!(v.report.backend, "cpu");
            assert!(v.report.warnings.iter().any(|w| w.contains("winding rule")));
        }
        Err(e) => {
            assert_eq!(e, VoxelizeError::Gpu(GpuError::NoAdapter));
            let help = miette::Diagnostic::help(&e).expect("help").to_string();
            assert!(help.contains("driver"), "{help}");
        }
    }
}

fn e1_balls() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 5);
    let mut dice = Dice(1);
    for n in [1, 2, 16, 31, 32, 33, 63, 64, 65, 128] {
        let v = same(&ball, &world(2.0 / f64::from(n), dice.vec()), "ball");
        assert!(n < 16 || (v.report.volume_particles / v.report.volume_mesh - 1.0).abs() < 0.02);
    }
}

fn e2_boxes_on_cell_centres() {
    for (h, n) in [(0.1, 7), (1.0, 1), (0.3, 16), (1.0 / 3.0, 65)] {
        for shift in [DVec3::ZERO, DVec3::new(3.0, -5.0, 11.0), DVec3::new(-100.0, 40.0, -7.0)] {
            let lo = (shift + 0.5) * h;
            let mesh = Mesh::cuboid(lo, lo + f64::from(n) * h);
            let v = same(&mesh, &world(h, DVec3::ZERO), "box on cell centres");
            assert_eq!(v.len(), (n * n * n) as usize);
        }
    }
}

fn e3_rays_through_every_corner() {
    let turned = Mesh::cuboid(DVec3::splat(-4.0), DVec3::splat(4.0))
        .transformed(DAffine3::from_quat(DQuat::from_rotation_z(PI / 4.0)));
    let mut snapped = Mesh::ball(DVec3::ZERO, 9.0, 3);
    snapped.vertices.iter_mut().for_each(|v| *v = v.round());
    for mesh in [turned, Mesh::octahedron(DVec3::ZERO, 8.0), snapped] {
        for offset in [0.0, 0.25, 0.5] {
            same(&mesh, &world(1.0, DVec3::splat(offset)), "corners on cell centres");
        }
    }
    same(&Mesh::octahedron(DVec3::ZERO, 7.3), &world(1.0, DVec3::ZERO), "octahedron");
}

fn e4_to_e6_shells() {
    let ball = |x: f64, r: f64| Mesh::ball(DVec3::X * x, r, 4);
    let options = world(0.05, DVec3::new(0.013, 0.007, 0.011));
    let twice = ball(0.0, 1.0).merged(&ball(0.0, 1.0));
    assert!(same(&twice, &options, "shell given twice").is_empty());
    same(&ball(-0.5, 1.0).merged(&ball(0.5, 1.0)), &options, "overlapping balls");
    same(&ball(0.0, 1.0).merged(&ball(0.0, 0.5)), &options, "ball within a ball");
    same(&ball(0.0, 1.0).merged(&ball(0.0, 0.5).inverted()), &options, "cavity");
}

fn e7_wrong_faces() {
    let options = world(0.04, DVec3::new(0.003, 0.011, 0.017));
    for mesh in [Mesh::ball(DVec3::ZERO, 1.0, 4), Mesh::cuboid(DVec3::splat(-0.9), DVec3::splat(0.9))] {
        let clean = same(&mesh, &options, "clean");
        let mut flipped = mesh.clone();
        for t in [7, 1, 11] {
            flipped.triangles[t].swap(0, 1);
        }
        for broken in [mesh.inverted(), flipped, mesh.unwelded()] {
            assert!(same(&broken, &options, "wrong faces").bits == clean.bits);
        }
    }
}

fn e8_holes() {
    let along_x = DAffine3::from_quat(DQuat::from_rotation_y(FRAC_PI_2));
    let mut open_cube = Mesh::cuboid(DVec3::splat(-1.0), DVec3::ONE);
    open_cube.triangles.truncate(10);
    let mut dice = Dice(5);
    let mut torn = Mesh::torus(0.8, 0.35, 48, 24).transformed(DAffine3::from_quat(dice.turn()));
    torn.triangles.retain(|_| dice.roll() < 0.75);
    for (name, mesh, mended) in [
        ("ball without its cap", Mesh::open_ball(1.0, 10f64.to_radians(), 96, 192), false),
        ("hole along the rows", Mesh::open_ball(1.0, 0.2, 96, 192).transformed(along_x), true),
        ("hemisphere", Mesh::open_ball(1.0, FRAC_PI_2, 64, 128).transformed(along_x), true),
        ("open cube", open_cube, false),
        ("torn torus", torn, true),
    ] {
        let v = same(&mesh, &across(33), name);
        let warned = v.report.warnings.iter().any(|w| w.contains("through a hole"));
        assert!(warned || !mended, "{name}");
    }
}

fn e9_thin_parts() {
    let plate = Mesh::cuboid(DVec3::new(-10.0, -10.0, -0.15), DVec3::new(10.0, 10.0, 0.15));
    let mut dice = Dice(1);
    for _ in 0..12 {
        let options = VoxelizeOptions { rotation: dice.turn(), ..world(1.0, dice.vec()) };
        same(&plate, &options, "plate");
        let thin = VoxelizeOptions { thin: true, ..options };
        same(&plate, &thin, "plate, thin");
    }
    let shell = VoxelizeOptions { shell: Some(0.2), ..across(40) };
    same(&Mesh::ball(DVec3::ZERO, 1.0, 4), &shell, "hollow ball");
}

fn e10_pathological_input() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 3);
    let options = world(0.07, DVec3::new(0.003, 0.011, 0.017));
    let mut dirty = ball.clone();
    let n = dirty.vertices.len() as u32;
    dirty.vertices.extend([
        DVec3::ZERO,
        DVec3::X * 0.5,
        DVec3::X * 0.25,
        DVec3::new(0.25, 0.5e-6, 0.0),
        // Of no triangle.
        DVec3::splat(1e300),
    ]);
    // Zero area, twice the same corner, three corners at one place, a needle of two sides.
    dirty.triangles.extend([[0, 0, 5], [3, 3, 3], [n, n, n + 1], [n, n + 1, n + 3], [n, n + 3, n + 1]]);
    assert!(same(&dirty, &options, "degenerate").bits == same(&ball, &options, "clean").bits);
    for scale in [1e-8, 1e8] {
        let scaled = ball.transformed(DAffine3::from_scale(DVec3::splat(scale)));
        same(&scaled, &across(30), "scaled");
    }
    for (name, third) in [("triangle", DVec3::Y), ("line", DVec3::X * 2.0)] {
        let flat = Mesh { vertices: vec![DVec3::ZERO, DVec3::X, third], triangles: vec![[0, 1, 2]] };
        same(&flat, &across(32), name);
    }
}

fn e11_shuffled_triangles() {
    let mut dice = Dice(42);
    let knot = Mesh::torus_knot(2, 3, 1.0, 0.3, 600, 30);
    let reference = same(&knot, &across(128), "knot");
    for _ in 0..3 {
        let mut shuffled = knot.clone();
        for i in (1..shuffled.triangles.len()).rev() {
            shuffled.triangles.swap(i, (dice.roll() * (i + 1) as f64) as usize);
        }
        for t in &mut shuffled.triangles {
            t.rotate_left((dice.roll() * 3.0) as usize);
        }
        assert!(same(&shuffled, &across(128), "shuffled").bits == reference.bits);
    }
    let wanted = VoxelizeOptions { resolution: Resolution::Particles(100_000), ..VoxelizeOptions::default() };
    same(&knot, &wanted, "a wanted number");
}

fn e12_e13_turned_and_merged() {
    let eye = |y: f64| Mesh::ball(DVec3::new(0.85, y, 0.2), 0.25, 4);
    let monkey = Mesh::ball(DVec3::ZERO, 1.0, 5).merged(&eye(-0.35)).merged(&eye(0.35));
    let mut dice = Dice(77);
    for mesh in [
        monkey,
        Mesh::torus_knot(2, 3, 1.0, 0.3, 240, 20),
        Mesh::torus(0.75, 0.25, 64, 32),
        Mesh::cylinder(0.5, 1.3, 37),
        Mesh::cuboid(DVec3::ZERO, DVec3::new(1.0, 2.0, 0.5)),
    ] {
        for cells in [1, 2, 5, 17, 64, 131] {
            let options =
                VoxelizeOptions { rotation: dice.turn(), offset: dice.vec(), align: Align::World, ..across(cells) };
            same(&mesh, &options, "turned");
        }
    }
}

/// Closed meshes whose every corner is where ties are: on cell centres, halfway between, or a hair beside them.
fn tetrahedra_on_the_lattice() {
    let mut dice = Dice(2024);
    for size in [4.0, 16.0, 70.0] {
        let mut many = Mesh::default();
        for _ in 0..400 {
            let mut corner = || {
                let hair = (dice.vec() - 0.5) * 2e-6;
                let p = (dice.vec() * size * 2.0).round() / 2.0;
                if dice.roll() < 0.3 { p + hair } else { p }
            };
            let one = Mesh {
                vertices: vec![corner(), corner(), corner(), corner()],
                triangles: vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]],
            };
            many = many.merged(&one);
        }
        for offset in [0.0, 0.5] {
            same(&many, &world(1.0, DVec3::splat(offset)), "tetrahedra");
        }
    }
}

/// The widest integers: rows of 30,000 cells, and faces almost along them.
fn the_longest_rows() {
    let mut dice = Dice(9);
    for _ in 0..4 {
        let size = DVec3::new(1.0, 1e-3, 1e-3);
        let axis = DVec3::new(0.0, dice.roll() - 0.5, dice.roll() - 0.5).normalize();
        let lean = DQuat::from_axis_angle(axis, 1e-3 * dice.roll());
        let bar = Mesh::cuboid(DVec3::ZERO, size).transformed(DAffine3::from_quat(lean));
        let v = same(&bar, &across(30_000), "bar");
        assert!(v.dims[0] >= 29_999);
        let needle = Mesh {
            vertices: vec![DVec3::ZERO, size * dice.vec(), size, DVec3::new(1.0, 0.0, 1e-3)],
            triangles: vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]],
        };
        same(&needle, &across(30_000), "needle");
        let turned = DAffine3::from_quat(DQuat::from_rotation_z(FRAC_PI_2));
        same(&needle.transformed(turned), &across(30_000), "needle along y");
    }
}

fn more_slices_than_a_pass_holds() {
    let knot = Mesh::torus_knot(2, 3, 1.0, 0.3, 240, 20);
    let stood_up = knot.transformed(DAffine3::from_quat(DQuat::from_rotation_x(1.1)));
    let v = same(&stood_up, &across(900), "knot");
    assert!(v.bits.words().len() * 8 > 32 << 20, "one pass holds {:?}", v.dims);
}

fn faults_are_errors() {
    let ball = Mesh::ball(DVec3::ZERO, 1.0, 3);
    let parity = VoxelizeOptions { rule: Rule::Parity, ..across(16) };
    let doomed = Voxelizer::new(Backend::Gpu).expect("a good device");
    doomed.voxelize(&ball, &parity).expect("still there");
    doomed.lose_device();
    for _ in 0..2 {
        match doomed.voxelize(&ball, &parity) {
            Err(VoxelizeError::Gpu(GpuError::Lost { .. })) => {}
            other => panic!("{other:?}"),
        }
    }
}
