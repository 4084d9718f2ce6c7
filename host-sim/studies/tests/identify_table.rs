//! Errors of a measurement's table: all of them at once, as types.

use wheeleg_config::AxisConfig;
use wheeleg_studies::StudyError;
use wheeleg_studies::identify::LabError;
use wheeleg_studies::identify::lab::Lab;

const HEAD: &str = "time_s,position_mm,fill_a,vent_a,fill_b,vent_b\n";

fn unread(text: &str) -> LabError {
    let axis = AxisConfig::load("bench-vq110u").expect("built in").axis;
    match Lab::parse("lab.csv", text, &axis, &[]) {
        Err(StudyError::Lab(error)) => error,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_empty_file_is_told_as_such() {
    for text in ["", "\n", "\u{feff}", " \r\n\t\n"] {
        let file = "lab.csv".to_owned();
        assert_eq!(unread(text), LabError::Empty { file }, "{text:?}");
    }
}

#[test]
fn all_wrong_values_of_a_table_are_told_at_once() {
    let rows = ["0,many,0,0,0,0", "0.001,40,2,0,0.5,0", "0.002,40,0,0"];
    let error = unread(&format!("{HEAD}{}\n", rows.join("\n")));
    let told = error.to_string();
    for words in [
        "lab.csv: 4 values wrong",
        "line 2, column `position_mm`: \"many\" is not a number",
        "line 3, column `fill_a`: 2 is outside 0 to 1",
        "line 3, column `fill_b`: 0.5 is not a whole number",
        "line 4, column `fill_b`: no value: the row has 4 values, and the table has 6 columns",
    ] {
        assert!(told.contains(words), "{told}");
    }
    let help = wheeleg_config::plain_text(&StudyError::from(error));
    assert_eq!(help.matches("a state is 0 or 1").count(), 1, "{help}");

    // One alone has a line of its own, and of many the first are listed.
    let one = unread(&format!("{HEAD}0,many,0,0,0,0\n")).to_string();
    assert_eq!(
        one,
        "lab.csv, line 2, column `position_mm`: \"many\" is not a number"
    );
    let many = unread(&format!("{HEAD}{}", "0,many,0,0,0,0\n".repeat(5000))).to_string();
    assert_eq!(many.lines().count(), 12, "{many}");
    assert!(many.ends_with("and 4990 more"), "{many}");
}
