//! `jetsam bench --pictures`: how long the GPU's renderer takes for a picture, by the device's own clock.
//!
//! A scene runs for some steps; then its picture is drawn again and again in each style. The median counts.

use crate::run::set_threads;
use crate::{Outcome, args};
use jetsam::Scene;

#[cfg(feature = "gpu")]
pub use with_gpu::pictures;

/// The scene that is measured unless another is named: 97,336 particles of fluid.
const USUAL: &str = "bench-dam";

/// Scenes to measure, size after size.
fn scenes(args: &args::Bench) -> miette::Result<(String, Vec<Scene>)> {
    set_threads(args.threads)?;
    let name = args.scene.clone().unwrap_or(USUAL.into());
    let scene = Scene::open(&name, &args.set).map_err(|e| *e)?;
    let sizes = match args.particles.as_slice() {
        [] => vec![scene],
        wanted => wanted.iter().map(|&n| crate::bench::sized(&scene, n)).collect::<miette::Result<_>>()?,
    };
    Ok((name, sizes))
}

/// Says that there is nothing to measure.
#[cfg(not(feature = "gpu"))]
pub fn pictures(args: &args::Bench) -> miette::Result<Outcome> {
    scenes(args)?;
    Err(jetsam::gpu::GpuError::NotBuilt.into())
}

#[cfg(feature = "gpu")]
mod with_gpu {
    use super::{Outcome, Scene, args, scenes};
    use crate::terminal::{print, print_json};
    use jetsam::World;
    use jetsam::gpu::Gpu;
    use jetsam_view::gpu::{Studio, Times};
    use jetsam_view::style::{Fluid, Lines, Style};
    use jetsam_view::{Curves, Frame, Show};
    use serde::Serialize;
    use std::time::Instant;

    /// Pictures of a style, after a few to warm up.
    const PICTURES: usize = 15;
    const WARM: usize = 3;

    const HEADER: &str =
        "scene            particles  picture    style           ms  wall ms\n                 milliseconds by pass";

    /// What is said of a style.
    #[derive(Serialize)]
    struct Case {
        scene: String,
        backend: &'static str,
        device: String,
        /// Particles of fluid and of bodies, and agents.
        particles: usize,
        size: [usize; 2],
        style: &'static str,
        /// From the beginning of the first pass to the end of the last, by the device's clock.
        ms: f64,
        /// The same with the way there and back, by the host's: commands recorded, lines made, the end waited for.
        wall_ms: f64,
        /// By pass.
        pass_ms: Vec<(&'static str, f64)>,
    }

    /// Measures every style.
    pub fn pictures(args: &args::Bench) -> miette::Result<Outcome> {
        let (name, sizes) = scenes(args)?;
        let gpu = Gpu::open(false)?;
        if !args.json {
            print(&format!("{}\n{HEADER}", gpu.info.name));
        }
        for scene in sizes {
            measure(&name, &scene, args, &gpu)?;
        }
        Ok(Outcome::Fine)
    }

    fn measure(name: &str, scene: &Scene, args: &args::Bench, gpu: &Gpu) -> miette::Result<()> {
        let assembly = scene.assemble().map_err(|e| *e)?;
        let (mut world, _) = World::choose_with(args.backend.into(), Some(gpu), assembly)?;
        world.run_steps(args.steps);
        let [width, height] = args.size;
        let show = Show::new(scene, &world, width as f32 / height as f32);
        let mut studio = Studio::new(gpu.clone(), show, width as u32, height as u32)?;
        let mut frame = Frame::default();
        frame.take(&world);
        let particles = frame.record.len() + frame.agents.len();
        let fluids = Fluid::ALL.into_iter().filter(|(fluid, _)| *fluid != Fluid::Hidden);
        let styles = fluids.map(|(fluid, name)| (name, Style { fluid, ..Style::default() }));
        let lines = Style { lines: Lines::Streamlines, ..Style::default() };
        for (style_name, style) in styles.chain([("streamlines", lines)]) {
            if style.at_home() {
                frame.take(&world)
            } else {
                frame.borrow(&world)
            }
            let (times, wall_ms) = median(&mut studio, &frame, &style)?;
            let case = Case {
                scene: name.into(),
                backend: world.backend(),
                device: gpu.info.name.clone(),
                particles,
                size: args.size,
                style: style_name,
                ms: times.ms,
                wall_ms,
                pass_ms: times.passes,
            };
            if args.json { print_json(&case) } else { print(&line(&case)) }
        }
        Ok(())
    }

    /// The picture that takes the median time, and the median time of the host.
    fn median(studio: &mut Studio, frame: &Frame, style: &Style) -> miette::Result<(Times, f64)> {
        let (mut all, mut walls) = (Vec::new(), Vec::new());
        for _ in 0..WARM + PICTURES {
            let start = Instant::now();
            let lines = Curves::default().lines(studio.show(), frame, style);
            let times = studio.times(frame, style, &lines)?.ok_or_else(|| {
                miette::miette!(
                    help = "use another driver or device",
                    "the device has no clock: it writes no timestamps"
                )
            })?;
            walls.push(1e3 * start.elapsed().as_secs_f64());
            all.push(times);
        }
        all.drain(..WARM);
        walls.drain(..WARM);
        all.sort_by(|a, b| a.ms.total_cmp(&b.ms));
        walls.sort_by(f64::total_cmp);
        Ok((all.swap_remove(PICTURES / 2), walls[PICTURES / 2]))
    }

    fn line(c: &Case) -> String {
        let passes: Vec<String> = c.pass_ms.iter().map(|(pass, ms)| format!("{pass} {ms:.2}")).collect();
        let [width, height] = c.size;
        format!(
            "{:16} {:9}  {:9}  {:11} {:6.2}  {:7.2}\n{:17}{}",
            c.scene,
            c.particles,
            format!("{width}x{height}"),
            c.style,
            c.ms,
            c.wall_ms,
            "",
            passes.join(", ")
        )
    }
}
