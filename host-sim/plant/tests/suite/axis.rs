//! Behaviour of one cylinder on the bench: conservation, order, sticking, determinism.

use wheeleg_plant::PlantError;
use wheeleg_plant::axis::{Axis, AxisParams, AxisState};
use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::testing::{DM3_S_BAR, wheeleg_2003_axis};
use wheeleg_plant::valve::ValveFault;

const SHUT: [u16; 4] = [0; 4];
const EXTEND: [u16; 4] = [1000, 0, 0, 1000];
const RETRACT: [u16; 4] = [0, 1000, 1000, 0];

fn run(axis: &Axis, state: &mut AxisState, on: [u16; 4], ms: u32) {
    for _ in 0..ms {
        axis.tick(state, on).unwrap();
    }
}

/// A lively program: strokes, short pulses, rests.
fn lively(axis: &Axis, state: &mut AxisState) {
    for k in 0..12u16 {
        run(axis, state, EXTEND, 300);
        run(axis, state, [0, 0, 0, 1000], 40);
        for i in 0..10u16 {
            run(axis, state, [1000, 0, 0, 1000], 6);
            axis.tick(state, [100 * i, 0, 0, 37 * k]).unwrap();
            run(axis, state, SHUT, 13);
        }
        run(axis, state, RETRACT, 250);
        run(axis, state, SHUT, 100);
    }
}

fn mid_stroke(a_pa: f64, b_pa: f64) -> AxisParams {
    let mut p = wheeleg_2003_axis();
    p.initial_stroke_m = 0.09;
    p.cylinder.initial_pressure_a_pa = a_pa;
    p.cylinder.initial_pressure_b_pa = b_pa;
    p
}

/// Pressure of B that balances A against the atmosphere on the rod.
fn balancing(p: &AxisParams, a_pa: f64) -> f64 {
    let (bore2, rod2) = (p.cylinder.bore_m.powi(2), p.cylinder.rod_m.powi(2));
    (a_pa * bore2 - p.gas.ambient_pressure_pa * rod2) / (bore2 - rod2)
}

#[test]
fn mass_and_energy_balance_close() {
    for gas_model in [
        GasModel::Polytropic { exponent: 1.2 },
        GasModel::Thermal {
            heat_transfer_w_m2_k: 40.0,
        },
    ] {
        let mut p = wheeleg_2003_axis();
        p.cylinder.gas_model = gas_model;
        let axis = Axis::new(&p).unwrap();
        let start = axis.initial_state(1);
        let mut state = start.clone();
        lively(&axis, &mut state);
        let used = state.core.cylinders[0].supply_mass_kg;
        assert!(used > 1e-3, "air moved: {used}");
        let before = axis.assembly.mass_balance_kg(&start.core);
        let after = axis.assembly.mass_balance_kg(&state.core);
        assert!(
            ((after - before) / before).abs() < 1e-12,
            "{before} {after}"
        );
        let residual = axis.assembly.energy_residual_j(&start.core, &state.core);
        let c = &state.core.cylinders[0];
        let through = c.chamber_a.ledger.work_j.abs() + c.chamber_a.pv_j;
        assert!(residual / through < 1e-10, "{residual} of {through}");
        // The mass ledger of a chamber is its own witness.
        let c0 = &start.core.cylinders[0];
        let gained = c.chamber_a.mass_kg - c0.chamber_a.mass_kg;
        assert!((gained - c.chamber_a.ledger.mass_in_kg).abs() < 1e-15);
    }
}

#[test]
fn gas_work_equals_what_the_piston_received() {
    // Independent of the ledger: kinetic energy, friction and load must add up to
    // the pressures' work. Frictionless, no stop reached, constant load.
    let mut p = mid_stroke(6e5, 2e5);
    p.cylinder.friction.coulomb_n = 0.0;
    p.cylinder.friction.static_n = 0.0;
    p.cylinder.friction.viscous_n_s_m = 0.0;
    p.load_n = -60.0;
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    run(&axis, &mut s, SHUT, 60);
    let m = s.core.motion;
    let c = &s.core.cylinders[0];
    let x = m.stroke_m - p.initial_stroke_m;
    assert!(x.abs() > 0.005 && m.stroke_m < 0.17, "{x}");
    let rod_area = std::f64::consts::FRAC_PI_4 * p.cylinder.rod_m.powi(2);
    let work = c.chamber_a.ledger.work_j + c.chamber_b.ledger.work_j
        - p.gas.ambient_pressure_pa * rod_area * x
        + p.load_n * x;
    let kinetic = 0.5 * p.moving_mass_kg * m.velocity_m_s.powi(2);
    let scale = c.chamber_a.ledger.work_j.abs();
    assert!(((kinetic - work) / scale).abs() < 1e-4, "{kinetic} {work}");
}

