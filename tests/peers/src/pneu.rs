//! The pneumatic loop of the C reference: its own model, and this project's whole plant.

use std::hint::black_box;

use wheeleg_plant::axis::{Axis, AxisParams};
use wheeleg_plant::chamber::GasModel;
use wheeleg_plant::reference::{Looped, Reference, bench_axis, command, three_state_loop};
use wheeleg_plant::testing::vq110u_axis;

use crate::measure::{put_realtime, scale, timed};

/// Steps of a tick: 100 µs.
const STEPS: u32 = 10;

/// Ticks of 1 ms; the reference does as many.
fn ticks() -> usize {
    (10_000.0 * scale()) as usize
}

pub(crate) fn run() {
    let reference = Reference::new();
    let error = reference.open_loop_error(STEPS);
    let mut looped = None;
    let took = timed(|| {
        looped = Some(reference.closed_loop(black_box(ticks()), black_box(STEPS)));
    });
    let check = looped.map_or_else(String::new, |l| {
        format!("ol_err={} {}", scientific(error), text(&l))
    });
    put_realtime("pneu", "_rk4_100us", took, ticks() as f64 * 1e-3, &check);
    plant("pneu_plain", &bench_axis());
    plant("pneu_full", &full());
}

/// The plant at the reference's parameters plus the effects that the reference lacks: heat exchange, tubes,
/// leaks.
fn full() -> AxisParams {
    let mut axis = bench_axis();
    let real = vq110u_axis().cylinder;
    let c = &mut axis.cylinder;
    c.line_volume_m3 = real.line_volume_m3;
    c.line_flow = real.line_flow;
    c.line_delay_s = real.line_delay_s;
    c.piston_leak_m3_s_pa = real.piston_leak_m3_s_pa;
    c.rod_leak_m3_s_pa = real.rod_leak_m3_s_pa;
    c.gas_model = GasModel::Thermal {
        heat_transfer_w_m2_k: 60.0,
    };
    axis
}

/// The whole plant, one cylinder, 100 µs, under the same loop.
fn plant(case: &str, params: &AxisParams) {
    let Ok(axis) = Axis::new(params) else {
        return;
    };
    let mut state = axis.initial_state(1);
    let start = (state.core.motion.stroke_m, state.core.motion.velocity_m_s);
    let mut looped = None;
    let took = timed(|| {
        looped = three_state_loop(black_box(ticks()), start, |decision| {
            let on = command(decision).map(|open| if open > 0.5 { 1000 } else { 0 });
            axis.tick(&mut state, on)?;
            let m = &state.core.motion;
            Ok::<_, wheeleg_plant::PlantError>((m.stroke_m, m.velocity_m_s))
        })
        .ok();
    });
    let check = looped.map_or_else(|| "BAD".to_owned(), |l| text(&l));
    put_realtime(case, "", took, ticks() as f64 * 1e-3, &check);
}

fn text(looped: &Looped) -> String {
    format!("rms={:.3}mm sw={}", looped.rms_mm, looped.switches)
}

/// As C prints it: two digits, an exponent of two.
fn scientific(value: f64) -> String {
    let text = format!("{value:.1e}");
    match text.split_once("e-") {
        Some((digits, exponent)) => format!("{digits}e-{exponent:0>2}"),
        None => text,
    }
}
