//! Texts of users in what is written for others: tables, pages and the data in their scripts. Each
//! comes back as it was, but for what would act on a reader of a page, and is never markup.

use std::fs;
use std::sync::OnceLock;

use wheeleg_report::plain::acts;
use wheeleg_report::{json, page, table};

/// Longest text that is written; names and descriptions are shorter.
const LENGTH_MAX: usize = 2 * 1024;

/// A text as name of a column and in a cell, in a page and in a script.
pub(crate) fn check(text: &str) {
    let mut end = text.len().min(LENGTH_MAX);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let text = &text[..end];
    in_a_table(text);
    in_a_page(text);
    let data = json(&text);
    assert!(!data.contains('<'), "{data}");
    let read: String = serde_json::from_str(&data).expect("JSON");
    assert_eq!(read, text);
}

fn in_a_table(text: &str) {
    static FOLDER: OnceLock<std::path::PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let name = format!("wheeleg-fuzz-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        fs::create_dir_all(&folder).expect("created");
        folder
    });
    // Tests of one program may run at the same time.
    let name = format!("{:?}", std::thread::current().id());
    let name: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
    let rows = [vec!["1".to_owned(), text.to_owned()]];
    table(folder, &name, &["number", text], rows.into_iter()).expect("written");
    let path = folder.join(format!("{name}.csv"));
    let mut reader = csv::ReaderBuilder::new();
    let mut reader = reader.has_headers(false).from_path(&path).expect("a file");
    let read: Vec<Vec<String>> = reader
        .records()
        .map(|r| r.expect("a record").iter().map(str::to_owned).collect())
        .collect();
    assert_eq!(read, [["number", text], ["1", text]]);
    fs::remove_file(&path).expect("removed");
}

fn in_a_page(text: &str) {
    const TEMPLATE: &str = "<p title=\"{{ text }}\">{{ text }}</p>";
    let values = std::collections::BTreeMap::from([("text", text)]);
    let page = page(TEMPLATE, values).expect("a page");
    let inside = page
        .strip_prefix("<p title=\"")
        .and_then(|page| page.strip_suffix("</p>"));
    let (attribute, element) = inside
        .and_then(|inside| inside.split_once("\">"))
        .expect("no mark of the text ends the attribute");
    // Characters that act on a reader are removed.
    let taken_out = |c: char| acts(c) && !matches!(c, '\n' | '\t');
    let shown = text.replace(taken_out, "\u{fffd}");
    for part in [attribute, element] {
        assert!(!part.contains(['<', '>', '"', '\'']), "{part}");
        let mut read = part.to_owned();
        for (escaped, plain) in [
            ("&lt;", "<"),
            ("&gt;", ">"),
            ("&quot;", "\""),
            ("&#x27;", "'"),
            ("&#x2f;", "/"),
            ("&amp;", "&"),
        ] {
            read = read.replace(escaped, plain);
        }
        assert_eq!(read, shown);
    }
}
