//! Destinations of samples.

use super::contact::Contact;
use super::registry::Sample;
use super::samples::{
    BehaviourSample, BodySample, BusSample, EventSample, FootSample, JointSample, LinkSample,
    MasterSample, ProvenanceSample, ServerSample, SessionSample, StateSample, SupplySample,
    WheelSample,
};
use crate::{Event, LogError};

/// Declares [`SampleRef`] and [`OwnedSample`] over the types of samples.
macro_rules! sample_ref {
    ($($name:ident: $ty:ty),* $(,)?) => {
        /// A sample of any channel.
        #[derive(Debug, Clone, Copy)]
        pub enum SampleRef<'a> {
            $(
                #[doc = concat!("A [`", stringify!($ty), "`].")]
                $name(&'a $ty),
            )*
        }

        $(
            impl<'a> From<&'a $ty> for SampleRef<'a> {
                fn from(sample: &'a $ty) -> Self {
                    Self::$name(sample)
                }
            }
        )*

        /// A sample of any channel, on its way to another thread.
        #[derive(Debug, Clone)]
        pub enum OwnedSample {
            $(
                #[doc = concat!("A [`", stringify!($ty), "`].")]
                $name($ty),
            )*
        }

        impl OwnedSample {
            /// Appends the values of all fields, as [`Sample::pack`].
            pub fn pack(&self, out: &mut Vec<u8>) {
                match self {
                    $( Self::$name(sample) => sample.pack(out), )*
                }
            }

            /// The sample for a [`Sink`].
            #[must_use]
            pub fn as_ref(&self) -> SampleRef<'_> {
                match self {
                    $( Self::$name(sample) => SampleRef::$name(sample), )*
                }
            }
        }

        impl SampleRef<'_> {
            /// The sample itself.
            #[must_use]
            pub fn to_owned(self) -> OwnedSample {
                match self {
                    $( Self::$name(sample) => OwnedSample::$name(sample.clone()), )*
                }
            }

            /// Appends the payload of the log, as [`Sample::encode_json`].
            pub fn encode_json(self, out: &mut Vec<u8>) {
                match self {
                    $( Self::$name(sample) => sample.encode_json(out), )*
                }
            }

            /// Gives the values as text, as [`Sample::cells`].
            pub fn cells(self, cell: &mut dyn FnMut(&[u8])) {
                match self {
                    $( Self::$name(sample) => sample.cells(cell), )*
                }
            }
        }
    };
}

sample_ref! {
    Joint: JointSample,
    Wheel: WheelSample,
    Body: BodySample,
    Foot: FootSample,
    Bus: BusSample,
    Supply: SupplySample,
    Master: MasterSample,
    Behaviour: BehaviourSample,
    State: StateSample,
    Event: EventSample,
    Link: LinkSample,
    Provenance: ProvenanceSample,
    Server: ServerSample,
    Session: SessionSample,
}

/// One sample on its way to the sinks.
#[derive(Debug, Clone, Copy)]
pub struct Taken<'a> {
    /// Index of the channel in [`channels`](crate::channels).
    pub channel: usize,
    /// Which of the channels of its kind: joint 0 to 5, wheel, foot or board.
    pub number: usize,
    /// Simulated time, ns.
    pub t_ns: u64,
    /// The sample, with the values that the recorder computes.
    pub sample: SampleRef<'a>,
    /// Due in the log at the channel's declared rate.
    pub due: bool,
    /// Kept from the log by a fault of the run, a full disk.
    pub lost: bool,
}

/// Takes every sample of every channel at full rate, in the order of the loop.
///
/// It cannot fail in the middle of a run: a sink that can no longer write keeps its first error for
/// [`Sink::finish`] and ignores later samples, so that neither the loop nor another sink suffers.
pub trait Sink {
    /// Takes one sample.
    fn take(&mut self, taken: &Taken<'_>);

    /// Whether [`contacts`](Self::contacts) are of use to it.
    fn wants_contacts(&self) -> bool {
        false
    }

    /// Takes all contacts with the ground at one instant. They are not samples: no part of the hash. `lost`:
    /// kept from the log by a fault of the run.
    fn contacts(&mut self, _t_ns: u64, _contacts: &[Contact], _lost: bool) {}

    /// Takes an event as data; its sample comes by [`take`](Self::take), too.
    fn event(&mut self, _t_ns: u64, _event: &Event) {}

    /// The run is over.
    ///
    /// # Errors
    /// The first error since the sink was made.
    fn finish(&mut self) -> Result<(), LogError> {
        Ok(())
    }
}

impl<S: Sink + ?Sized> Sink for &mut S {
    fn take(&mut self, taken: &Taken<'_>) {
        (**self).take(taken);
    }

    fn wants_contacts(&self) -> bool {
        (**self).wants_contacts()
    }

    fn event(&mut self, t_ns: u64, event: &Event) {
        (**self).event(t_ns, event);
    }

    fn contacts(&mut self, t_ns: u64, contacts: &[Contact], lost: bool) {
        (**self).contacts(t_ns, contacts, lost);
    }

    fn finish(&mut self) -> Result<(), LogError> {
        (**self).finish()
    }
}
