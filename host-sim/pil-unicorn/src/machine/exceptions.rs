//! Exception entry and return.

use unicorn_engine::RegisterARM as R;

use super::{Machine, THUMB};

impl Machine {
    /// Takes the most urgent exception that is not masked.
    pub(super) fn take_exception(&mut self) -> Result<bool, String> {
        let state = self.uc.get_data_mut();
        if state.stop_processor {
            return Ok(false);
        }
        state.nvic.lines = state.soc.lines();
        if !state.nvic.wakes() {
            return Ok(false);
        }
        let primask = self.get(R::PRIMASK)? & 1 != 0;
        let basepri = self.get(R::BASEPRI)? as u8;
        // A sleeping processor wakes even if the exception is masked.
        if self.uc.get_data().nvic.next(false, 0).is_some() {
            self.asleep = false;
        }
        let Some(n) = self.uc.get_data().nvic.next(primask, basepri) else {
            return Ok(false);
        };
        self.enter(n)?;
        Ok(true)
    }

    /// Stacks the basic frame and goes to the handler (ARMv7-M B1.5.6).
    pub(super) fn enter(&mut self, n: usize) -> Result<(), String> {
        let sp = self.get(R::SP)?;
        let xpsr = self.get(R::XPSR)?;
        let frame = (sp - 0x20) & !7;
        let aligned = (sp & 4) << 7;
        let mut words = [0; 8];
        let saved = [R::R0, R::R1, R::R2, R::R3, R::R12, R::LR];
        for (word, register) in words.iter_mut().zip(saved) {
            *word = self.get(register)?;
        }
        words[6] = self.get(R::PC)? & !1;
        words[7] = xpsr & !(1 << 9) | aligned;
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        self.set_memory(frame, &bytes)
            .map_err(|_| format!("the stack has left RAM: {frame:#010x}"))?;
        self.set(R::SP, frame)?;
        let nested = self.uc.get_data().nvic.in_handler();
        self.set(R::LR, if nested { 0xFFFF_FFF1 } else { 0xFFFF_FFF9 })?;
        let vector = self.uc.get_data().nvic.vector_base() + 4 * n as u32;
        let mut handler = [0; 4];
        self.memory(vector, &mut handler)?;
        self.set(R::IPSR, n as u32)?;
        // An IT block may have been interrupted; the handler is not part of it.
        self.set(R::EPSR, THUMB as u32)?;
        self.mode_changed(xpsr)?;
        self.set(R::PC, u32::from_le_bytes(handler) | 1)?;
        let state = self.uc.get_data_mut();
        state.nvic.enter(n);
        state.woken_by(n);
        Ok(())
    }

    /// Tells the engine that thread or handler mode has begun, which decides whether a jump to 0xFFFF_FFFx is
    /// a return. The engine checks this when flags are written.
    fn mode_changed(&mut self, flags: u32) -> Result<(), String> {
        self.set(R::APSR_NZCV, flags)
    }

    /// Unstacks the frame (ARMv7-M B1.5.8).
    pub(super) fn leave(&mut self) -> Result<(), String> {
        let sp = self.get(R::SP)?;
        let mut bytes = [0; 32];
        self.memory(sp, &mut bytes)?;
        let word = |i: usize| {
            let b = &bytes[4 * i..4 * i + 4];
            u32::from_le_bytes([b[0], b[1], b[2], b[3]])
        };
        let saved = [R::R0, R::R1, R::R2, R::R3, R::R12, R::LR];
        for (i, register) in saved.into_iter().enumerate() {
            self.set(register, word(i))?;
        }
        self.set(R::SP, sp + 0x20 + (word(7) >> 9 & 1) * 4)?;
        self.set(R::XPSR, word(7) & !(1 << 9))?;
        self.mode_changed(word(7))?;
        self.set(R::PC, word(6) | 1)?;
        let left = self.uc.get_data_mut().nvic.leave();
        left.map(drop)
            .ok_or_else(|| "exception return outside of a handler".to_owned())
    }
}
