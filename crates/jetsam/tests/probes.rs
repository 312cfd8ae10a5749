//! Probes, expectations and formulas of scenes: readings against closed forms, verdicts, and what is said of mistakes.

mod common;

use common::{scene, world};
use jetsam::probe::{Probes, Sampler};
use jetsam::scene::Source;
use jetsam::validate::{Verdict, run};
use jetsam::{Scene, World};

/// A tank of water in a plane, 1 m wide and 0.5 m deep, at rest under its own weight.
const TANK: &str = r#"
[world]
dimensions = 2
[domain]
min = [0, 0, 0]
max = [1, 0, 1]
[resolution]
spacing = 0.025
[solver]
sound_speed = 40
[[fluid]]
name = "water"
shape = { box = { min = [0, 0, 0], max = [1, 0, 0.5] } }
"#;

/// What probes read in a scene's first moment.
fn read(text: &str) -> Vec<f64> {
    let (s, w) = (scene(text), world(text));
    let probes = Probes::new(&s, &w).unwrap_or_else(|e| panic!("{e}"));
    probes.read(&w, &vec![true; s.probe.len()])
}

fn near(reading: f64, expected: f64, tolerance: f64) {
    assert!((reading - expected).abs() <= tolerance, "{reading} is not {expected} within {tolerance}");
}

/// What is said of a scene that is wrong: message and remedy.
fn refused(text: &str) -> String {
    let source = Source { name: "test".into(), text: text.into(), ..Source::default() };
    let error = match run("test", &source, &[], jetsam::Choice::Cpu, &mut |_, _| {}) {
        Ok(_) => panic!("not refused: {text}"),
        Err(error) => error,
    };
    match *error {
        jetsam::Error::Scene { ref help, .. } => format!("{error} | {help}"),
        _ => error.to_string(),
    }
}

