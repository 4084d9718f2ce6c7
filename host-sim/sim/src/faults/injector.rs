//! The faults under way: their effect on the plant, on signals and on the line.
//!
//! A fault acts at one of three places. On the plant it is set once, when it begins, and undone when it ends
//! ([`Injector::inject`]). A fault on a signal between plant and board, or on the line, acts on every passage
//! as long as it lasts. All randomness comes from one random stream of the run's seed, which runs without
//! faults never draw from.

use rand_pcg::Pcg64Mcg;
use wheeleg_plant::cylinder::{CylinderModel, CylinderParams};
use wheeleg_plant::noise::Normal;
use wheeleg_plant::robot::{Plant, PlantState};
use wheeleg_plant::sensors::{SensorFault, signal_rng};
use wheeleg_plant::valve::ValveFault;
use wheeleg_protocol::Node;
use wheeleg_protocol::link::SlotTiming;

use super::interface::of_other;
use super::line::{LineErrors, record, rubbish};
use rand::RngExt;
use wheeleg_config::faults::{FaultKind, FaultSpec, FaultTarget};

/// Speed at which ground gives way \[m/s\].
const SINKS_M_S: f64 = 0.03;

/// The faults of one run.
#[derive(Debug)]
pub(crate) struct Injector {
    active: Vec<FaultSpec>,
    rng: Pcg64Mcg,
    line: LineErrors,
    /// Encoder count at the begin of an encoder fault, per wheel.
    encoder_at: [Option<i64>; 2],
    /// Simulated time at the begin of a clock fault, per board, ns.
    clock_from_ns: [u64; 8],
    /// Simulated time at which the ground begins to give way, ns.
    sinks_from_ns: u64,
    last_sync: Vec<u8>,
}

