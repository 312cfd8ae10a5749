use jetsam::*; use jetsam::state::Kind;
fn main(){
 let a: Vec<String> = std::env::args().collect();
 let sc = Scene::load(a[1].as_ref(), &a[3..]).unwrap();
 let mut w = World::from_scene(&sc).unwrap_or_else(|e| panic!("{e}"));
 w.advance(a[2].parse().unwrap(), |_,_| true);
fastest(&w);
 let p=&w.state().particles; let m=w.model(); let b=1000.0*m.sound_speed*m.sound_speed/7.0; let dx=m.spacing;
 let top = (p.segment(Kind::Fluid).map(|i| p.record[i].x[2]).fold(0.0,f32::max) as f64/dx).round() as usize+1;
 let h=1.0f64.min(sc.fluid[0].shape_h());
 for l in 0..top { let v:Vec<usize>=p.segment(Kind::Fluid).filter(|&i| (p.record[i].x[2] as f64/dx) as usize==l).collect(); if v.is_empty(){continue}
  let n=v.len() as f64; let z=v.iter().map(|&i|p.record[i].x[2] as f64).sum::<f64>()/n; let d=v.iter().map(|&i|p.density[i] as f64).sum::<f64>()/n;
  let mid:Vec<&usize>=v.iter().filter(|&&i| (p.record[i].x[0]-0.5*m.grid.max.x as f32).abs()<0.3*m.grid.max.x as f32).collect();
  let dm=mid.iter().map(|&&i|p.density[i] as f64).sum::<f64>()/mid.len() as f64;
  let pr=b*(d.powi(7)-1.0); let prm=b*(dm.powi(7)-1.0);
  println!("layer {l} n {n} z/dx {:.3} D {d:.4} p {pr:.0} mid {prm:.0} ref {:.0} ratio {:.3} ratio mid {:.3}", z/dx, 9810.0*(h-z), pr/(9810.0*(h-z)), prm/(9810.0*(h-z))); }
 for k in 0..3 { let s=p.segment(Kind::Static); let v:Vec<usize>=s.clone().filter(|&i| ((p.record[i].x[2] as f64/dx+0.5)+k as f64).abs()<0.3 && (p.record[i].x[0]-0.5*m.grid.max.x as f32).abs()<0.3*m.grid.max.x as f32 ).collect(); if v.is_empty(){continue}; println!("wall layer {k}: share {:.0} V {:.3}", v.iter().map(|&i|p.record[i].share as f64).sum::<f64>()/v.len() as f64, v.iter().map(|&i|p.record[i].volume as f64).sum::<f64>()/v.len() as f64/ dx.powi(m.dimensions as i32)); }
}
trait Sh{fn shape_h(&self)->f64;} impl Sh for scene::Fluid{fn shape_h(&self)->f64{ if let scene::Shape::Box(r)=&self.shape {r.max[2]} else {1.0}}}
pub fn fastest(w:&World){ let p=&w.state().particles; let mut v:Vec<(f32,[f32;3],f32)>=p.segment(Kind::Fluid).map(|i|{let r=&p.record[i]; ((r.v[0]*r.v[0]+r.v[1]*r.v[1]+r.v[2]*r.v[2]).sqrt(), r.x, p.density[i])}).collect(); v.sort_by(|a,b|b.0.total_cmp(&a.0)); let rms=(v.iter().map(|a|(a.0*a.0) as f64).sum::<f64>()/v.len() as f64).sqrt(); println!("rms {rms:.5}"); for a in v.iter().take(6){println!("{:?}",a)} }