#[test]
fn second_order_in_the_step() {
    let at_end = |step_ns: u64| {
        let mut p = mid_stroke(4.5e5, 3.5e5);
        p.step_ns = step_ns;
        p.cylinder.gas_model = GasModel::Thermal {
            heat_transfer_w_m2_k: 40.0,
        };
        let axis = Axis::new(&p).unwrap();
        let mut s = axis.initial_state(0);
        // Already sliding, so that no stick-slip change falls inside.
        s.core.motion.velocity_m_s = 0.15;
        s.core.cylinders[0].bristle_m = 1.0e-4;
        run(&axis, &mut s, EXTEND, 150);
        let o = axis.outputs(&s);
        assert!(o.stroke_m < 0.17 && o.velocity_m_s > 0.05, "{o:?}");
        [
            o.stroke_m,
            o.velocity_m_s,
            o.pressure_pa[0],
            o.pressure_pa[1],
        ]
    };
    let exact = at_end(3_125);
    let (coarse, fine) = (at_end(100_000), at_end(50_000));
    for i in 0..4 {
        let (e1, e2) = ((coarse[i] - exact[i]).abs(), (fine[i] - exact[i]).abs());
        let order = (e1 / e2).log2();
        println!("variable {i}: order {order:.2}, {e1:.2e} {e2:.2e}");
        assert!(
            order > 1.5 && order < 2.6,
            "variable {i}: order {order}, {e1} {e2}"
        );
        assert!(e1 / exact[i].abs() < 1e-4, "variable {i}: {e1}");
    }
}

#[test]
fn edges_are_exact_not_rounded_to_the_grid() {
    // The mass of one pulse depends on its length to the microsecond: open time = pulse - t_on + t_off, for
    // any grid.
    let filled = |us: u16, step_ns: u64| {
        let mut p = mid_stroke(2e5, 2e5);
        p.cylinder.b_blocked();
        p.step_ns = step_ns;
        let axis = Axis::new(&p).unwrap();
        let mut s = axis.initial_state(0);
        run(&axis, &mut s, [1000, 0, 0, 0], 7);
        axis.tick(&mut s, [us, 0, 0, 0]).unwrap();
        run(&axis, &mut s, SHUT, 30);
        s.core.cylinders[0].supply_mass_kg
    };
    let (a, b, c) = (
        filled(501, 100_000),
        filled(502, 100_000),
        filled(503, 100_000),
    );
    let per_us = b - a;
    // Choked: C rho0 p for one microsecond.
    let p = wheeleg_2003_axis();
    let expected = p.cylinder.fill_valve.flow.conductance_m3_s_pa * 1.185 * 701_325.0 * 1e-6;
    assert!(
        (per_us / expected - 1.0).abs() < 0.02,
        "{per_us} {expected}"
    );
    assert!(((c - b) / per_us - 1.0).abs() < 1e-3);
    let other_grid = filled(501, 70_000);
    assert!((other_grid / a - 1.0).abs() < 1e-6);
}

/// Small helpers on parameters, to keep the experiments readable.
trait Tweak {
    fn b_blocked(&mut self);
}
impl Tweak for wheeleg_plant::cylinder::CylinderParams {
    /// No leaks, so that nothing but the valves moves gas.
    fn b_blocked(&mut self) {
        self.piston_leak_m3_s_pa = 0.0;
        self.rod_leak_m3_s_pa = 0.0;
    }
}

#[test]
fn nothing_moves_without_a_pressure_difference() {
    let mut p = mid_stroke(101_325.0, 101_325.0);
    p.supply.initial_pressure_pa = 101_325.0;
    p.supply.source_pressure_pa = 101_325.0;
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    run(&axis, &mut s, [1000; 4], 2000);
    let o = axis.outputs(&s);
    assert!((o.stroke_m - 0.09).abs() < 1e-9, "{}", o.stroke_m);
    assert!(o.velocity_m_s.abs() < 1e-9);
    assert!((o.pressure_pa[0] - 101_325.0).abs() < 0.1);
    assert!(s.core.cylinders[0].supply_mass_kg.abs() < 1e-12);
}

