//! Plots the share of cases that meet all required targets over a factor with a list of numbers.

use wheeleg_config::plan::{Factor, Plan, Value};
use wheeleg_report::plot::{Content, Figure, Panel, colour, line};

use super::Merged;
use super::cells::{self, Cell};

/// Number of values from which a curve shows more than a table.
const CURVE: usize = 3;
/// Height of a panel, pixels.
const HEIGHT: u32 = 110;

/// Draws one curve for each combination of the other listed factors, and one panel for each value of the one
/// with the most values. Returns `None` for a plan without such a list, or with more curves than colours.
pub(super) fn figure(merged: &Merged, plan: &Plan, all: &[Cell]) -> Option<Figure> {
    let listed: Vec<(&Factor, &[Value])> = cells::listed(plan).collect();
    let most = |fits: &dyn Fn(usize) -> bool| {
        let places = (0..listed.len()).filter(|place| fits(*place));
        // The first one, if several have equally many values.
        places.rev().max_by_key(|place| listed[*place].1.len())
    };
    let is_curve = |place: usize| {
        let values = listed[place].1;
        values.len() >= CURVE && values.iter().all(|v| matches!(v, Value::Number(_)))
    };
    let x = most(&is_curve)?;
    let panel = most(&|place| place != x && listed[place].1.len() > 1);
    let passed = merged.table.flags("passed");
    let (mut panels, mut curves) = (Vec::<Value>::new(), Vec::<String>::new());
    let mut points = Vec::new();
    for cell in all {
        let Some(Value::Number(at)) = cell.values.get(x) else {
            continue;
        };
        let met = cell.rows.iter().filter(|row| passed[**row] == Some(true));
        let share = met.count() as f64 / cell.rows.len() as f64;
        let others = (0..listed.len()).filter(|place| *place != x && Some(*place) != panel);
        let named = others.filter(|place| listed[*place].1.len() > 1);
        let named = named.map(|place| format!("{} {}", listed[place].0.name, cell.values[place]));
        let curve = place_of(&mut curves, named.collect::<Vec<_>>().join(", "));
        let panel = panel.map(|place| place_of(&mut panels, cell.values[place].clone()));
        points.push((panel.unwrap_or(0), curve, (*at, share)));
    }
    if curves.len() > colour::AXES.len() {
        return None;
    }
    let xs = points.iter().map(|(_, _, (at, _))| *at);
    let range = xs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
        (low.min(at), high.max(at))
    });
    let unit = match listed[x].0.unit.as_str() {
        "" => String::new(),
        unit => format!(" [{unit}]"),
    };
    let label = format!("{}{unit}", listed[x].0.name);
    let draw = |at: usize| {
        let series = curves.iter().enumerate().map(|(place, name)| {
            let own = points.iter().filter(|(p, c, _)| (*p, *c) == (at, place));
            let mut own: Vec<(f64, f64)> = own.map(|(_, _, point)| *point).collect();
            own.sort_by(|a, b| a.0.total_cmp(&b.0));
            line(name, colour::AXES[place], 2, own)
        });
        let content = Content::curves(&label, ("[share]", (-0.05, 1.05)), series.collect());
        let title = panel.map_or(String::new(), |place| {
            format!("{} {}", listed[place].0.name, panels[at])
        });
        Panel::new(title, range, HEIGHT, content)
    };
    let mut drawn: Vec<Panel> = (0..panels.len().max(1)).map(draw).collect();
    for panel in drawn.iter_mut().skip(1) {
        panel.name_only(0..0);
    }
    Some(Figure {
        id: "shares".to_owned(),
        title: format!("All required targets met, by {}", listed[x].0.name),
        caption: "Share of all cases of a cell; the table above has its interval.".to_owned(),
        panels: drawn,
    })
}

/// Position of a value in a list; appends it if it is missing.
fn place_of<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    if let Some(place) = list.iter().position(|own| *own == value) {
        return place;
    }
    list.push(value);
    list.len() - 1
}
