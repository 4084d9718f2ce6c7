//! Who of the clients is in control, or has asked for it. The master knows one operator; which
//! client that is, stands here. Who is in control may hand it over: then one other client alone may
//! take it, for a short time.

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
}

/// Why a client may not give a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Denied {
    /// It wants the control, which another holds.
    Held,
    /// It is not in control.
    NotInControl,
}

/// Time in which the control that was handed over is kept for one client; then it is free.
pub const KEPT: Duration = Duration::from_secs(2);

/// For whom the control is kept.
#[derive(Debug)]
struct Heir {
    client: ClientId,
    name: String,
    until: Instant,
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

    /// Whether this client does.
    #[must_use]
    pub fn holds(&self, client: ClientId) -> bool {
        self.holder.as_ref().is_some_and(|h| h.client == client)
    }

    /// A client wants to give a command, or to take the control: then it has asked for it.
    ///
    /// # Errors
    /// [`Denied`] if another holds it, if it is kept for another, or if the client does not hold it.
    pub fn ask(
        &mut self,
        client: ClientId,
        (name, session): (&str, &str),
        takes: bool,
    ) -> Result<(), Denied> {
        let heir = self.heir.as_ref();
        let kept = heir.is_some_and(|heir| heir.client != client);
        match &self.holder {
            Some(holder) if holder.client == client => Ok(()),
            Some(_) if takes => Err(Denied::Held),
            None if takes && kept => Err(Denied::Held),
            None if takes => {
                self.holder = Some(Holder {
                    client,
                    name: name.to_owned(),
                    session: session.to_owned(),
                    granted_us: None,
                });
                Ok(())
            }
            _ => Err(Denied::NotInControl),
        }
    }

    /// The master has granted what a client asked for.
    pub fn grant(&mut self, client: ClientId, time_us: u64) {
        if let Some(holder) = self.holder.as_mut().filter(|h| h.client == client) {
            holder.granted_us.get_or_insert(time_us);
            self.heir = None;
        }
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
    pub fn hand_over(&mut self, client: ClientId, (to, name): (ClientId, &str), now: Instant) {
        self.release(client);
        self.heir = Some(Heir {
            client: to,
            name: name.to_owned(),
            until: now + KEPT,
        });
    }

    /// It is `now`: what was kept for too long is free.
    pub fn free(&mut self, now: Instant) {
        self.heir.take_if(|heir| now >= heir.until);
    }

    /// A client is gone: nothing is kept for it. What it holds ends with its beats, at the master.
    pub fn leave(&mut self, client: ClientId) {
        self.heir.take_if(|heir| heir.client == client);
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
        desk.grant(2, 10);
        desk.grant(1, 10);
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
            desk.hand_over(1, (2, "b"), now);
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
}