#[test]
fn holds_a_load_for_a_minute_with_all_valves_shut() {
    // Balanced pressures, a load of two thirds of break-away, no leaks: pressures only
    // stiffen the hold. The piston may give the bristle's deflection, no more.
    let mut p = mid_stroke(4e5, 0.0);
    p.cylinder.initial_pressure_b_pa = balancing(&p, 4e5);
    p.cylinder.b_blocked();
    p.load_n = -10.0;
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    run(&axis, &mut s, SHUT, 1000);
    let early = s.core.motion.stroke_m;
    run(&axis, &mut s, SHUT, 59_000);
    let late = s.core.motion.stroke_m;
    let give = p.cylinder.friction.static_n / p.cylinder.friction.bristle_stiffness_n_m;
    assert!((late - 0.09).abs() < 3.0 * give, "{}", late - 0.09);
    assert!((late - early).abs() < 1e-8, "creep {}", late - early);
    // Twice break-away does move it, against the gas spring only.
    s.core.motion.load_n = -30.0;
    run(&axis, &mut s, SHUT, 2000);
    assert!(late - s.core.motion.stroke_m > 5e-4);
}

#[test]
fn leaks_bring_trapped_pressures_down_and_balance_mass() {
    let p = mid_stroke(6e5, 6e5);
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    let start = axis.assembly.mass_balance_kg(&s.core);
    run(&axis, &mut s, SHUT, 1000); // to rest
    let early = axis.outputs(&s).pressure_pa;
    run(&axis, &mut s, SHUT, 20_000);
    let late = axis.outputs(&s).pressure_pa;
    // Rod leak of 2e-14 m³/(s Pa) at 6 bar: some kPa in 20 s, no more.
    let fallen = early[1] - late[1];
    assert!(fallen > 500.0 && fallen < 20_000.0, "{early:?} {late:?}");
    assert!(s.core.cylinders[0].vented_mass_kg > 0.0);
    let end = axis.assembly.mass_balance_kg(&s.core);
    assert!(((end - start) / start).abs() < 1e-12);
}

#[test]
fn one_short_pulse_does_nothing_a_longer_one_does() {
    let mut p = mid_stroke(3e5, 3e5);
    p.cylinder.b_blocked();
    let axis = Axis::new(&p).unwrap();
    let pulse = |full_ms: u32, us: u16| {
        let mut s = axis.initial_state(0);
        run(&axis, &mut s, [1000, 0, 0, 0], full_ms);
        axis.tick(&mut s, [us, 0, 0, 0]).unwrap();
        run(&axis, &mut s, SHUT, 30);
        (
            s.core.cylinders[0].supply_mass_kg,
            axis.outputs(&s).valve_switches[0],
        )
    };
    // t_on is 5 ms.
    assert_eq!(pulse(4, 999), (0.0, 0));
    let (mass, switches) = pulse(5, 1);
    assert!(mass > 0.0 && switches == 2);
}

#[test]
fn a_chamber_fills_between_isothermal_and_adiabatic() {
    // Pressure after a fixed charge: n = 1 lowest, n = γ highest, heat exchange between.
    let pressure = |gas_model| {
        let mut p = mid_stroke(101_325.0, 101_325.0);
        p.cylinder.b_blocked();
        p.initial_stroke_m = 0.18;
        p.cylinder.gas_model = gas_model;
        let axis = Axis::new(&p).unwrap();
        let mut s = axis.initial_state(0);
        run(&axis, &mut s, [1000, 0, 0, 0], 150);
        let o = axis.outputs(&s);
        (o.pressure_pa[0], o.temperature_k[0])
    };
    let (isothermal, _) = pressure(GasModel::Polytropic { exponent: 1.0 });
    let (thermal, warm) = pressure(GasModel::Thermal {
        heat_transfer_w_m2_k: 60.0,
    });
    let (adiabatic, hot) = pressure(GasModel::Thermal {
        heat_transfer_w_m2_k: 0.0,
    });
    let (same, _) = pressure(GasModel::Polytropic { exponent: 1.4 });
    assert!(
        isothermal < thermal && thermal < adiabatic,
        "{isothermal} {thermal} {adiabatic}"
    );
    assert!(
        hot > warm && warm > 293.15 && hot < 293.15 * 1.4,
        "{hot} {warm}"
    );
    // Filled from a reservoir at T0 without loss, only the choked inflow counts:
    // both adiabatic forms agree while the flow is choked.
    assert!((same / adiabatic - 1.0).abs() < 1e-6, "{same} {adiabatic}");
}

