//! Pictures by the GPU: against geometry, against the CPU's renderer, against golden pictures.
//!
//! Needs a device, if only Mesa's software driver; without one the tests show as ignored, and with `JETSAM_REQUIRE_GPU=1` in the
//! environment they fail. `JETSAM_BLESS=1` writes the golden pictures anew: look at them before they are committed.

use glam::{Vec3, vec2};
use jetsam::gpu::{Gpu, devices};
use jetsam::state::Record;
use jetsam::{Scene, World};
use jetsam_view::gpu::Studio;
use jetsam_view::style::{Bodies, ColorBy, Fluid, Lines, Smoothing, Style};
use jetsam_view::{Camera, Curves, Frame, Image, Show, Sprite, color, paint};
use libtest_mimic::{Arguments, Trial, run};
use std::path::Path;
use std::process::ExitCode;
use std::sync::{LazyLock, Mutex};

fn main() -> ExitCode {
    let tests: [(&str, fn()); 12] = [
        ("a_ball_covers_its_outline", a_ball_covers_its_outline),
        ("colours_are_those_of_the_scale", colours_are_those_of_the_scale),
        ("nearer_hides_farther", nearer_hides_farther),
        ("both_renderers_agree", both_renderers_agree),
        ("water_absorbs_by_beer_and_lambert", water_absorbs_by_beer_and_lambert),
        ("smoothing_flattens_a_layer_of_balls", smoothing_flattens_a_layer_of_balls),
        ("two_eyes_agree_where_they_look", two_eyes_agree_where_they_look),
        ("sprites_are_textured_squares", sprites_are_textured_squares),
        ("sprites_hide_by_the_depth_of_their_centres", sprites_hide_by_the_depth_of_their_centres),
        ("golden_pictures", golden_pictures),
        ("lent_buffers_are_drawn_as_they_are", lent_buffers_are_drawn_as_they_are),
        ("a_simulation_on_the_device_is_drawn_from_its_buffers", a_simulation_on_the_device_is_drawn_from_its_buffers),
    ];
    let absent = devices().is_empty();
    let required = std::env::var("JETSAM_REQUIRE_GPU").is_ok_and(|v| v == "1");
    let trial = |(name, test): (&'static str, fn())| {
        let body = move || {
            test();
            Ok(())
        };
        Trial::test(name, body).with_ignored_flag(absent && !required)
    };
    run(&Arguments::from_args(), tests.map(trial).into()).exit_code()
}

/// One device for all; tests take turns.
static GPU: LazyLock<Mutex<Gpu>> = LazyLock::new(|| Mutex::new(Gpu::open(false).unwrap_or_else(|e| panic!("{e}"))));

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;

fn picture(show: &Show, frame: &Frame, style: &Style) -> Image {
    let gpu = GPU.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let mut studio = Studio::new(gpu.clone(), show.clone(), WIDTH, HEIGHT).unwrap();
    studio.picture(frame, style, &[]).unwrap()
}

/// A world of fluid alone, seen along y by an angle of view of 2 atan(1/2).
fn bare() -> Show {
    let scene = Scene::open("dam-break", &["resolution.spacing=0.1".into()]).unwrap();
    let show = Show::new(&scene, &World::from_scene(&scene).unwrap(), 4.0 / 3.0);
    let fov_y = 2.0 * 0.5f32.atan();
    Show {
        camera: Camera { eye: Vec3::ZERO, target: Vec3::Y, up: Vec3::Z, fov_y },
        bounds: [Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 9.0, 3.0)],
        edges: Vec::new(),
        ground: None,
        spacing: 0.1,
        fast: 1.0,
        bodies: Vec::new(),
        ..show
    }
}

/// Fluid particles at places, with speeds along x.
fn drops(places: &[(Vec3, f32)]) -> Frame {
    let n = places.len();
    Frame {
        record: places
            .iter()
            .map(|(x, v)| Record { x: x.to_array(), v: [*v, 0.0, 0.0], ..Record::default() })
            .collect(),
        push: vec![[0.0, 0.0, 0.0, 1.0]; n],
        tag: (0..n as u32).map(|id| [id, 0]).collect(),
        first: [0, n as u32, n as u32],
        count: [n as u32, 0, 0],
        ..Frame::default()
    }
}

/// Without light that depends on anything but the surface.
fn plain() -> Style {
    Style { shadows: false, crevices: 0, edges: false, ..Style::default() }
}

fn background(show: &Show) -> Image {
    picture(show, &drops(&[]), &plain())
}

