//! Who of the clients is in control, or has asked for it. The master knows one operator; which
//! client that is, stands here.

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

/// The place of the one who drives.
#[derive(Debug, Default)]
pub struct Desk(Option<Holder>);

impl Desk {
    /// Who holds the control, or has asked for it.
    #[must_use]
    pub fn holder(&self) -> Option<&Holder> {
        self.0.as_ref()
    }

    /// Whether this client does.
    #[must_use]
    pub fn holds(&self, client: ClientId) -> bool {
        self.0.as_ref().is_some_and(|h| h.client == client)
    }

    /// A client wants to give a command, or to take the control: then it has asked for it.
    ///
    /// # Errors
    /// [`Denied`] if another holds it, or if the client does not.
    pub fn ask(
        &mut self,
        client: ClientId,
        (name, session): (&str, &str),
        takes: bool,
    ) -> Result<(), Denied> {
        match &self.0 {
            Some(holder) if holder.client == client => Ok(()),
            Some(_) if takes => Err(Denied::Held),
            None if takes => {
                self.0 = Some(Holder {
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
        if let Some(holder) = self.0.as_mut().filter(|h| h.client == client) {
            holder.granted_us.get_or_insert(time_us);
        }
    }

    /// What a client asked for was not granted.
    pub fn withdraw(&mut self, client: ClientId) {
        self.0
            .take_if(|h| h.client == client && h.granted_us.is_none());
    }

    /// A client has released it.
    pub fn release(&mut self, client: ClientId) {
        self.0.take_if(|h| h.client == client);
    }

    /// The master knows best whether anybody is in control: how it is at `now_us`.
    pub fn look(&mut self, now_us: u64, held: bool) {
        self.0
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
}
