use jetsam::*;
fn main(){
 let mut args=std::env::args().skip(1);
 let path=args.next().unwrap();
 let sets:Vec<String>=args.collect();
 let text=std::fs::read_to_string(&path).unwrap();
 let scene=Scene::parse(jetsam::scene::Source{text:text.into(),..Default::default()},&[]).unwrap_or_else(|e|panic!("{e}"));
 let scene=scene.with(&sets).unwrap_or_else(|e|panic!("{e}"));
 let mut w=World::from_scene(&scene).unwrap_or_else(|e|panic!("{e}"));
 let b=w.state().bodies.body.iter().position(|b|b.name=="disc").unwrap();
 let mass=w.state().bodies.body[b].mass; let s:f64=std::env::var("S").map_or(0.5,|s|s.parse().unwrap());
 let weight=mass/s*9.81;
 let end:f64=std::env::var("END").map_or(0.011,|s|s.parse().unwrap());
 let tau=0.05/44.3;
 let (mut k,mut last)=(0.0,(0.0,0.0));
 println!("mass {mass} F0/(rho g V) {:.4}",w.state().bodies.body[b].force_fluid.z/weight);
 let n=10; 
 for i in 1..=n { let t=end*i as f64/n as f64; w.advance(t,|_,r|r.trouble.is_none()); let bd=&w.state().bodies.body[b];
  println!("t/tau {:.2} a/g {:.4} v/g/t {:.4} F/(rho g V) {:.4} fx {:.4}", t/tau, (bd.v.z/9.81-last.1)/(t-last.0), bd.v.z/9.81/t, bd.force_fluid.z/weight, bd.force_fluid.x/weight); last=(t,bd.v.z/9.81); k+=1.0; }
 let _=k;
}
