//! The faults that are under way.

use wheeleg_config::RobotConfig;
use wheeleg_config::faults::FaultSpec;
use wheeleg_remote_host::Nodes;

use super::admission;
use crate::SimError;

/// Faults under way, each with its end as time since power-up, ns.
#[derive(Debug, Default)]
pub(crate) struct ActiveFaults(Vec<(FaultSpec, u64)>);

impl ActiveFaults {
    /// A fault begins at `now_ns`.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if it cannot begin: nothing has changed then.
    pub(crate) fn begin(
        &mut self,
        fault: &FaultSpec,
        now_ns: u64,
        robot: &RobotConfig,
        nodes: &Nodes,
    ) -> Result<(), SimError> {
        self.0.retain(|(_, over_ns)| *over_ns > now_ns);
        let active: Vec<FaultSpec> = self.0.iter().map(|(fault, _)| *fault).collect();
        admission::check_now(fault, &active, robot, nodes)?;
        // Infinity saturates: such a fault lasts until it is ended.
        let lasts_ns = (fault.kind.lasts_s(fault.value) * 1e9).round() as u64;
        self.0.push((*fault, now_ns.saturating_add(lasts_ns)));
        Ok(())
    }

    /// A fault ends.
    ///
    /// # Errors
    /// [`SimError::Simulation`] if it is not under way.
    pub(crate) fn end(&mut self, fault: &FaultSpec) -> Result<(), SimError> {
        let Some(at) = self.0.iter().position(|(active, _)| active == fault) else {
            // It was given without a time.
            let fault = fault.untimed();
            return Err(SimError::simulation(
                format!("the fault `{fault}` cannot be ended: it is not active"),
                "end a fault that has begun",
            ));
        };
        self.0.swap_remove(at);
        Ok(())
    }
}