impl Injector {
    /// No fault yet.
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            active: Vec::new(),
            rng: signal_rng(seed, "faults"),
            line: LineErrors::default(),
            encoder_at: [None; 2],
            clock_from_ns: [0; 8],
            sinks_from_ns: 0,
            last_sync: Vec::new(),
        }
    }

    /// Begins a fault, or ends it if `begin` is false. Plant faults take effect here.
    pub(crate) fn inject(
        &mut self,
        fault: &FaultSpec,
        begin: bool,
        now_ns: u64,
        plant: &mut Plant,
        state: &mut PlantState,
    ) {
        if let (FaultKind::ClockDrift, FaultTarget::Board(node)) = (fault.kind, fault.target) {
            self.clock_from_ns[node.index()] = now_ns;
        }
        if begin && fault.kind == FaultKind::FootSinks {
            self.sinks_from_ns = now_ns;
        }
        if begin {
            self.active.push(*fault);
        } else {
            self.active.retain(|f| f != fault);
        }
        self.line = LineErrors {
            bit: self.value(FaultKind::BitErrors),
            lost: self.value(FaultKind::BytesLost),
            inserted: self.value(FaultKind::BytesInserted),
            delay_ns: (self.value(FaultKind::FramesDelayed) * 1e3) as u64,
        };
        on_sensors(fault, begin, plant, state);
        on_air(fault, begin, plant, state);
        on_ground(fault, begin, plant);
        self.sink(now_ns, plant);
        if let (FaultKind::EncoderLost | FaultKind::EncoderReversed, FaultTarget::Board(node)) =
            (fault.kind, fault.target)
            && let Some(wheel) = node.wheel()
        {
            self.encoder_at[wheel] = None;
        }
    }

    fn of(&self, kind: FaultKind) -> impl Iterator<Item = &FaultSpec> {
        self.active.iter().filter(move |f| f.kind == kind)
    }

    fn is(&self, kind: FaultKind) -> bool {
        self.of(kind).next().is_some()
    }

    fn affects(&self, kind: FaultKind, node: Node) -> bool {
        self.of(kind).any(|f| f.target == FaultTarget::Board(node))
    }

    /// The value of a fault of which only one is active at a time (`admission`); 0 without it.
    fn value(&self, kind: FaultKind) -> f64 {
        self.of(kind).next().map_or(0.0, |f| f.value)
    }

    /// Lowers the ground under the feet to its height at this time; to be called in every joint tick. The
    /// ground under the wheels stays.
    pub(crate) fn sink(&self, now_ns: u64, plant: &mut Plant) {
        let since_s = now_ns.saturating_sub(self.sinks_from_ns) as f64 * 1e-9;
        let gives_way_m = self.value(FaultKind::FootSinks).min(SINKS_M_S * since_s);
        let depth_m = self.value(FaultKind::FootLosesContact) + gives_way_m;
        plant.assembly.mechanics.touching.sink_under_feet(depth_m);
    }

    /// The bytes that the master puts on the line in place of `sync`; `None`: nothing.
    pub(crate) fn master_sends(&mut self, sync: &[u8]) -> Option<Vec<u8>> {
        if self.is(FaultKind::MasterSilent) {
            return None;
        }
        if self.is(FaultKind::MasterFrozen) && !self.last_sync.is_empty() {
            return Some(self.last_sync.clone());
        }
        self.last_sync.clear();
        self.last_sync.extend_from_slice(sync);
        Some(self.last_sync.clone())
    }

    /// Whether the master may use the line for requests.
    pub(crate) fn master_requests(&self) -> bool {
        !self.is(FaultKind::MasterSilent) && !self.is(FaultKind::MasterFrozen)
    }

    /// Whether layer 1 of the master is cut off.
    pub(crate) fn layer_one_stalls(&self) -> bool {
        self.is(FaultKind::LayerOneStall)
    }

    /// Commands per cycle of a user who floods the master.
    pub(crate) fn flood(&self) -> usize {
        self.value(FaultKind::CommandFlood) as usize
    }

    /// By how much the master's next cycle comes late (or early), ns.
    pub(crate) fn cycle_jitter_ns(&mut self) -> i64 {
        let largest = (self.value(FaultKind::CycleJitter) * 1e6) as i64;
        if largest == 0 {
            0
        } else {
            self.rng.random_range(-largest..=largest)
        }
    }

    /// The bytes that the board's driver puts on the line for a frame; `None`: nothing.
    pub(crate) fn board_sends(&mut self, node: Node, bytes: Vec<u8>) -> Option<Vec<u8>> {
        if self.affects(FaultKind::NodeSilent, node)
            || self.affects(FaultKind::BabbleUnguarded, node)
        {
            return None;
        }
        if self.affects(FaultKind::Babble, node) {
            // A byte more would end beyond the limit.
            let limit = SlotTiming::DEFAULT.driver_limit_us() / SlotTiming::DEFAULT.bytes_us(1);
            return Some(rubbish(limit as usize, &mut self.rng));
        }
        if self.affects(FaultKind::OtherInterface, node) {
            return Some(of_other(bytes));
        }
        Some(bytes)
    }

    /// Whether the guard of the board's driver cuts its transmissions off.
    pub(crate) fn cuts_off(&self, node: Node) -> bool {
        self.affects(FaultKind::Babble, node)
    }

    /// Bytes that a driver that is stuck on sends in the time of `bytes` bytes.
    pub(crate) fn babble(&mut self, node: Node, bytes: usize) -> Option<Vec<u8>> {
        let stuck = self.affects(FaultKind::BabbleUnguarded, node);
        stuck.then(|| rubbish(bytes, &mut self.rng))
    }

    /// The next frame of a stream that fills the line, at most `room` bytes long.
    pub(crate) fn stream(&self, room: usize) -> Option<Vec<u8>> {
        if self.is(FaultKind::BusFull) {
            record(room)
        } else {
            None
        }
    }

    /// A transmission after the errors of the line, and its delay, ns; unchanged on a line without faults.
    pub(crate) fn transmit(&mut self, bytes: Vec<u8>) -> (Vec<u8>, u64) {
        if self.line.is_none() {
            return (bytes, 0);
        }
        let received = self.line.corrupt(&bytes, &mut self.rng);
        (received, self.line.delay_ns(&mut self.rng))
    }

    /// Converter code as the board reads it.
    pub(crate) fn position_code(&mut self, joint: usize, code: u16, full_scale_m: f64) -> u16 {
        let node = Node::JOINTS[joint];
        let noise_mm: f64 = self
            .of(FaultKind::PotNoisy)
            .filter(|f| f.target == FaultTarget::Board(node))
            .map(|f| f.value)
            .sum();
        if noise_mm == 0.0 {
            return code;
        }
        let unit = Normal::default().sample(&mut self.rng);
        let jump = noise_mm * 1e-3 / full_scale_m * 65536.0 * unit;
        (f64::from(code) + jump).clamp(0.0, 65520.0) as u16
    }

    /// Foot switches as the board reads them: front, left, back, right.
    pub(crate) fn switches(&self, leg: usize, sound: [bool; 4]) -> [bool; 4] {
        let stuck = |kind, switch| {
            self.of(kind)
                .any(|f| f.target == FaultTarget::FootSwitch(leg, switch))
        };
        std::array::from_fn(|i| {
            (sound[i] || stuck(FaultKind::SwitchStuckOn, i)) && !stuck(FaultKind::SwitchStuckOff, i)
        })
    }

    /// Encoder edges as the board counts them.
    pub(crate) fn edges(&mut self, wheel: usize, edges: i64) -> i64 {
        let node = Node::WHEELS[wheel];
        let lost = self.affects(FaultKind::EncoderLost, node);
        if !lost && !self.affects(FaultKind::EncoderReversed, node) {
            return edges;
        }
        let at = *self.encoder_at[wheel].get_or_insert(edges);
        if lost { at } else { at - (edges - at) }
    }

    /// A board's own clock at simulated time `now_ns`, ns.
    pub(crate) fn clock_ns(&self, node: Node, now_ns: u64) -> u64 {
        let drift = self
            .of(FaultKind::ClockDrift)
            .filter(|f| f.target == FaultTarget::Board(node));
        // The drift begins with the fault; before it the clock was right.
        let since_ns = now_ns.saturating_sub(self.clock_from_ns[node.index()]);
        drift.fold(now_ns, |t, f| {
            t.saturating_add_signed((since_ns as f64 * f.value * 1e-6) as i64)
        })
    }

    /// How long a board's clock takes for `ahead_us` on it, ns.
    pub(crate) fn duration_ns(&self, node: Node, ahead_us: u32) -> u64 {
        let ahead_ns = u64::from(ahead_us) * 1_000;
        let drift = self
            .of(FaultKind::ClockDrift)
            .filter(|f| f.target == FaultTarget::Board(node));
        drift.fold(ahead_ns, |ns, f| {
            (ns as f64 / (1.0 + f.value * 1e-6)).round() as u64
        })
    }

    /// Whether the recorder can write.
    pub(crate) fn can_record(&self) -> bool {
        !self.is(FaultKind::DiskFull)
    }
}

