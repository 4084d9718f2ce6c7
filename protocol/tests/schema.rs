//! The schema hash changes with every change of the meaning of bytes.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use wheeleg_protocol::param::{
    Format, JOINT_PARAMS, JointParam, ParamInfo, WHEEL_PARAMS, WheelParam, lookup,
};
use wheeleg_protocol::{
    Address, BoardKind, EnumSchema, FAULTS, Fault, FaultBits, FaultClass, FaultSchema, INTERFACE,
    Interface, LIMITS, Limit, LimitBits, MESSAGES, MessageType, NackReason, SCHEMA_HASH,
    ValueSchema, Warning,
};

fn text() -> String {
    let mut out = String::new();
    INTERFACE.write_text(&mut out).expect("a string takes all");
    out
}

fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01B3)
    })
}

#[test]
fn the_hash_is_fnv_1a_of_the_text() {
    // Published check values of FNV-1a.
    assert_eq!(fnv(b""), 0xCBF2_9CE4_8422_2325);
    assert_eq!(fnv(b"foobar"), 0x8594_4171_F739_67E8);
    assert_eq!(fnv(text().as_bytes()), SCHEMA_HASH);
}

/// The archive shows people the definition behind a hash: one file for each definition, and their order in
/// `ORDER`, oldest first. With `UPDATE_SPEC` the definition of this build is added to it.
#[test]
fn the_archive_has_this_interface_and_every_file_has_the_hash_of_its_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("interfaces");
    let order = folder.join("ORDER");
    let listed = || fs::read_to_string(&order).expect("ORDER");
    let own = format!("{SCHEMA_HASH:016x}");
    if std::env::var_os("UPDATE_SPEC").is_some() && !listed().lines().any(|line| line == own) {
        fs::write(folder.join(format!("{own}.txt")), text()).expect("the folder is writable");
        fs::write(&order, format!("{}{own}\n", listed())).expect("ORDER is writable");
    }
    let listed = listed();
    let listed: Vec<&str> = listed.lines().collect();
    assert!(
        listed.contains(&own.as_str()),
        "{own} is not in protocol/interfaces: \
         UPDATE_SPEC=1 cargo test -p wheeleg-protocol --test schema"
    );
    let mut files = BTreeSet::new();
    for entry in fs::read_dir(&folder).expect("the folder") {
        let path = entry.expect("an entry").path();
        if path == order {
            continue;
        }
        let name = path.file_name().expect("a name").to_string_lossy();
        let hash = fnv(&fs::read(&path).expect("a file"));
        assert_eq!(name, format!("{hash:016x}.txt"), "{}", path.display());
        files.insert(format!("{hash:016x}"));
    }
    let set: BTreeSet<String> = listed.iter().map(|line| (*line).to_owned()).collect();
    assert_eq!(set, files, "ORDER and the files");
    assert_eq!(listed.len(), set.len(), "ORDER names one twice");
}

#[test]
fn the_text_names_formats_and_units() {
    let text = text();
    for part in [
        "field position_raw i32 4 joint: stroke, I16F16 mm",
        "field next_reference i16 2 joint: stroke, I10F6 mm",
        "parameter 257 proportional 1/mm I8F24 0 67108864 335544",
        "fault 32 4 SensorRange",
        "value 13 FaultLatched",
        "timing turnaround_us 120",
    ] {
        assert!(text.contains(part), "{part}");
    }
}

#[test]
fn every_field_of_every_message_counts() {
    let mut hashes = vec![SCHEMA_HASH];
    let mut messages = MESSAGES.to_vec();
    let mut note = |interface: Interface<'_>, what: &str| {
        let hash = interface.hash();
        assert!(!hashes.contains(&hash), "{what} does not change the hash");
        hashes.push(hash);
    };
    for index in 0..messages.len() {
        let original = messages[index];
        for field in 0..original.fields.len() {
            let mut fields = original.fields.to_vec();
            // A Q-format in place of another, everything else the same.
            fields[field].format = "I15F17 mm";
            let leaked: &'static [_] = Box::leak(fields.clone().into_boxed_slice());
            messages[index].fields = leaked;
            note(
                Interface {
                    messages: &messages,
                    ..INTERFACE
                },
                "a format",
            );
            fields[field] = original.fields[field];
            fields[field].name = "other";
            messages[index].fields = Box::leak(fields.clone().into_boxed_slice());
            note(
                Interface {
                    messages: &messages,
                    ..INTERFACE
                },
                "a name",
            );
            fields[field] = original.fields[field];
            fields[field].ty = "i24";
            messages[index].fields = Box::leak(fields.into_boxed_slice());
            note(
                Interface {
                    messages: &messages,
                    ..INTERFACE
                },
                "a type",
            );
        }
        messages[index] = original;
        messages[index].id ^= 0x08;
        note(
            Interface {
                messages: &messages,
                ..INTERFACE
            },
            "a message number",
        );
        messages[index] = original;
    }
    note(
        Interface {
            version: INTERFACE.version + 1,
            ..INTERFACE
        },
        "the version",
    );
    note(
        Interface {
            slot: &INTERFACE.slot[1..],
            ..INTERFACE
        },
        "the slot",
    );
}

