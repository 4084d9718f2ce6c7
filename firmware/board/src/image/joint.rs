//! The joint image: everything but its panic handler.

use cortex_m_rt::entry;
use wheeleg_board::executive;
use wheeleg_board::g431::latch::{Feet, Potentiometer};
use wheeleg_board::g431::slot::Slot;
use wheeleg_board::g431::valves::Valves;
use wheeleg_board::g431::{self, adc, board, bus, pac, start};
use wheeleg_node::joint::JointNode;
use wheeleg_node::parameters::JointParameters;
use wheeleg_node::{ConfigError, NodeIdentity};

use pac::interrupt;

type Node = JointNode<Valves, Potentiometer, Feet>;

static NODE: Slot<Result<Node, ConfigError>> = Slot::new();

#[entry]
fn main() -> ! {
    let start = start::start();
    let Some(identity) = start.identity else {
        start.halt();
    };
    let (valves, potentiometer, feet) = start.joint_hardware();
    let Some(node) = make(identity, valves, potentiometer, feet) else {
        start.halt();
    };
    node.started_by(start.cause);
    let mut board = start.joint_board();
    executive::run(node, &mut board)
}

/// Makes the application in its place. Not inlined, so that its construction is off the stack when it runs.
#[inline(never)]
fn make(
    identity: NodeIdentity,
    valves: Valves,
    potentiometer: Potentiometer,
    feet: Feet,
) -> Option<&'static mut Node> {
    let node = NODE.fill(|| {
        let parameters = g431::parameters::load(JointParameters::default(), |held, id, raw| {
            held.with(id, raw, true)
        });
        JointNode::from_store(identity, parameters, valves, potentiometer, feet)
    });
    node?.as_mut().ok()
}

#[interrupt]
fn ADC1_2() {
    adc::on_conversion();
}

#[interrupt]
fn TIM2() {
    board::on_joint_timer();
}

#[interrupt]
fn USART1() {
    bus::on_usart();
}

#[interrupt]
fn DMA1_CHANNEL1() {
    bus::on_ring();
}

wheeleg_board::exception_handlers!();
wheeleg_board::image_record!(Joint);
