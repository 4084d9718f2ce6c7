//! `wheeleg figures`: everything that is promised is written, and nothing that was there is lost.

use crate::program;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

fn figures(out: &Path) -> Value {
    let assert = Command::new(program::path())
        .env("NO_COLOR", "1")
        .args(["figures", "--json", "--out"])
        .arg(out)
        .assert()
        .success();
    serde_json::from_slice(&assert.get_output().stdout).expect("JSON")
}

#[test]
fn page_pictures_and_tables_are_written_and_earlier_ones_kept() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let out = dir.path().join("figures");
    fs::create_dir_all(&out).expect("created");
    fs::write(out.join("report.html"), "earlier").expect("written");
    let json = figures(&out);
    crate::schema::assert_valid(&json, "figures");
    let kept = fs::read_to_string(out.join("previous/report.html")).expect("kept");
    assert_eq!(kept, "earlier");

    let page = fs::read_to_string(out.join("report.html")).expect("page");
    // The main figure comes before any table, and once.
    let (figure, table) = (page.find("<figure"), page.find("<table"));
    assert!(figure.is_some() && figure < table, "{figure:?} {table:?}");
    assert_eq!(page.matches("id=\"fig5-argument\"").count(), 1);
    let links = page.replace("http://www.w3.org/2000/svg", "");
    for forbidden in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!links.contains(forbidden), "{forbidden}");
    }
    let mut ids = vec!["fig9".to_owned()];
    for number in 5..=8 {
        ids.extend(["argument", "literal"].map(|r| format!("fig{number}-{r}")));
    }
    ids.extend(["forward", "inverse"].map(|d| format!("precision-{d}")));
    for id in &ids {
        let svg = fs::read_to_string(out.join(format!("figures/{id}.svg"))).expect("SVG");
        assert!(svg.starts_with("<svg") && svg.len() > 3_000, "{id}");
        assert!(page.contains(&format!("id=\"{id}\"")), "{id}");
    }
    for (table, lines) in [
        ("fig5-8-argument", 2002),
        ("fig5-8-literal", 2002),
        ("fig9", 2002),
        ("axes", 22),
        ("single-precision", 181 * 181 + 1),
    ] {
        let text = fs::read_to_string(out.join(format!("csv/{table}.csv"))).expect("table");
        assert_eq!(text.lines().count(), lines, "{table}");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{table}");
    }

    // The argument reading fits all ten axes, the literal one does not (MODEL.md §6.1).
    let axes = json["axes"].as_array().expect("a list");
    let fitting = |reading: &str| {
        let rows = axes.iter().filter(|a| a["reading"] == reading);
        rows.filter(|a| a["fits"] == true).count()
    };
    assert_eq!(fitting("argument"), 10);
    assert!((1..10).contains(&fitting("literal")));
    assert_eq!(fitting("model"), 1);

    // Single precision: below 0.02 mm everywhere, and not the same thing compared with itself.
    for key in ["worst_forward_m", "worst_inverse_m"] {
        let worst = json["single_precision"][key].as_f64().expect("a number");
        assert!(worst > 0.0 && worst < 0.02e-3, "{key}: {worst}");
    }
    assert_eq!(json["single_precision"]["poses"], 181 * 181 * 19);

    let misprints = json["misprints"].as_array().expect("a list");
    for equation in [
        "5", "9", "11", "13", "14", "15", "16", "21", "27", "28", "31", "32", "34", "35", "36",
        "37", "38", "39", "55", "58", "61", "64",
    ] {
        assert!(
            misprints.iter().any(|m| m["equation"] == equation),
            "({equation})"
        );
        assert!(
            page.contains(&format!("<td class=\"id\">{equation}</td>")),
            "({equation})"
        );
    }
}
