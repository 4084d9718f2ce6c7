//! The wheel image: everything but its panic handler.

use cortex_m_rt::entry;
use wheeleg_board::executive;
use wheeleg_board::g431::bridge::{Dump, Pulse, Sign};
use wheeleg_board::g431::encoder::WheelEncoder;
use wheeleg_board::g431::latch::Supply;
use wheeleg_board::g431::slot::Slot;
use wheeleg_board::g431::{self, board, bus, pac, start};
use wheeleg_node::hardware::{DumpPin, HBridge};
use wheeleg_node::parameters::WheelParameters;
use wheeleg_node::wheel::WheelNode;
use wheeleg_node::{ConfigError, NodeIdentity};
use wheeleg_units::Micros;

use pac::interrupt;

type Node = WheelNode<HBridge<Pulse, Sign>, WheelEncoder, Supply, DumpPin<Dump>>;

static NODE: Slot<Result<Node, ConfigError>> = Slot::new();

#[entry]
fn main() -> ! {
    let start = start::start();
    let Some(identity) = start.identity else {
        start.halt();
    };
    let (motor, encoder, supply, dump) = start.wheel_hardware();
    let Some(node) = make(identity, motor, encoder, supply, dump) else {
        start.halt();
    };
    node.started_by(start.cause);
    let mut board = start.wheel_board(Micros(node.tick_period_us()));
    executive::run(node, &mut board)
}

/// Makes the application in its place. Not inlined, so that its construction is off the stack when it runs.
#[inline(never)]
fn make(
    identity: NodeIdentity,
    motor: HBridge<Pulse, Sign>,
    encoder: WheelEncoder,
    supply: Supply,
    dump: Dump,
) -> Option<&'static mut Node> {
    let node = NODE.fill(|| {
        let parameters = g431::parameters::load(WheelParameters::default(), |held, id, raw| {
            held.with(id, raw, true)
        });
        WheelNode::from_store(identity, parameters, motor, encoder, supply, DumpPin(dump))
    });
    node?.as_mut().ok()
}

#[interrupt]
fn TIM2() {
    board::on_wheel_timer();
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
wheeleg_board::image_record!(Wheel);
