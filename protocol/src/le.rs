//! Integers of exact size, low byte first: `#[serde(with = "le")]`.
//!
//! Gives the same bytes as `postcard::fixint::le`, whose code a board would hold once for each size, with its
//! bytes one after the other. Here one loop serves all sizes.

use core::fmt;
use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{SerializeTuple, Serializer};

/// An integer of two bytes or more.
pub(crate) trait LittleEndian: Copy {
    type Bytes: AsRef<[u8]> + AsMut<[u8]> + Default;

    fn to_bytes(self) -> Self::Bytes;
    fn from_bytes(bytes: Self::Bytes) -> Self;
}

macro_rules! little_endian {
    ($($integer:ty),*) => { $(
        impl LittleEndian for $integer {
            type Bytes = [u8; size_of::<Self>()];

            fn to_bytes(self) -> Self::Bytes {
                self.to_le_bytes()
            }

            fn from_bytes(bytes: Self::Bytes) -> Self {
                Self::from_le_bytes(bytes)
            }
        }
    )* };
}
little_endian!(u16, i16, u32, i32, u64);

pub(crate) fn serialize<S: Serializer, T: LittleEndian>(
    value: &T,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    write(value.to_bytes().as_ref(), serializer)
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>, T: LittleEndian>(
    deserializer: D,
) -> Result<T, D::Error> {
    let mut bytes = T::Bytes::default();
    read(bytes.as_mut(), deserializer)?;
    Ok(T::from_bytes(bytes))
}

#[inline(never)]
fn write<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    let mut tuple = serializer.serialize_tuple(bytes.len())?;
    for byte in bytes {
        tuple.serialize_element(byte)?;
    }
    tuple.end()
}

#[inline(never)]
fn read<'de, D: Deserializer<'de>>(bytes: &mut [u8], deserializer: D) -> Result<(), D::Error> {
    deserializer.deserialize_tuple(bytes.len(), Places(bytes))
}

/// Where the bytes go.
struct Places<'a>(&'a mut [u8]);

impl<'de> Visitor<'de> for Places<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.0.len())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<(), A::Error> {
        for (at, place) in self.0.iter_mut().enumerate() {
            let missing = || A::Error::invalid_length(at, &"all bytes");
            *place = bytes.next_element()?.ok_or_else(missing)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use postcard::fixint;
    use serde::{Deserialize, Serialize};

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Ours {
        #[serde(with = "super")]
        a: u16,
        #[serde(with = "super")]
        b: i32,
        #[serde(with = "super")]
        c: u64,
        #[serde(with = "super")]
        d: i16,
        #[serde(with = "super")]
        e: u32,
    }

    #[derive(Serialize)]
    struct Postcard {
        #[serde(with = "fixint::le")]
        a: u16,
        #[serde(with = "fixint::le")]
        b: i32,
        #[serde(with = "fixint::le")]
        c: u64,
        #[serde(with = "fixint::le")]
        d: i16,
        #[serde(with = "fixint::le")]
        e: u32,
    }

    #[test]
    fn bytes_are_those_of_postcard_and_come_back() {
        let (a, b, c, d, e) = (0x8102, -0x0304_0506, 0x8081_8283_8485_8687, -2, 0xF0E0_D0C0);
        let (mut ours, mut theirs) = ([0_u8; 20], [0_u8; 20]);
        let value = Ours { a, b, c, d, e };
        let length = postcard::to_slice(&value, &mut ours).expect("room").len();
        postcard::to_slice(&Postcard { a, b, c, d, e }, &mut theirs).expect("room");
        assert_eq!((length, ours), (20, theirs));
        assert_eq!(postcard::from_bytes::<Ours>(&ours), Ok(value));
        for length in 0..ours.len() {
            assert!(postcard::from_bytes::<Ours>(&ours[..length]).is_err());
        }
    }
}
