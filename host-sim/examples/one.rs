use wheeleg_sim::bench::suite::{self, Factors, StartUp};
use wheeleg_sim::bench::{Kind, Metrics};
use wheeleg_sim::config::AxisConfig;
fn main() {
    let sheet = AxisConfig::load("bench-vq110u").unwrap().axis;
    for seed in 0..50u64 {
        let tr = suite::steps(&sheet, &Factors::NONE, Kind::Predictive, StartUp::Sheet, seed, &[0.14,0.04,0.14,0.12,0.14], 2.5).unwrap();
        for (n,t) in tr.iter().enumerate().skip(1) { let m = Metrics::of(t); if m.steady_error_mm.abs() > 0.2 { println!("seed {seed} move {n} err {:.3}", m.steady_error_mm);
            for (i,r) in t.rows.iter().enumerate() { if i>150 && i%25==0 && i<1400 || i%200==0 { println!("{i} ref {:.2} x {:.3} meas {:.3} v {:.2} on {:?} settled {} sw {}", r.reference_m*1e3, r.stroke_m*1e3, r.measured_m*1e3, r.velocity_m_s*1e3, r.on_us, r.settled, r.switches); } } return; } }
    }
}