fn on_sensors(fault: &FaultSpec, begin: bool, plant: &Plant, state: &mut PlantState) {
    let FaultTarget::Board(node) = fault.target else {
        return;
    };
    let Some(joint) = node.joint() else {
        return;
    };
    let defect = match fault.kind {
        FaultKind::PotOpen => SensorFault::Open,
        FaultKind::PotShort => SensorFault::Short,
        FaultKind::PotFrozen => SensorFault::Stuck {
            ratio: plant.position_ratio(state, joint),
        },
        _ => return,
    };
    state.adc[joint].fault = if begin { defect } else { SensorFault::None };
}

fn on_air(fault: &FaultSpec, begin: bool, plant: &mut Plant, state: &mut PlantState) {
    let supply = plant.params().supply;
    let ambient = plant.params().gas.ambient_pressure_pa;
    let core = &mut state.core;
    match (fault.kind, fault.target) {
        (
            FaultKind::ValveStuckOpen | FaultKind::ValveStuckShut,
            FaultTarget::Valve(joint, valve),
        ) => {
            let stuck = if fault.kind == FaultKind::ValveStuckOpen {
                ValveFault::StuckOpen
            } else {
                ValveFault::StuckShut
            };
            let cylinder = &mut core.cylinders[joint];
            cylinder.valves[valve].fault = if begin { stuck } else { ValveFault::None };
            cylinder.refresh();
        }
        (FaultKind::ValveSlow, FaultTarget::Valve(joint, valve)) => {
            rebuild(plant, joint, begin, |c| {
                c.timing_spread[valve] *= fault.value
            });
        }
        (FaultKind::ValveLeak, FaultTarget::Board(node)) if node.is_joint() => {
            rebuild(plant, node.index(), begin, |c| {
                c.piston_leak_m3_s_pa *= fault.value;
                c.rod_leak_m3_s_pa *= fault.value;
            });
        }
        (FaultKind::SupplySag, _) => {
            let sagged = ambient + fault.value * 1e5;
            core.supply.source_pressure_pa = if begin {
                sagged
            } else {
                supply.source_pressure_pa
            };
        }
        (FaultKind::SupplyLost, _) => {
            core.supply.source_pressure_pa = if begin {
                ambient
            } else {
                supply.source_pressure_pa
            };
        }
        (FaultKind::TubeBurst, _) => {
            core.supply.dump.fault = if begin {
                ValveFault::StuckOpen
            } else {
                ValveFault::None
            };
        }
        (FaultKind::LoadStep, FaultTarget::Board(node)) if node.is_joint() => {
            let force_n = if begin { fault.value } else { 0.0 };
            plant.assembly.mechanics.load_n[node.index()] = force_n;
        }
        _ => {}
    }
}