#[test]
fn a_tank_at_rest_reads_as_hydrostatics_says() {
    // a support of three spacings: what the lattice does to sums is below a hundredth then
    let values = read(
        &(TANK.replace("sound_speed = 40", "sound_speed = 40\nsupport = 3")
            + r#"
[[probe]]
name = "p"
of = "pressure"
at = [0.5, 0, 0.2]
[[probe]]
name = "p in a box"
of = "pressure"
region = { min = [0.2, 0, 0.2], max = [0.8, 0, 0.3] }
[[probe]]
name = "p above"
of = "pressure"
at = [0.5, 0, 0.8]
[[probe]]
name = "level"
of = "height"
at = [0.5, 0, 0]
[[probe]]
name = "level at the wall"
of = "height"
at = [0, 0, 0]
[[probe]]
name = "mass"
of = "mass"
[[probe]]
name = "profile"
of = "pressure"
line = { from = [0.5, 0, 0.05], to = [0.5, 0, 0.4] }
reference = "1000 * 9.81 * (0.5 - z)"
scale = 4905
[[probe]]
name = "particles"
of = "count"
region = { min = [0, 0, 0], max = [0.5, 0, 1] }
[[probe]]
name = "far"
of = "extent"
component = "x"
padding = true
"#),
    );
    near(values[0], 2943.0, 0.02 * 4905.0);
    near(values[1], 2452.5, 0.02 * 4905.0);
    assert_eq!(values[2], 0.0);
    // the column is shorter by g H^2 / (2 c^2) under its own weight, 0.8 mm
    near(values[3], 0.5, 0.5 * 0.025);
    near(values[4], values[3], 0.25 * 0.025);
    near(values[5], 500.0, 1e-3);
    near(values[6], 0.0, 0.02);
    assert_eq!(values[7], 400.0);
    near(values[8], 1.0, 1e-6);
}

#[test]
fn spray_does_not_raise_the_level() {
    let spray = "[[fluid]]\nname = \"spray\"\nshape = { points = [[0.5, 0, 0.8]] }\n";
    let probe = "[[probe]]\nname = \"level\"\nof = \"height\"\nat = [0.5, 0, 0]\n";
    near(read(&format!("{TANK}{spray}{probe}"))[0], 0.5, 0.5 * 0.025);
}

#[test]
fn an_even_flow_reads_its_flux_speed_and_momenta() {
    let text = r#"
[constants]
u = 2.0
[world]
dimensions = 2
gravity = [0, 0, 0]
[domain]
min = [-1, 0, -1]
max = [1, 0, 1]
walls = ["periodic", "open", "periodic"]
[resolution]
spacing = 0.05
[solver]
support = 3
[[fluid]]
shape = { box = { min = [-1, 0, -1], max = [1, 0, 1] } }
velocity = ["u + 0 * x", 0, "z"]
[[probe]]
name = "flux"
of = "flux"
region = { min = [0.31, 0, -0.5], max = [0.31, 0, 0.5] }
[[probe]]
name = "vz"
of = "velocity"
component = "z"
at = [0.2, 0, 0.3]
[[probe]]
name = "px"
of = "momentum"
component = "x"
[[probe]]
name = "Ly"
of = "angular-momentum"
component = "y"
[[probe]]
name = "energy"
of = "kinetic-energy"
[[probe]]
name = "u again"
of = "formula"
formula = "px / mass + 0 * t"
[[probe]]
name = "mass"
of = "mass"
"#;
    let values = read(text);
    near(values[0], 2.0, 0.02);
    near(values[1], 0.3, 1e-3);
    near(values[2], 8000.0, 0.1);
    // sum of z u m over rows placed evenly about 0 is 0; x z likewise
    near(values[3], 0.0, 1.0);
    let lattice_z_squared = (1.0 - 0.05f64 * 0.05 / 4.0) / 3.0;
    near(values[4], 0.5 * 4000.0 * (4.0 + lattice_z_squared), 2.0);
    near(values[5], 2.0, 1e-5);
}

#[test]
fn energy_is_kept_by_an_elastic_meeting() {
    let text = common::space(1.0, 0.1, 1e-5)
        + r#"
[run]
seconds = 0.02
frames_per_second = 1000
[[rigid]]
name = "a"
shape = { points = [[0, 0, 0]] }
position = [-0.101, 0, 0]
velocity = [1, 0, 0]
mass = 1
stiffness = 1e5
damping = 0
[[rigid]]
name = "b"
shape = { points = [[0, 0, 0]] }
mass = 1
stiffness = 1e5
damping = 0
[[probe]]
name = "energy"
of = "energy"
interval = 0
[[probe]]
name = "springs"
of = "elastic-energy"
interval = 0
"#;
    let (s, mut w) = (scene(&text), world(&text));
    let mut sampler = Sampler::new(&s, &w).unwrap();
    w.advance(0.02, |w, _| {
        sampler.step(w);
        true
    });
    let series = sampler.series();
    assert!(series[0].time.len() > 1000);
    for e in &series[0].value {
        near(*e, 0.5, 1e-4);
    }
    // half of the kinetic energy is that of the relative motion: it goes into the spring whole
    near(series[1].value.iter().copied().fold(0.0, f64::max), 0.25, 1e-3);
}

#[test]
fn jitter_and_displacement_move_particles_as_far_as_asked() {
    let base = TANK.replace("name = \"water\"", "name = \"water\"\njitter = 0.2\nstart = \"lattice\"");
    let places = |text: &str| -> Vec<[f32; 3]> {
        let w = world(text);
        let p = &w.state().particles;
        let mut all: Vec<_> = p.segment(jetsam::state::Kind::Fluid).map(|i| (p.id[i], p.record[i].x)).collect();
        all.sort_by_key(|a| a.0);
        all.into_iter().map(|a| a.1).collect()
    };
    let (even, moved) = (places(&base.replace("jitter = 0.2", "")), places(&base));
    let off = |a: usize| even.iter().zip(&moved).map(move |(e, m)| (m[a] - e[a]).abs()).fold(0.0, f32::max);
    for a in [0, 2] {
        assert!(off(a) <= 0.2 * 0.025 * 1.0001 && off(a) > 0.19 * 0.025, "axis {a}: {}", off(a));
    }
    assert_eq!(moved, places(&base));
    assert_ne!(moved, places(&base.replace("dimensions = 2", "dimensions = 2\nseed = 7")));
    let tilted = places(&base.replace("jitter = 0.2", "displace = [0, 0, \"0.1 * x\"]"));
    for (e, t) in even.iter().zip(&tilted) {
        near(f64::from(t[2] - e[2]), 0.1 * f64::from(e[0]), 1e-6);
    }
}

const FALL: &str = r#"
[constants]
g = 10
[world]
gravity = [0, 0, -10]
[domain]
min = [-1, -1, -9]
max = [1, 1, 1]
walls = ["open", "open", "open"]
[resolution]
spacing = 0.1
[solver]
dt = 0.01
[run]
seconds = 1
[[rigid]]
name = "stone"
shape = { points = [[0, 0, 0]] }
mass = 1
[[probe]]
name = "z"
of = "position"
body = "stone"
component = "z"
[[expect]]
probe = "z"
time = 1
value = "-g/2"
tolerance = 1e-9
source = "-g t^2 / 2"
"#;

fn verdicts(text: &str) -> Vec<(Verdict, Option<f64>)> {
    let source = Source { name: "test".into(), text: text.into(), ..Source::default() };
    let report = run("test", &source, &[], jetsam::Choice::Cpu, &mut |_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    assert!(report.plot.starts_with("<svg") && report.plot.ends_with("</svg>\n"));
    report.rows.iter().map(|r| (r.verdict, r.reached)).collect()
}

#[test]
fn verdicts_follow_tolerances_and_gates() {
    let all = verdicts(FALL);
    assert_eq!(all[0].0, Verdict::Ok);
    near(all[0].1.unwrap(), -5.0, 1e-12);
    assert_eq!(verdicts(&FALL.replace("-g/2", "-g/3"))[0].0, Verdict::Fail);
    assert_eq!(verdicts(&FALL.replace("tolerance = 1e-9", "gate = false"))[0].0, Verdict::Info);
    assert_eq!(verdicts(&FALL.replace("time = 1", "time = 2"))[0], (Verdict::Fail, None));
    let curve = FALL.replace("time = 1\nvalue = \"-g/2\"", "curve = [[0.2, -0.2], [0.6, -1.8]]\nscale = [1, 1]");
    assert_eq!(verdicts(&curve)[0].0, Verdict::Ok);
}

#[test]
fn variants_are_compared() {
    // a first-order step falls too far by g dt t / 2: an error that halves with the step
    let text =
        FALL.replace("tolerance = 1e-9", "gate = false").replace("dt = 0.01", "integrator = \"euler\"\ndt = 0.01")
            + r#"
[[expect]]
probe = "z"
time = 1
compare = { by = "order", of = ["coarse", "fine"], exact = "-g/2" }
value = 1
tolerance = 0.01
source = "first order"
[[expect]]
probe = "z"
time = 1
compare = { by = "difference", of = ["fine", "coarse"] }
value = "g / 2 * 0.005"
tolerance = 1e-9
source = "g dt t / 2"
[[expect]]
probe = "z"
time = 1
compare = { by = "median", of = ["coarse", "fine", "heavy"] }
value = "-g / 2 - g / 2 * 0.01"
tolerance = 1e-9
source = "the middle one, whatever the lowest"
[[variant]]
name = "coarse"
[[variant]]
name = "fine"
set = ["solver.dt=0.005"]
[[variant]]
name = "heavy"
set = ["world.gravity=[0,0,-40]"]
"#;
    let all = verdicts(&text);
    assert_eq!(all.len(), 6);
    near(all[0].1.unwrap(), -5.05, 1e-9);
    assert!(all[3..].iter().all(|row| row.0 == Verdict::Ok), "{all:?}");
}

#[test]
fn a_run_that_goes_wrong_is_a_row_that_fails() {
    let text = format!(
        "{TANK}[[probe]]\nname = \"v\"\nof = \"speed\"\n[[expect]]\nprobe = \"v\"\nat_most = 1e30\nsource = \"none\"\n"
    );
    let text = text.replace("sound_speed = 40", "sound_speed = 40\ndt = 0.05");
    assert_eq!(verdicts(&text), [(Verdict::Fail, None)]);
}

#[test]
fn mistakes_are_answered_with_place_and_remedy() {
    let with = |from: &str, to: &str| refused(&FALL.replace(from, to));
    for (from, to, says) in [
        ("probe = \"z\"", "probe = \"zz\"", "did you mean `z`?"),
        ("body = \"stone\"", "body = \"stones\"", "did you mean `stone`?"),
        ("of = \"position\"", "of = \"positions\"", "`position`"),
        ("of = \"position\"", "of = \"tilt\"", "`component` means nothing"),
        ("of = \"position\"\nbody = \"stone\"", "of = \"spin\"", "needs `body`"),
        (
            "of = \"position\"\nbody = \"stone\"\ncomponent = \"z\"",
            "of = \"pressure\"",
            "needs `at` or `line` or `region`",
        ),
        ("-g/2", "-G/2", "`G` is not known"),
        ("-g/2", "-g/(2", "`)` is missing"),
        ("g = 10", "g = \"g + 1\"", "need each other's values"),
        ("g = 10", "g = \"1 / 0\"", "finite number"),
        ("tolerance = 1e-9\n", "", "how far it may be off"),
        ("time = 1", "take = \"first-above\"", "needs a level"),
        ("source = \"-g t^2 / 2\"", "source = \"\"", "where the expected value comes from"),
        ("time = 1", "variants = [\"fine\"]", "no variant `fine`"),
        ("time = 1", "tiem = 1", "`time`"),
    ] {
        let said = with(from, to);
        assert!(said.contains(says), "{to}: {said}");
        assert!(said.contains("test:"), "no place: {said}");
    }
    assert!(refused(TANK).contains("[[expect]]"));
    let odd = TANK.replace("name = \"water\"", "name = \"water\"\nvelocity = [\"sqrt(-1 - x)\", 0, 0]");
    let source = Source { name: "test".into(), text: odd, ..Source::default() };
    let said = World::from_scene(&Scene::parse(source, &[]).unwrap()).err().unwrap().to_string();
    assert!(said.contains("velocity") && said.contains("not finite"), "{said}");
}