fn differs(a: [u8; 4], b: [u8; 4]) -> bool {
    (0..3).any(|k| a[k].abs_diff(b[k]) > 6)
}

fn a_ball_covers_its_outline() {
    let show = bare();
    let empty = background(&show);
    for (x, z) in [(0.0, 0.0), (0.9, 0.5), (-1.1, -0.6)] {
        let center = Vec3::new(x, 2.5, z);
        let r = 0.35f32;
        let style = Style { radius: Some(r / show.spacing), ..plain() };
        let image = picture(&show, &drops(&[(center, 0.0)]), &style);
        let (mut inside, mut wrong) = (0, 0);
        for j in 0..HEIGHT as usize {
            for i in 0..WIDTH as usize {
                // the line of sight through the pixel's middle: does it pass the centre within the radius?
                let slope = (vec2(i as f32, j as f32) + 0.5 - vec2(160.0, 120.0)) / 240.0;
                let along = Vec3::new(slope.x, 1.0, -slope.y).normalize();
                let miss = center - center.dot(along) * along;
                // pixels that the outline crosses may be either
                let distance = miss.length() - r;
                if distance.abs() < 0.012 {
                    continue;
                }
                inside += usize::from(distance < 0.0);
                wrong += usize::from((distance < 0.0) != differs(image.pixel(i, j), empty.pixel(i, j)));
            }
        }
        assert!(inside > 2000 && wrong == 0, "{wrong} pixels are wrong, {inside} are inside");
    }
}

fn colours_are_those_of_the_scale() {
    let show = bare();
    let speeds = [0.0f32, 0.25, 0.5, 1.0];
    let balls: Vec<_> = (0..4).map(|k| (Vec3::new(-1.2 + 0.8 * k as f32, 2.5, 0.0), speeds[k])).collect();
    let style = Style { radius: Some(3.0), map: color::Map::Viridis, range: Some([0.0, 1.0]), ..plain() };
    let image = picture(&show, &drops(&balls), &style);
    for (k, (center, speed)) in balls.iter().enumerate() {
        let at = show.camera.project(*center, WIDTH as usize, HEIGHT as usize).unwrap();
        let seen = image.pixel(at.x as usize, at.y as usize);
        let linear: Vec<f32> = seen[..3].iter().map(|b| color::linear(f32::from(*b) / 255.0)).collect();
        let wanted = style.map.at(speed.powf(style.gamma()));
        // the same hue: light changes all three alike, gloss adds a little white
        let ratio: Vec<f32> = (0..3).filter(|c| wanted[*c] > 0.05).map(|c| linear[c] / wanted[c]).collect();
        let (low, high) = ratio.iter().fold((f32::INFINITY, 0.0f32), |(l, h), x| (l.min(*x), h.max(*x)));
        assert!(high / low < 1.25, "ball {k}: {linear:?} is not the hue of {wanted:?}");
    }
}

fn nearer_hides_farther() {
    let show = bare();
    let style = Style { radius: Some(3.0), color: ColorBy::Speed, range: Some([0.0, 1.0]), ..plain() };
    let (near, far) = (Vec3::new(0.0, 2.0, 0.0), Vec3::new(0.0, 4.0, 0.0));
    let alone = picture(&show, &drops(&[(near, 0.0)]), &style);
    for order in [[(near, 0.0), (far, 1.0)], [(far, 1.0), (near, 0.0)]] {
        let both = picture(&show, &drops(&order), &style);
        assert_eq!(both.pixel(160, 120), alone.pixel(160, 120));
    }
}

/// A dam of a few hundred balls and a monkey's head, drawn by either.
fn both_renderers_agree() {
    let set = ["resolution.spacing=0.05", "rigid.0.copies.count=3"].map(String::from);
    let scene = Scene::open("monkey-splash", &set).unwrap();
    let world = World::from_scene(&scene).unwrap();
    let show = Show::new(&scene, &world, WIDTH as f32 / HEIGHT as f32);
    let frame = Frame::of(&world);
    let (gpu, cpu) = (picture(&show, &frame, &Style::default()), paint(&show, &frame, WIDTH as usize, HEIGHT as usize));
    let mut far = 0;
    let mut sum = 0u64;
    for (a, b) in gpu.rgba.chunks(4).zip(cpu.rgba.chunks(4)) {
        let apart = (0..3).map(|k| u64::from(a[k].abs_diff(b[k]))).max().unwrap();
        far += usize::from(apart > 60);
        sum += apart;
    }
    let pixels = (WIDTH * HEIGHT) as usize;
    // light is set up alike, not equal: what has to agree is what is seen where
    assert!(far * 100 < 4 * pixels, "{far} of {pixels} pixels are quite different");
    assert!(sum < 16 * pixels as u64, "the pictures differ by {} on the mean", sum as f64 / pixels as f64);
}

