//! Pictures against geometry: outlines, order, shadows, and the same bits every time.

use glam::{Vec3, vec3};
use jetsam_view::{Ball, Camera, Facet, Image, Line, Options, box_edges, facets, render};

const WIDTH: usize = 240;
const HEIGHT: usize = 160;
const RED: [f32; 3] = [0.8, 0.1, 0.1];
const BLUE: [f32; 3] = [0.1, 0.1, 0.8];

/// Three metres before the origin, looks along +y.
fn camera() -> Camera {
    Camera { eye: vec3(0.0, -3.0, 0.0), target: Vec3::ZERO, up: Vec3::Z, fov_y: 0.8 }
}

fn ball(center: Vec3, radius: f32, color: [f32; 3]) -> Ball {
    Ball { center, radius, color }
}

/// A square across the line of sight at depth `y`, half its edge wide.
fn wall(y: f32, half: f32, color: [f32; 3]) -> Vec<Facet> {
    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(x, z)| vec3(x, y, z));
    facets(&corners, &[[0, 1, 2], [0, 2, 3]], color)
}

fn draw(balls: &[Ball], options: &Options) -> Image {
    render(balls, &camera(), WIDTH, HEIGHT, options)
}

fn is_red([r, _, b, _]: [u8; 4]) -> bool {
    r > b.saturating_add(40)
}

fn is_blue([r, _, b, _]: [u8; 4]) -> bool {
    b > r.saturating_add(40)
}

/// Pseudo-random balls in a box of one metre.
fn cloud(count: u32) -> Vec<Ball> {
    let random = |i: u32| ((i.wrapping_mul(0x9e37_79b1) ^ 0x5bd1).wrapping_mul(0x85eb_ca77) >> 8) as f32 / 16_777_216.0;
    let point = |i| vec3(random(3 * i), random(3 * i + 1), random(3 * i + 2)) - 0.5;
    (0..count).map(|i| ball(point(i), 0.01 + 0.02 * random(i), [random(i), 0.5, 0.5])).collect()
}

#[test]
fn nothing_gives_the_background() {
    let image = draw(&[], &Options::default());
    for y in 0..HEIGHT {
        assert!((1..WIDTH).all(|x| image.pixel(x, y) == image.pixel(0, y)), "row {y} is not even");
    }
    assert_ne!(image.pixel(0, 0), image.pixel(0, HEIGHT - 1), "there is a gradient");
    let invisible = [
        ball(vec3(0.0, -4.0, 0.0), 0.5, RED),
        ball(vec3(0.0, -3.0, 0.0), 0.5, RED),
        ball(Vec3::ZERO, 0.0, RED),
        ball(Vec3::NAN, 1.0, RED),
        ball(Vec3::ZERO, f32::INFINITY, RED),
    ];
    assert!(draw(&invisible, &Options::default()) == image, "balls behind the eye, round it, or broken are left out");
    assert!(render(&cloud(9), &camera(), 0, 0, &Options::default()).rgba.is_empty());
}

#[test]
fn a_ball_in_the_middle_has_the_radius_of_the_projection_formula() {
    let (radius, distance) = (0.7f32, 3.0f32);
    let image = draw(&[ball(Vec3::ZERO, radius, RED)], &Options::default());
    let focal = 0.5 * HEIGHT as f32 / 0.4f32.tan();
    let expected = focal * radius / (distance * distance - radius * radius).sqrt();
    let empty = draw(&[], &Options::default());
    let middle = HEIGHT / 2;
    let across = (0..WIDTH).filter(|x| image.pixel(*x, middle) != empty.pixel(*x, middle)).count();
    assert!((across as f32 / 2.0 - expected).abs() <= 1.0, "{across} pixels across, expected twice {expected}");
}

#[test]
fn a_ball_aside_covers_exactly_the_lines_of_sight_that_meet_it() {
    let (center, radius) = (vec3(0.9, -0.4, -0.45), 0.5f32);
    let image = draw(&[ball(center, radius, RED)], &Options::default());
    let empty = draw(&[], &Options::default());
    let focal = 0.5 * HEIGHT as f32 / 0.4f32.tan();
    let aim = center - camera().eye;
    // Angle between the line of sight and the ball's outline, in pixels about: negative inside.
    let beside = |x: usize, y: usize| {
        let ray = vec3(x as f32 + 0.5 - WIDTH as f32 / 2.0, focal, HEIGHT as f32 / 2.0 - y as f32 - 0.5);
        (ray.angle_between(aim) - (radius / aim.length()).asin()) * focal
    };
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let drawn = image.pixel(x, y) != empty.pixel(x, y);
            assert!(beside(x, y) > -1.0 || drawn, "hole at ({x}, {y})");
            assert!(beside(x, y) < 1.0 || !drawn, "speck at ({x}, {y})");
        }
    }
}

