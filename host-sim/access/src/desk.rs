//! The client that is in control, or has asked for it. The master knows only one operator; this module knows
//! which client that is. The holder may hand control over: then only one other client may take it, for a
//! short time.
//!
//! A lease ends at the master, in its time, which stops while the simulation is paused. A holder that is
//! gone, or whose control was revoked, ends here at once: it can command nothing, and keeps nothing from
//! others but the lease, until the master has ended it.

use std::time::{Duration, Instant};

/// Number of a client.
pub type ClientId = u64;

/// The client that holds control, or has asked for it.
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

/// Time for which the control is reserved for one client; then it is free.
pub const RESERVED: Duration = Duration::from_secs(2);

/// The asking client.
#[derive(Debug, Clone, Copy)]
pub struct Asker<'a> {
    /// Which client.
    pub client: ClientId,
    /// Its name.
    pub name: &'a str,
    /// Its session.
    pub session: &'a str,
    /// It is on the robot's own computer.
    pub is_local: bool,
}

/// The clients for which control is reserved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Heir {
    /// For the client to which it was handed over.
    Client {
        /// Which client.
        client: ClientId,
        /// Its name.
        name: String,
        /// Its session.
        session: String,
    },
    /// The clients on the robot's own computer, after a revocation.
    RobotsComputer {
        /// The one that was in control.
        except: ClientId,
    },
}

impl Heir {
    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Client { name, .. } => name,
            Self::RobotsComputer { .. } => "the robot's computer",
        }
    }

    /// Its session; none of several clients.
    #[must_use]
    pub fn session(&self) -> Option<&str> {
        match self {
            Self::Client { session, .. } => Some(session),
            Self::RobotsComputer { .. } => None,
        }
    }

    fn is(&self, asker: &Asker<'_>) -> bool {
        match self {
            Self::Client { client, .. } => *client == asker.client,
            Self::RobotsComputer { except } => asker.is_local && asker.client != *except,
        }
    }
}

/// A reservation, and how long it lasts.
#[derive(Debug)]
struct Reserved {
    heir: Heir,
    lasts: Duration,
    /// None while a lease is not over.
    until: Option<Instant>,
}

/// Register of the client that drives.
#[derive(Debug, Default)]
pub struct Desk {
    holder: Option<Holder>,
    reserved: Option<Reserved>,
}

impl Desk {
    /// The client that holds control, or has asked for it.
    #[must_use]
    pub fn holder(&self) -> Option<&Holder> {
        self.holder.as_ref()
    }

