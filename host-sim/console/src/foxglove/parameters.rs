//! The boards' parameters as viewers see them: as the robot's file stores them, and as this console
//! has written them since.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use wheeleg_config::NodeParams;
use wheeleg_protocol::Node;
use wheeleg_protocol::param::{Format, ParamInfo, params_at};

/// Name under which viewers look for the robot.
pub(crate) const DESCRIPTION: &str = "/robot_description";

/// A board and the number of its parameter.
pub(crate) type Place = (u8, u16);

#[derive(Debug, Clone, Copy)]
struct Parameter {
    place: Place,
    info: &'static ParamInfo,
    raw: i32,
}

/// All parameters, by name.
#[derive(Debug, Clone)]
pub(crate) struct Parameters {
    all: BTreeMap<String, Parameter>,
    urdf: String,
}

impl Parameters {
    /// Parameters of boards that a robot's file has set up.
    pub(crate) fn new(stored: &NodeParams, urdf: String) -> Self {
        let boards = Node::ALL.into_iter().flat_map(|node| {
            let board = node.number();
            let stored = stored.of(node);
            params_at(board).iter().map(move |info| {
                let set = stored.iter().find(|(id, _)| *id == info.id);
                let parameter = Parameter {
                    place: (board, info.id),
                    info,
                    raw: set.map_or(info.default, |(_, raw)| *raw),
                };
                (name(node, info), parameter)
            })
        });
        Self {
            all: boards.collect(),
            urdf,
        }
    }

    /// Those of `names` that there are, or all; each as the protocol has it.
    pub(crate) fn list(&self, names: &[String]) -> Vec<Value> {
        if names.is_empty() {
            let all = self.all.iter().map(|(name, p)| entry(name, p));
            return all.chain([self.description()]).collect();
        }
        let one = |name: &String| {
            let of_board = self.all.get(name).map(|p| entry(name, p));
            of_board.or_else(|| (name == DESCRIPTION).then(|| self.description()))
        };
        names.iter().filter_map(one).collect()
    }

    fn description(&self) -> Value {
        json!({ "name": DESCRIPTION, "value": self.urdf })
    }

    /// Which parameter has this name.
    pub(crate) fn place(&self, name: &str) -> Option<Place> {
        self.all.get(name).map(|p| p.place)
    }

    /// The raw number of a value, or what is wrong with it.
    pub(crate) fn raw(&self, name: &str, value: Option<&Value>) -> Result<i32, String> {
        let Some(Parameter { info, .. }) = self.all.get(name) else {
            return Err(format!("there is no parameter {name} that can be written"));
        };
        let raw = match (value, info.format) {
            (Some(Value::Bool(flag)), Format::Flag) => Some(f64::from(u8::from(*flag))),
            (Some(Value::Number(number)), _) => number
                .as_f64()
                .map(|x| (x * scale(info.format)).round())
                .filter(|raw| f64::from(info.min) <= *raw && *raw <= f64::from(info.max)),
            _ => None,
        };
        raw.map(|raw| raw as i32).ok_or_else(|| {
            let [min, max] = [info.min, info.max].map(|raw| f64::from(raw) / scale(info.format));
            format!(
                "{name}: allowed are numbers from {min} to {max} {}",
                info.unit
            )
        })
    }

    /// A parameter has another value; its name.
    pub(crate) fn written(&mut self, place: Place, raw: i32) -> Option<String> {
        let mut all = self.all.iter_mut();
        let (name, parameter) = all.find(|(_, p)| p.place == place)?;
        parameter.raw = raw;
        Some(name.clone())
    }
}

fn name(node: Node, info: &ParamInfo) -> String {
    let kind = if node.is_joint() { "joint" } else { "wheel" };
    format!("/{kind}/{}/{}", node.number(), info.name)
}

fn scale(format: Format) -> f64 {
    f64::from(1_u32 << format.fraction_bits())
}

fn entry(name: &str, parameter: &Parameter) -> Value {
    match parameter.info.format {
        Format::Flag => json!({ "name": name, "value": parameter.raw != 0 }),
        format => {
            let value = f64::from(parameter.raw) / scale(format);
            json!({ "name": name, "value": value, "type": "float64" })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::builtin;

    const GAIN: &str = "/joint/3/proportional";

    fn parameters() -> Parameters {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        Parameters::new(&robot.node, "<robot/>".to_owned())
    }

    #[test]
    fn every_board_has_its_whole_table() {
        let all = parameters().list(&[]);
        let boards = 6 * params_at(1).len() + 2 * params_at(7).len();
        assert_eq!(all.len(), boards + 1);
        assert_eq!(
            all[boards],
            json!({ "name": DESCRIPTION, "value": "<robot/>" })
        );
    }

    #[test]
    fn values_go_through_the_format_of_the_wire_and_back() {
        let mut parameters = parameters();
        let raw = parameters.raw(GAIN, Some(&json!(0.03))).expect("allowed");
        // I8F24.
        assert_eq!(raw, (0.03 * f64::from(1 << 24)).round() as i32);
        let place = parameters.place(GAIN).expect("there");
        assert_eq!(parameters.written(place, raw).as_deref(), Some(GAIN));
        let told = &parameters.list(&[GAIN.to_owned()])[0];
        let value = told["value"].as_f64().expect("a number");
        assert!((value - 0.03).abs() < 1e-7, "{told}");
    }

    #[test]
    fn what_a_board_does_not_allow_is_refused_with_the_range() {
        let parameters = parameters();
        for value in [
            json!(-0.001),
            json!(4.001),
            json!("1"),
            json!([1]),
            json!(true),
        ] {
            let why = parameters.raw(GAIN, Some(&value)).expect_err("refused");
            assert!(why.contains("0 to 4 1/mm"), "{value}: {why}");
        }
        assert!(parameters.raw(GAIN, None).is_err());
        for name in ["/joint/9/proportional", DESCRIPTION, ""] {
            assert!(parameters.raw(name, Some(&json!(1))).is_err(), "{name}");
        }
    }
}