/// A wall of water of a known thickness before a white sky.
fn wall(layers: usize) -> Frame {
    let mut places = Vec::new();
    for j in 0..layers {
        for i in -24i32..24 {
            for k in -18i32..18 {
                places.push((0.1 * Vec3::new(i as f32 + 0.5, 30.0 + j as f32 + 0.5, k as f32 + 0.5), 0.0));
            }
        }
    }
    drops(&places)
}

fn water_absorbs_by_beer_and_lambert() {
    let show = bare();
    let style = Style { fluid: Fluid::Surface, ..plain() };
    // red, the least scattered: what comes through twice the water is the square, as a fraction of what comes in
    let red = |image: &Image| color::linear(f32::from(image.pixel(160, 120)[0]) / 255.0);
    let sky = red(&background(&show));
    let share = |layers: usize| {
        let clear = Style { murk: 0.0, ..style.clone() };
        let through = red(&picture(&show, &wall(layers), &style));
        // with nothing absorbed: what the surface reflects
        through / red(&picture(&show, &wall(layers), &clear))
    };
    let (thin, thick) = (share(3), share(6));
    assert!(sky > 0.5 && thin < 0.97 && thick < thin, "{sky} {thin} {thick}");
    let depth = 0.25 * (show.bounds[1] - show.bounds[0]).length();
    for (layers, share) in [(3, thin), (6, thick)] {
        let expected = (-2.4 / depth * 0.1 * layers as f32).exp();
        // a few hundredths are reflected and scattered
        assert!((share - expected).abs() < 0.05, "{layers} layers let {share} through, {expected} expected");
    }
}

fn smoothing_flattens_a_layer_of_balls() {
    let show = bare();
    let frame = wall(2);
    let unrest = |smoothing: Smoothing| {
        let style = Style { fluid: Fluid::Surface, smoothing, passes: 3, ..plain() };
        let image = picture(&show, &frame, &style);
        let mut sum = 0.0;
        for y in 90..150 {
            for x in 130..190 {
                let at = |x: usize, y: usize| f64::from(image.pixel(x, y)[1]);
                sum += (at(x + 1, y) - at(x, y)).abs() + (at(x, y + 1) - at(x, y)).abs();
            }
        }
        sum / 3600.0
    };
    let rough = unrest(Smoothing::None);
    for smoothing in [Smoothing::NarrowRange, Smoothing::Bilateral, Smoothing::CurvatureFlow] {
        let smooth = unrest(smoothing);
        assert!(smooth < 0.5 * rough, "{smoothing:?} leaves {smooth} of {rough}");
    }
}

fn two_eyes_agree_where_they_look() {
    let mut show = bare();
    show.camera.target = Vec3::new(0.0, 3.0, 0.0);
    let style = Style { stereo: 1.0, radius: Some(2.0), ..plain() };
    let columns = |center: Vec3| {
        let (image, empty) = (picture(&show, &drops(&[(center, 0.0)]), &style), picture(&show, &drops(&[]), &style));
        let half = WIDTH as usize / 2;
        let middle = |from: usize| {
            let seen = (0..half)
                .filter(|i| (0..HEIGHT as usize).any(|j| differs(image.pixel(from + i, j), empty.pixel(from + i, j))));
            let seen: Vec<usize> = seen.collect();
            seen.iter().sum::<usize>() as f32 / seen.len() as f32
        };
        middle(half) - middle(0)
    };
    // at the depth of the target both see it in the same place; before it, crossed; behind it, apart
    let (at, before, behind) = (columns(Vec3::Y * 3.0), columns(Vec3::Y * 2.0), columns(Vec3::Y * 5.0));
    assert!(at.abs() < 0.6, "{at}");
    let aside = 0.04 * 3.0;
    for (depth, seen) in [(2.0, before), (5.0, behind)] {
        let expected = 240.0 * aside * (1.0 / 3.0 - 1.0 / depth);
        assert!((seen - expected).abs() < 1.0, "at {depth} m the eyes differ by {seen}, {expected} expected");
    }
}

