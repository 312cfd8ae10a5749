//! Joints on both backends.

use crate::common::{scene, space};
use crate::{Test, on_gpu};
use glam::DVec3;
use jetsam::World;

/// The tests of this file.
pub const TESTS: &[Test] = &tests![joints_swing_and_hold, a_chain_agrees];

/// E32: a bar let go level from a ball joint or a hinge swings as the CPU's does, keeps its energy and its end.
fn joints_swing_and_hold() {
    for kind in ["ball", "hinge"] {
        let text = space(0.6, 0.05, 1e-3).replace("[0, 0, 0]", "[0, 0, -9.81]")
            + &format!(
                "[[rigid]]\nname = \"bar\"\nshape = {{ box = {{ min = [0, -0.05, -0.05], max = [0.4, 0.05, 0.05] }} }}\ndensity = 1000\n\
                 [[joint]]\nkind = \"{kind}\"\na = \"bar\"\nanchor = [0, 0, 0]\naxis = [0, 1, 0]\n"
            );
        let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
        let energy = |w: &World| w.ledger().kinetic + w.ledger().potential;
        let scale = gpu.state().bodies.body[0].mass * 9.81 * 0.2;
        let begin = energy(&gpu);
        for quarter in 1..=4 {
            cpu.run_to(0.25 * f64::from(quarter));
            assert_eq!(gpu.run_to(0.25 * f64::from(quarter)), None);
            let (a, b) = (&cpu.state().bodies.body[0], &gpu.state().bodies.body[0]);
            let gap = (b.x + b.q * DVec3::new(-0.2, 0.0, 0.0)).length();
            let drift = (energy(&gpu) - begin).abs() / scale;
            println!("{kind}: {} m apart, gap {gap:e} m, energy {drift:e}", (a.x - b.x).length());
            assert!((a.x - b.x).length() < 1e-4 && gap < 1e-6 && drift < 1e-4, "{kind}: {} {}", a.x, b.x);
        }
        assert!(gpu.momentum_residual() < 1e-3, "{}", gpu.momentum_residual());
    }
}

/// E32: a chain in space of all kinds of joints keeps its momenta and its links; a stop of a hinge holds; springs pull.
fn a_chain_agrees() {
    let mut text = space(1.4, 0.1, 1e-3);
    for k in 0..5 {
        let v = if k == 4 { "velocity = [0.3, 0.5, 1.0]\nspin = [1, 2, 3]" } else { "" };
        text += &format!(
            "[[rigid]]\nname = \"link{k}\"\nshape = {{ box = {{ min = [-0.1, -0.05, -0.05], max = [0.1, 0.05, 0.05] }} }}\n\
             density = 500\nposition = [{}, 0, 0]\n{v}\n",
            0.2 * f64::from(k)
        );
    }
    for k in 0..4 {
        let kind = ["ball", "hinge", "ball", "fixed"][k];
        text += &format!(
            "[[joint]]\nkind = \"{kind}\"\na = \"link{k}\"\nb = \"link{}\"\nanchor = [{}, 0, 0]\naxis = [0, 1, 0]\nlimits = [-5, 5]\n",
            k + 1,
            0.2 * k as f64 + 0.1
        );
    }
    text += "[[joint]]\nkind = \"spring\"\na = \"link0\"\nb = \"link2\"\nanchor = [0, 0, 0.05]\nanchor_b = [0.4, 0, 0.05]\n\
             stiffness = 5\ndamping = 0.1\nlength = 0.3\n";
    let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
    let momenta = |w: &World| {
        let b = &w.state().bodies.body;
        let p: DVec3 = b.iter().map(|b| b.mass * b.v).sum();
        (p, b.iter().map(|b| b.l + b.x.cross(b.mass * b.v)).sum::<DVec3>())
    };
    gpu.step(1e-3);
    let (p_0, l_0) = momenta(&gpu);
    assert_eq!(gpu.run_to(0.4), None);
    cpu.run_to(0.4);
    let (p, l) = momenta(&gpu);
    println!("momentum {:e}, angular {:e}", (p - p_0).length() / p_0.length(), (l - l_0).length() / l_0.length());
    assert!((p - p_0).length() < 1e-5 * p_0.length() && (l - l_0).length() < 1e-4 * l_0.length());
    let (a, b) = (&cpu.state().bodies.body, &gpu.state().bodies.body);
    for k in 0..4 {
        let ends = b[k].x + b[k].q * (0.1 * DVec3::X) - (b[k + 1].x - b[k + 1].q * (0.1 * DVec3::X));
        println!("joint {k}: gap {:e}; {:e} m apart", ends.length(), (a[k].x - b[k].x).length());
        assert!(ends.length() < 2e-6, "joint {k} opens by {}", ends.length());
        assert!((a[k].x - b[k].x).length() < 1e-3, "{} {}", a[k].x, b[k].x);
    }
    assert!((b[1].q * DVec3::Y).cross(b[2].q * DVec3::Y).length() < 1e-5);
    assert!((b[3].q.inverse() * b[4].q).to_scaled_axis().length() < 1e-5);
}