/// A cylinder with changed parameters, or the sound one again: one fault at a time.
///
/// The catalogue's ranges keep every changed parameter in the plant's own.
fn rebuild(plant: &mut Plant, joint: usize, begin: bool, change: impl FnOnce(&mut CylinderParams)) {
    let mut params = plant.params().cylinders[joint].clone();
    if begin {
        change(&mut params);
    }
    let gas = plant.params().gas;
    if let Ok(model) = CylinderModel::new(&params, &gas) {
        plant.assembly.cylinders[joint] = model;
    }
}

fn on_ground(fault: &FaultSpec, begin: bool, plant: &mut Plant) {
    let touching = &mut plant.assembly.mechanics.touching;
    if fault.kind == FaultKind::FootSlips {
        let mu = begin.then_some(fault.value);
        touching.limit_foot_friction(mu);
        touching.limit_wheel_friction(mu);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    /// An encoder counts from where its own fault began, whatever else affects its board.
    #[test]
    fn another_fault_of_the_board_leaves_a_faulty_encoder_where_it_stood() {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        let mut plant = Plant::new(&robot.plant).expect("a plant");
        let mut state = plant.initial_state(1).expect("a state");
        let mut injector = Injector::new(1);
        let mut inject = |injector: &mut Injector, text: &str, begin| {
            let fault = text.parse().expect(text);
            injector.inject(&fault, begin, 0, &mut plant, &mut state);
        };
        inject(&mut injector, "encoder-lost:wheel7@1s", true);
        assert_eq!(injector.edges(0, 100), 100);
        inject(&mut injector, "node-silent:wheel7@2s..3s", true);
        assert_eq!(injector.edges(0, 250), 100);
        inject(&mut injector, "encoder-lost:wheel7@1s", false);
        assert_eq!(injector.edges(0, 300), 300);
        inject(&mut injector, "encoder-reversed:wheel7@4s", true);
        assert_eq!(injector.edges(0, 400), 400);
        assert_eq!(injector.edges(0, 430), 370);
    }
}