#[test]
fn opened_to_the_atmosphere_the_pressure_falls_monotonically_to_it() {
    for gas_model in [
        GasModel::Polytropic { exponent: 1.2 },
        GasModel::Thermal {
            heat_transfer_w_m2_k: 40.0,
        },
    ] {
        let mut p = mid_stroke(7e5, 101_325.0);
        p.initial_stroke_m = 0.18;
        p.cylinder.b_blocked();
        p.cylinder.gas_model = gas_model;
        let axis = Axis::new(&p).unwrap();
        let mut s = axis.initial_state(0);
        // The bottom of a vented chamber: pushed against its stop so that it stays.
        s.core.motion.load_n = 100.0;
        run(&axis, &mut s, SHUT, 50);
        let mut last = axis.outputs(&s).pressure_pa[0];
        for _ in 0..3000 {
            axis.tick(&mut s, [0, 1000, 0, 0]).unwrap();
            let p_a = axis.outputs(&s).pressure_pa[0];
            // The stop's rebound may squeeze it by a little; warming gas at the end too.
            assert!(p_a <= last + 30.0, "{p_a} after {last}");
            last = p_a;
        }
        assert!((last - 101_325.0).abs() < 200.0, "{last}");
    }
}

#[test]
fn a_choked_vent_decays_with_the_textbook_time_constant() {
    // p = p0 exp(-t/τ), τ = V/(n C p_ref), p_ref = rho0 R T0: hardware note, section 6.
    let mut p = mid_stroke(7e5, 101_325.0);
    p.initial_stroke_m = 0.18;
    p.load_n = 300.0;
    p.cylinder.b_blocked();
    p.cylinder.line_flow = None;
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    run(&axis, &mut s, SHUT, 200); // the load settles into the stop
    let p0 = axis.outputs(&s).pressure_pa[0];
    let lead_ms = 8; // t_on + line delay = 7.9 ms
    run(&axis, &mut s, [0, 1000, 0, 0], lead_ms + 50);
    let measured = axis.outputs(&s).pressure_pa[0];
    let c = &p.cylinder;
    let volume = c.dead_volume_a_m3
        + c.line_volume_m3
        + std::f64::consts::FRAC_PI_4 * c.bore_m.powi(2) * s.core.motion.stroke_m;
    let p_ref = 1.185 * 287.05 * 293.15;
    let tau = volume / (1.2 * c.vent_valve.flow.conductance_m3_s_pa * p_ref);
    let expected = p0 * (-(0.050_1) / tau).exp();
    assert!(
        (measured / expected - 1.0).abs() < 3e-4,
        "{measured} {expected}"
    );
}

#[test]
fn supply_sags_under_demand_recovers_and_dumps() {
    let mut p = wheeleg_2003_axis();
    p.supply.reservoir_m3 = 1e-4;
    p.supply.regulator_flow.conductance_m3_s_pa = 0.02 * DM3_S_BAR;
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    let supply = |s: &AxisState| axis.assembly.supply.pressure_pa(s.core.supply.mass_kg);
    let full = supply(&s);
    run(&axis, &mut s, EXTEND, 1500);
    let sagged = supply(&s);
    assert!(sagged < full - 5e4, "{sagged}");
    run(&axis, &mut s, SHUT, 20_000);
    let droop = p.supply.droop_pa;
    assert!(
        supply(&s) > p.supply.set_pressure_pa - droop,
        "{}",
        supply(&s)
    );
    assert!(supply(&s) <= p.supply.set_pressure_pa * (1.0 + 1e-9));
    assert!(s.core.supply.pressure_switch());
    let now = s.core.time_ns;
    let timing_on = 20_000_000;
    s.core.supply.dump.command(
        true,
        now,
        &wheeleg_plant::valve::ValveTiming {
            t_on_ns: timing_on,
            t_off_ns: timing_on,
            line_delay_ns: 0,
        },
    );
    run(&axis, &mut s, SHUT, 19);
    assert!(s.core.supply.pressure_switch() && !s.core.supply.dump.is_open());
    run(&axis, &mut s, SHUT, 300);
    assert!(supply(&s) < 103_000.0, "{}", supply(&s));
    assert!(!s.core.supply.pressure_switch());
    assert!(s.core.supply.dumped_mass_kg > 0.0);
    // Held cylinders keep their gas when the supply is dumped.
    assert!(axis.outputs(&s).pressure_pa[0] > 3e5);
}

