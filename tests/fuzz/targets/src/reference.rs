//! A second decoder and encoder, written from `SPEC.md` §2 and sharing nothing
//! with the crate under test: whole stretches at once, the CRC bit by bit.

/// Longest decoded frame.
const LONGEST: usize = 197;

/// Why a stretch between two delimiters is no frame, as `SPEC.md` §2 numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// 1. More bytes than the longest frame.
    Overflow,
    /// 2. Ends inside a COBS block.
    Truncated,
    /// 3. Shorter than header and CRC.
    Short,
    /// 4. Wrong CRC.
    Crc,
    /// 5. Another protocol version.
    Version(u8),
    /// 6. Length field and payload differ.
    Length,
    /// 7. No such address.
    Address,
}

/// A sound frame: the first six header bytes and the payload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sound {
    /// Protocol version.
    pub version: u8,
    /// Message type.
    pub message_type: u8,
    /// Source address.
    pub source: u8,
    /// Destination address.
    pub destination: u8,
    /// Sequence.
    pub sequence: u16,
    /// Payload.
    pub payload: Vec<u8>,
}

/// CRC-32C, one bit at a time.
#[must_use]
pub fn crc32c(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ if crc & 1 == 1 { 0x82F6_3B78 } else { 0 };
        }
    }
    !crc
}

/// COBS with blocks of any number of bytes below 254, without delimiters.
#[must_use]
pub fn cobs(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() + 2);
    for block in bytes.split(|byte| *byte == 0) {
        // Longer blocks do not exist in a frame; garbage may hold anything.
        out.push(u8::try_from(block.len() + 1).unwrap_or(u8::MAX));
        out.extend_from_slice(block);
    }
    out
}

/// A frame on the line, both delimiters included; `crc_error` is xored to the CRC
/// and `length` replaces the length field.
#[must_use]
pub fn frame(sound: &Sound, length: Option<u16>, crc_error: u32) -> Vec<u8> {
    let length = length.unwrap_or(sound.payload.len() as u16);
    let mut body = vec![
        sound.version,
        sound.message_type,
        sound.source,
        sound.destination,
    ];
    body.extend(sound.sequence.to_le_bytes());
    body.extend(length.to_le_bytes());
    body.extend(&sound.payload);
    let crc = crc32c(&body) ^ crc_error;
    body.extend(crc.to_le_bytes());
    let mut line = vec![0];
    line.extend(cobs(&body));
    line.push(0);
    line
}

/// Everything that a stream holds up to its last delimiter.
#[must_use]
pub fn decode(stream: &[u8]) -> Vec<Result<Sound, Reason>> {
    let mut stretches: Vec<&[u8]> = stream.split(|byte| *byte == 0).collect();
    // Behind the last delimiter nothing is finished.
    stretches.pop();
    stretches
        .into_iter()
        .filter(|stretch| !stretch.is_empty())
        .map(stretch)
        .collect()
}

fn stretch(mut rest: &[u8]) -> Result<Sound, Reason> {
    let mut bytes = Vec::new();
    let mut truncated = false;
    let mut first = true;
    while let Some((code, tail)) = rest.split_first() {
        if !first {
            bytes.push(0);
        }
        first = false;
        let wanted = usize::from(*code) - 1;
        truncated = tail.len() < wanted;
        let (block, tail) = tail.split_at(wanted.min(tail.len()));
        bytes.extend_from_slice(block);
        rest = tail;
    }
    if bytes.len() > LONGEST {
        return Err(Reason::Overflow);
    }
    if truncated {
        return Err(Reason::Truncated);
    }
    check(&bytes)
}

fn check(bytes: &[u8]) -> Result<Sound, Reason> {
    if bytes.len() < 12 {
        return Err(Reason::Short);
    }
    let (body, crc) = bytes.split_at(bytes.len() - 4);
    if crc32c(body).to_le_bytes() != crc {
        return Err(Reason::Crc);
    }
    let payload = &body[8..];
    if body[0] != 1 && ![0x10, 0x81, 0x82].contains(&body[1]) {
        return Err(Reason::Version(body[0]));
    }
    if usize::from(u16::from_le_bytes([body[6], body[7]])) != payload.len() {
        return Err(Reason::Length);
    }
    if !matches!(body[2], 0..=8) || !matches!(body[3], 0..=8 | 255) {
        return Err(Reason::Address);
    }
    Ok(Sound {
        version: body[0],
        message_type: body[1],
        source: body[2],
        destination: body[3],
        sequence: u16::from_le_bytes([body[4], body[5]]),
        payload: payload.to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_and_an_example_of_the_specification() {
        assert_eq!(crc32c(b"123456789"), 0xE306_9283);
        let disarm = Sound {
            version: 1,
            message_type: 0x12,
            source: 0,
            destination: 2,
            sequence: 43_415,
            payload: Vec::new(),
        };
        let line = [
            0x00, 0x03, 0x01, 0x12, 0x04, 0x02, 0x97, 0xA9, 0x01, 0x05, 0xE7, 0x53, 0xDC, 0xAC,
            0x00,
        ];
        assert_eq!(frame(&disarm, None, 0), line);
        assert_eq!(decode(&line), [Ok(disarm)]);
    }
}
