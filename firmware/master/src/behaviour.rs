//! The behaviours of a walking robot: their names, the set that may act, their counters, and their reports.
//!
//! [`crate::layer0::behaviours`] describes their inputs and actions.

use crate::contact::Side;

macro_rules! behaviours {
    ($($(#[doc = $doc:literal])* $name:ident = $number:literal, $key:literal;)*) => {
        /// A behaviour, numbered by priority.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum Behaviour {
            $($(#[doc = $doc])* $name = $number,)*
        }

        impl Behaviour {
            /// All of them, highest priority first.
            pub const ALL: [Self; BEHAVIOURS] = [$(Self::$name,)*];

            /// Name in files.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => $key,)* }
            }

            /// Its action.
            #[must_use]
            pub const fn meaning(self) -> &'static str {
                match self { $(Self::$name => concat!($($doc),*).trim_ascii(),)* }
            }
        }
    };
}

/// Number of behaviours.
pub const BEHAVIOURS: usize = 11;

behaviours! {
    /// An axis that pulls at its limit and does not move holds where it is.
    Overload = 1, "overload";
    /// Where no foot carries the wheels stop, then give way, and no leg extends far: that lifts the nose.
    TipGuard = 2, "tip-guard";
    /// A foot that goes down stops where its switches close.
    Touchdown = 3, "touchdown";
    /// A foot that finds no ground where it was expected looks for it below.
    Search = 4, "search";
    /// A swinging foot that runs against something is lifted higher.
    Bump = 5, "bump";
    /// A standing foot that loses the ground follows it.
    LostContact = 6, "lost-contact";
    /// Wheels that slip slow down, and the legs pull.
    Slip = 7, "slip";
    /// A foot that holds on something pulls harder; its place is kept, it does nothing yet.
    Hook = 8, "hook";
    /// A robot that does not get on backs off, and stands after three tries, or one before what no wheel climbs.
    Stuck = 9, "stuck";
    /// Legs that both stand share the load.
    LoadShare = 10, "load-share";
    /// The wheels wait for a standing foot at the end of its reach.
    StrokeGovernor = 11, "stroke-governor";
}

impl Behaviour {
    /// Index in arrays of behaviours.
    #[must_use]
    pub const fn index(self) -> usize {
        (self as usize).saturating_sub(1)
    }

    const fn bit(self) -> u16 {
        1 << (self as u16).saturating_sub(1)
    }

    /// The behaviour with this name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.name() == name)
    }
}

/// A set of behaviours; bit 0 has the highest priority.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Behaviours(u16);

impl Behaviours {
    /// All of them.
    pub const ALL: Self = Self((1 << BEHAVIOURS) - 1);
    /// None.
    pub const NONE: Self = Self(0);

    /// The set with these bits; other bits are dropped.
    #[must_use]
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits & Self::ALL.0)
    }

    /// Bits of the set.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether a behaviour is in the set.
    #[must_use]
    pub const fn contains(self, one: Behaviour) -> bool {
        self.0 & one.bit() != 0
    }

    /// The set without this behaviour.
    #[must_use]
    pub const fn without(self, one: Behaviour) -> Self {
        Self(self.0 & !one.bit())
    }
}

impl Default for Behaviours {
    fn default() -> Self {
        Self::ALL
    }
}

/// How often each behaviour has acted since start-up; a count stops at its largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally([u32; BEHAVIOURS]);

impl Tally {
    /// Counts one more action.
    pub fn count(&mut self, one: Behaviour) {
        if let Some(count) = self.0.get_mut(one.index()) {
            *count = count.saturating_add(1);
        }
    }

    /// How often this behaviour has acted.
    #[must_use]
    pub fn of(&self, one: Behaviour) -> u32 {
        self.0.get(one.index()).copied().unwrap_or(0)
    }

    /// The sum of both: each layer keeps its own counts.
    #[must_use]
    pub fn with(mut self, other: &Self) -> Self {
        for (mine, theirs) in self.0.iter_mut().zip(other.0) {
            *mine = mine.saturating_add(theirs);
        }
        self
    }
}

/// Report that a behaviour acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// An axis works at its limit and does not move: it holds.
    Overload {
        /// Bus address of its board.
        node: u8,
    },
    /// No foot carries load: the wheels slow down, so that the robot does not fall on its tail.
    TipGuard,
    /// A foot has met the ground far above the expected height.
    EarlyGround(
        /// Its leg.
        Side,
    ),
    /// A foot has met the ground far below the expected height.
    LateGround(
        /// Its leg.
        Side,
    ),
    /// A leg at full length finds no ground: the nose goes down, then the foot is set nearer.
    NoGround(
        /// The leg.
        Side,
    ),
    /// A swinging foot ran against something: it is lifted higher, or set down there.
    Bump(
        /// Its leg.
        Side,
    ),
    /// A standing foot has lost the ground and follows it.
    LostGround(
        /// Its leg.
        Side,
    ),
    /// The wheels slip: they slow down and the legs pull.
    Slip,
    /// No progress: the robot backs off, and lifts its feet higher.
    BackOff,
    /// No progress after several tries: the robot stands.
    Stuck,
    /// One leg carries more than the other: they are made to share the load.
    LoadShare,
    /// A standing foot is at the end of its reach: the wheels wait.
    Governor,
}

impl Act {
    /// The behaviour that acts.
    #[must_use]
    pub const fn behaviour(self) -> Behaviour {
        match self {
            Self::Overload { .. } => Behaviour::Overload,
            Self::TipGuard => Behaviour::TipGuard,
            Self::EarlyGround(_) | Self::LateGround(_) => Behaviour::Touchdown,
            Self::NoGround(_) => Behaviour::Search,
            Self::Bump(_) => Behaviour::Bump,
            Self::LostGround(_) => Behaviour::LostContact,
            Self::Slip => Behaviour::Slip,
            Self::BackOff | Self::Stuck => Behaviour::Stuck,
            Self::LoadShare => Behaviour::LoadShare,
            Self::Governor => Behaviour::StrokeGovernor,
        }
    }

    /// The leg concerned, if there is one.
    #[must_use]
    pub const fn side(self) -> Option<Side> {
        match self {
            Self::EarlyGround(side)
            | Self::LateGround(side)
            | Self::NoGround(side)
            | Self::Bump(side)
            | Self::LostGround(side) => Some(side),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bits_are_in_the_order_of_priority_and_names_find_their_behaviour() {
        for (place, one) in Behaviour::ALL.into_iter().enumerate() {
            assert_eq!(one.index(), place);
            assert_eq!(Behaviour::of_name(one.name()), Some(one));
            let only = Behaviours::from_bits(1 << place);
            assert!(only.contains(one) && Behaviours::ALL.contains(one));
            assert!(!Behaviours::ALL.without(one).contains(one));
            assert_eq!(only.without(one), Behaviours::NONE);
        }
        assert_eq!(Behaviours::from_bits(u16::MAX), Behaviours::ALL);
        assert_eq!(Behaviour::of_name("fly"), None);
    }

    #[test]
    fn a_tally_counts_each_for_itself() {
        let mut one = Tally::default();
        one.count(Behaviour::Bump);
        let mut other = one;
        other.count(Behaviour::StrokeGovernor);
        let both = one.with(&other);
        let counts = Behaviour::ALL.map(|which| both.of(which));
        assert_eq!(counts, [0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 1]);
    }
}
