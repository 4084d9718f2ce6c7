//! How fields and tables are declared: size, format text and codec from one place.
//!
//! postcard writes most integers with variable length. Every message of this
//! bus has one exact size, so multi-byte integers are written with
//! [`crate::le`], and each field type states its size here. A test
//! serialises extreme values of every message and compares the two.

/// A type with one exact size on the wire.
pub trait WireSize {
    /// Bytes on the wire.
    const SIZE: usize;
}

macro_rules! wire_sizes {
    ($($ty:ty),*) => { $(impl WireSize for $ty { const SIZE: usize = core::mem::size_of::<$ty>(); })* };
}
wire_sizes!(u8, i8, u16, i16, u32, i32, u64);

impl<T: WireSize, const N: usize> WireSize for [T; N] {
    const SIZE: usize = T::SIZE.saturating_mul(N);
}

/// One field of a message as the interface definition sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldSchema {
    /// Name.
    pub name: &'static str,
    /// Wire type, as in the source.
    pub ty: &'static str,
    /// Bytes on the wire.
    pub size: usize,
    /// Q-format, unit and range.
    pub format: &'static str,
}

/// One message as the interface definition sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageSchema {
    /// Wire number.
    pub id: u8,
    /// Name.
    pub name: &'static str,
    /// `cyclic`, `request` or `answer`.
    pub class: &'static str,
    /// What it is for; not part of the schema hash.
    pub text: &'static str,
    /// Payload fields in wire order.
    pub fields: &'static [FieldSchema],
}

impl MessageSchema {
    /// Payload bytes: the sum of the field sizes.
    #[must_use]
    pub fn payload_len(&self) -> usize {
        self.fields
            .iter()
            .fold(0_usize, |sum, field| sum.saturating_add(field.size))
    }
}

/// One named number: value of an enumeration, or bit of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValueSchema {
    /// Wire value, or bit number.
    pub value: u8,
    /// Name.
    pub name: &'static str,
    /// What it means, for a person.
    pub text: &'static str,
}

/// An enumeration or bit set as the interface definition sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnumSchema {
    /// Name of the type.
    pub name: &'static str,
    /// Its values in ascending order.
    pub values: &'static [ValueSchema],
}

/// A byte that is not a value of the enumeration it should belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownValue {
    /// The enumeration.
    pub of: &'static str,
    /// The byte.
    pub value: u8,
}

impl core::fmt::Display for UnknownValue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} is not a value of {}", self.value, self.of)
    }
}

/// Declares a one-byte enumeration with its texts.
macro_rules! wire_enum {
    ($(#[$meta:meta])* $name:ident { $( $(#[$vmeta:meta])* $variant:ident = $value:literal, $text:literal; )* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        #[serde(try_from = "u8", into = "u8")]
        #[repr(u8)]
        pub enum $name { $( $(#[$vmeta])* #[doc = $text] $variant = $value, )* }

        impl $name {
            /// Every value, in ascending order.
            pub const ALL: &'static [Self] = &[ $( Self::$variant ),* ];
            /// Its part of the interface definition.
            pub const SCHEMA: $crate::wire::EnumSchema = $crate::wire::EnumSchema {
                name: stringify!($name),
                values: &[ $( $crate::wire::ValueSchema {
                    value: $value, name: stringify!($variant), text: $text,
                } ),* ],
            };

            /// The number on the wire.
            #[must_use]
            pub const fn code(self) -> u8 {
                self as u8
            }

            /// The value with this number on the wire, if there is one.
            #[must_use]
            pub const fn from_code(code: u8) -> Option<Self> {
                match code {
                    $( $value => Some(Self::$variant), )*
                    _ => None,
                }
            }

            /// Name as in the interface definition.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Self::$variant => stringify!($variant) ),* }
            }

            /// What it means, for a person.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $( Self::$variant => $text ),* }
            }
        }

        impl TryFrom<u8> for $name {
            type Error = $crate::wire::UnknownValue;
            fn try_from(value: u8) -> Result<Self, Self::Error> {
                Self::from_code(value)
                    .ok_or($crate::wire::UnknownValue { of: stringify!($name), value })
            }
        }

        impl From<$name> for u8 {
            fn from(value: $name) -> u8 {
                value as u8
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.text())
            }
        }

        impl $crate::wire::WireSize for $name {
            const SIZE: usize = 1;
        }
    };
}

/// Declares a one-byte set of bits; bits not named are reserved and rejected.
macro_rules! wire_bits {
    ($(#[$meta:meta])* $name:ident { $( $constant:ident = $bit:literal, $text:literal; )* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        #[serde(try_from = "u8", into = "u8")]
        pub struct $name(u8);

        impl $name {
            /// No bit set.
            pub const NONE: Self = Self(0);
            /// Every bit with a meaning.
            pub const MASK: u8 = 0 $( | (1 << $bit) )*;
            $( #[doc = $text] pub const $constant: Self = Self(1 << $bit); )*
            /// Its part of the interface definition.
            pub const SCHEMA: $crate::wire::EnumSchema = $crate::wire::EnumSchema {
                name: stringify!($name),
                values: &[ $( $crate::wire::ValueSchema {
                    value: $bit, name: stringify!($constant), text: $text,
                } ),* ],
            };

            /// From the byte on the wire; `None` if a reserved bit is set.
            #[must_use]
            pub const fn from_raw(raw: u8) -> Option<Self> {
                if raw & !Self::MASK == 0 { Some(Self(raw)) } else { None }
            }

            /// The byte on the wire.
            #[must_use]
            pub const fn raw(self) -> u8 {
                self.0
            }

            /// Whether every bit of `other` is set.
            #[must_use]
            pub const fn contains(self, other: Self) -> bool {
                self.0 & other.0 == other.0
            }

            /// Union.
            #[must_use]
            pub const fn with(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }

            /// Whether no bit is set.
            #[must_use]
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }
        }

        impl TryFrom<u8> for $name {
            type Error = $crate::wire::UnknownValue;
            fn try_from(value: u8) -> Result<Self, Self::Error> {
                Self::from_raw(value)
                    .ok_or($crate::wire::UnknownValue { of: stringify!($name), value })
            }
        }

        impl From<$name> for u8 {
            fn from(value: $name) -> u8 {
                value.0
            }
        }

        impl $crate::wire::WireSize for $name {
            const SIZE: usize = 1;
        }
    };
}

pub(crate) use {wire_bits, wire_enum};