/// A sprite whose right half is clear, and whose lower half is half as bright.
fn flag() -> Sprite {
    let texel = |k: usize| {
        let tone = if k < 32 { 255 } else { color::byte(0.5) };
        [tone, tone, tone, if k % 8 < 4 { 255 } else { 0 }]
    };
    Sprite::of(Image { width: 8, height: 8, rgba: (0..64).flat_map(texel).collect() })
}

fn of_sprites(radius: f32) -> Style {
    let (fluid, range) = (Fluid::Sprites, Some([0.0, 1.0]));
    Style { fluid, sprite: flag(), radius: Some(radius / 0.1), map: color::Map::Viridis, range, ..plain() }
}

/// What a sprite of a speed shows as at a brightness, in bytes of sRGB: no light falls on it.
fn shown(style: &Style, speed: f32, bright: f32) -> [u8; 4] {
    let [r, g, b] = style.map.at(speed.powf(style.gamma())).map(|c| color::byte(bright * c));
    [r, g, b, 255]
}

fn sprites_are_textured_squares() {
    let show = bare();
    let empty = background(&show);
    for (x, z, speed) in [(0.0, 0.0, 0.5), (0.9, 0.5, 1.0), (-1.1, -0.6, 0.1)] {
        let (center, r) = (Vec3::new(x, 2.5, z), 0.35f32);
        let style = of_sprites(r);
        let image = picture(&show, &drops(&[(center, speed)]), &style);
        let mut counted = [0; 3];
        for j in 0..HEIGHT as usize {
            for i in 0..WIDTH as usize {
                // where the line of sight meets the plane through the centre, in radii to the right and up
                let slope = (vec2(i as f32, j as f32) + 0.5 - vec2(160.0, 120.0)) / 240.0;
                let at = (2.5 * vec2(slope.x, -slope.y) - vec2(x, z)) / r;
                // a pixel on an edge may be either, half a texel from one inside the picture is between
                let (edge, blend) = (0.03, 0.14);
                if (at.abs().max_element() - 1.0).abs() < edge || at.abs().min_element() < blend {
                    continue;
                }
                let inside = at.abs().max_element() < 1.0 && at.x < 0.0;
                let wanted = match (inside, at.y > 0.0) {
                    (false, _) => empty.pixel(i, j),
                    (true, upper) => shown(&style, speed, if upper { 1.0 } else { 0.5 }),
                };
                counted[if !inside {
                    0
                } else if at.y > 0.0 {
                    1
                } else {
                    2
                }] += 1;
                let seen = image.pixel(i, j);
                assert!(!differs(seen, wanted), "{seen:?} at {i}, {j}, where {wanted:?} was expected");
            }
        }
        assert!(counted.iter().all(|n| *n > 600), "{counted:?}");
    }
}

fn sprites_hide_by_the_depth_of_their_centres() {
    let show = bare();
    let style = of_sprites(0.35);
    let (near, far) = ((Vec3::new(0.0, 2.0, 0.0), 0.0), (Vec3::new(0.2, 2.2, 0.0), 1.0));
    for order in [[near, far], [far, near]] {
        let image = picture(&show, &drops(&order), &style);
        // the near one covers 160 - 42 .. 160, the far one 160 - 16 .. 160 + 22: left of the middle only the near one is seen
        assert!(!differs(image.pixel(150, 100), shown(&style, 0.0, 1.0)));
        // where the near one is clear the far one shows
        assert!(!differs(image.pixel(168, 100), shown(&style, 1.0, 1.0)));
    }
}

/// A simulation on the device that draws: nothing has to come home for its picture, and lines are there if it does.
fn a_simulation_on_the_device_is_drawn_from_its_buffers() {
    let scene = Scene::open("monkey-splash", &["resolution.spacing=0.08".into(), "rigid.0.copies.count=3".into()]);
    let scene = scene.unwrap().with(&["solver.pressure=wcsph".into(), "rigid.0.position=[0, 0, 0.9]".into()]).unwrap();
    let gpu = GPU.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone();
    let (mut world, _) = World::choose_with(jetsam::Choice::Gpu, Some(&gpu), scene.assemble().unwrap()).unwrap();
    assert!(world.run_to(0.2).is_none());
    let show = Show::new(&scene, &world, WIDTH as f32 / HEIGHT as f32);
    let (mut lent, home) = (Frame::default(), Frame::of(&world));
    lent.borrow(&world);
    assert!(lent.lent.is_some() && lent.record.is_empty() && !home.record.is_empty());
    for (color, bodies) in [(ColorBy::Speed, Bodies::Meshes), (ColorBy::Pressure, Bodies::Particles)] {
        let style = Style { color, bodies, arrows: 0.05, ..Style::default() };
        assert!(!style.at_home());
        assert_eq!(picture(&show, &lent, &style), picture(&show, &home, &style), "{color:?}");
    }
    // water that fell begins to move
    let style = Style { lines: Lines::Streamlines, ..Style::default() };
    assert!(style.at_home());
    let lines = |frame: &Frame| Curves::default().lines(&show, frame, &style).len();
    assert!(lines(&home) > 100 && lines(&lent) == 0, "{} {}", lines(&home), lines(&lent));
}