#[test]
fn pressure_switch_has_hysteresis() {
    let mut p = wheeleg_2003_axis();
    p.supply.source_switch = None;
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    s.core.supply.source_pressure_pa = 101_325.0; // supply lost
    let mut set = |pa: f64| {
        let per_kg = p.supply.initial_pressure_pa / axis.initial_state(0).core.supply.mass_kg;
        s.core.supply.mass_kg = pa / per_kg;
        axis.tick(&mut s, SHUT).unwrap();
        s.core.supply.pressure_switch()
    };
    let middle = 0.5 * (p.supply.switch.on_pa + p.supply.switch.off_pa);
    assert!(set(p.supply.switch.on_pa + 100.0));
    assert!(set(middle));
    assert!(!set(p.supply.switch.off_pa - 100.0));
    assert!(!set(middle));
    assert!(set(p.supply.switch.on_pa + 100.0));
}

/// The contact at the source is in series: it opens at once when the source is lost or sags,
/// while the reservoir is still full, and closes again with hysteresis.
#[test]
fn the_contact_at_the_source_sees_a_lost_source_before_the_reservoir_is_used_up() {
    let p = wheeleg_2003_axis();
    let source = p.supply.source_switch.expect("fitted");
    let alone = {
        let mut p = wheeleg_2003_axis();
        p.supply.source_switch = None;
        p
    };
    for (p, seen) in [(p, true), (alone, false)] {
        let axis = Axis::new(&p).unwrap();
        let mut s = axis.initial_state(0);
        let mut with_source = |pa: f64| {
            s.core.supply.source_pressure_pa = pa;
            axis.tick(&mut s, SHUT).unwrap();
            s.core.supply.pressure_switch()
        };
        let middle = 0.5 * (source.on_pa + source.off_pa);
        assert!(with_source(source.on_pa + 100.0));
        assert!(with_source(middle));
        assert_eq!(with_source(source.off_pa - 100.0), !seen);
        assert_eq!(with_source(middle), !seen);
        assert!(with_source(source.on_pa + 100.0));
        assert_eq!(with_source(101_325.0), !seen);
        assert!(axis.assembly.supply.pressure_pa(s.core.supply.mass_kg) > 7e5);
    }
}

#[test]
fn pushes_against_the_stop_with_the_full_pressure_force_and_stays_there() {
    let p = wheeleg_2003_axis();
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    run(&axis, &mut s, EXTEND, 4000);
    let o = axis.outputs(&s);
    let area = std::f64::consts::FRAC_PI_4 * 4e-4;
    let expected = 600_000.0 * area;
    assert!(
        (o.forces.pressure_n / expected - 1.0).abs() < 0.02,
        "{:?}",
        o.forces
    );
    let held = o.forces.net_n().abs();
    assert!(held < 1e-3, "{held}");
    assert!(o.stroke_m > 0.18 && o.stroke_m < 0.1805, "{}", o.stroke_m);
    assert!(o.velocity_m_s.abs() < 1e-6);
}

