use wheeleg_sim::bench::Kind;
use wheeleg_sim::compare::{Move, Scene, Variation};
use wheeleg_sim::config::AxisConfig;
fn main() {
    let name = std::env::args().nth(1).unwrap_or("bench-vq110u".into());
    let mv = match std::env::args().nth(2).as_deref() { Some("step") => Move::Step100, _ => Move::SCurve };
    let v = match std::env::args().nth(3) { Some(n) => Variation::Combination(n.parse().unwrap()), None => Variation::Nominal };
    let sheet = AxisConfig::load(&name).unwrap().axis;
    let s = Scene::new(&name, &sheet, v, 0).unwrap();
    let p = s.play(Kind::Predictive, mv).unwrap().unwrap();
    for t in &p.measured { println!("---");
    for (i, r) in t.rows.iter().enumerate().step_by(10) {
        println!("{i} ref {:.2} x {:.2} v {:.1} pa {:.0} pb {:.0} on {:?} settled {}", r.reference_m*1e3, r.stroke_m*1e3, r.velocity_m_s*1e3, r.pressure_pa[0]/1e3, r.pressure_pa[1]/1e3, r.on_us, r.settled);
    } }
}
