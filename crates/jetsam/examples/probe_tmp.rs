use jetsam::*;
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = Scene::builtin(&a[1], &a[3..]).unwrap_or_else(|| Scene::load(a[1].as_ref(), &a[3..])).map_err(|e| { eprintln!("{:?}", miette::Report::new(*e)); }).unwrap();
    let t = Instant::now();
    let mut w = match World::from_scene(&scene) { Ok(w) => w, Err(e) => { eprintln!("{:?}", miette::Report::new(*e)); return } };
    eprintln!("assemble {:?} particles {:?} warnings {:?}", t.elapsed(), w.state().particles.count, w.model().warnings);
    eprintln!("c0 {} vmax {} bounds {:?}", w.model().sound_speed, w.model().largest_speed, w.model().dt_bounds);
    let end: f64 = a[2].parse().unwrap();
    let frames = 20;
    for f in 0..frames {
        let t = Instant::now();
        let s0 = w.steps();
        w.advance(end * (f + 1) as f64 / frames as f64, |_, r| r.finite);
        let n = w.steps() - s0;
        let l = w.ledger();
        let ns = t.elapsed().as_nanos() as f64 / n as f64 / l.fluid as f64;
        eprintln!("t {:.3} n {} dt {:.2e} vmax {:.3} amax {:.1} err {:.4} {:.4} nb {:.1} lost {} left {} nonf {} resid {:.1e} KE {:.4} PE {:.4} ns/ps {:.0} F {:.3e}", w.time(), n, w.time()/w.steps() as f64, l.speed, l.acceleration, l.density_error_mean, l.density_error_max, l.neighbours, l.lost, l.left, l.nonfinite, w.momentum_residual(), l.kinetic, l.potential, ns, (l.total_force-l.external_force).length()/l.force_scale);
        if l.nonfinite > 0 { break }
    }
    for (s, d) in w.timers() { eprintln!("{:10} {:.1} ns/p/step", s.name(), d.as_nanos() as f64 / w.steps() as f64 / w.ledger().fluid as f64); }
    eprintln!("{:?}", w.bounds());
}
