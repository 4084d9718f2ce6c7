//! A JSON value with its path, which collects errors instead of stopping at the first.

use std::cell::RefCell;

use serde_json::Value;

use super::Problem;

/// Longest piece of a value in a message, in characters.
const SHOWN: usize = 60;

/// A value of the file.
pub(super) struct Node<'a> {
    value: &'a Value,
    path: String,
    problems: &'a RefCell<Vec<Problem>>,
}

impl<'a> Node<'a> {
    pub(super) fn root(value: &'a Value, problems: &'a RefCell<Vec<Problem>>) -> Self {
        Self {
            value,
            path: String::new(),
            problems,
        }
    }

    fn child(&self, value: &'a Value, path: String) -> Self {
        Self {
            value,
            path,
            problems: self.problems,
        }
    }

    fn at(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    fn note(&self, path: String, value: String, expected: impl Into<String>) {
        self.problems.borrow_mut().push(Problem {
            path,
            value,
            expected: expected.into(),
        });
    }

    /// Notes that this value is not the expected one.
    pub(super) fn refuse(&self, expected: impl Into<String>) {
        let mut shown = self.value.to_string();
        if shown.chars().count() > SHOWN {
            shown = shown.chars().take(SHOWN).chain("…".chars()).collect();
        }
        let path = if self.path.is_empty() {
            "the file"
        } else {
            &self.path
        };
        self.note(path.to_owned(), shown, expected);
    }

    /// Notes every key that is not in `known`, and every one of `required` that is missing.
    pub(super) fn keys(&self, known: &[&str], required: &[&str]) {
        let Some(object) = self.value.as_object() else {
            self.refuse("an object");
            return;
        };
        for key in object.keys().filter(|k| !known.contains(&k.as_str())) {
            self.note(
                self.at(key),
                "an unknown key".to_owned(),
                format!("one of {}", known.join(", ")),
            );
        }
        for key in required.iter().filter(|k| !object.contains_key(**k)) {
            self.note(self.at(key), "missing".to_owned(), "this key");
        }
    }

    /// The value of a key; nothing if it is missing, as noted by [`Node::keys`].
    pub(super) fn get(&self, key: &str) -> Option<Node<'a>> {
        let value = self.value.as_object()?.get(key)?;
        Some(self.child(value, self.at(key)))
    }

    /// The elements of an array.
    pub(super) fn elements(&self) -> Vec<Node<'a>> {
        let Some(items) = self.value.as_array() else {
            self.refuse("an array");
            return Vec::new();
        };
        items
            .iter()
            .enumerate()
            .map(|(i, value)| self.child(value, format!("{}[{i}]", self.path)))
            .collect()
    }

    /// An exact text.
    pub(super) fn exactly(&self, text: &str) {
        if self.value.as_str() != Some(text) {
            self.refuse(format!("the text \"{text}\""));
        }
    }

    /// A whole number from zero.
    pub(super) fn whole(&self) -> u64 {
        self.value.as_u64().unwrap_or_else(|| {
            self.refuse("a whole number from 0");
            0
        })
    }

    /// A finite number.
    pub(super) fn number(&self) -> f64 {
        match self.value.as_f64() {
            Some(number) if number.is_finite() => number,
            _ => {
                self.refuse("a finite number");
                0.0
            }
        }
    }

    /// A number in a range, which is given in words.
    pub(super) fn number_that(&self, words: &str, fits: impl Fn(f64) -> bool) -> f64 {
        let number = self.number();
        if self.value.is_number() && !fits(number) {
            self.refuse(words);
        }
        number
    }

    /// A list of `rows` numbers, or with more than one column a list of `rows` lists, row by row.
    pub(super) fn numbers(&self, rows: usize, columns: usize) -> Vec<f64> {
        let before = self.problems.borrow().len();
        let items = self.elements();
        if self.problems.borrow().len() == before && items.len() != rows {
            let what = if columns == 1 { "numbers" } else { "rows" };
            self.refuse(format!("an array of {rows} {what}, not {}", items.len()));
        }
        let mut out = Vec::with_capacity(rows * columns);
        for item in items {
            if columns == 1 {
                out.push(item.number());
            } else {
                out.extend(item.numbers(columns, 1));
            }
        }
        out.resize(rows * columns, 0.0);
        out
    }

    pub(super) fn array<const N: usize>(&self) -> [f64; N] {
        let numbers = self.numbers(N, 1);
        std::array::from_fn(|i| numbers[i])
    }
}
