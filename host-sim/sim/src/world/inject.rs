//! Faults that stop boards or programs: their effect at the instant at which they begin.

use wheeleg_protocol::{Node, ResetCause};
use wheeleg_remote_link as link;

use super::World;
use crate::SimError;
use crate::client::Client;
use crate::down::Down;
use wheeleg_config::faults::{FaultKind, FaultSpec, FaultTarget};
use wheeleg_config::timing::{JOINT_TICK_NS, WATCHDOG_NS};

impl World {
    /// Applies a fault to the power of a board or to a program.
    ///
    /// # Errors
    /// [`SimError`] if a board outside refuses it.
    pub(super) fn inject_power(&mut self, fault: &FaultSpec, begin: bool) -> Result<(), SimError> {
        let after_ns = |ms: f64| self.now_ns.saturating_add((ms * 1e6) as u64);
        match fault.kind {
            FaultKind::MasterReset if begin => {
                self.master_alive = false;
                self.master_back_ns = Some(after_ns(fault.value));
            }
            FaultKind::ClientReset if begin => self.client = Client::connect(&mut self.master),
            _ => {}
        }
        let FaultTarget::Board(node) = fault.target else {
            return Ok(());
        };
        let down = match fault.kind {
            FaultKind::NodeOff if begin => Down::Off { until_ns: u64::MAX },
            FaultKind::NodeOff => Down::Off { until_ns: 0 },
            FaultKind::NodeReset if begin => Down::Off {
                until_ns: self.now_ns.saturating_add(JOINT_TICK_NS),
            },
            FaultKind::BrownOut if begin => Down::Off {
                until_ns: after_ns(fault.value),
            },
            FaultKind::NodeHang if begin => Down::Hung {
                until_ns: self.now_ns.saturating_add(WATCHDOG_NS),
            },
            FaultKind::ProcessorFault if begin => return self.fault_processor(node),
            _ => return Ok(()),
        };
        if let Down::Off { .. } = down {
            let now_ns = self.now_ns;
            self.board_mut(node).memory.power_fails(now_ns);
        }
        self.board_mut(node).down = down;
        let Some(remote) = &mut self.remote else {
            return Ok(());
        };
        match down {
            Down::Hung { .. } => Ok(remote.hook(node, link::Hook::StopProcessor)?),
            _ => {
                remote.set_power(node, link::Power::BrownOut);
                // At once: it may be back before the board next runs.
                self.run_remote(&[(node, None)])
            }
        }
    }

    /// The processor of a board faults: its handler turns the outputs off and resets it.
    fn fault_processor(&mut self, node: Node) -> Result<(), SimError> {
        let now_ns = self.now_ns;
        self.board_mut(node).memory.power_fails(now_ns);
        match &mut self.remote {
            Some(remote) if remote.has(node) => {
                // Until its own reset.
                remote.hook(node, link::Hook::FaultProcessor)?;
                self.board_mut(node).down = Down::Hung {
                    until_ns: now_ns.saturating_add(JOINT_TICK_NS),
                };
                self.run_remote(&[(node, None)])
            }
            // The run that this one repeats says how long its start takes.
            _ if self.replayed.is_replayed(node) => {
                self.board_mut(node).down = Down::Off { until_ns: u64::MAX };
                Ok(())
            }
            _ => {
                self.begin_start(node, ResetCause::ProcessorFault);
                Ok(())
            }
        }
    }
}