/// Buffers that somebody else filled are drawn without a copy.
fn lent_buffers_are_drawn_as_they_are() {
    use jetsam_view::gpu::Particles;
    let show = bare();
    let style = Style { radius: Some(3.0), ..plain() };
    let frame = drops(&[(Vec3::new(0.2, 2.5, 0.1), 0.3), (Vec3::new(-0.6, 3.0, 0.0), 0.9)]);
    let wanted = picture(&show, &frame, &style);
    let gpu = GPU.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone();
    let mut studio = Studio::new(gpu.clone(), show.clone(), WIDTH, HEIGHT).unwrap();
    let buffer = |bytes: &[u8]| {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let size = bytes.len() as u64;
        let buffer =
            gpu.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false });
        gpu.queue.write_buffer(&buffer, 0, bytes);
        buffer
    };
    let particles = Particles {
        record: buffer(bytemuck::cast_slice(&frame.record)),
        push: buffer(bytemuck::cast_slice(&frame.push)),
        tag: buffer(bytemuck::cast_slice(&frame.tag)),
        first: frame.first,
        count: frame.count,
    };
    let image = studio.picture_of(particles, &frame, &style, &[]).unwrap();
    assert_eq!(image, wanted);
}

/// Scenes at their beginning, as they were when somebody looked at them.
fn golden_pictures() {
    let open = |name: &str, set: &[&str]| {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let scene = Scene::open(name, &set).unwrap();
        let world = World::from_scene(&scene).unwrap();
        (Show::new(&scene, &world, WIDTH as f32 / HEIGHT as f32), Frame::of(&world))
    };
    let coarse = "resolution.spacing=0.05";
    let monkeys = open("monkey-splash", &[coarse, "rigid.0.copies.count=3", "solver.pressure=wcsph"]);
    let school = open("school", &[coarse, "rigid.0.copies.count=2"]);
    let dam = open("dam-break", &[coarse]);
    let surface = Style { fluid: Fluid::Surface, ..Style::default() };
    let pressure =
        Style { color: ColorBy::Pressure, map: color::Map::Magma, bodies: Bodies::Particles, ..Style::default() };
    let sprites = Style { fluid: Fluid::Sprites, ..Style::default() };
    let points = Style { fluid: Fluid::Points, color: ColorBy::Owner, ..Style::default() };
    for (name, (show, frame), style) in [
        ("balls", &monkeys, Style::default()),
        ("surface", &monkeys, surface),
        ("pressure", &monkeys, pressure),
        ("points", &monkeys, points),
        ("sprites", &monkeys, sprites),
        ("school", &school, Style::default()),
        ("dam", &dam, Style::default()),
    ] {
        compare(name, &picture(show, frame, &style));
    }
}

/// Drivers round differently: a hundredth of the pixels may be quite different, the mean hardly.
fn compare(name: &str, image: &Image) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.png"));
    if std::env::var("JETSAM_BLESS").is_ok_and(|v| v == "1") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        image.save_png(&path).unwrap();
    }
    let file = std::fs::File::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
    let mut golden = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut golden).unwrap();
    assert_eq!((info.width, info.height), (WIDTH, HEIGHT), "{name}");
    let (mut far, mut sum) = (0, 0u64);
    for (a, b) in image.rgba.chunks(4).zip(golden.chunks(4)) {
        let apart = (0..3).map(|k| u64::from(a[k].abs_diff(b[k]))).max().unwrap();
        far += usize::from(apart > 24);
        sum += apart;
    }
    let pixels = (WIDTH * HEIGHT) as usize;
    let mean = sum as f64 / pixels as f64;
    if far * 100 >= pixels || mean >= 1.5 {
        let seen = std::env::temp_dir().join(format!("jetsam-{name}.png"));
        image.save_png(&seen).unwrap();
        panic!("{name}: {far} pixels are quite different, the mean is {mean:.2}; see {}", seen.display());
    }
}