#[test]
fn every_table_row_counts() {
    let mut hashes = vec![SCHEMA_HASH];
    let mut note = |interface: Interface<'_>, what: &str| {
        let hash = interface.hash();
        assert!(!hashes.contains(&hash), "{what} does not change the hash");
        hashes.push(hash);
    };
    type Change = fn(&mut ParamInfo);
    let changes: [(&str, Change); 6] = [
        ("number", |row| row.id += 0x400),
        ("unit", |row| row.unit = "inch"),
        ("format", |row| {
            row.format = if row.format == Format::I16F16 {
                Format::I2F30
            } else {
                Format::I16F16
            };
        }),
        ("min", |row| row.min -= 1),
        ("max", |row| row.max = row.max.wrapping_add(1)),
        ("default", |row| row.default += 1),
    ];
    for (what, change) in changes {
        for index in 0..JOINT_PARAMS.len() {
            let mut rows = JOINT_PARAMS.to_vec();
            change(&mut rows[index]);
            note(
                Interface {
                    parameters: &[&rows, WHEEL_PARAMS],
                    ..INTERFACE
                },
                what,
            );
        }
    }
    for index in 0..FAULTS.len() {
        let mut rows: Vec<FaultSchema> = FAULTS.to_vec();
        rows[index].bit ^= 1;
        note(
            Interface {
                faults: &rows,
                ..INTERFACE
            },
            "a fault bit",
        );
    }
    for index in 0..INTERFACE.enums.len() {
        let mut sets: Vec<EnumSchema> = INTERFACE.enums.to_vec();
        let mut values: Vec<ValueSchema> = sets[index].values.to_vec();
        values[0].value ^= 0x40;
        sets[index].values = Box::leak(values.into_boxed_slice());
        note(
            Interface {
                enums: &sets,
                ..INTERFACE
            },
            "an enumeration value",
        );
    }
}

#[test]
fn sentences_for_people_do_not_count() {
    let mut rows = FAULTS.to_vec();
    rows[0].sentence = "Another wording.";
    assert_eq!(
        Interface {
            faults: &rows,
            ..INTERFACE
        }
        .hash(),
        SCHEMA_HASH
    );
}

/// Every enumeration that a message uses is part of the definition.
#[test]
fn no_field_type_is_missing_from_the_definition() {
    let plain = [
        "u8",
        "u16",
        "u32",
        "u64",
        "i16",
        "i32",
        "Address",
        "FaultBits",
        "FaultCode",
        "LimitBits",
        "Count24",
        "Speed7",
        "Acceleration8p8",
        "SyncSlots",
        "[u8; 3]",
        "[u8; 12]",
        "[u8; 32]",
    ];
    for message in MESSAGES {
        for field in message.fields {
            assert!(
                plain.contains(&field.ty) || INTERFACE.enums.iter().any(|set| set.name == field.ty),
                "{} of {}",
                field.ty,
                message.name
            );
        }
    }
}

#[test]
fn fault_numbers_keep_to_their_ranges_and_bits_are_unique() {
    let (mut bits, mut limit_bits) = (0_u16, 0_u8);
    for (index, fault) in Fault::ALL.iter().enumerate() {
        assert_eq!(FaultClass::of(fault.code()), Some(fault.class()));
        assert_eq!(Fault::from_code(fault.code()), Some(*fault));
        assert_eq!(FAULTS[index].code, fault.code());
        assert_eq!(
            bits & fault.mask().raw(),
            0,
            "{} shares a bit",
            fault.name()
        );
        bits |= fault.mask().raw();
        assert_eq!(fault.mask().raw(), 1 << fault.bit());
    }
    for limit in Limit::ALL {
        assert_eq!(FaultClass::of(limit.code()), Some(FaultClass::Limit));
        assert_eq!(limit_bits & limit.mask().raw(), 0);
        limit_bits |= limit.mask().raw();
    }
    assert_eq!((bits, limit_bits), (u16::MAX, u8::MAX));
    assert!(
        FAULTS
            .windows(2)
            .chain(LIMITS.windows(2))
            .all(|pair| pair[0].code < pair[1].code)
    );
    for warning in Warning::ALL {
        assert_eq!(FaultClass::of(warning.code()), Some(FaultClass::Warning));
        assert_eq!(Warning::from_code(warning.code()), Some(*warning));
        assert!(Fault::from_code(warning.code()).is_none());
    }
    for code in [0, 4, 31, 45, 95, 128, 255] {
        assert_eq!(Fault::from_code(code), None);
    }
    assert_eq!(FaultClass::of(0), None);
    assert_eq!(FaultClass::of(160), None);
}