    /// Name of the client that has control, or of the one it is reserved for.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        let holder = self.holder.as_ref().map(|holder| &*holder.name);
        holder.or_else(|| Some(self.reserved.as_ref()?.heir.name()))
    }

    /// The clients for which control is reserved: only they may take it.
    #[must_use]
    pub fn heir(&self) -> Option<&Heir> {
        let reserved = self.reserved.as_ref().filter(|_| self.holder.is_none());
        reserved.map(|reserved| &reserved.heir)
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

    /// A client wants to give a command, or to take control: then it has asked for it.
    ///
    /// # Errors
    /// [`Denied`] if another holds control, if it is reserved for another, or if the client does not hold it,
    /// or no longer does.
    pub fn ask(&mut self, asker: Asker<'_>, takes: bool) -> Result<(), Denied> {
        let reserved = self.reserved.as_ref();
        let for_others = reserved.is_some_and(|reserved| !reserved.heir.is(&asker));
        match &self.holder {
            Some(holder) if holder.client == asker.client => match holder.ended {
                None => Ok(()),
                Some(Ended::Revoked) => Err(Denied::Revoked),
                Some(Ended::Gone) => Err(Denied::NotInControl),
            },
            Some(_) if takes => Err(Denied::Held),
            None if takes && for_others => Err(Denied::Held),
            None if takes => {
                self.holder = Some(Holder {
                    client: asker.client,
                    name: asker.name.to_owned(),
                    session: asker.session.to_owned(),
                    granted_us: None,
                    ended: None,
                });
                Ok(())
            }
            _ => Err(Denied::NotInControl),
        }
    }

    /// The master has granted a client's request. True if this puts the client in control: it was not revoked
    /// meanwhile.
    pub fn grant(&mut self, client: ClientId, time_us: u64) -> bool {
        let Some(holder) = self.holder.as_mut().filter(|h| h.client == client) else {
            return false;
        };
        holder.granted_us.get_or_insert(time_us);
        let holds = holder.ended.is_none();
        self.reserved.take_if(|_| holds);
        holds
    }

    /// A client's request was not granted.
    pub fn withdraw(&mut self, client: ClientId) {
        self.holder
            .take_if(|h| h.client == client && h.granted_us.is_none());
    }

    /// A client has released it.
    pub fn release(&mut self, client: ClientId) {
        self.holder.take_if(|h| h.client == client);
    }

    /// A client has released it for another, which has [`RESERVED`] from `now` on to take it.
    pub fn hand_over(&mut self, client: ClientId, to: ClientId, who: (&str, &str), now: Instant) {
        self.release(client);
        let (name, session) = who;
        self.reserved = Some(Reserved {
            heir: Heir::Client {
                client: to,
                name: name.to_owned(),
                session: session.to_owned(),
            },
            lasts: RESERVED,
            until: Some(now + RESERVED),
        });
    }

    /// Takes control away from its holder, or from the client that has asked for it, and returns that client.
    /// Its lease then runs out; from that moment the clients on the robot's own computer have `lasts` to take
    /// control. It is not reserved for one client: a command line ends with each of its commands.
    pub fn revoke(&mut self, lasts: Duration) -> Option<&Holder> {
        let holder = self.holder.as_mut()?;
        holder.ended = Some(Ended::Revoked);
        self.reserved = Some(Reserved {
            heir: Heir::RobotsComputer {
                except: holder.client,
            },
            lasts,
            until: None,
        });
        Some(&*holder)
    }

    /// Updates the time: a reservation that has lasted too long ends.
    pub fn free(&mut self, now: Instant) {
        if let (Some(reserved), None) = (&mut self.reserved, &self.holder) {
            reserved.until.get_or_insert(now + reserved.lasts);
        }
        self.reserved
            .take_if(|reserved| reserved.until.is_some_and(|until| now >= until));
    }

    /// How long the control is still reserved.
    #[must_use]
    pub fn reserved_for(&self, now: Instant) -> Duration {
        let until = self.reserved.as_ref().and_then(|reserved| reserved.until);
        until.map_or(Duration::ZERO, |until| until.saturating_duration_since(now))
    }

    /// A client is gone: nothing is reserved for it, and it can command nothing. Without its beats the master
    /// ends its lease.
    pub fn leave(&mut self, client: ClientId) {
        self.reserved.take_if(
            |reserved| matches!(reserved.heir, Heir::Client { client: heir, .. } if heir == client),
        );
        if let Some(holder) = self.holder.as_mut().filter(|h| h.client == client) {
            holder.ended.get_or_insert(Ended::Gone);
        }
    }

    /// Takes the master's state at `now_us`: the master knows best whether anybody is in control.
    pub fn look(&mut self, now_us: u64, held: bool) {
        self.holder
            .take_if(|h| !held && h.granted_us.is_some_and(|us| now_us > us));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const B: (&str, &str) = ("b", "2");

    /// A client, on another computer; those from [`LOCAL`] on are on the robot's own.
    fn client(client: ClientId) -> Asker<'static> {
        const NAMES: [&str; 5] = ["", "a", "b", "c", "d"];
        let name = NAMES[client as usize];
        Asker {
            client,
            name,
            session: name,
            is_local: client >= LOCAL,
        }
    }

    const LOCAL: ClientId = 3;

    #[test]
    fn one_drives_until_it_releases_or_the_master_says_that_it_is_gone() {
        let mut desk = Desk::default();
        assert_eq!(desk.ask(client(1), false), Err(Denied::NotInControl));
        assert_eq!(desk.ask(client(1), true), Ok(()));
        // Asked for, and not yet granted.
        assert_eq!(desk.ask(client(2), true), Err(Denied::Held));
        assert_eq!(desk.ask(client(2), false), Err(Denied::NotInControl));
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
        assert_eq!(desk.ask(client(2), true), Ok(()));
        desk.withdraw(1);
        assert!(desk.holds(2));
        desk.withdraw(2);
        assert_eq!(desk.holder(), None);
    }

    #[test]
    fn what_is_handed_over_is_reserved_for_one_and_then_free() {
        let now = Instant::now();
        let held_by_a = || {
            let mut desk = Desk::default();
            assert_eq!(desk.ask(client(1), true), Ok(()));
            desk.grant(1, 10);
            desk.hand_over(1, 2, B, now);
            desk
        };
        let mut desk = held_by_a();
        assert_eq!((desk.holder(), desk.name()), (None, Some("b")));
        for other in [1, 3] {
            assert_eq!(desk.ask(client(other), true), Err(Denied::Held));
        }
        // Nobody has it yet, not even the heir.
        assert_eq!(desk.ask(client(2), false), Err(Denied::NotInControl));
        assert_eq!(desk.ask(client(2), true), Ok(()));
        // The master may refuse it; it stays reserved.
        desk.withdraw(2);
        assert_eq!(desk.ask(client(3), true), Err(Denied::Held));
        assert_eq!(desk.ask(client(2), true), Ok(()));
        desk.grant(2, 20);
        desk.release(2);
        assert_eq!(
            desk.ask(client(3), true),
            Ok(()),
            "reserved once, not for ever"
        );

        let mut desk = held_by_a();
        desk.free(now + RESERVED / 2);
        assert_eq!(desk.ask(client(3), true), Err(Denied::Held));
        desk.free(now + RESERVED);
        assert_eq!(desk.name(), None);
        assert_eq!(desk.ask(client(3), true), Ok(()));

        let mut desk = held_by_a();
        desk.leave(3);
        assert_eq!(desk.ask(client(3), true), Err(Denied::Held));
        desk.leave(2);
        assert_eq!(desk.ask(client(3), true), Ok(()));
    }

    /// Its lease ends in the master's time, which may stop. Until then nobody can take control, but everybody
    /// can command the simulation.
    #[test]
    fn who_is_gone_keeps_the_lease_and_nothing_else() {
        let mut desk = Desk::default();
        assert!(desk.may_command_host(2));
        assert_eq!(desk.ask(client(1), true), Ok(()));
        desk.grant(1, 10);
        assert!(desk.may_command_host(1) && !desk.may_command_host(2));
        desk.leave(2);
        assert!(!desk.may_command_host(2));
        desk.leave(1);
        assert!(desk.may_command_host(2) && !desk.holds(1));
        desk.look(11, true);
        assert_eq!(desk.ask(client(2), true), Err(Denied::Held));
        desk.look(12, false);
        assert_eq!(desk.ask(client(2), true), Ok(()));
    }

    #[test]
    fn who_is_revoked_commands_nothing_and_the_robot_s_computer_has_time_to_take_it() {
        let now = Instant::now();
        let lasts = Duration::from_secs(10);
        let mut desk = Desk::default();
        assert_eq!(desk.revoke(lasts), None);
        assert_eq!(desk.ask(client(1), true), Ok(()));
        desk.grant(1, 10);
        assert_eq!(desk.revoke(lasts).map(|h| h.client), Some(1));
        for takes in [true, false] {
            assert_eq!(desk.ask(client(1), takes), Err(Denied::Revoked));
        }
        assert!(desk.may_command_host(2) && !desk.holds(1));
        // However long the clock stands, the time begins when the lease ends.
        desk.free(now + 100 * lasts);
        assert_eq!(desk.ask(client(3), true), Err(Denied::Held));
        assert!(desk.heir().is_none(), "it is not free yet, for nobody");
        desk.look(11, false);
        desk.free(now);
        assert_eq!(desk.heir(), Some(&Heir::RobotsComputer { except: 1 }));
        assert_eq!(desk.reserved_for(now + lasts / 4), lasts * 3 / 4);
        for remote in [1, 2] {
            assert_eq!(desk.ask(client(remote), true), Err(Denied::Held));
        }
        // The client that revoked control may be gone: another one there takes it.
        desk.leave(3);
        assert_eq!(desk.ask(client(4), true), Ok(()));
        desk.grant(4, 20);
        desk.release(4);
        assert_eq!(desk.ask(client(1), true), Ok(()), "reserved once");
        // Nor can the former holder take it back by being there.
        desk.release(1);
        assert_eq!(desk.ask(client(4), true), Ok(()));
        desk.grant(4, 25);
        desk.revoke(lasts);
        desk.look(26, false);
        assert_eq!(desk.ask(client(4), true), Err(Denied::Held));
        assert_eq!(desk.ask(client(3), true), Ok(()));
        desk.grant(3, 27);
        desk.release(3);
        // If nobody there takes it, everybody may.
        assert_eq!(desk.ask(client(1), true), Ok(()));
        desk.grant(1, 30);
        desk.revoke(lasts);
        desk.look(31, false);
        desk.free(now);
        assert_eq!(desk.ask(client(2), true), Err(Denied::Held));
        desk.free(now + lasts);
        assert_eq!(desk.ask(client(2), true), Ok(()));
    }

    /// The master still grants it; nobody sends beats for it, and it ends.
    #[test]
    fn what_is_only_asked_for_is_revoked_as_well() {
        let mut desk = Desk::default();
        assert_eq!(desk.ask(client(1), true), Ok(()));
        let revoked = desk.revoke(RESERVED).map(|h| h.granted_us);
        assert_eq!(revoked, Some(None));
        assert!(!desk.grant(1, 10));
        assert_eq!(desk.ask(client(1), false), Err(Denied::Revoked));
        assert_eq!(desk.ask(client(3), true), Err(Denied::Held));
        desk.look(11, false);
        assert_eq!(desk.ask(client(1), true), Err(Denied::Held), "reserved");
        assert_eq!(desk.ask(client(3), true), Ok(()));
        // Or the master refuses it.
        assert_eq!(desk.revoke(RESERVED).map(|h| h.client), Some(3));
        desk.withdraw(3);
        assert_eq!(desk.holder(), None);
    }
}
