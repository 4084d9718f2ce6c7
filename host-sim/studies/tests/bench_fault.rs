//! A replayed case on the bench in which the supervision latches a fault.

use wheeleg_config::AxisConfig;
use wheeleg_config::bench::{Air, Bench, Kind, Move, StartUp, Variation, Varied};
use wheeleg_studies::bench::{play, write};
use wheeleg_studies::study::Settings;

/// Seals that hold the piston against all of the supply.
#[test]
fn a_fault_is_told_with_its_time_meaning_and_remedy() {
    let sheet = AxisConfig::load("bench-vq110u").expect("built in").axis;
    let mut plant = sheet.clone();
    plant.cylinder.friction.coulomb_n = 400.0;
    plant.cylinder.friction.static_n = 400.0;
    plant.load_n = 12.5;
    let bench = Bench {
        axis: "bench-vq110u".to_owned(),
        sheet,
        plant,
        without_variation: Vec::new(),
        variation: Varied::Always(Variation::Nominal),
        load_share: 0.0,
        motion: Move::FirstStep,
        controller: Kind::Predictive,
        delays: StartUp::Sheet,
        air: Air::File,
    };
    let played = play(&bench, 1).expect("it plays");
    let folder = tempfile::tempdir().expect("a folder");
    let finished = write(&bench, 1, &played, &Settings::new(folder.path())).expect("written");
    let summary = finished.result;
    let [fault] = &summary.latched[..] else {
        panic!("{:?}", summary.latched);
    };
    assert_eq!(summary.faults, [fault.name]);
    assert_eq!(fault.recording, "measured-1");
    assert!(0.05 < fault.at_s && fault.at_s < 2.0, "{}", fault.at_s);
    let page = std::fs::read_to_string(folder.path().join("report.html")).expect("a page");
    let row = page.lines().find(|line| line.contains(fault.name));
    let row = row.unwrap_or_else(|| panic!("no line has {}", fault.name));
    let at = format!("the first move after power-up, {:.3} s", fault.at_s);
    for words in [at.as_str(), fault.meaning, fault.remedy] {
        assert!(row.contains(words), "{words}: {row}");
    }
    assert!(page.contains("fault latched"), "a mark in the figures");
    // The load in newtons.
    assert_eq!(summary.load_n, 12.5);
    assert!(page.contains("load: 0 of the force left, 12.5 N on the rod in all"));
}
