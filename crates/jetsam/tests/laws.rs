//! The laws against formulas and tables of the literature.

use jetsam::laws::kernel::{Kernel, KernelSet};
use jetsam::laws::{contact, field, fluid, implicit};
use std::f64::consts::PI;

/// Integral of `f(r)` over the ball (disc) of radius `support`, by Simpson's rule.
fn integral(support: f64, dimensions: u32, f: impl Fn(f64) -> f64) -> f64 {
    let n = 20_000;
    let shell = |r: f64| if dimensions == 3 { 4.0 * PI * r * r } else { 2.0 * PI * r };
    let step = support / f64::from(n);
    let at = |i: i32| {
        let r = (f64::from(i) * step).max(1e-12);
        shell(r) * f(r)
    };
    let sum: f64 = (0..n / 2).map(|i| at(2 * i) + 4.0 * at(2 * i + 1) + at(2 * i + 2)).sum();
    sum * step / 3.0
}

#[test]
fn kernels_integrate_to_one() {
    for kernel in Kernel::ALL {
        for dimensions in [2, 3] {
            if dimensions == 2 && kernel == Kernel::Viscosity {
                continue; // defined through its Laplacian there
            }
            for support in [0.04, 1.7] {
                let one = integral(support, dimensions, |r| kernel.value(r, support, dimensions));
                // the viscosity kernel is cut off where it is singular
                let tolerance = if kernel == Kernel::Viscosity { 1e-4 } else { 1e-5 };
                assert!((one - 1.0).abs() < tolerance, "{kernel:?} {dimensions}D H={support}: {one}");
            }
        }
    }
}

#[test]
fn kernels_have_their_published_values_at_the_centre() {
    // W(0) h^d for support 2 h (quintic 3 h, poly6 h): closed forms of the norms
    let cases = [
        (Kernel::Cubic, 2.0, 10.0 / (7.0 * PI), 1.0 / PI),
        (Kernel::WendlandC2, 2.0, 7.0 / (4.0 * PI), 21.0 / (16.0 * PI)),
        (Kernel::WendlandC4, 2.0, 9.0 / (4.0 * PI), 495.0 / (256.0 * PI)),
        (Kernel::Quintic, 3.0, 66.0 * 7.0 / (478.0 * PI), 66.0 / (120.0 * PI)),
        (Kernel::Poly6, 1.0, 4.0 / PI, 315.0 / (64.0 * PI)),
    ];
    for (kernel, support, two, three) in cases {
        for (dimensions, expected) in [(2, two), (3, three)] {
            let w = kernel.value(0.0, support, dimensions);
            assert!((w / expected - 1.0).abs() < 1e-6, "{kernel:?} {dimensions}D: {w} {expected}");
        }
    }
}

#[test]
fn kernels_are_positive_and_end_at_their_support() {
    for kernel in Kernel::ALL {
        assert_eq!(kernel.w(1.0), 0.0, "{kernel:?}");
        assert_eq!(kernel.g(1.0), 0.0, "{kernel:?}");
        for i in 0..1000 {
            let s = i as f32 / 1000.0;
            assert!(kernel.w(s) >= 0.0, "{kernel:?} at {s}");
        }
    }
}

#[test]
fn slopes_are_the_derivatives_of_the_values() {
    for kernel in Kernel::ALL.into_iter().filter(|&k| k != Kernel::Viscosity) {
        for i in 1..50 {
            let s = f64::from(i) / 50.0 - 0.003;
            // central difference of a single-precision value: its rounding over the step bounds the accuracy
            let (above, below) = ((s + 2e-3) as f32, (s - 2e-3) as f32);
            let difference = f64::from(kernel.w(above)) - f64::from(kernel.w(below));
            let slope = f64::from(kernel.g(s as f32)) * s;
            let error = difference / f64::from(above - below) - slope;
            let scale = 6.0 * f64::from(kernel.w(0.0));
            assert!(error.abs() < 2e-4 * scale, "{kernel:?} at {s}: {error}");
        }
    }
}

#[test]
fn smooth_kernels_are_flat_at_the_centre() {
    for kernel in [Kernel::Cubic, Kernel::WendlandC2, Kernel::WendlandC4, Kernel::Quintic, Kernel::Poly6] {
        assert_eq!(kernel.slope(0.0, 1.0, 3), 0.0);
        assert!(kernel.g(0.0).is_finite());
    }
}

#[test]
fn the_viscosity_kernel_has_a_linear_laplacian() {
    // E2: nabla^2 W = 45 (H - r) / (pi H^6) in three dimensions
    let h = 0.7;
    let factor = Kernel::laplacian_norm(3) / f64::powi(h, 5);
    for r in [0.1, 0.3, 0.6] {
        let laplacian = factor * f64::from(Kernel::Viscosity.g((r / h) as f32));
        assert!((laplacian / (45.0 * (h - r) / (PI * h.powi(6))) - 1.0).abs() < 1e-6);
    }
    // in any dimension the kernel turns r^2 into its Laplacian, 2 d
    for dimensions in [2, 3] {
        let factor = Kernel::laplacian_norm(dimensions) / h.powi(dimensions as i32 + 2);
        let sum = integral(h, dimensions, |r| r * r * factor * f64::from(Kernel::Viscosity.g((r / h) as f32)));
        assert!((sum - 2.0 * f64::from(dimensions)).abs() < 1e-4, "{dimensions}D: {sum}");
    }
}

