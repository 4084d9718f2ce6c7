//! Keys and message authentication codes of the console (PROTOCOL.md, Keys and MACs).

use std::fmt;

use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;
use subtle::ConstantTimeEq as _;

use crate::hex;

/// Bytes of the code before a client frame.
const FRAME_MAC: usize = 16;

/// A secret of 32 bytes, which no log shows.
#[derive(Clone)]
pub struct Key([u8; 32]);

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(redacted)")
    }
}

impl Key {
    /// A key with these bytes.
    #[must_use]
    pub fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Its digits, to hand to a person.
    #[must_use]
    pub fn to_hex(&self) -> String {
        hex::encode(&self.0)
    }

    /// Whether `bytes` are this key, in a time that does not reveal where they differ.
    pub fn is(&self, bytes: &[u8; 32]) -> bool {
        self.0.ct_eq(bytes).into()
    }

    fn mac(&self, fields: &[&[u8]]) -> Hmac<Sha256> {
        // HMAC fills a key up with zeros to a block of the hash.
        let mut block = [0; 64];
        block[..32].copy_from_slice(&self.0);
        let mut mac = Hmac::<Sha256>::new(&block.into());
        for field in fields {
            mac.update(&(field.len() as u32).to_le_bytes());
            mac.update(field);
        }
        mac
    }

    /// Code before a client frame; this is the session's key.
    fn frame(&self, json: &[u8]) -> [u8; FRAME_MAC] {
        let full: [u8; 32] = self.mac(&[b"f1", json]).finalize().into_bytes().into();
        let mut out = [0; FRAME_MAC];
        out.copy_from_slice(&full[..FRAME_MAC]);
        out
    }

    /// A client frame around its JSON; this is the session's key.
    #[must_use]
    pub fn seal(&self, json: &[u8]) -> Vec<u8> {
        [&self.frame(json)[..], json].concat()
    }

    /// The JSON of a client frame, if its code is right; this is the session's key.
    pub fn open<'a>(&self, frame: &'a [u8]) -> Option<&'a [u8]> {
        let (mac, json) = frame.split_at_checked(FRAME_MAC)?;
        self.mac(&[b"f1", json]).verify_truncated_left(mac).ok()?;
        Some(json)
    }
}

/// Data of a handshake that both sides must agree on.
#[derive(Debug, Clone, Copy)]
pub struct Transcript<'a> {
    /// Nonce of the server.
    pub nonce_s: &'a [u8; 32],
    /// Nonce of the client.
    pub nonce_c: &'a [u8; 32],
    /// Requested role.
    pub role: &'a str,
    /// Name of the client.
    pub name: &'a str,
    /// `Host` that the client speaks to.
    pub host: &'a str,
    /// Hash of the channels.
    pub layout: &'a str,
    /// Hash of the commands.
    pub commands: &'a str,
}

impl Transcript<'_> {
    fn fields<'a>(&'a self, label: &'a [u8]) -> [&'a [u8]; 8] {
        [
            label,
            self.nonce_s,
            self.nonce_c,
            self.role.as_bytes(),
            self.name.as_bytes(),
            self.host.as_bytes(),
            self.layout.as_bytes(),
            self.commands.as_bytes(),
        ]
    }

    /// Proof of the client that it has the key.
    pub fn of_client(&self, key: &Key) -> [u8; 32] {
        key.mac(&self.fields(b"c1")).finalize().into_bytes().into()
    }

    /// Whether `mac` is the client's proof.
    pub fn is_client(&self, key: &Key, mac: &[u8; 32]) -> bool {
        key.mac(&self.fields(b"c1")).verify_slice(mac).is_ok()
    }

    /// Proof of the server that it has the key.
    pub fn of_server(&self, key: &Key, session: &str) -> [u8; 32] {
        let fields = [&self.fields(b"s1")[..], &[session.as_bytes()]].concat();
        key.mac(&fields).finalize().into_bytes().into()
    }

    /// Whether `mac` is the server's proof.
    pub fn is_server(&self, key: &Key, session: &str, mac: &[u8; 32]) -> bool {
        let fields = [&self.fields(b"s1")[..], &[session.as_bytes()]].concat();
        key.mac(&fields).verify_slice(mac).is_ok()
    }

    /// The key of the session.
    pub fn session_key(&self, key: &Key) -> Key {
        let fields: [&[u8]; 3] = [b"k1", self.nonce_s, self.nonce_c];
        Key(key.mac(&fields).finalize().into_bytes().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: [u8; 32] = [7; 32];

    fn transcript<'a>(name: &'a str, host: &'a str) -> Transcript<'a> {
        Transcript {
            nonce_s: &[1; 32],
            nonce_c: &[2; 32],
            role: "control",
            name,
            host,
            layout: "a",
            commands: "b",
        }
    }

    #[test]
    fn every_field_counts_and_none_runs_into_the_next() {
        let key = Key::new(KEY);
        let whole = transcript("ab", "c");
        let mac = whole.of_client(&key);
        assert!(whole.is_client(&key, &mac));
        assert!(!transcript("a", "bc").is_client(&key, &mac));
        assert!(!whole.is_client(&Key::new([8; 32]), &mac));
        let server = whole.of_server(&key, "s");
        assert!(whole.is_server(&key, "s", &server));
        assert!(!whole.is_server(&key, "t", &server));
        assert_ne!(mac, server);
    }

    #[test]
    fn a_frame_with_any_bit_flipped_does_not_open() {
        let key = transcript("ab", "c").session_key(&Key::new(KEY));
        let json = br#"{"n":1,"op":"stop"}"#;
        let mut frame = key.frame(json).to_vec();
        frame.extend_from_slice(json);
        assert_eq!(key.open(&frame), Some(&json[..]));
        for bit in 0..8 * frame.len() {
            frame[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(key.open(&frame), None, "bit {bit}");
            frame[bit / 8] ^= 1 << (bit % 8);
        }
        assert_eq!(key.open(&frame[..15]), None);
        assert_eq!(key.open(&[]), None);
    }

    #[test]
    fn a_key_is_not_shown() {
        assert_eq!(format!("{:?}", Key::new(KEY)), "Key(redacted)");
        assert!(Key::new(KEY).is(&KEY) && !Key::new(KEY).is(&[0; 32]));
    }
}
