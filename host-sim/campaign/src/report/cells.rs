//! Groups rows by their cell of the grid.

use std::collections::HashMap;

use wheeleg_config::plan::{Factor, Plan, Value, Values};

use crate::table::{Data, Table};

/// One combination of the values of the factors that have a list.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cell {
    /// The values in words; empty for a plan without a grid.
    pub(super) name: String,
    /// The values, in the order of [`grid`].
    pub(super) values: Vec<Value>,
    /// Positions of its rows in the table.
    pub(super) rows: Vec<usize>,
}

/// The factors that have a list, each with its list.
pub(super) fn listed(plan: &Plan) -> impl Iterator<Item = (&Factor, &[Value])> {
    plan.factors
        .iter()
        .filter_map(|factor| match &factor.values {
            Values::Grid(values) => Some((factor, values.as_slice())),
            Values::Drawn(_) => None,
        })
}

/// Names of these factors.
pub(super) fn grid(plan: &Plan) -> Vec<String> {
    listed(plan)
        .map(|(factor, _)| factor.name.clone())
        .collect()
}

/// The value of a factor in a row.
pub(super) fn value(table: &Table, factor: &str, row: usize) -> Option<Value> {
    match table.column(&format!("f.{factor}"))? {
        Data::Number(v) => v.get(row)?.map(Value::Number),
        Data::Flag(v) => v.get(row)?.map(Value::Flag),
        Data::Text(v) => v.get(row)?.clone().map(Value::Text),
        Data::Whole(_) => None,
    }
}

/// All cells, in the order of their first rows.
pub(super) fn cells(table: &Table, plan: &Plan) -> Vec<Cell> {
    let grid = grid(plan);
    let mut cells: Vec<Cell> = Vec::new();
    // Position of each cell by name, because a plan may have very many.
    let mut places: HashMap<String, usize> = HashMap::new();
    for row in 0..table.rows() {
        let values = grid.iter().filter_map(|factor| value(table, factor, row));
        let values: Vec<Value> = values.collect();
        let named = grid.iter().zip(&values);
        let named = named.map(|(name, value)| format!("{name} {value}"));
        let name = named.collect::<Vec<_>>().join(", ");
        let place = *places.entry(name.clone()).or_insert(cells.len());
        match cells.get_mut(place) {
            Some(cell) => cell.rows.push(row),
            None => cells.push(Cell {
                name,
                values,
                rows: vec![row],
            }),
        }
    }
    cells
}
