//! The account of the energy, if one is kept.

use super::World;
use crate::energy::{EnergyBalance, EnergyMeter};
use crate::{SimError, unphysical};

impl World {
    pub(crate) fn account_for_energy(&mut self) -> Result<(), SimError> {
        let meter = EnergyMeter::new(&self.plant, &self.state);
        let meter = meter.map_err(|e| unphysical::failed(self.now_ns, &e, &self.outputs))?;
        self.energy = Some(meter);
        Ok(())
    }

    pub(crate) fn energy(&self) -> Result<Option<EnergyBalance>, SimError> {
        let meter = self.energy.as_ref();
        let balance = meter.map(|meter| meter.balance(&self.plant, &self.state));
        let failed = |e| unphysical::failed(self.now_ns, &e, &self.outputs);
        balance.transpose().map_err(failed)
    }
}
