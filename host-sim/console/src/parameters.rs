//! The boards' parameters as clients see them: as stored in the robot's file, and as the boards have reported
//! them since.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};
use wheeleg_config::{NodeParams, allowed_values, in_unit, stored_raw};
use wheeleg_protocol::Node;
use wheeleg_protocol::param::{Format, JOINT_PARAMS, ParamInfo, WHEEL_PARAMS, params_at};

use wheeleg_access::arguments;

/// Name under which viewers look for the robot.
pub(crate) const DESCRIPTION: &str = "/robot_description";

/// A board and the number of its parameter.
pub(crate) type Place = (u8, u16);

#[derive(Debug, Clone)]
struct Parameter {
    place: Place,
    info: &'static ParamInfo,
    raw: i32,
    /// The board has reported it; otherwise it comes from the robot's file.
    told: bool,
    /// As in the viewers' protocol, JSON.
    shown: String,
}

/// All parameters, by name. Their texts are made once: a client that asks without end costs little time.
#[derive(Debug, Clone)]
pub(crate) struct Parameters {
    all: BTreeMap<String, Parameter>,
    /// Their places.
    places: BTreeSet<Place>,
    /// The robot's description, as a parameter of the viewers' protocol.
    description: String,
    /// [`Self::document`], until a board reports a value.
    document: OnceCell<String>,
}

impl Parameters {
    /// Parameters of boards, as set by a robot's file.
    pub(crate) fn new(stored: &NodeParams, urdf: String) -> Self {
        let boards = Node::ALL.into_iter().flat_map(|node| {
            let board = node.number();
            let stored = stored.of(node);
            params_at(board).iter().map(move |info| {
                let raw = stored_raw(info, stored);
                let name = name(node, info);
                let parameter = Parameter {
                    place: (board, info.id),
                    info,
                    raw,
                    told: false,
                    shown: shown(&name, info, raw),
                };
                (name, parameter)
            })
        });
        let all: BTreeMap<String, Parameter> = boards.collect();
        Self {
            places: all.values().map(|parameter| parameter.place).collect(),
            all,
            description: json!({ "name": DESCRIPTION, "value": urdf }).to_string(),
            document: OnceCell::new(),
        }
    }

    /// Tables of both kinds of boards, and the values of each board in the order of its table: JSON.
    pub(crate) fn document(&self) -> &str {
        self.document.get_or_init(|| self.tables().to_string())
    }

    fn tables(&self) -> Value {
        let boards = Node::ALL.into_iter().map(|node| {
            let values = params_at(node.number()).iter().map(|info| {
                let parameter = self.all.get(&name(node, info));
                parameter.map_or(
                    Value::Null,
                    |p| json!({ "value": in_unit(info, p.raw), "told": p.told }),
                )
            });
            json!({
                "address": node.number(),
                "kind": kind(node),
                "values": values.collect::<Vec<_>>(),
            })
        });
        json!({
            "joint": table(JOINT_PARAMS),
            "wheel": table(WHEEL_PARAMS),
            "boards": boards.collect::<Vec<_>>(),
        })
    }

    /// Those of `names` that exist, each once, or all: a JSON list as in the viewers' protocol.
    pub(crate) fn list(&self, names: &[String]) -> String {
        let texts: Vec<&str> = match names.is_empty() {
            true => self.shown().collect(),
            false => self.named(names).collect(),
        };
        format!("[{}]", texts.join(","))
    }

    /// Boards and numbers of all boards' parameters.
    pub(crate) fn places(&self) -> &BTreeSet<Place> {
        &self.places
    }

    /// Board and number of the parameter with this name, if a board has it.
    pub(crate) fn place(&self, name: &str) -> Option<Place> {
        self.all.get(name).map(|parameter| parameter.place)
    }

    /// Texts of all parameters.
    fn shown(&self) -> impl Iterator<Item = &str> {
        let of_boards = self.all.values().map(|parameter| &*parameter.shown);
        of_boards.chain([&*self.description])
    }

    /// Texts of those of `names` that exist, each once however often it is named: a short request must not
    /// have an endless answer.
    fn named(&self, names: &[String]) -> impl Iterator<Item = &str> {
        let once: BTreeSet<&str> = names.iter().map(String::as_str).collect();
        once.into_iter().filter_map(|name| {
            let of_board = self.all.get(name).map(|parameter| &*parameter.shown);
            of_board.or((name == DESCRIPTION).then_some(&*self.description))
        })
    }

    /// Arguments of the `WriteParameter` that sets a parameter, or the error in it.
    pub(crate) fn write(&self, name: &str, value: Option<&Value>) -> Result<Value, String> {
        let Some(Parameter { place, info, .. }) = self.all.get(name) else {
            return Err(format!("there is no parameter {name} that can be written"));
        };
        let value = value.filter(|value| arguments::raw(info, value).is_some());
        let value = value.ok_or_else(|| format!("{name}: allowed are {}", allowed_values(info)))?;
        Ok(json!({ "board": place.0, "parameter": info.name, "value": value }))
    }

