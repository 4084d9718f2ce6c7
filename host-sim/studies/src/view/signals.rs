//! Signals of a log that are shown, and their panels.

use wheeleg_report::plot::Colour;
use wheeleg_report::plot::colour::{COMMAND, DELAYED, MODEL, RAW, ROBOT, SECOND};
use wheeleg_telemetry::{FieldType, channels};

use crate::StudyError;

/// A signal: channel and field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Signal {
    /// Index of the channel.
    pub(super) channel: usize,
    /// Name of the field.
    pub(super) field: &'static str,
}

/// A curve of a panel.
pub(super) struct Curve {
    pub(super) signal: Signal,
    pub(super) label: String,
    pub(super) colour: Colour,
    /// The same for a compared log.
    pub(super) other: Colour,
}

/// A panel.
pub(super) struct Plot {
    pub(super) title: String,
    pub(super) unit: &'static str,
    pub(super) curves: Vec<Curve>,
    /// Smallest range of its axis.
    pub(super) least: (f64, f64),
}

/// Panels under one heading.
pub(super) struct Group {
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    pub(super) caption: &'static str,
    pub(super) plots: Vec<Plot>,
}

/// Joints 1 to 6 by their names in events, and their places.
pub(super) const JOINTS: [&str; 6] = [
    "Joint 1 (left yaw)",
    "Joint 2 (left horizontal)",
    "Joint 3 (left vertical)",
    "Joint 4 (right yaw)",
    "Joint 5 (right horizontal)",
    "Joint 6 (right vertical)",
];
const SIDES: [&str; 2] = ["Left", "Right"];

/// A channel by its topic; all topics named here exist.
fn channel(topic: &str) -> usize {
    let place = channels().iter().position(|c| c.topic == topic);
    place.unwrap_or_default()
}

pub(super) fn signal(topic: &str, field: &'static str) -> Signal {
    Signal {
        channel: channel(topic),
        field,
    }
}

pub(super) fn joint(joint: usize, field: &'static str) -> Signal {
    signal(&format!("/joint/{}", joint + 1), field)
}

/// The feet, left and right.
pub(super) fn foot(side: usize, field: &'static str) -> Signal {
    signal(["/foot/left", "/foot/right"][side], field)
}

/// Signals of the robot's picture in addition to those of the panels.
pub(super) fn pictured() -> Vec<Signal> {
    let feet = (0..2).map(|side| foot(side, "switches"));
    let master = ["phase", "step"].map(|field| signal("/master", field));
    feet.chain(master).collect()
}

fn plot(title: String, unit: &'static str, least: (f64, f64), curves: Vec<Curve>) -> Plot {
    Plot {
        title,
        unit,
        curves,
        least,
    }
}

fn curve(signal: Signal, label: &str, colour: Colour, other: Colour) -> Curve {
    Curve {
        signal,
        label: label.to_owned(),
        colour,
        other,
    }
}

fn one(title: &str, unit: &'static str, least: (f64, f64), signal: Signal) -> Plot {
    let curves = vec![curve(signal, "", ROBOT, MODEL)];
    plot(title.to_owned(), unit, least, curves)
}

/// Panels of every log.
pub(super) fn groups() -> Vec<Group> {
    let strokes = JOINTS.iter().enumerate().map(|(i, name)| {
        let asked = curve(joint(i, "commanded_mm"), "asked", COMMAND, DELAYED);
        let sensed = curve(joint(i, "sensed_mm"), "sensed", ROBOT, MODEL);
        plot((*name).to_owned(), "mm", (0.0, 180.0), vec![asked, sensed])
    });
    let pressures = JOINTS.iter().enumerate().map(|(i, name)| {
        let a = curve(joint(i, "pressure_a_bar"), "A, extends", ROBOT, MODEL);
        let b = curve(joint(i, "pressure_b_bar"), "B, retracts", SECOND, RAW);
        plot((*name).to_owned(), "bar, absolute", (1.0, 7.0), vec![a, b])
    });
    let loads = SIDES.iter().enumerate().map(|(i, side)| {
        let load = foot(i, "normal_force_n");
        one(&format!("{side} foot, load"), "N", (0.0, 50.0), load)
    });
    let wheels = SIDES.iter().enumerate().map(|(i, side)| {
        let speed = signal(["/wheel/7", "/wheel/8"][i], "velocity_mm_s");
        one(
            &format!("{side} wheel, speed at the rim"),
            "mm/s",
            (-10.0, 10.0),
            speed,
        )
    });
    let body = [
        ("Travelled", "mm", (0.0, 10.0), "x_mm"),
        ("Pitch, nose up", "deg", (-1.0, 1.0), "pitch_deg"),
        ("Roll, right side down", "deg", (-1.0, 1.0), "roll_deg"),
    ];
    let body =
        body.map(|(title, unit, least, field)| one(title, unit, least, signal("/body", field)));
    let air = signal("/supply", "pressure_bar");
    vec![
        Group {
            id: "strokes",
            title: "Strokes: commanded by the master and measured by the boards",
            caption: "A drag across a plot zooms all of them; a double click shows everything again.",
            plots: strokes.collect(),
        },
        Group {
            id: "pressures",
            title: "Pressures in the chambers",
            caption: "Of the simulated plant; a real robot does not measure them.",
            plots: pressures.collect(),
        },
        Group {
            id: "ground",
            title: "Feet and wheels on the ground",
            caption: "Of the simulated plant.",
            plots: loads.chain(wheels).collect(),
        },
        Group {
            id: "chassis",
            title: "Chassis and air",
            caption: "Of the simulated plant.",
            plots: body
                .into_iter()
                .chain([one("Air in the supply, absolute", "bar", (1.0, 7.0), air)])
                .collect(),
        },
    ]
}

