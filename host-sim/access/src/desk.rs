//! Who of the clients is in control, or has asked for it. The master knows one operator; which
//! client that is, stands here. Who is in control may hand it over: then one other client alone may
//! take it, for a short time.
//!
//! A lease ends at the master, in its time, which stands while the simulation is paused. A holder who
//! is gone, or whose control was revoked, is at its end here at once: it commands nothing, and keeps
//! nothing from others but the lease, until the master has ended it.

use std::time::{Duration, Instant};

/// Number of a client.
pub type ClientId = u64;

/// Who holds the control, or has asked for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holder {
    /// Which client.
    pub client: ClientId,
    /// Its name.
    pub name: String,
    /// Its session.
    pub session: String,
    /// Master time at which the master granted it, µs.
    pub granted_us: Option<u64>,
    /// Why it commands nothing any more, although its lease is not over.
    pub ended: Option<Ended>,
}

/// Why a holder is no longer in control, before the master has ended its lease.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// Its connection has ended.
    Gone,
    /// Its control was revoked.
    Revoked,
}

impl Ended {
    /// Its name in the state.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gone => "gone",
            Self::Revoked => "revoked",
        }
    }
}

/// Why a client may not give a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Denied {
    /// It wants the control, which another holds.
    Held,
    /// It is not in control.
    NotInControl,
    /// Its control was revoked, and its lease is not over.
    Revoked,
}

/// Time in which the control is kept for one client; then it is free.
pub const KEPT: Duration = Duration::from_secs(2);

/// For whom the control is kept.
#[derive(Debug)]
pub struct Heir {
    /// Which client.
    pub client: ClientId,
    /// Its name.
    pub name: String,
    /// Its session.
    pub session: String,
    /// None while somebody's lease is not over.
    until: Option<Instant>,
}

impl Heir {
    fn new(client: ClientId, (name, session): (&str, &str), until: Option<Instant>) -> Self {
        Self {
            client,
            name: name.to_owned(),
            session: session.to_owned(),
            until,
        }
    }
}

/// The place of the one who drives.
#[derive(Debug, Default)]
pub struct Desk {
    holder: Option<Holder>,
    heir: Option<Heir>,
}

impl Desk {
    /// Who holds the control, or has asked for it.
    #[must_use]
    pub fn holder(&self) -> Option<&Holder> {
        self.holder.as_ref()
    }