    /// Takes the value of a parameter that a board has reported; returns its name.
    pub(crate) fn told(&mut self, place: Place, raw: i32) -> Option<String> {
        let mut all = self.all.iter_mut();
        let (name, parameter) = all.find(|(_, p)| p.place == place)?;
        parameter.raw = raw;
        parameter.told = true;
        parameter.shown = shown(name, parameter.info, raw);
        self.document.take();
        Some(name.clone())
    }
}

fn kind(node: Node) -> &'static str {
    if node.is_joint() { "joint" } else { "wheel" }
}

fn name(node: Node, info: &ParamInfo) -> String {
    format!("/{}/{}/{}", kind(node), node.number(), info.name)
}

fn table(rows: &[ParamInfo]) -> Vec<Value> {
    let row = |info: &ParamInfo| {
        json!({
            "name": info.name,
            "unit": info.unit,
            "min": in_unit(info, info.min),
            "max": in_unit(info, info.max),
            "default": in_unit(info, info.default),
            "whole": info.format.fraction_bits() == 0,
            "saved": info.persistent,
            "disarmed_only": info.disarmed_only,
            "description": info.text,
        })
    };
    rows.iter().map(row).collect()
}

fn shown(name: &str, info: &ParamInfo, raw: i32) -> String {
    let value = match info.format {
        Format::Flag => json!({ "name": name, "value": raw != 0 }),
        _ => json!({ "name": name, "value": in_unit(info, raw), "type": "float64" }),
    };
    value.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheeleg_config::{builtin, raw_of};

    const GAIN: &str = "/joint/3/proportional";

    fn json(text: &str) -> Value {
        serde_json::from_str(text).expect("JSON")
    }

    fn parameters() -> Parameters {
        let robot = builtin::robot("wheeleg-2003").expect("built in");
        Parameters::new(&robot.node, "<robot/>".to_owned())
    }

    #[test]
    fn every_board_has_its_whole_table() {
        let all = json(&parameters().list(&[]));
        let all = all.as_array().expect("a list");
        let boards = 6 * params_at(1).len() + 2 * params_at(7).len();
        assert_eq!(parameters().places().len(), boards);
        assert!(
            boards < crate::foxglove::ITEMS_MAX,
            "all can be named at once"
        );
        assert_eq!(all.len(), boards + 1);
        assert_eq!(
            all[boards],
            json!({ "name": DESCRIPTION, "value": "<robot/>" })
        );
        let document = json(parameters().document());
        for board in document["boards"].as_array().expect("a list") {
            let kind = board["kind"].as_str().expect("a text");
            let rows = document[kind].as_array().expect("a table");
            let values = board["values"].as_array().expect("a list");
            assert_eq!(rows.len(), values.len(), "{board}");
            for (row, value) in rows.iter().zip(values) {
                let number = |of: &Value| of.as_f64().expect("a number");
                let range = number(&row["min"])..=number(&row["max"]);
                assert!(range.contains(&number(&value["value"])), "{row} {value}");
                assert_eq!(value["told"], false);
            }
        }
    }

    #[test]
    fn what_a_board_has_told_is_shown_in_its_unit() {
        let mut parameters = parameters();
        // It was also requested before.
        assert_eq!(json(parameters.document())["boards"][2]["address"], 3);
        let info = params_at(3)
            .iter()
            .find(|row| row.name == "proportional")
            .expect("in the table");
        let told = parameters.told((3, info.id), raw_of(info, 0.03));
        assert_eq!(told.as_deref(), Some(GAIN));
        let listed = json(&parameters.list(&[GAIN.to_owned()]));
        assert_eq!(listed[0]["value"], 0.03);
        let place = params_at(3).iter().position(|row| row.name == info.name);
        let place = place.expect("in the table");
        let shown = &json(parameters.document())["boards"][2]["values"][place];
        assert_eq!(shown, &json!({ "value": 0.03, "told": true }));
        assert_eq!(parameters.told((3, 0xFFFF), 0), None);
    }

    #[test]
    fn what_is_named_often_is_told_once() {
        let parameters = parameters();
        let names = vec![DESCRIPTION.to_owned(); 1_300];
        let listed = json(&parameters.list(&names));
        assert_eq!(
            listed,
            json!([{ "name": DESCRIPTION, "value": "<robot/>" }])
        );
        let names = [GAIN, GAIN, "/nothing"].map(str::to_owned);
        let listed = json(&parameters.list(&names));
        assert_eq!(listed.as_array().expect("a list").len(), 1);
        assert_eq!(parameters.list(&["/nothing".to_owned()]), "[]");
    }

    #[test]
    fn what_a_board_does_not_allow_is_refused_with_the_range() {
        let parameters = parameters();
        let args = parameters.write(GAIN, Some(&json!(0.03))).expect("allowed");
        let wanted = json!({ "board": 3, "parameter": "proportional", "value": 0.03 });
        assert_eq!(args, wanted);
        for value in [
            json!(-0.001),
            json!(4.001),
            json!("1"),
            json!([1]),
            json!(true),
        ] {
            let why = parameters.write(GAIN, Some(&value)).expect_err("refused");
            assert!(why.contains("0 to 4 1/mm"), "{value}: {why}");
        }
        assert!(parameters.write(GAIN, None).is_err());
        for name in ["/joint/9/proportional", DESCRIPTION, ""] {
            assert!(parameters.write(name, Some(&json!(1))).is_err(), "{name}");
        }
    }
}