/// Panels of signals requested by name, `/joint/3.force_net_n`.
///
/// # Errors
/// [`StudyError::Refused`] if there is no such channel or field, or it has no numbers.
pub(super) fn asked(names: &[String]) -> Result<Option<Group>, StudyError> {
    let plots: Vec<Plot> = names
        .iter()
        .map(|name| named(name))
        .collect::<Result<_, _>>()?;
    Ok((!plots.is_empty()).then_some(Group {
        id: "asked",
        title: "Signals that were asked for",
        caption: "",
        plots,
    }))
}

fn named(name: &str) -> Result<Plot, StudyError> {
    let help = "write CHANNEL.FIELD, such as /joint/3.force_net_n; `wheeleg channels` lists both";
    let refused = |what: String| StudyError::refused(what, help);
    let (topic, field) = name
        .split_once('.')
        .ok_or_else(|| refused(format!("`{name}` is not a signal")))?;
    let place = channels().iter().position(|c| c.topic == topic);
    let place = place.ok_or_else(|| refused(format!("there is no channel `{topic}`")))?;
    let channel = &channels()[place];
    let found = channel.fields.iter().find(|f| f.name == field);
    let found = found.ok_or_else(|| refused(format!("{topic} has no field `{field}`")))?;
    if found.ty == FieldType::Text {
        return Err(refused(format!("`{name}` has no numbers: it is a text")));
    }
    let signal = Signal {
        channel: place,
        field: found.name,
    };
    Ok(one(name, found.unit, (0.0, 0.0), signal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cause::capital;
    use wheeleg_protocol::Address;
    use wheeleg_telemetry::placed;

    #[test]
    fn every_signal_exists_and_has_numbers() {
        let groups = groups();
        let curves = groups.iter().flat_map(|g| &g.plots).flat_map(|p| &p.curves);
        let signals = curves.map(|curve| curve.signal).chain(pictured());
        for Signal { channel, field } in signals {
            let found = channels()[channel].fields.iter().find(|f| f.name == field);
            let found = found.unwrap_or_else(|| panic!("{field}"));
            assert_ne!(found.ty, FieldType::Text);
        }
        assert_eq!(
            channels()[signal("/supply", "pressure_bar").channel].topic,
            "/supply"
        );
    }

    #[test]
    fn joints_are_named_as_everywhere_else() {
        for (address, name) in (1..).zip(JOINTS) {
            let board = Address::new(address).expect("a joint");
            assert_eq!(name, capital(&placed(board)));
        }
    }

    #[test]
    fn a_signal_that_is_asked_for_must_exist() {
        let one = asked(&["/joint/3.force_net_n".to_owned()]).expect("there");
        let plot = &one.expect("a group").plots[0];
        assert_eq!(
            (plot.unit, plot.curves[0].signal),
            ("N", joint(2, "force_net_n"))
        );
        assert!(asked(&[]).expect("none").is_none());
        for (name, word) in [
            ("force", "not a signal"),
            ("/joint/9.force", "/joint/9"),
            ("/joint/3.speed", "no field `speed`"),
            ("/events.text", "text"),
        ] {
            let told = asked(&[name.to_owned()])
                .err()
                .expect("refused")
                .to_string();
            assert!(told.contains(word), "{told}");
        }
    }
}
