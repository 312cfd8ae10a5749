//! The command line as a contract: fields, exit statuses, and what is said of wrong input.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A tank of about 500 fluid particles with a ball above it; runs in well under a second.
const POOL: &str = r#"title = "A small pool"

[domain]
min = [0.0, 0.0, 0.0]
max = [0.5, 0.5, 0.8]

[resolution]
spacing = 0.05

[run]
seconds = 0.06

[[fluid]]
name = "water"
shape = { box = { min = [0.0, 0.0, 0.0], max = [0.5, 0.5, 0.25] } }

[[rigid]]
name = "ball, red"
shape = { sphere = { center = [0.0, 0.0, 0.0], radius = 0.1 } }
density = 500
position = [0.25, 0.25, 0.5]
"#;

/// A folder of its own for each test, empty at the beginning.
fn folder(test: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn scene(folder: &Path, text: &str) -> String {
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

fn monkey() -> String {
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/meshes/monkey.obj").into()
}

fn jetsam(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_jetsam")).args(args).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Stdout of a command that must succeed.
fn good(folder: &Path, args: &[&str]) -> String {
    let out = jetsam(folder, args);
    assert_eq!(out.status.code(), Some(0), "{args:?}: {}", text(&out.stderr));
    text(&out.stdout)
}

/// Stderr of a command that must end with status 2, say all of `needles`, and print no data.
fn bad(folder: &Path, args: &[&str], needles: &[&str]) -> String {
    let out = jetsam(folder, args);
    let message = text(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{args:?}: {message}");
    for needle in needles {
        assert!(message.contains(needle), "{args:?} does not say {needle:?}: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
    assert!(out.stdout.is_empty(), "{args:?} printed data: {}", text(&out.stdout));
    message
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn assert_keys(value: &Value, keys: &str) {
    for key in keys.split_whitespace() {
        assert!(value.get(key).is_some(), "no `{key}` in {value}");
    }
}

/// The pool with one line replaced.
fn pool_with(line: &str, by: &str) -> String {
    assert!(POOL.contains(line), "{line}");
    POOL.replace(line, by)
}

#[test]
fn run_writes_what_the_contract_says() {
    let dir = folder("run");
    let file = scene(&dir, POOL);
    let run = jetsam(&dir, &["run", &file, "--headless", "--save", "png,ply,vtk,csv", "--out", "a/b"]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let out = dir.join("a/b");

    let stats = std::fs::read_to_string(out.join("stats.jsonl")).unwrap();
    let lines: Vec<Value> = stats.lines().map(json).collect();
    assert_eq!(lines.len(), 4, "frame 0 and one each 0.02 s");
    let keys = "frame time steps dt dt_bound fluid rigid_particles bodies agents lost nonfinite density_error_mean \
                density_error_max momentum momentum_residual kinetic_energy potential_energy wall_ms real_time_factor stage_ms";
    let mut from = 0;
    for key in keys.split_whitespace() {
        let at =
            stats[from..].find(&format!("\"{key}\":")).unwrap_or_else(|| panic!("`{key}` is missing or out of order"));
        from += at;
    }
    for (n, line) in lines.iter().enumerate() {
        assert_keys(line, keys);
        assert_eq!(line.as_object().unwrap().len(), keys.split_whitespace().count(), "{line}");
        assert_eq!(line["frame"], n);
        assert!((line["time"].as_f64().unwrap() - 0.02 * n as f64).abs() < 1e-12);
        assert_eq!(line["momentum"].as_array().unwrap().len(), 3);
        assert_eq!((&line["bodies"], &line["lost"], &line["nonfinite"]), (&1.into(), &0.into(), &0.into()));
    }
    let last = &lines[3];
    let dt = 0.02 / last["steps"].as_f64().unwrap();
    assert!((last["dt"].as_f64().unwrap() / dt - 1.0).abs() < 1e-9);
    assert_eq!(last["stage_ms"].as_object().unwrap().len(), 12);

    let bodies = std::fs::read_to_string(out.join("bodies.csv")).unwrap();
    let mut rows = bodies.lines();
    assert_eq!(rows.next(), Some("time,body,name,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz,fx,fy,fz,tx,ty,tz"));
    assert_eq!(rows.clone().count(), 4);
    assert!(rows.all(|r| r.contains(",\"ball, red\",") && r.split(',').count() == 23), "{bodies}");

    for extension in ["png", "ply", "vtk"] {
        for frame in 0..4 {
            let path = out.join(format!("frame_{frame:05}.{extension}"));
            assert!(std::fs::metadata(&path).is_ok_and(|m| m.len() > 1000), "{path:?}");
        }
    }
    let ply = text(&std::fs::read(out.join("frame_00003.ply")).unwrap());
    let particles = last["fluid"].as_u64().unwrap() + last["rigid_particles"].as_u64().unwrap();
    assert!(ply.contains(&format!("element vertex {particles}\n")));
    for name in "x y z vx vy vz density pressure kind owner id".split(' ') {
        assert!(ply.contains(&format!(" {name}\n")), "{name}");
    }
}

/// The pressure in a file is that with which the solver pushes: in water at rest rho g times the depth, on average half of that at the bottom.
/// It is that of one step, so the tolerance is one at which single steps can be read.
#[test]
fn files_of_particles_hold_the_pressure_of_the_solver() {
    let dir = folder("pressures");
    for solver in ["wcsph", "dfsph"] {
        let text = format!(
            "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [0.5, 0, 0.4]\n[resolution]\nspacing = 0.02\n\
             [solver]\npressure = \"{solver}\"\nartificial_viscosity = 0.5\ntolerance = 1e-4\nsettle = 0.5\n[run]\nseconds = 0.4\nframes_per_second = 2.5\n\
             [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.5, 0, 0.3] }} }}\n"
        );
        good(&dir, &["run", &scene(&dir, &text), "--save", "ply", "--out", solver]);
        let bytes = std::fs::read(dir.join(solver).join("frame_00001.ply")).unwrap();
        let end = b"end_header\n";
        let begin = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        // eight numbers, a byte, two indices
        let rows = bytes[begin..].chunks_exact(8 * 4 + 1 + 2 * 4);
        assert_eq!(rows.len(), 25 * 15);
        let mean = rows.clone().map(|row| f32::from_le_bytes(row[28..32].try_into().unwrap())).sum::<f32>() / 375.0;
        let expected = 1000.0 * 9.81 * 0.3 / 2.0;
        assert!((mean / expected - 1.0).abs() < 0.1, "{solver}: {mean} Pa, {expected} expected");
    }
}

/// A shorter run into the folder of a longer one: pictures of both would make one video.
#[test]
fn frames_of_an_earlier_run_are_told_of() {
    let dir = folder("earlier");
    let water = "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [0.4, 0, 0.4]\n[resolution]\nspacing = 0.05\n\
                 [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.2, 0, 0.2] } }\n";
    let scene = scene(&dir, water);
    let run = |frames| {
        let out = jetsam(&dir, &["run", &scene, "--frames", frames, "--save", "ply,vtk", "--out", "o"]);
        assert_eq!(out.status.code(), Some(0));
        text(&out.stderr)
    };
    assert!(!run("5").contains("earlier run"));
    let told = run("3");
    assert!(told.contains("4 files from frame_00004 on are of an earlier run"), "{told}");
    assert!(dir.join("o/frame_00005.vtk").exists());
}

#[test]
fn a_run_is_quiet_in_a_pipe_and_repeats_to_the_last_bit() {
    let dir = folder("quiet");
    let file = scene(&dir, POOL);
    let hash = |threads: &str, out: &str| {
        let run = jetsam(&dir, &["run", &file, "--save", "csv", "--threads", threads, "--out", out]);
        let message = text(&run.stderr);
        assert!(run.stdout.is_empty(), "{}", text(&run.stdout));
        // some graphics drivers have a word of their own where there is no display
        let ours = message.lines().filter(|l| !l.starts_with("error: XDG_RUNTIME_DIR"));
        assert!(ours.count() < 12 && !message.contains(['\r', '\u{1b}']), "{message}");
        let line = message.lines().find(|l| l.starts_with("state hash")).unwrap().to_owned();
        (line, std::fs::read(dir.join(out).join("bodies.csv")).unwrap())
    };
    assert_eq!(hash("1", "one"), hash("3", "three"));
}

#[test]
fn the_last_frame_ends_with_the_run() {
    let dir = folder("lengths");
    let file = scene(&dir, POOL);
    let times = |args: &[&str]| -> Vec<f64> {
        good(&dir, &[&["run", &file, "--save", "csv", "--out", "o"], args].concat());
        let stats = std::fs::read_to_string(dir.join("o/stats.jsonl")).unwrap();
        stats.lines().map(|l| json(l)["time"].as_f64().unwrap()).collect()
    };
    assert_eq!(times(&["--seconds", "0.03"]), [0.0, 0.02, 0.03]);
    assert_eq!(times(&["--frames", "1"]), [0.0, 0.02]);
    assert_eq!(times(&["--seconds", "0"]), [0.0]);
}

#[test]
fn pictures_are_complete_when_a_run_ends_and_one_that_cannot_be_written_ends_it() {
    let dir = folder("pictures");
    let file = scene(&dir, POOL);
    let run = ["run", &file, "--frames", "3", "--size", "32x24", "--save", "png", "--renderer", "cpu", "--out", "o"];
    good(&dir, &run);
    let picture = |frame: u32| dir.join(format!("o/frame_{frame:05}.png"));
    for frame in 0..=3 {
        // the header of a PNG says how large it is, and its last chunk that it is whole
        let bytes = std::fs::read(picture(frame)).unwrap();
        assert_eq!(bytes[16..24], [0, 0, 0, 32, 0, 0, 0, 24]);
        assert_eq!(&bytes[bytes.len() - 8..bytes.len() - 4], b"IEND");
    }
    std::fs::remove_file(picture(1)).unwrap();
    std::fs::create_dir(picture(1)).unwrap();
    let out = jetsam(&dir, &run);
    assert_eq!(out.status.code(), Some(2), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("frame_00001.png"), "{}", text(&out.stderr));
}

#[test]
fn too_many_lost_particles_are_status_1() {
    let dir = folder("lost");
    // a step a thousand times too long throws particles through the walls
    let text_of =
        pool_with("[run]", "[solver]\ndt = 0.02\ncourant = 1.0\ncourant_force = 1.0\nsound_speed = 900.0\n\n[run]");
    let file = scene(&dir, &text_of.replace("[[rigid]]", "[[fluid]]\nshape = { box = { min = [0.1, 0.1, 0.4], max = [0.3, 0.3, 0.6] } }\nvelocity = [90000.0, 0.0, 0.0]\n\n[[rigid]]"));
    let out = jetsam(&dir, &["run", &file, "--save", "csv", "--out", "o"]);
    assert_eq!(out.status.code(), Some(1), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("help: "), "{}", text(&out.stderr));
}

#[test]
fn voxelize_says_what_the_contract_says() {
    let dir = folder("voxelize");
    let keys = "particles spacing triangles volume_mesh volume_particles com inertia watertight boundary_edges \
                nonmanifold_edges flipped_shells rule millis backend";
    for fineness in [["--particles", "500"], ["--resolution", "12"], ["--spacing", "0.09"]] {
        let report = json(&good(&dir, &["voxelize", &monkey(), fineness[0], fineness[1], "--json", "--out", "m.ply"]));
        assert_keys(&report, keys);
        let header = format!("element vertex {}\n", report["particles"]);
        assert!(text(&std::fs::read(dir.join("m.ply")).unwrap()).contains(&header));
    }
    let turned = [
        "voxelize",
        &monkey(),
        "--spacing",
        "0.09",
        "--offset",
        "-1,0,2",
        "--rotate",
        "0,0,1,90",
        "--rule",
        "parity",
        "--json",
    ];
    let report = json(&good(&dir, &turned));
    assert!((report["com"][0].as_f64().unwrap() + 1.0).abs() < 0.05, "{report}");
    assert_eq!(report["rule"], "parity");

    let series = good(&dir, &["voxelize", &monkey(), "--particles", "40", "--series", "3", "--out", "s", "--json"]);
    let counts: Vec<f64> = series.lines().map(|l| json(l)["particles"].as_f64().unwrap()).collect();
    assert_eq!(counts.len(), 3);
    assert!(counts.windows(2).all(|w| (1.8..2.2).contains(&(w[1] / w[0]))), "{counts:?}");
    assert!(dir.join("s/series_02.png").is_file());
}

#[test]
fn bench_and_check_say_what_the_contract_says() {
    let dir = folder("bench");
    let file = scene(&dir, POOL);
    let lines = good(&dir, &["bench", &file, "--particles", "300", "--particles", "1500", "--steps", "5", "--json"]);
    let cases: Vec<Value> = lines.lines().map(json).collect();
    assert_eq!(cases.len(), 2);
    for (case, wanted) in cases.iter().zip([300.0, 1500.0]) {
        assert_keys(
            case,
            "scene backend device particles neighbours steps ms_per_step particle_steps_per_s real_time_factor",
        );
        assert_keys(case, "density_error_mean rounds peak_mb threads stage_ms state_hash");
        assert_eq!((&case["steps"], &case["backend"]), (&5.into(), &"cpu".into()));
        let particles = case["particles"].as_f64().unwrap();
        assert!((0.7..1.6).contains(&(particles / wanted)), "{particles} for {wanted}");
        assert!(case["real_time_factor"].as_f64().unwrap() > 0.0 && case["peak_mb"].as_f64().unwrap() > 0.0);
    }
    assert!(good(&dir, &["bench", "--list"]).contains("dam-break"));

    let check = json(&good(&dir, &["check", &file, "--json"]));
    assert_keys(&check, "fluid rigid_particles static_particles dt dt_bound sound_speed margins warnings");
    assert_eq!(check["fluid"], 500);
    for margin in check["margins"].as_array().unwrap() {
        assert!(margin["value"].as_f64().unwrap() <= 1.000_001 * margin["limit"].as_f64().unwrap(), "{margin}");
    }
    assert!(good(&dir, &["check", &file]).contains("time step"));
}

#[test]
fn the_schema_knows_every_key_of_the_built_in_scenes() {
    let dir = folder("schema");
    let schema = json(&good(&dir, &["schema"]));
    let scenes = json(&good(&dir, &["scenes", "--json"]));
    assert_eq!(scenes[0]["name"], "monkey-splash");
    for scene in scenes.as_array().unwrap() {
        let name = scene["name"].as_str().unwrap();
        let path = format!("{}/../../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let table: toml::Table = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        accepts(&schema, &schema, &serde_json::to_value(table).unwrap(), name);
    }
}

/// Every key of a value is named by the schema, through references, arrays and alternatives.
fn accepts(root: &Value, schema: &Value, value: &Value, place: &str) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let child = find(root, schema, &|s| {
                    s["properties"].get(key).or(s.get("additionalProperties").filter(|free| free.is_object()))
                });
                let child = child.unwrap_or_else(|| panic!("{place}.{key} is not in the schema"));
                accepts(root, child, value, &format!("{place}.{key}"));
            }
        }
        Value::Array(items) => {
            let element = find(root, schema, &|s| s.get("items"));
            items.iter().for_each(|item| accepts(root, element.unwrap_or(&Value::Null), item, place));
        }
        _ => {}
    }
}

/// The first schema, through references and alternatives, in which `pick` finds something.
fn find<'a>(root: &'a Value, at: &'a Value, pick: &dyn Fn(&'a Value) -> Option<&'a Value>) -> Option<&'a Value> {
    if let Some(reference) = at["$ref"].as_str() {
        return find(root, root.pointer(reference.trim_start_matches('#'))?, pick);
    }
    pick(at).or_else(|| {
        let choices = ["anyOf", "oneOf", "allOf"].iter().find_map(|k| at[k].as_array())?;
        choices.iter().find_map(|choice| find(root, choice, pick))
    })
}

#[test]
fn a_scene_that_cannot_be_read_is_status_2() {
    let dir = folder("unreadable");
    bad(&dir, &["run", "nowhere.toml"], &["nowhere.toml", "help: "]);
    bad(&dir, &["run", "dam-brake"], &["did you mean `dam-break`"]);
    bad(&dir, &["run", "."], &["help: "]);
    let binary = dir.join("binary.toml");
    std::fs::write(&binary, [0xff, 0xfe, 0, 1, 2]).unwrap();
    bad(&dir, &["check", "binary.toml"], &["binary.toml", "help: "]);
    for line in ["", "title = ", "[domain]\nmin = 3\n", "fluid = 7", "= = ="] {
        bad(&dir, &["check", &scene(&dir, line)], &["help: "]);
    }
}

#[test]
fn wrong_values_are_named_with_line_and_remedy() {
    let dir = folder("values");
    let check = |line: &str, by: &str, needles: &[&str]| {
        let file = scene(&dir, &pool_with(line, by));
        bad(&dir, &["check", &file], &[needles, &["help: "]].concat())
    };
    let water = "name = \"water\"";
    let ball = "density = 500";
    let shape = "shape = { sphere = { center = [0.0, 0.0, 0.0], radius = 0.1 } }";
    check(water, "name = \"water\"\nviscosty = 1", &["scene.toml:15", "did you mean `viscosity`"]);
    check(water, "density = -3", &["scene.toml:14", "-3"]);
    check(ball, "density = -500", &["scene.toml:20", "-500"]);
    check(ball, "density = nan", &["scene.toml:20"]);
    check(ball, "", &["scene.toml:17", "density"]);
    check("spacing = 0.05", "spacing = 1e-6", &["scene.toml:8", "GB"]);
    check("spacing = 0.05", "spacing = 0", &["scene.toml:8"]);
    check("spacing = 0.05", "spacing = 50", &["help: "]);
    check("0.25, 0.25, 0.5", "0.25, 0.25, 0.75", &["scene.toml:21", "outside the domain"]);
    check("0.25, 0.25, 0.5", "1e300, 0, 0", &["scene.toml:21"]);
    check("max = [0.5, 0.5, 0.8]", "max = [0.5, -0.5, 0.8]", &["scene.toml:5"]);
    check("max = [0.5, 0.5, 0.8]", "max = [0.5, 1e30, 0.8]", &["help: "]);
    check("radius = 0.1", "radius = -0.1", &["scene.toml:19"]);
    check("max = [0.5, 0.5, 0.25]", "max = [0.5, 0.5, -0.25]", &["scene.toml:15"]);
    check(shape, "shape = { mesh = { path = \"gone.obj\" } }", &["scene.toml:19", "gone.obj"]);
    std::fs::write(dir.join("broken.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n").unwrap();
    check(shape, "shape = { mesh = { path = \"broken.obj\" } }", &["scene.toml:19", "broken.obj"]);
    std::fs::write(dir.join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    check(shape, "shape = { mesh = { path = \"flat.obj\", scale = 0.1 } }", &["scene.toml:19", "flat.obj"]);
    check(shape, "shape = { mesh = { path = \"flat.obj\", scale = 1e12 } }", &["scene.toml:19"]);
    check(
        ball,
        "density = 500\ncopies = { count = 4000000000, grid = { columns = [1, 1], step = [0, 0, 0.1] } }",
        &["scene.toml:21", "too many"],
    );
    check(
        ball,
        "density = 500\ncopies = { count = 50, random = { min = [0, 0, 0.3], max = [0.5, 0.5, 0.8] } }",
        &["scene.toml", "copies fit"],
    );
    check(ball, "density = 500\ncopies = { count = 2 }", &["scene.toml", "grid"]);
    check("[run]", "[run]\nframes_per_second = 0", &["scene.toml:11"]);
    check("[run]", "[world]\ndimensions = 4\n[run]", &["dimensions"]);
}

#[test]
fn wrong_arguments_are_status_2() {
    let dir = folder("arguments");
    let file = scene(&dir, POOL);
    bad(&dir, &["run", &file, "--set", "solver.supprt=2"], &["did you mean `support`"]);
    bad(&dir, &["run", &file, "--set", "nonsense"], &["--set key=value"]);
    bad(&dir, &["run", &file, "--set", "rigid.7.density=3"], &["help: "]);
    bad(&dir, &["run", &file, "--set", "fluid.0.density=heavy"], &["help: "]);
    bad(&dir, &["run", &file, "--set", "fluid.0.density=-1"], &["help: "]);
    bad(&dir, &["run", &file, "--backend", "quantum"], &["quantum"]);
    bad(&dir, &["run", &file, "--size", "1280x721"], &["721", "even"]);
    bad(&dir, &["run", &file, "--color", "taste"], &["speed, density"]);
    bad(&dir, &["run", &file, "--fluid", "surface", "--renderer", "cpu"], &["help: "]);
    bad(&dir, &["run", &file, "--lines", "cobwebs"], &["none, trails, streamlines"]);
    bad(&dir, &["run", &file, "--lines", "trails", "--renderer", "cpu"], &["help: "]);
    let sprites =
        |sprite| bad(&dir, &["run", &file, "--fluid", "sprites", "--sprite", sprite], &[sprite, "PNG", "help: "]);
    sprites("gone.png");
    sprites("scene.toml");
    bad(&dir, &["run", &file, "--sprite", "gone.png"], &["--fluid sprites"]);
    bad(&dir, &["bench", "--size", "64x48"], &["--pictures"]);
    bad(&dir, &["run", &file, "--save", "gif"], &["gif"]);
    bad(&dir, &["run", &file, "--seconds", "-1"], &["seconds"]);
    bad(&dir, &["run", &file, "--threads", "0"], &["threads"]);
    bad(&dir, &["run", &file, "--out", &format!("{file}/below")], &["scene.toml", "help: "]);
    bad(&dir, &["frobnicate"], &["frobnicate"]);
    bad(&dir, &["voxelize", &monkey()], &["--spacing"]);
    bad(&dir, &["voxelize", &monkey(), "--spacing", "-1"], &["spacing"]);
    bad(&dir, &["voxelize", &monkey(), "--spacing", "1e-9"], &["cells"]);
    bad(&dir, &["voxelize", "gone.stl", "--particles", "10"], &["gone.stl", "help: "]);
    bad(&dir, &["voxelize", &monkey(), "--particles", "10", "--out", "no/folder/m.ply"], &["help: "]);
    bad(&dir, &["bench", "nowhere.toml"], &["nowhere.toml"]);
}

#[test]
fn an_animation_needs_nothing() {
    let dir = folder("animation");
    let file = scene(&dir, POOL);
    let args = ["run", &file, "--frames", "2", "--save", "apng", "--size", "64x48", "--renderer", "cpu", "--out", "o"];
    let out = Command::new(env!("CARGO_BIN_EXE_jetsam")).args(args).current_dir(&dir).env("PATH", "").output().unwrap();
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let bytes = std::fs::read(dir.join("o/o.apng")).unwrap();
    // after the signature and the header: how many pictures there are
    assert_eq!((&bytes[1..4], &bytes[37..41], bytes[44]), (&b"PNG"[..], &b"acTL"[..], 3));
}

#[test]
fn a_video_without_ffmpeg_is_status_2() {
    let dir = folder("video");
    let file = scene(&dir, POOL);
    let args = ["run", &file, "--save", "mp4", "--out", "o"];
    let out = Command::new(env!("CARGO_BIN_EXE_jetsam")).args(args).current_dir(&dir).env("PATH", "").output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("install ffmpeg"), "{}", text(&out.stderr));
}

#[test]
fn fluid_gives_way_to_bodies_and_says_so() {
    let dir = folder("carve");
    let file = scene(&dir, &pool_with("0.25, 0.25, 0.5", "0.25, 0.25, 0.12"));
    let check = json(&good(&dir, &["check", &file, "--json"]));
    assert!(check["fluid"].as_u64().unwrap() < 500);
    assert!(check["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains("carved")), "{check}");
    let run = jetsam(&dir, &["run", &file, "--frames", "1", "--save", "csv", "--out", "o"]);
    assert!(text(&run.stderr).lines().any(|l| l.starts_with("warning: ")), "{}", text(&run.stderr));
}

#[test]
fn scenes_of_other_kinds_run_too() {
    let dir = folder("kinds");
    let flat = pool_with("[domain]", "[world]\ndimensions = 2\n\n[domain]");
    let dry = POOL[..POOL.find("[[fluid]]").unwrap()].to_owned() + &POOL[POOL.find("[[rigid]]").unwrap()..];
    let open = pool_with("[resolution]", "walls = [\"periodic\", \"open\", \"solid\"]\n\n[resolution]");
    let settled = pool_with("[run]", "[solver]\nsettle = 0.01\n\n[run]");
    let still = pool_with("[domain]", "[world]\ngravity = [0, 0, 0]\n\n[domain]");
    for text in [flat, dry, open, settled, still] {
        let file = scene(&dir, &text);
        good(&dir, &["check", &file]);
        good(&dir, &["run", &file, "--frames", "1", "--out", "o"]);
        assert!(std::fs::metadata(dir.join("o/frame_00001.png")).is_ok_and(|m| m.len() > 1000));
    }
}

#[test]
fn help_completions_and_man_page_are_there() {
    let dir = folder("help");
    for command in ["run", "check", "voxelize", "bench", "scenes", "schema"] {
        assert!(good(&dir, &["--help"]).contains(command));
        assert!(good(&dir, &[command, "--help"]).contains("Usage"));
    }
    assert!(good(&dir, &["completions", "bash"]).contains("jetsam"));
    assert!(good(&dir, &["man"]).contains(".TH"));
}

/// A stone that falls 5 m in a second.
const FALL: &str = r#"title = "A fall"
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
name = "z, up"
of = "position"
body = "stone"
component = "z"
interval = 0.25
[[expect]]
probe = "z, up"
time = 1
value = -5
tolerance = 1e-9
source = "g t^2 / 2"
"#;

#[test]
fn validate_judges_a_scene_by_its_exit_status() {
    let dir = folder("validate");
    let file = scene(&dir, FALL);
    let rows = good(&dir, &["validate", &file, "--json", "--out", "report"]);
    let row = json(rows.trim());
    assert_keys(&row, "case variant what value reference tolerance reached verdict seconds source note");
    assert_eq!((&row["verdict"], &row["value"], &row["case"]), (&"ok".into(), &(-5.0).into(), &"scene".into()));
    let table = good(&dir, &["validate", &file]);
    assert!(table.contains("A fall") && table.contains("z, up at 1 s"), "{table}");
    let markdown = std::fs::read_to_string(dir.join("report/validation.md")).unwrap();
    assert!(markdown.contains("| z, up at 1 s | -5 |") && markdown.contains("scene.svg"), "{markdown}");
    assert!(std::fs::read_to_string(dir.join("report/scene.svg")).unwrap().contains("</svg>"));
    let readings = std::fs::read_to_string(dir.join("report/scene.csv")).unwrap();
    assert_eq!(readings.lines().count(), 1 + 5, "{readings}");

    let wrong = jetsam(&dir, &["validate", &file, "--set", "expect.0.value=-4"]);
    assert_eq!(wrong.status.code(), Some(1), "{}", text(&wrong.stderr));
    assert!(text(&wrong.stdout).contains("FAIL"));
    bad(&dir, &["validate", &file, "--set", "expect.0.probe=x"], &["no probe `x`"]);
    bad(&dir, &["validate", "B99"], &["no validation case `B99`", "--list"]);
    bad(&dir, &["check", &scene(&dir, &FALL.replace("tolerance = 1e-9", "")), "--json"], &["how far", "scene.toml:"]);
    let listed = good(&dir, &["validate", "--list"]);
    assert!(listed.contains("B2-free-fall") && listed.contains("A1-kernels"), "{listed}");
}

#[test]
fn a_run_writes_what_probes_read() {
    let dir = folder("probes");
    let file = scene(&dir, FALL);
    good(&dir, &["run", &file, "--headless", "--save", "csv", "--out", "."]);
    let csv = std::fs::read_to_string(dir.join("probes.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!((lines[0], lines[1], lines.len()), ("time,probe,value", "0,\"z, up\",0", 6));
    let last: f64 = lines[5].rsplit(',').next().unwrap().parse().unwrap();
    assert!((last + 5.0).abs() < 1e-9, "{csv}");
}
