use jetsam::*; use jetsam::state::Kind;
fn main(){ let a: Vec<String> = std::env::args().collect(); let sc = Scene::load(a[1].as_ref(), &a[3..]).unwrap(); let mut w = World::from_scene(&sc).unwrap_or_else(|e| panic!("{e}")); let end:f64=a[2].parse().unwrap();
println!("{:?} {:?}", w.state().particles.count, w.model().warnings);
for f in 1..=15 { w.advance(end*f as f64/15.0, |_,_|true); let b=&w.state().bodies.body[0]; let p=&w.state().particles; 
 let mut top:Vec<f32>=p.segment(Kind::Fluid).filter(|&i| {let x=p.record[i].x; (x[0]-b.x.x as f32).hypot(x[1]-b.x.y as f32)>0.2}).map(|i|p.record[i].x[2]).collect(); top.sort_by(|a,b|b.total_cmp(a)); let lvl=top[..200].iter().sum::<f32>()/200.0+0.01;
 println!("t {:.2} x {:.4} {:.4} z {:.4} v {:.4} F/W {:.4} level {:.4} draft/D {:.4} om {:.3} res {:.1e} lost {}", w.time(), b.x.x,b.x.y,b.x.z, b.v.z, 1.0+b.force.z/(b.mass*9.81), lvl, (lvl as f64-(b.x.z-0.1))/0.2, b.omega.length(), w.momentum_residual(), w.ledger().lost); } }