#[test]
fn the_nearer_ball_hides_the_farther_in_any_order() {
    let (near, far) = (ball(vec3(0.0, -1.0, 0.0), 0.2, RED), ball(vec3(0.0, 0.5, 0.0), 0.6, BLUE));
    let image = draw(&[far, near], &Options::default());
    assert!(image == draw(&[near, far], &Options::default()));
    assert!(is_red(image.pixel(WIDTH / 2, HEIGHT / 2)));
    assert!(is_blue(image.pixel(WIDTH / 2 + 25, HEIGHT / 2)));
}

#[test]
fn facets_have_depth_and_no_seams() {
    let wall = wall(0.0, 0.5, BLUE);
    let options = Options { facets: &wall, ..Options::default() };
    let image = draw(&[ball(Vec3::ZERO, 0.3, RED)], &options);
    let half = 0.5 * HEIGHT as f32 / 0.4f32.tan() * 0.5 / 3.0;
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let (dx, dy) = ((x as f32 + 0.5 - WIDTH as f32 / 2.0).abs(), (y as f32 + 0.5 - HEIGHT as f32 / 2.0).abs());
            let (away, aside) = (dx.hypot(dy), dx.max(dy));
            let (pixel, disc) = (image.pixel(x, y), 0.3 / 0.5 * half);
            if away < disc - 1.0 {
                assert!(is_red(pixel), "the ball stands out before the wall at ({x}, {y}): {pixel:?}");
            } else if away > disc + 2.0 && aside < half - 1.0 {
                assert!(is_blue(pixel), "the wall is whole at ({x}, {y}): {pixel:?}");
            } else if aside > half + 1.0 {
                assert!(!is_blue(pixel) && !is_red(pixel), "nothing beside the wall at ({x}, {y}): {pixel:?}");
            }
        }
    }
}

#[test]
fn lines_are_hidden_by_what_is_nearer() {
    let line = |y: f32| [Line { from: vec3(-0.9, y, 0.0), to: vec3(0.9, y, 0.0), color: [0.0; 3] }];
    let wall = wall(0.0, 0.4, RED);
    let draw = |line: &[Line]| draw(&[], &Options { facets: &wall, lines: line, ..Options::default() });
    let (before, behind, without) = (draw(&line(-0.5)), draw(&line(0.5)), draw(&[]));
    let (middle, side) = ((WIDTH / 2, HEIGHT / 2), (WIDTH / 2 + 40, HEIGHT / 2));
    assert!(before.pixel(middle.0, middle.1)[0] < 60);
    assert_eq!(behind.pixel(middle.0, middle.1), without.pixel(middle.0, middle.1));
    assert!(behind.pixel(side.0, side.1)[0] < without.pixel(side.0, side.1)[0]);
    // Ends behind the eye or far beside the picture are cut.
    draw(&box_edges(Vec3::splat(-50.0), Vec3::splat(50.0), RED));
    draw(&[
        Line { from: Vec3::NAN, to: Vec3::ZERO, color: RED },
        Line { from: Vec3::ZERO, to: Vec3::ZERO, color: RED },
    ]);
}

#[test]
fn a_plate_of_balls_casts_a_shadow_on_the_ground() {
    let options = Options { ground: Some(-0.5), light: Vec3::Z, ..Options::default() };
    let at = |i: i32| 0.05 * i as f32;
    let plate = (-4..=4).flat_map(|i| (-4..=4).map(move |j| ball(vec3(at(i), at(j), 0.0), 0.03, RED)));
    let (image, empty) = (draw(&plate.collect::<Vec<_>>(), &options), draw(&[], &options));
    let below = camera().project(vec3(0.0, 0.0, -0.5), WIDTH, HEIGHT).unwrap();
    let (x, y) = (below.x as usize, below.y as usize);
    assert!(image.pixel(x, y)[1] + 20 < empty.pixel(x, y)[1], "it is dark under the plate");
    assert_eq!(image.pixel(x + 60, y), empty.pixel(x + 60, y), "and bright beside it");
}

#[test]
fn any_number_of_threads_draws_the_same_bits() {
    let balls = cloud(3000);
    let (wall, edges) = (wall(0.2, 0.6, BLUE), box_edges(Vec3::splat(-0.5), Vec3::splat(0.5), RED));
    let options = Options { facets: &wall, lines: &edges, ground: Some(-0.5), ..Options::default() };
    let image = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draw(&balls, &options))
    };
    let one = image(1);
    for threads in [2, 4] {
        assert!(image(threads) == one, "{threads} threads draw another picture");
    }
}

#[test]
fn a_picture_goes_to_a_file_or_says_where_it_could_not() {
    let image = draw(&cloud(50), &Options::default());
    let path = std::env::temp_dir().join(format!("jetsam-view-{}.png", std::process::id()));
    image.save_png(&path).unwrap();
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap())).read_info().unwrap();
    let mut rgba = vec![0; image.rgba.len()];
    reader.next_frame(&mut rgba).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert!(rgba == image.rgba);
    let error = image.save_png("no/such/folder/picture.png").unwrap_err().to_string();
    assert!(error.contains("no/such/folder/picture.png"), "{error}");
}
