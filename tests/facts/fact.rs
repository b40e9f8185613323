//! One fact, and how its values are read and compared. Reading notes every key, so that none is passed over.

use std::cell::RefCell;
use std::collections::BTreeSet;

use serde_json::{Map, Value};
use tomoswarm::geom::Point;

/// How far a number may be off where the fact does not say.
const TOLERANCE: f64 = 1e-9;

/// What a check says: nothing, or what is wrong.
pub type Checked = Result<(), String>;

/// A fact as it stands in a file.
#[derive(Clone, Debug)]
pub struct Fact {
    pub id: String,
    pub area: String,
    pub description: String,
    pub inputs: Map<String, Value>,
    pub expected: Map<String, Value>,
    pub tolerance: f64,
    read: RefCell<BTreeSet<String>>,
}

impl Fact {
    /// Takes a fact from a file; a key that is not known is an error.
    pub fn from_json(value: &Value) -> Result<Fact, String> {
        const KNOWN: [&str; 8] = [
            "id",
            "area",
            "description",
            "inputs",
            "expected",
            "tolerance",
            "source",
            "note",
        ];
        let object = value.as_object().ok_or("a fact is an object")?;
        if let Some(key) = object.keys().find(|key| !KNOWN.contains(&key.as_str())) {
            return Err(format!("{key} is not known"));
        }
        let text = |key: &str| {
            object
                .get(key)
                .and_then(Value::as_str)
                .unwrap_or_default()
                .to_owned()
        };
        let table = |key: &str| {
            object
                .get(key)
                .and_then(Value::as_object)
                .cloned()
                .unwrap_or_default()
        };
        let (id, area, description) = (text("id"), text("area"), text("description"));
        if id.is_empty() || area.is_empty() || table("expected").is_empty() {
            return Err(format!("{id}: id, area and expected are needed"));
        }
        let tolerance = object
            .get("tolerance")
            .and_then(Value::as_f64)
            .unwrap_or(TOLERANCE);
        let (inputs, expected) = (table("inputs"), table("expected"));
        Ok(Fact {
            id,
            area,
            description,
            inputs,
            expected,
            tolerance,
            read: RefCell::default(),
        })
    }

    /// Returns whether a key is among the inputs.
    pub fn has(&self, key: &str) -> bool {
        self.inputs.contains_key(key)
    }

    /// Returns whether a key is among the outputs.
    pub fn expects(&self, key: &str) -> bool {
        self.expected.contains_key(key)
    }

    /// Returns an input.
    pub fn input(&self, key: &str) -> Result<&Value, String> {
        self.read.borrow_mut().insert(format!("inputs.{key}"));
        self.inputs
            .get(key)
            .ok_or_else(|| format!("there is no input {key}"))
    }

    /// Returns an output.
    pub fn output(&self, key: &str) -> Result<&Value, String> {
        self.read.borrow_mut().insert(format!("expected.{key}"));
        self.expected
            .get(key)
            .ok_or_else(|| format!("there is no output {key}"))
    }

    /// Returns an input that is a number.
    pub fn number(&self, key: &str) -> Result<f64, String> {
        self.input(key)?
            .as_f64()
            .ok_or_else(|| format!("{key} is no number"))
    }

    /// Returns an input that is a whole number.
    pub fn whole(&self, key: &str) -> Result<i64, String> {
        self.input(key)?
            .as_i64()
            .ok_or_else(|| format!("{key} is no whole number"))
    }

    /// Returns an input that is true or false.
    pub fn flag(&self, key: &str) -> Result<bool, String> {
        self.input(key)?
            .as_bool()
            .ok_or_else(|| format!("{key} is no flag"))
    }

    /// Returns an input that is a text.
    pub fn text(&self, key: &str) -> Result<&str, String> {
        self.input(key)?
            .as_str()
            .ok_or_else(|| format!("{key} is no text"))
    }

    /// Returns an input that is a list of N numbers.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], String> {
        numbers(self.input(key)?)
    }

    /// Returns an input that is a list of lists of N numbers.
    pub fn table<const N: usize>(&self, key: &str) -> Result<Vec<[f64; N]>, String> {
        table(self.input(key)?)
    }

    /// Returns an input that is a point as (north, east).
    pub fn place(&self, key: &str) -> Result<Point, String> {
        self.numbers(key).map(place)
    }

    /// Compares an output with what was found.
    pub fn expect(&self, key: &str, found: Value) -> Checked {
        let expected = self.output(key)?;
        if same(expected, &found, self.tolerance) {
            return Ok(());
        }
        Err(format!("{key} is {found}, expected {expected}"))
    }

    /// Fails when a key of the inputs or outputs was never asked for.
    pub fn all_was_read(&self) -> Checked {
        let read = self.read.borrow();
        let inputs = self.inputs.keys().map(|key| format!("inputs.{key}"));
        let outputs = self.expected.keys().map(|key| format!("expected.{key}"));
        match inputs.chain(outputs).find(|key| !read.contains(key)) {
            Some(key) => Err(format!("nobody read {key}")),
            None => Ok(()),
        }
    }
}

/// Compares two values: numbers within the tolerance; "inf" is infinity.
fn same(expected: &Value, found: &Value, tolerance: f64) -> bool {
    match (expected, found) {
        (Value::Number(_), Value::Number(_)) => {
            let (a, b) = (
                expected.as_f64().unwrap_or(f64::NAN),
                found.as_f64().unwrap_or(f64::NAN),
            );
            (a - b).abs() <= tolerance
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b, tolerance))
        }
        (expected, found) => expected == found,
    }
}

/// Returns a number as a fact writes it: infinity is a word.
pub fn written(number: f64) -> Value {
    if number == f64::INFINITY {
        Value::from("inf")
    } else {
        Value::from(number)
    }
}

/// Reads a list of N numbers.
pub fn numbers<const N: usize>(value: &Value) -> Result<[f64; N], String> {
    let list: Option<Vec<f64>> = value
        .as_array()
        .and_then(|list| list.iter().map(|number| number.as_f64()).collect());
    let list = list.ok_or_else(|| format!("{value} is no list of numbers"))?;
    <[f64; N]>::try_from(list).map_err(|list| format!("{list:?} has not {N} numbers"))
}

/// Reads a list of lists of N numbers.
pub fn table<const N: usize>(value: &Value) -> Result<Vec<[f64; N]>, String> {
    value
        .as_array()
        .ok_or_else(|| format!("{value} is no list"))?
        .iter()
        .map(numbers)
        .collect()
}

/// Returns the point of (north, east).
pub fn place([north, east]: [f64; 2]) -> Point {
    Point::new(east, north)
}
