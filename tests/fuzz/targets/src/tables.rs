//! Parquet tables of a campaign: names, texts and metadata survive a round trip; for changed bytes the reader
//! returns an error or a table and never panics.

use std::fs;
use std::path::{Path, PathBuf};

use wheeleg_campaign::{Column, Data, Kind, Table};

/// Longest text.
const LENGTH_MAX: usize = 16 * 1024;
/// Changes of one file.
const CHANGES: usize = 4;

/// A file of this thread of this process.
fn file() -> PathBuf {
    let thread = format!("{:?}", std::thread::current().id());
    let thread: String = thread.chars().filter(char::is_ascii_alphanumeric).collect();
    let process = std::process::id();
    std::env::temp_dir().join(format!("wheeleg-fuzz-tables-{process}-{thread}.parquet"))
}

fn written(path: &Path, table: &Table, facts: &[(&str, &str)]) {
    if path.exists() {
        fs::remove_file(path).expect("removed");
    }
    table.write_to(path, facts).expect("written");
}

/// A table that has the text as the name of a column, as unit, meaning and value.
fn table(text: &str) -> Table {
    let column = |name: String, kind| Column {
        name,
        kind,
        unit: text.to_owned(),
        meaning: text.to_owned(),
        min: None,
        max: Some(0.5),
        required: false,
    };
    let columns = vec![
        column("index".to_owned(), Kind::Whole),
        column(format!("x{text}"), Kind::Text),
        column(format!("y{text}"), Kind::Number),
        column(format!("z{text}"), Kind::Flag),
    ];
    let data = vec![
        Data::Whole(vec![Some(0), Some(i64::MIN), None]),
        Data::Text(vec![Some(text.to_owned()), None, Some(text.to_owned())]),
        Data::Number(vec![None, Some(-0.0), Some(1e300)]),
        Data::Flag(vec![Some(true), Some(false), None]),
    ];
    Table { columns, data }
}

/// First the number of changes, then a place and a byte for each; the rest is the text.
pub fn run(data: &[u8]) {
    let count = data
        .first()
        .map_or(0, |first| usize::from(*first) % (CHANGES + 1));
    let rest = data.get(1..).unwrap_or_default();
    let (changes, text) = rest.split_at((3 * count).min(rest.len()));
    let text = String::from_utf8_lossy(&text[..text.len().min(LENGTH_MAX)]);
    let path = file();
    let whole = table(&text);
    written(&path, &whole, &[("plan", &text), (&text, "named")]);
    let (read, facts) = Table::read_from(&path, &["plan", &text, "none"]).expect("a table");
    assert_eq!(read, whole);
    // A text may be the name of another fact.
    assert_eq!(facts[0].as_deref(), Some(&*text));
    assert!(facts[1].is_some() && (facts[2].is_none() || text == "none"));

    let mut bytes = fs::read(&path).expect("a file");
    for change in changes.chunks_exact(3) {
        // The footer, which holds most of the claims, is at the end.
        let place = usize::from(u16::from_le_bytes([change[0], change[1]]));
        let at = bytes.len() - 1 - place % bytes.len();
        bytes[at] = change[2];
    }
    if let Some(last) = changes
        .chunks_exact(3)
        .last()
        .filter(|change| change[2] % 8 == 0)
    {
        bytes.truncate(usize::from(u16::from_le_bytes([last[0], last[1]])));
    }
    fs::write(&path, bytes).expect("written");
    // An error, or another table.
    drop(Table::read_from(&path, &["plan"]));
    fs::remove_file(&path).expect("removed");
}