    /// Name of the client that has the control, or for which it is kept.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        let holder = self.holder.as_ref().map(|holder| &*holder.name);
        holder.or_else(|| Some(&*self.heir.as_ref()?.name))
    }

    /// For whom the control is kept: for this client alone it is free.
    #[must_use]
    pub fn heir(&self) -> Option<&Heir> {
        self.heir.as_ref().filter(|_| self.holder.is_none())
    }

    /// Whether this client holds the control, or has asked for it, and is not at its end.
    #[must_use]
    pub fn holds(&self, client: ClientId) -> bool {
        let holder = self.holder.as_ref();
        holder.is_some_and(|h| h.client == client && h.ended.is_none())
    }

    /// Whether this client may command the simulation: nobody else is in control of the robot.
    #[must_use]
    pub fn may_command_host(&self, client: ClientId) -> bool {
        let holder = self.holder.as_ref();
        holder.is_none_or(|h| h.client == client || h.ended.is_some())
    }

    /// A client wants to give a command, or to take the control: then it has asked for it.
    ///
    /// # Errors
    /// [`Denied`] if another holds it, if it is kept for another, or if the client does not hold it, or
    /// no longer.
    pub fn ask(
        &mut self,
        client: ClientId,
        (name, session): (&str, &str),
        takes: bool,
    ) -> Result<(), Denied> {
        let heir = self.heir.as_ref();
        let kept = heir.is_some_and(|heir| heir.client != client);
        match &self.holder {
            Some(holder) if holder.client == client => match holder.ended {
                None => Ok(()),
                Some(Ended::Revoked) => Err(Denied::Revoked),
                Some(Ended::Gone) => Err(Denied::NotInControl),
            },
            Some(_) if takes => Err(Denied::Held),
            None if takes && kept => Err(Denied::Held),
            None if takes => {
                self.holder = Some(Holder {
                    client,
                    name: name.to_owned(),
                    session: session.to_owned(),
                    granted_us: None,
                    ended: None,
                });
                Ok(())
            }
            _ => Err(Denied::NotInControl),
        }
    }

    /// The master has granted what a client asked for. True if the client is in control with that: it
    /// was not revoked meanwhile.
    pub fn grant(&mut self, client: ClientId, time_us: u64) -> bool {
        let Some(holder) = self.holder.as_mut().filter(|h| h.client == client) else {
            return false;
        };
        holder.granted_us.get_or_insert(time_us);
        let holds = holder.ended.is_none();
        self.heir.take_if(|_| holds);
        holds
    }

    /// What a client asked for was not granted.
    pub fn withdraw(&mut self, client: ClientId) {
        self.holder
            .take_if(|h| h.client == client && h.granted_us.is_none());
    }

    /// A client has released it.
    pub fn release(&mut self, client: ClientId) {
        self.holder.take_if(|h| h.client == client);
    }

    /// A client has released it for another, which has [`KEPT`] from `now` on to take it.
    pub fn hand_over(&mut self, client: ClientId, to: ClientId, who: (&str, &str), now: Instant) {
        self.release(client);
        self.heir = Some(Heir::new(to, who, Some(now + KEPT)));
    }

    /// Who holds the control, or has asked for it, does so no longer, and is returned. Its lease ends
    /// without it; from then on whoever revoked has [`KEPT`] to take the control.
    pub fn revoke(&mut self, by: ClientId, who: (&str, &str)) -> Option<&Holder> {
        let holder = self.holder.as_mut()?;
        holder.ended = Some(Ended::Revoked);
        self.heir = Some(Heir::new(by, who, None));
        Some(&*holder)
    }

    /// It is `now`: what was kept for too long is free.
    pub fn free(&mut self, now: Instant) {
        if let (Some(heir), None) = (&mut self.heir, &self.holder) {
            heir.until.get_or_insert(now + KEPT);
        }
        self.heir
            .take_if(|heir| heir.until.is_some_and(|until| now >= until));
    }

    /// A client is gone: nothing is kept for it, and it commands nothing. Its lease ends with its
    /// beats, at the master.
    pub fn leave(&mut self, client: ClientId) {
        self.heir.take_if(|heir| heir.client == client);
        if let Some(holder) = self.holder.as_mut().filter(|h| h.client == client) {
            holder.ended.get_or_insert(Ended::Gone);
        }
    }

    /// The master knows best whether anybody is in control: how it is at `now_us`.
    pub fn look(&mut self, now_us: u64, held: bool) {
        self.holder
            .take_if(|h| !held && h.granted_us.is_some_and(|us| now_us > us));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: (&str, &str) = ("a", "1");
    const B: (&str, &str) = ("b", "2");

    #[test]
    fn one_drives_until_it_releases_or_the_master_says_that_it_is_gone() {
        let mut desk = Desk::default();
        assert_eq!(desk.ask(1, A, false), Err(Denied::NotInControl));
        assert_eq!(desk.ask(1, A, true), Ok(()));
        // Asked for, and not yet granted.
        assert_eq!(desk.ask(2, B, true), Err(Denied::Held));
        assert_eq!(desk.ask(2, B, false), Err(Denied::NotInControl));
        assert!(!desk.grant(2, 10) && desk.grant(1, 10));
        desk.withdraw(1);
        desk.release(2);
        assert!(desk.holds(1) && !desk.holds(2));
        desk.look(10, false);
        assert!(desk.holds(1), "the master has not looked since");
        desk.look(11, true);
        assert!(desk.holds(1));
        desk.look(11, false);
        assert_eq!(desk.holder(), None);
        assert_eq!(desk.ask(2, B, true), Ok(()));
        desk.withdraw(1);
        assert!(desk.holds(2));
        desk.withdraw(2);
        assert_eq!(desk.holder(), None);
    }

    #[test]
    fn what_is_handed_over_is_kept_for_one_and_then_free() {
        let now = Instant::now();
        let held_by_a = || {
            let mut desk = Desk::default();
            assert_eq!(desk.ask(1, A, true), Ok(()));
            desk.grant(1, 10);
            desk.hand_over(1, 2, B, now);
            desk
        };
        let mut desk = held_by_a();
        assert_eq!((desk.holder(), desk.name()), (None, Some("b")));
        for other in [1, 3] {
            assert_eq!(desk.ask(other, A, true), Err(Denied::Held));
        }
        // It is nobody's yet, the heir's neither.
        assert_eq!(desk.ask(2, B, false), Err(Denied::NotInControl));
        assert_eq!(desk.ask(2, B, true), Ok(()));
        // The master may refuse it; it is kept all the same.
        desk.withdraw(2);
        assert_eq!(desk.ask(3, A, true), Err(Denied::Held));
        assert_eq!(desk.ask(2, B, true), Ok(()));
        desk.grant(2, 20);
        desk.release(2);
        assert_eq!(desk.ask(3, A, true), Ok(()), "kept once, not for ever");

        let mut desk = held_by_a();
        desk.free(now + KEPT / 2);
        assert_eq!(desk.ask(3, A, true), Err(Denied::Held));
        desk.free(now + KEPT);
        assert_eq!(desk.name(), None);
        assert_eq!(desk.ask(3, A, true), Ok(()));

        let mut desk = held_by_a();
        desk.leave(3);
        assert_eq!(desk.ask(3, A, true), Err(Denied::Held));
        desk.leave(2);
        assert_eq!(desk.ask(3, A, true), Ok(()));
    }

    /// Its lease ends in the master's time, which may stand. Until then nobody takes the control, and
    /// nobody is kept from the simulation.
    #[test]
    fn who_is_gone_keeps_the_lease_and_nothing_else() {
        let mut desk = Desk::default();
        assert!(desk.may_command_host(2));
        assert_eq!(desk.ask(1, A, true), Ok(()));
        desk.grant(1, 10);
        assert!(desk.may_command_host(1) && !desk.may_command_host(2));
        desk.leave(2);
        assert!(!desk.may_command_host(2));
        desk.leave(1);
        assert!(desk.may_command_host(2) && !desk.holds(1));
        desk.look(11, true);
        assert_eq!(desk.ask(2, B, true), Err(Denied::Held));
        desk.look(12, false);
        assert_eq!(desk.ask(2, B, true), Ok(()));
    }

    #[test]
    fn who_is_revoked_commands_nothing_and_the_revoker_has_time_to_take_it() {
        let now = Instant::now();
        let mut desk = Desk::default();
        assert_eq!(desk.revoke(2, B), None);
        assert_eq!(desk.ask(1, A, true), Ok(()));
        desk.grant(1, 10);
        assert_eq!(desk.revoke(2, B).map(|h| h.client), Some(1));
        for takes in [true, false] {
            assert_eq!(desk.ask(1, A, takes), Err(Denied::Revoked));
        }
        assert!(desk.may_command_host(2) && !desk.holds(1));
        // However long the clock stands, the time of the revoker begins with the end of the lease.
        desk.free(now + 100 * KEPT);
        assert_eq!(desk.ask(2, B, true), Err(Denied::Held));
        assert!(desk.heir().is_none(), "it is not free yet, for nobody");
        desk.look(11, false);
        desk.free(now);
        assert_eq!(desk.heir().map(|heir| &*heir.name), Some("b"));
        assert_eq!(desk.ask(1, A, true), Err(Denied::Held));
        desk.free(now + KEPT);
        assert_eq!(desk.ask(1, A, true), Ok(()));
        // Whoever revokes and goes keeps nothing.
        desk.grant(1, 20);
        desk.revoke(2, B);
        desk.leave(2);
        desk.look(21, false);
        assert_eq!(desk.ask(3, ("c", "3"), true), Ok(()));
    }

    /// The master grants it all the same; nobody beats for it, and it ends.
    #[test]
    fn what_is_only_asked_for_is_revoked_as_well() {
        let mut desk = Desk::default();
        assert_eq!(desk.ask(1, A, true), Ok(()));
        assert_eq!(desk.revoke(2, B).map(|h| h.granted_us), Some(None));
        assert!(!desk.grant(1, 10));
        assert_eq!(desk.ask(1, A, false), Err(Denied::Revoked));
        assert_eq!(desk.ask(2, B, true), Err(Denied::Held));
        desk.look(11, false);
        assert_eq!(desk.ask(1, A, true), Err(Denied::Held), "kept for b");
        assert_eq!(desk.ask(2, B, true), Ok(()));
        // Or the master refuses it.
        assert_eq!(desk.revoke(3, A).map(|h| h.client), Some(2));
        desk.withdraw(2);
        assert_eq!(desk.holder(), None);
    }
}