#[test]
fn a_full_lift_takes_a_second_and_the_delay_follows_from_the_pressure_swap() {
    // The fit of the conductance (weight of rod and foot, 0.8 kg) and what it predicts.
    let lift = |b_at_supply: bool| {
        let mut p = wheeleg_2003_axis();
        p.moving_mass_kg = 0.8;
        p.load_n = 0.8 * 9.81;
        p.initial_stroke_m = 0.18;
        let supply = p.supply.initial_pressure_pa;
        p.cylinder.initial_pressure_a_pa = if b_at_supply { supply } else { 101_325.0 };
        let axis = Axis::new(&p).unwrap();
        let mut s = axis.initial_state(0);
        run(&axis, &mut s, SHUT, 200);
        let (x0, mut delay, mut peak) = (s.core.motion.stroke_m, 0, 0.0_f64);
        for ms in 1..3000 {
            axis.tick(&mut s, RETRACT).unwrap();
            peak = peak.max(-s.core.motion.velocity_m_s);
            let moved = x0 - s.core.motion.stroke_m;
            if moved >= 1e-3 && delay == 0 {
                delay = ms;
            }
            if moved >= 0.99 * 0.18 {
                return (ms, delay, peak);
            }
        }
        panic!("never arrived");
    };
    let (time, delay, peak) = lift(true);
    assert!((980..=1040).contains(&time), "{time} ms");
    assert!((200..=300).contains(&delay), "{delay} ms");
    assert!(peak < 0.4, "{peak}");
    let (_, swapped, _) = lift(false);
    assert!(
        swapped < 80,
        "vented counter-chamber starts soon: {swapped} ms"
    );
}

#[test]
fn stuck_valves_do_what_they_say() {
    let p = mid_stroke(3e5, 3e5);
    let axis = Axis::new(&p).unwrap();
    let mut s = axis.initial_state(0);
    s.core.cylinders[0].valves[0].fault = ValveFault::StuckShut;
    run(&axis, &mut s, [1000, 0, 0, 0], 100);
    assert_eq!(s.core.cylinders[0].supply_mass_kg, 0.0);
    s.core.cylinders[0].valves[0].fault = ValveFault::StuckOpen;
    run(&axis, &mut s, SHUT, 100);
    assert!(s.core.cylinders[0].supply_mass_kg > 1e-6);
}

#[test]
fn save_and_restore_goes_on_bit_for_bit() {
    let axis = Axis::new(&wheeleg_2003_axis()).unwrap();
    let mut state = axis.initial_state(3);
    lively(&axis, &mut state);
    run(&axis, &mut state, EXTEND, 3); // valves under way, edges in the lines
    let _ = axis.read_position(&mut state);
    let saved = serde_json::to_string(&state).unwrap();
    let mut restored: AxisState = serde_json::from_str(&saved).unwrap();
    assert_eq!(axis.state_hash(&state), axis.state_hash(&restored));
    for s in [&mut state, &mut restored] {
        lively(&axis, s);
        let _ = axis.read_position(s);
    }
    assert_eq!(axis.state_hash(&state), axis.state_hash(&restored));
    assert_eq!(state, restored);
}

#[test]
fn seed_decides_the_readings_and_nothing_else() {
    let axis = Axis::new(&wheeleg_2003_axis()).unwrap();
    let hash = |seed| {
        let mut s = axis.initial_state(seed);
        let mut readings = Vec::new();
        for _ in 0..100 {
            axis.tick(&mut s, EXTEND).unwrap();
            readings.push(axis.read_position(&mut s));
        }
        (axis.state_hash(&s), readings, s.core)
    };
    let (a, b, c) = (hash(5), hash(5), hash(6));
    assert_eq!(a, b);
    assert_ne!(a.0, c.0);
    assert_ne!(a.1, c.1);
    assert_eq!(a.2, c.2);
}

#[test]
fn a_broken_state_is_named_never_silent() {
    let axis = Axis::new(&wheeleg_2003_axis()).unwrap();
    let mut s = axis.initial_state(0);
    s.core.motion.velocity_m_s = f64::NAN;
    let error = axis.tick(&mut s, SHUT).unwrap_err();
    assert!(matches!(error, PlantError::NonFinite { .. }), "{error}");
    let mut s = axis.initial_state(0);
    s.core.cylinders[0].chamber_b.pv_j = 1e6;
    let error = axis.tick(&mut s, SHUT).unwrap_err();
    assert!(matches!(error, PlantError::OutOfBounds { .. }), "{error}");
    let mut p = wheeleg_2003_axis();
    p.cylinder.friction.static_n = 5.0; // below Coulomb
    let error = Axis::new(&p).unwrap_err().to_string();
    assert!(error.contains("friction.static_n"), "{error}");
    let mut s = axis.initial_state(0);
    let error = axis.tick(&mut s, [0, 1001, 0, 0]).unwrap_err();
    assert!(
        matches!(error, PlantError::Input { index: 1, .. }),
        "{error}"
    );
}