#[test]
fn lattice_sums_match_the_table() {
    // sum of W dx^d over the infinite lattice, in double precision outside of this program; h / dx, then
    // cubic 2D, cubic 3D, Wendland C2 2D, 3D, Wendland C4 3D, quintic 3D
    let table = [
        (1.0, [1.000862, 0.999972, 1.037602, 1.033843, 1.066655, 0.999980]),
        (1.2, [0.999757, 1.000810, 1.017952, 1.017457, 1.013440, 1.000006]),
        (1.3, [0.999947, 0.997262, 1.010473, 1.009501, 1.008547, 0.999876]),
        (1.5, [1.003440, 1.001795, 1.005142, 1.003141, 1.002898, 1.000077]),
        (2.0, [0.999958, 1.000079, 1.001206, 1.000549, 1.000306, 1.000000]),
    ];
    let columns = [
        (Kernel::Cubic, 2.0, 2),
        (Kernel::Cubic, 2.0, 3),
        (Kernel::WendlandC2, 2.0, 2),
        (Kernel::WendlandC2, 2.0, 3),
        (Kernel::WendlandC4, 2.0, 3),
        (Kernel::Quintic, 3.0, 3),
    ];
    for (h, row) in table {
        for ((kernel, supports, dimensions), expected) in columns.into_iter().zip(row) {
            let sum = kernel.lattice_sum(supports * h, dimensions);
            assert!((sum - expected).abs() < 1e-5, "{kernel:?} {dimensions}D h/dx={h}: {sum} {expected}");
        }
    }
}

#[test]
fn gradients_are_consistent_on_lattices_as_tabulated() {
    // -sum V x dW/dx, towards 1 as h / dx grows
    let table = [
        (1.0, [1.013099, 1.020042, 0.976231, 0.982305]),
        (1.2, [0.990793, 0.981689, 0.963850, 0.985229]),
        (1.3, [1.010543, 0.993484, 0.973921, 0.978896]),
        (1.5, [1.006725, 1.010123, 0.997399, 1.000619]),
        (2.0, [0.999100, 0.999951, 0.999199, 0.999413]),
    ];
    let columns = [(Kernel::Cubic, 2), (Kernel::Cubic, 3), (Kernel::WendlandC2, 2), (Kernel::WendlandC2, 3)];
    for (h, row) in table {
        for ((kernel, dimensions), expected) in columns.into_iter().zip(row) {
            let sum = kernel.lattice_gradient(2.0 * h, dimensions);
            assert!((sum - expected).abs() < 1e-5, "{kernel:?} {dimensions}D h/dx={h}: {sum} {expected}");
        }
    }
}

#[test]
fn the_mueller_set_is_poly_six_and_spiky() {
    assert_eq!(KernelSet::Mueller.density(), Kernel::Poly6);
    assert_eq!(KernelSet::Mueller.force(), Kernel::Spiky);
    assert_eq!(KernelSet::Cubic.force(), Kernel::Cubic);
}

#[test]
fn equations_of_state_start_alike() {
    // E3: both are c^2 (rho - rho_0) to first order, and zero at rest
    let stiffness = 1000.0 * 20.0 * 20.0;
    assert_eq!(fluid::pressure_linear(1.0, stiffness), 0.0);
    assert_eq!(fluid::pressure_tait(1.0, stiffness), 0.0);
    let d = 1.001f32;
    let expected = f64::from(stiffness) / 7.0 * (f64::from(d).powi(7) - 1.0);
    assert!((f64::from(fluid::pressure_tait(d, stiffness)) / expected - 1.0).abs() < 1e-3);
    assert!((fluid::pressure_tait(d, stiffness) / fluid::pressure_linear(d, stiffness) - 1.0).abs() < 4e-3);
}

#[test]
fn pair_laws_are_antisymmetric_to_the_last_bit() {
    for n in 0..1000 {
        let random = |k: u64| (jetsam::random::uniform(1, n, k) - 0.5) as f32;
        let d = [random(0), random(1), random(2)];
        let v = [random(3), random(4), random(5)];
        let (minus_d, minus_v) = (d.map(|c| -c), v.map(|c| -c));
        let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        for normal_only in [0.0, 1.0] {
            let on_i = contact::contact_force(d, v, r, 0.8, 1e4, 30.0, normal_only, 1e-3);
            let on_j = contact::contact_force(minus_d, minus_v, r, 0.8, 1e4, 30.0, normal_only, 1e-3);
            assert_eq!([on_i.x, on_i.y, on_i.z], [-on_j.x, -on_j.y, -on_j.z]);
        }
        let (vi, vj, pi, pj, g) = (random(6), random(7), random(8), random(9), random(10));
        assert_eq!(fluid::pressure_force(vi * vj, pi, pj, g), fluid::pressure_force(vj * vi, pj, pi, g));
    }
}

