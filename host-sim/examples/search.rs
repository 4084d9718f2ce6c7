use rayon::prelude::*;
use wheeleg_sim::bench::suite::{self, Factors, StartUp};
use wheeleg_sim::bench::{Kind, Metrics, design, optimal};
use wheeleg_sim::compare::{Figures, Move, Scene, Variation};
use wheeleg_sim::config::AxisConfig;
use wheeleg_units::{PositionMm,Duty};
const TARGETS: [f64; 5] = [0.14, 0.04, 0.14, 0.12, 0.14];
fn main() {
    let full = std::env::args().nth(1).as_deref() == Some("full");
    let base0: u64 = std::env::var("SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(0);
    let n_comb: u64 = std::env::args().nth(2).and_then(|s| s.parse().ok()).unwrap_or(200);
    let sheet = AxisConfig::load("bench-vq110u").expect("ok").axis;
    let run = |f: &Factors, st, seed, t: &[f64]| -> Result<Vec<Metrics>, String> {
        let tr = suite::steps(&sheet, f, Kind::Predictive, st, seed, t, 2.5).map_err(|e| e.to_string())?;
        if tr.iter().any(|t| !t.faults.is_empty() || !t.drove) { return Err("fault".into()); }
        Ok(tr.iter().map(Metrics::of).collect())
    };
    // nominal
    let nom: Vec<_> = (base0*50..base0*50+if full {50} else {16}).into_par_iter().map(|s| run(&Factors::NONE, StartUp::Sheet, s, &TARGETS)).collect();
    let (mut times, mut over, mut err, mut lc, mut faults) = (vec![], 0f64, 0f64, 0, 0); let mut wide=0;
    let mut t20=vec![];
    for r in &nom { match r { Ok(all) => { for m in &all[1..] { err = err.max(m.steady_error_mm.abs()); wide += (m.steady_error_mm.abs() > 0.19) as u32; lc += m.limit_cycle() as u32; }
        for m in &all[1..3] { over = over.max(m.overshoot_mm); times.push(m.settle_s.unwrap_or(9.0)); }
        for m in &all[3..] { t20.push(m.settle_s.unwrap_or(9.0)); } } Err(_) => faults += 1 } }
    times.sort_by(f64::total_cmp); t20.sort_by(f64::total_cmp);
    println!("nominal settle {:.3} worst {:.3} t20 {:.3} over {:.2} err {:.3} lc {} faults {} wide {wide}", times[times.len()/2], times[times.len()-1], t20[t20.len()/2], over, err, lc, faults);
    let sc: Vec<f64> = (0..10).into_par_iter().map(|seed| { let s = Scene::new("bench-vq110u", &sheet, Variation::Nominal, seed).unwrap(); let p = s.play(Kind::Predictive, Move::SCurve).unwrap().unwrap(); Figures::of(Move::SCurve, &p, None).worst_mm.unwrap_or(99.0) }).collect();
    println!("scurve worst {:.2}", sc.iter().cloned().fold(0.0, f64::max));
    // one factor
    let b = Factors::NONE; let mut list = vec![];
    for l in [-0.8,-0.4,0.4,0.8] { list.push(Factors{load_share:l,..b}); }
    for m in [1.0,3.0,8.0] { list.push(Factors{mass_kg:Some(m),..b}); }
    for p in [4.0,5.0,7.0] { list.push(Factors{supply_pa:Some(p*1e5),..b}); }
    for f in [0.5,2.0] { list.push(Factors{friction:f,..b}); }
    for d in [0.5,2.0] { list.push(Factors{valve_delay:d,..b}); }
    let jobs: Vec<(Factors,u64)> = list.iter().flat_map(|f| (0..3).map(move |s| (*f,s+base0*3))).collect();
    let res: Vec<_> = jobs.par_iter().map(|(f,s)| run(f, StartUp::Identified, *s, &TARGETS)).collect();
    let (mut over, mut err, mut lc, mut faults, mut bad) = (0f64,0f64,0,0,0);
    for (r,(f,s)) in res.iter().zip(&jobs) { match r { Ok(all) => for m in &all[1..] { over=over.max(m.overshoot_mm); err=err.max(m.steady_error_mm.abs()); lc+=m.limit_cycle() as u32; if m.overshoot_mm>3.0||m.steady_error_mm.abs()>0.5||m.limit_cycle() { bad+=1; if full {println!("   one {f:?} {s}: over {:.2} err {:.2} lc {}", m.overshoot_mm,m.steady_error_mm,m.limit_cycle());} } }, Err(_) => faults+=1 } }
    println!("one-factor over {over:.2} err {err:.3} lc {lc} faults {faults} bad {bad}");
    let res: Vec<_> = (base0*1000..base0*1000+n_comb).into_par_iter().map(|s| (s, run(&Factors::random(&sheet, s), StartUp::Identified, s, &TARGETS[..3]))).collect();
    let (mut miss, mut o, mut e, mut faults) = (0,0f64,0f64,0);
    for (s,r) in &res { match r { Ok(all) => { let mut bad=false; for m in &all[1..] { o=o.max(m.overshoot_mm); e=e.max(m.steady_error_mm.abs()); bad |= m.overshoot_mm>6.0||m.steady_error_mm.abs()>0.5||m.limit_cycle(); } if bad {miss+=1; if full {println!("   comb {s} {:?}", all[1..].iter().map(|m|(m.overshoot_mm,m.steady_error_mm,m.limit_cycle())).collect::<Vec<_>>());}} }, Err(_) => {miss+=1; faults+=1} } }
    println!("combos missed {miss} of {n_comb} over {o:.2} err {e:.3} faults {faults}");
    for (name,count) in [("small-12x50",60u64),("long-16x400",30),("heavy-40x250",60)] {
        let sh = AxisConfig::load(name).unwrap().axis;
        let c = base0*1000;
        let missed: usize = (c..c+count).into_par_iter().map(|n| { let s = Scene::new(name,&sh,Variation::Combination(n),1).unwrap(); let p = s.play(Kind::Predictive, Move::Step100).unwrap().unwrap(); let f = Figures::of(Move::Step100,&p,None);
            let ok = f.steady_error_mm.is_some_and(|mm| mm.abs()<=0.5)&&f.overshoot_mm.is_some_and(|mm| mm<=6.0)&&f.limit_cycle==Some(false)&&(f.faults.as_str(),f.stopped)==("",Some(false)); !ok as usize }).sum();
        let s=sh.cylinder.stroke_m; let t=[0.76*s,0.2*s,0.76*s,0.65*s,0.76*s];
        let mut w=(0f64,0f64,0f64,0);
        for seed in 0..3 { let tr=suite::steps(&sh,&Factors::NONE,Kind::Predictive,StartUp::Sheet,seed,&t,3.0).unwrap(); for t in &tr[1..] { let m=Metrics::of(t); w.0=w.0.max(m.overshoot_mm); w.1=w.1.max(m.steady_error_mm.abs()); w.2=w.2.max(m.settle_s.unwrap_or(9.0)); w.3+=m.limit_cycle() as u32 + (!t.faults.is_empty()) as u32; } }
        println!("{name} missed {missed} of {count}; nominal over {:.2} err {:.2} settle {:.2} bad {}", w.0,w.1,w.2,w.3);
    }
    // contact
    let mut c=(0f64,0f64,0);
    for mv in [Move::Contact, Move::ContactHelped] { for seed in 0..5 { let s = Scene::new("bench-vq110u", &sheet, Variation::Nominal, seed).unwrap(); let p = s.play(Kind::Predictive, mv).unwrap().unwrap(); let f=Figures::of(mv,&p,None); c.0=c.0.max(f.contact_error_mm.unwrap_or(99.0)); c.1=c.1.max(f.recovery_s.unwrap_or(9.0)); c.2+=(f.limit_cycle!=Some(false)) as u32; } }
    println!("contact err {:.2} recovery {:.2} lc {}", c.0,c.1,c.2);
    // home
    let axis = wheeleg_plant::testing::wheeleg_2003_axis();
    let resting = design(&axis, Kind::Predictive); let mut pushing=resting.clone(); pushing.gains.stroke_max=PositionMm::from_int(185); let _=Duty::ZERO;
    let home=|d,n| Metrics::of(&suite::home_retract(&axis,d,1,n).unwrap());
    let (a,b2,c2,d)=(home(&resting,0.4),home(&pushing,0.4),home(&pushing,0.0),home(&pushing,0.2));
    println!("home rest {:?} {:.2}; push {:?} {:.2}; none {:?}; 0.2: {:?}", a.start_delay_s,a.early_mm,b2.start_delay_s,b2.early_mm,c2.start_delay_s,d.start_delay_s);
    // wandering
    let told = wheeleg_sim::bench::axis_data(&axis);
    let other = wheeleg_control::axis::AxisData::default();
    for (n,data) in [("right",told),("wrong",other)] {
        let mut dsg=design(&axis,Kind::Predictive); dsg.gains.axis=data;
        let r: Vec<(usize,usize)> = (0..40u32).into_par_iter().map(|seed| { let mut rig=suite::Rig::new(&axis,&dsg,seed as u64).unwrap(); let (mut late,mut rl)=(0,0); for k in 0..6 { let share=(f64::from(6*seed+k)*0.618_033_988_75).fract(); let t=rig.step(0.01+0.16*share,2.5).unwrap(); if k>0 { let at=((t.motion.start_s()+1.0)*1e3).round() as usize; late+=((t.rows[at].stroke_m-t.motion.to_m()).abs()>1e-3) as usize; let m=Metrics::of(&t); rl+=(m.settle_s.is_none()||m.limit_cycle()) as usize; } } (late,rl) }).collect();
        println!("wander {n}: late {} restless {}", r.iter().map(|x|x.0).sum::<usize>(), r.iter().map(|x|x.1).sum::<usize>());
    }
    if full {
        let mut rig=suite::Rig::new(&sheet,&design(&sheet,Kind::Predictive),1).unwrap(); for to in [0.14,0.04] { rig.step(to,2.0).unwrap(); }
        let bench=rig.bench(); let bound=optimal::fastest(bench.axis(),&bench.state,0.14,1,1500).unwrap();
        let ours=Metrics::of(&rig.step(0.14,1.5).unwrap()).settle_s.unwrap_or(9.0); println!("ratio {:.3} ({ours:.3} / {:.3})", ours/bound.settle_s, bound.settle_s);
    }
}