/// Numbers on the wire never change: these are the ones used so far.
#[test]
fn permanent_numbers_stay() {
    let faults: Vec<u8> = Fault::ALL.iter().map(|fault| fault.code()).collect();
    assert_eq!(
        faults,
        // 4 meant what Nack now reports as VersionMismatch, and is not reused.
        [1, 2, 3, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 44]
    );
    assert_eq!(
        (
            Fault::LinkLost.code(),
            Fault::SensorRange.code(),
            Fault::DuplicateAddress.code()
        ),
        (1, 32, 43)
    );
    assert_eq!(
        (
            MessageType::Sync.code(),
            MessageType::Arm.code(),
            MessageType::Nack.code()
        ),
        (1, 0x11, 0x81)
    );
    assert_eq!(
        (
            NackReason::UnknownMessage.code(),
            NackReason::FaultLatched.code()
        ),
        (1, 13)
    );
    assert_eq!(
        (JointParam::Proportional.id(), WheelParam::FilterZero.id()),
        (0x101, 0x201)
    );
}

#[test]
fn every_text_is_a_sentence_with_a_remedy() {
    let sentence = |text: &str| {
        text.len() > 8 && text.ends_with('.') && text.starts_with(|c: char| c.is_uppercase())
    };
    for row in FAULTS.iter().chain(LIMITS) {
        assert!(
            sentence(row.sentence) && sentence(row.remedy),
            "{}",
            row.name
        );
    }
    for reason in NackReason::ALL {
        assert!(sentence(reason.text()), "{}", reason.name());
    }
}

#[test]
fn sets_do_what_sets_do() {
    let mut set = FaultBits::NONE.with(Fault::OverTravel);
    set.insert(Fault::LinkLost);
    assert_eq!(set.raw(), 1 | 1 << 12);
    assert_eq!(
        set.iter().collect::<Vec<_>>(),
        [Fault::LinkLost, Fault::OverTravel]
    );
    assert!(set.contains(Fault::LinkLost) && !set.contains(Fault::StaleMaster));
    assert_eq!(
        set.without(Fault::LinkLost),
        FaultBits::from(Fault::OverTravel)
    );
    assert!(
        set.without(Fault::LinkLost)
            .without(Fault::OverTravel)
            .is_empty()
    );
    assert_eq!(LimitBits::from_raw(3).iter().count(), 2);
}

#[test]
fn parameters_are_found_and_limited() {
    for (board, table) in [
        (BoardKind::Joint, JOINT_PARAMS),
        (BoardKind::Wheel, WHEEL_PARAMS),
    ] {
        for row in table {
            assert_eq!(lookup(board, row.id), Some(row));
            assert_eq!(row.board, board);
            assert!(row.permits(row.min) && row.permits(row.max) && row.permits(row.default));
            assert!(row.min.checked_sub(1).is_none_or(|raw| !row.permits(raw)));
            assert!(row.max.checked_add(1).is_none_or(|raw| !row.permits(raw)));
        }
    }
    assert_eq!(lookup(BoardKind::Joint, WheelParam::FilterZero.id()), None);
    assert_eq!(lookup(BoardKind::Wheel, 0), None);
    for (index, param) in JointParam::ALL.iter().enumerate() {
        assert_eq!((param.index(), param.info().id), (index, param.id()));
    }
    // The watchdog can be lengthened to 10 cycles and not switched off.
    for row in [
        JointParam::WatchdogCycles.info(),
        WheelParam::WatchdogCycles.info(),
    ] {
        assert_eq!((row.min, row.default, row.max), (1, 5, 10));
    }
}

#[test]
fn bounds_convert_like_the_nearest_number() {
    assert_eq!(Format::I16F16.parse("0.8"), Some(52_429));
    assert_eq!(Format::I16F16.parse("-5"), Some(-327_680));
    assert_eq!(Format::I8F24.parse("0.02"), Some(335_544));
    assert_eq!(Format::I2F30.parse("1"), Some(1 << 30));
    assert_eq!(
        Format::Integer.parse("-0.5"),
        Some(-1),
        "ties away from zero"
    );
    assert_eq!(Format::Integer.parse("0.49"), Some(0));
    for bad in [
        "",
        "-",
        ".",
        "1e3",
        "1.2.3",
        "99999999999",
        "2147483648",
        " 1",
    ] {
        assert_eq!(Format::Integer.parse(bad), None, "{bad}");
    }
    assert_eq!(Format::I2F30.parse("2"), None, "does not fit");
}

#[test]
fn addresses_exist_or_do_not() {
    let existing: Vec<u8> = (0..=255)
        .filter(|raw| Address::new(*raw).is_some())
        .collect();
    assert_eq!(existing, [0, 1, 2, 3, 4, 5, 6, 7, 8, 255]);
    assert_eq!(Address::nodes().count(), 8);
    for (index, node) in Address::nodes().enumerate() {
        assert_eq!(
            (node.slot(), Address::of_slot(index)),
            (Some(index), Some(node))
        );
        assert_eq!(node.is_joint(), index < 6);
        assert_eq!(node.is_wheel(), index >= 6);
    }
    assert_eq!(Address::of_slot(8), None);
}

/// Boards whose slots begin at other times talk over each other.
#[test]
fn every_time_of_the_line_counts() {
    for index in 0..INTERFACE.timing.len() {
        let mut timing = INTERFACE.timing.to_vec();
        timing[index].1 += 1;
        let other = Interface {
            timing: &timing,
            ..INTERFACE
        };
        assert_ne!(other.hash(), SCHEMA_HASH, "{:?}", timing[index]);
    }
}