#[test]
fn contact_is_spring_and_dashpot() {
    // E10: F = -k (r - |d|) n; E11: eta v, whole or along n only
    let (k, eta, diameter) = (1000.0, 7.0, 0.02);
    let f = contact::contact_force([0.015, 0.0, 0.0], [0.0; 3], 0.015, diameter, k, eta, 0.0, 0.0);
    assert!((f.x - -k * 0.005).abs() < 1e-4 && f.y == 0.0 && f.z == 0.0);
    let none = contact::contact_force([0.02, 0.0, 0.0], [1.0, 1.0, 1.0], 0.02, diameter, k, eta, 0.0, 0.0);
    assert_eq!([none.x, none.y, none.z], [0.0; 3]);
    let full = contact::contact_force([0.015, 0.0, 0.0], [1.0, 2.0, 0.0], 0.015, diameter, 0.0, eta, 0.0, 0.0);
    assert!((full.x - eta).abs() < 1e-5 && (full.y - 2.0 * eta).abs() < 1e-5);
    let normal = contact::contact_force([0.015, 0.0, 0.0], [1.0, 2.0, 0.0], 0.015, diameter, 0.0, eta, 1.0, 0.0);
    assert!((normal.x - eta).abs() < 1e-5 && normal.y == 0.0);
}

#[test]
fn a_contact_counts_for_the_part_of_a_step_it_lasts() {
    // closing at 2 m/s, steps of 0.01 s: a sample at overlap o stands for the times about it with overlap > 0
    for (overlap, expected) in [(-0.02, 0.0), (-0.005, 0.25), (0.0, 0.5), (0.005, 0.75), (0.02, 1.0)] {
        assert!((contact::contact_fraction(overlap, -2.0, 0.01) - expected).abs() < 1e-6);
    }
    assert_eq!(contact::contact_fraction(1e-9, 0.0, 0.01), 1.0);
    assert_eq!(contact::contact_fraction(-1e-9, 0.0, 0.01), 0.0);
}

#[test]
fn damping_ratio_inverts_restitution() {
    // E14: zeta = -ln e / sqrt(pi^2 + ln^2 e)
    for (e, zeta) in [(0.9, 0.03352), (0.8, 0.07085), (0.5, 0.21545), (0.3, 0.35786)] {
        assert!((contact::damping_ratio(f32::ln(e)) - zeta).abs() < 1e-5);
    }
    assert_eq!(contact::damping_ratio(0.0), 0.0);
}

#[test]
fn fields_have_their_formulas() {
    // E30: Plummer's softened point, G M d / (d^2 + core^2)^(3/2)
    let a = field::point_gravity([3.0, 0.0, 4.0], 10.0, 2.0);
    let expected = -10.0 / 29.0f32.powf(1.5);
    assert!((a.x - 3.0 * expected).abs() < 1e-6 && (a.z - 4.0 * expected).abs() < 1e-6);
    let w = field::wind([1.0, 0.0, 0.0], [3.0, 0.0, 0.0], 0.5);
    assert_eq!([w.x, w.y, w.z], [1.0, 0.0, 0.0]);
    // Rankine vortex about z: at twice the core's radius half the speed, across the radius
    let u = field::vortex([2.0, 0.0, 5.0], [0.0; 3], [0.0, 0.0, 1.0], 4.0, 1.0, 1.0);
    assert!((u.y - 2.0).abs() < 1e-6 && u.x.abs() < 1e-6 && u.z.abs() < 1e-6);
}

/// What a density answers to its own share by: the sums of Bender and Koschier 2015, but never less than is stated (E9).
#[test]
fn a_density_answers_to_its_own_share_by_no_less_than_stated() {
    assert_eq!(implicit::response(3.0, 1e-3, 0.2, 50.0), 3.0 * 1e-3 + 0.2);
    assert_eq!(implicit::response(3.0, 1e-3, 0.02, 50.0), 50.0 * 1e-3);
}

/// Half of the share of the last step, but no more than moves the density, which a share drives down by `response dt^2`, by 3 % (E9).
#[test]
fn corrections_of_places_begin_with_what_moves_a_density_by_three_per_cent_at_most() {
    let (response, dt) = (40.0, 2e-3);
    let moves = |share: f32| share * response * dt * dt;
    assert_eq!(implicit::begun(20.0, response, dt), 10.0);
    let capped = implicit::begun(1e6, response, dt);
    assert!((moves(capped) - 0.03).abs() < 1e-6, "{}", moves(capped));
}

/// PBF begins with half of the last shares; a correction of places is `share dt^2`, so in a longer step with less by the square (E9).
#[test]
fn shares_of_a_shorter_step_count_less_in_a_longer_one() {
    assert_eq!(implicit::recalled(1e-3, 1e-3), 0.5);
    assert_eq!(implicit::recalled(2e-3, 1e-3), 0.5);
    assert_eq!(implicit::recalled(1e-3, 2e-3), 0.125);
    assert_eq!(implicit::recalled(0.0, 1e-3), 0.0);
}
