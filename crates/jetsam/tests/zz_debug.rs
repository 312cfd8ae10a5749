mod common;
use common::world;
#[test]
fn debug() {
    let g = 9.81;
    let (gx, gz) = (g * 0.5, -g * 30f64.to_radians().cos());
    for mu in [0.2, 0.6] {
    let mut w = world(&format!(
        "[world]\ngravity = [{gx}, 0, {gz}]\n[domain]\nmin = [-0.2, -0.2, 0]\nmax = [1.0, 0.2, 0.4]\n\
         walls = [\"open\", \"open\", \"solid\"]\n[resolution]\nspacing = 0.02\n\
         [[rigid]]\nshape = {{ box = {{ min = [-0.06, -0.06, -0.04], max = [0.06, 0.06, 0.04] }} }}\ndensity = 1000\nposition = [0, 0, 0.04]\nfriction = {mu}\n\
         restitution = 0.1\n"
    ));
    let (k, eta) = w.model().contact_pair(0, 1);
    println!("k {k} eta {eta} shared {} u {} ft {:?} slots {}", w.model().contacts[0].shared_by, w.model().largest_speed, w.model().friction_pair(0,1,k,1.0,1.0), w.state().bodies.rigid_slots);
    for n in 0..2000 {
        let r = w.step(1.0);
        if n < 20 || n % 200 < 3 { let b = &w.state().bodies.body[0];
        println!("{n} dt {:.2e} z {:.3e} v {:.4e} {:.4e} om {:.3e} n {} fc {:.4} {:.4} slip {:?}", r.dt, b.x.z-0.04, b.v.x, b.v.z, b.omega.y, b.contacts, b.force_contact.x/(b.mass*-gz), b.force_contact.z/(b.mass*-gz), w.state().bodies.slip[0]); }
    }}
}
