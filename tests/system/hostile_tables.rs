//! Malicious or damaged Parquet files: an error or a table, never a panic, and no more memory than a file of
//! their size can hold.

use std::fs;
use std::path::{Path, PathBuf};
#[cfg(target_os = "linux")]
use std::process::Command;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use wheeleg_campaign::{Column, Data, Kind, Table};

#[cfg(target_os = "linux")]
use crate::program;

/// Memory that the program may have for its data, kB.
#[cfg(target_os = "linux")]
const MEMORY_KB: u64 = 64 * 1024;

fn column(name: &str, kind: Kind) -> Column {
    Column {
        name: name.to_owned(),
        kind,
        unit: String::new(),
        meaning: String::new(),
        min: None,
        max: None,
        required: false,
    }
}

/// A file with a column of texts that do not pack and one of numbers.
fn written(path: &Path, rows: u64) -> Table {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let texts = (0..rows).map(|_| Some(format!("{:032x}", rng.random::<u128>())));
    let table = Table {
        columns: vec![column("case", Kind::Text), column("figure", Kind::Number)],
        data: vec![
            Data::Text(texts.collect()),
            Data::Number((0..rows).map(|n| (n % 3 > 0).then_some(n as f64)).collect()),
        ],
    };
    let facts = [
        ("wheeleg.plan", "{\"plan\":\"no plan\"}"),
        ("wheeleg.program", "another"),
    ];
    table.write_to(path, &facts).expect("written");
    table
}

/// The same file with the size that its first page of more than a mebibyte claims to have unpacked.
fn claims(bytes: &[u8]) -> Vec<u8> {
    // Kind of the page, then the size as a number of four groups of seven bits.
    let at = bytes.windows(7).position(|b| {
        b[0] == 0x15
            && b[1] <= 0x06
            && b[2] == 0x15
            && b[3..6].iter().all(|b| b & 0x80 != 0)
            && b[6] < 0x80
    });
    let at = at.expect("a large page") + 3;
    let mut claims = bytes.to_vec();
    // 134 MB.
    claims[at..at + 4].copy_from_slice(&[0xfe, 0xff, 0xff, 0x7f]);
    claims
}

fn read(path: &Path) -> Result<Table, String> {
    let read = Table::read_from(path, &["wheeleg.plan"]);
    read.map(|(table, _)| table).map_err(|e| e.to_string())
}

#[test]
fn changed_bytes_are_an_error_or_a_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    let table = written(&path("sound"), 40);
    assert_eq!(read(&path("sound")), Ok(table));
    let sound = fs::read(path("sound")).expect("read");
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut refused = 0;
    for number in 0..3_000 {
        let mut bytes = sound.clone();
        match number % 4 {
            0 => bytes.truncate(rng.random_range(0..sound.len())),
            // Most of the claims are in the footer.
            1 => {
                let at = bytes.len() - 1 - rng.random_range(0..900);
                bytes[at] = rng.random();
            }
            2 => {
                let at = rng.random_range(0..bytes.len());
                bytes[at] ^= 1 << rng.random_range(0..8);
            }
            _ => {
                // A number that begins there goes on to its greatest.
                let at = rng.random_range(4..bytes.len() - 5);
                bytes[at..at + 5].copy_from_slice(&[0xff, 0xff, 0xff, 0xff, 0x0f]);
            }
        }
        fs::write(path("changed"), bytes).expect("written");
        refused += usize::from(read(&path("changed")).is_err());
    }
    println!("{refused} of 3000 refused");
    assert!(refused > 1_500, "{refused}");
}

#[test]
fn what_claims_more_than_it_holds_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    written(&path("sound"), 60_000);
    assert!(read(&path("sound")).is_ok());
    let sound = fs::read(path("sound")).expect("read");
    fs::write(path("page"), claims(&sound)).expect("written");
    let said = read(&path("page")).expect_err("refused");
    assert!(said.contains("claims more bytes"), "{said}");
    // More rows in one group than any program has written: the levels of all would be kept in memory.
    written(&path("most"), 131_071);
    assert!(read(&path("most")).is_ok());
    written(&path("rows"), 131_072);
    let said = read(&path("rows")).expect_err("refused");
    assert!(said.contains("claims more rows"), "{said}");
    // Very many columns, each of a few bytes.
    let kind = Kind::Flag;
    let many = Table {
        columns: (0..400).map(|n| column(&format!("c{n}"), kind)).collect(),
        data: vec![Data::Flag(vec![None; 60_000]); 400],
    };
    many.write_to(&path("cells"), &[]).expect("written");
    let said = read(&path("cells")).expect_err("refused");
    assert!(said.contains("claims more rows"), "{said}");
    // A text that all rows share.
    let long = Table {
        columns: vec![column("case", Kind::Text), column("figure", Kind::Number)],
        data: vec![
            Data::Text(vec![Some("x".repeat(1_000)); 50_000]),
            Data::Number((0..50_000).map(|n| Some(f64::from(n).sqrt())).collect()),
        ],
    };
    long.write_to(&path("long"), &[]).expect("written");
    let said = read(&path("long")).expect_err("refused");
    assert!(said.contains("texts"), "{said}");
}

/// The whole program, with little memory for its data.
#[cfg(target_os = "linux")]
#[test]
fn a_hostile_table_takes_no_memory_to_speak_of() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    written(&path("sound"), 60_000);
    let sound = fs::read(path("sound")).expect("read");
    fs::write(path("page.parquet"), claims(&sound)).expect("written");
    let mut footer = sound.clone();
    let length = footer.len();
    footer[length - 8..length - 4].copy_from_slice(&u32::MAX.to_le_bytes());
    fs::write(path("footer.parquet"), footer).expect("written");
    fs::write(path("cut.parquet"), &sound[..length / 2]).expect("written");
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let mut names = vec!["page".to_owned(), "footer".to_owned(), "cut".to_owned()];
    for number in 0..40 {
        let mut bytes = sound.clone();
        let at = length - 13 - rng.random_range(0..700);
        bytes[at..at + 5].copy_from_slice(&[0xff, 0xff, 0xff, 0xff, 0x0f]);
        fs::write(path(&format!("{number}.parquet")), bytes).expect("written");
        names.push(number.to_string());
    }
    for name in names {
        let shell = format!("ulimit -d {MEMORY_KB}; exec \"$0\" campaign report {name}.parquet");
        let output = Command::new("bash")
            .current_dir(folder.path())
            .args(["-c", &shell])
            .arg(program::path())
            .output()
            .expect("start");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{name}: {said}");
        assert!(said.contains(&format!("{name}.parquet")), "{name}: {said}");
    }
}
