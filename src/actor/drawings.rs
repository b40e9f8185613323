//! What compares a state machine drawn in a file's doc with its enum, for tests.

use std::collections::BTreeSet;
use std::fmt::Debug;

use serde::Deserialize;
use serde::de::value::{Error, StrDeserializer};

/// Gives the name of a value's variant.
pub fn variant_of(value: &impl Debug) -> String {
    format!("{value:?}").chars().take_while(|letter| letter.is_alphanumeric()).collect()
}

/// Gives the names of all variants of an enum: serde lists them to whoever asks for one that is not there.
pub fn variants<'a, T: Deserialize<'a> + Debug>() -> BTreeSet<String> {
    let refusal = T::deserialize(StrDeserializer::<Error>::new("none of them")).unwrap_err().to_string();
    refusal.split('`').skip(3).step_by(2).map(str::to_owned).collect()
}

/// Gives the names in brackets within the drawings of a file's doc.
pub fn drawn(source: &str) -> BTreeSet<String> {
    let doc: Vec<&str> = source.lines().map_while(|line| line.strip_prefix("//!")).collect();
    let doc = doc.join("\n");
    let drawings = doc.split("```").skip(1).step_by(2).flat_map(|drawing| drawing.split('[').skip(1));
    drawings.filter_map(|from| Some(from.split_once(']')?.0.to_owned())).collect()
}
