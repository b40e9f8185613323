//! Whether JSON keeps a value, so that a type that reads what it writes reads the value back: JSON has no numbers that are
//! infinite or none at all, and shows nothing within something (`Some(None)`) as nothing. A value is walked through, nothing
//! is written. Serde's interface has thirty methods, nearly all of which do the same here: hence the two macros.

use std::fmt;

use serde::Serialize;
use serde::ser::{
    SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant, SerializeTuple,
    SerializeTupleStruct, SerializeTupleVariant, Serializer,
};

/// Returns whether JSON keeps a value.
pub(super) fn is_lossless<T: Serialize>(value: &T) -> bool {
    let walk = Walk {
        is_within_some: false,
    };
    value.serialize(walk).is_ok()
}

/// Walks through a value, and ends with an error at what JSON does not keep.
#[derive(Clone, Copy)]
struct Walk {
    /// Whether what comes is all that a `Some` has.
    is_within_some: bool,
}

impl Walk {
    const PART: Walk = Walk {
        is_within_some: false,
    };

    /// Passes something that JSON shows as `null`.
    fn null(self) -> fmt::Result {
        match self.is_within_some {
            true => Err(fmt::Error),
            false => Ok(()),
        }
    }

    fn number(is_finite: bool) -> fmt::Result {
        match is_finite {
            true => Ok(()),
            false => Err(fmt::Error),
        }
    }
}

/// Values of these types come back as they were.
macro_rules! kept {
    ($($name:ident: $type:ty),*) => {
        $(fn $name(self, _: $type) -> fmt::Result {
            Ok(())
        })*
    };
}

impl Serializer for Walk {
    type Ok = ();
    type Error = fmt::Error;
    type SerializeSeq = Walk;
    type SerializeTuple = Walk;
    type SerializeTupleStruct = Walk;
    type SerializeTupleVariant = Walk;
    type SerializeMap = Walk;
    type SerializeStruct = Walk;
    type SerializeStructVariant = Walk;

    kept!(
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_char: char,
        serialize_str: &str, serialize_bytes: &[u8]
    );

    fn serialize_f32(self, number: f32) -> fmt::Result {
        Walk::number(number.is_finite())
    }

    fn serialize_f64(self, number: f64) -> fmt::Result {
        Walk::number(number.is_finite())
    }

    fn serialize_none(self) -> fmt::Result {
        self.null()
    }

    fn serialize_some<T: ?Sized + Serialize>(self, value: &T) -> fmt::Result {
        value.serialize(Walk {
            is_within_some: true,
        })
    }

    fn serialize_unit(self) -> fmt::Result {
        self.null()
    }

    fn serialize_unit_struct(self, _: &'static str) -> fmt::Result {
        self.null()
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> fmt::Result {
        Ok(())
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        value: &T,
    ) -> fmt::Result {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        value: &T,
    ) -> fmt::Result {
        value.serialize(Walk::PART)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Walk, fmt::Error> {
        Ok(Walk::PART)
    }

    fn serialize_tuple(self, _: usize) -> Result<Walk, fmt::Error> {
        Ok(Walk::PART)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Walk, fmt::Error> {
        Ok(Walk::PART)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Walk, fmt::Error> {
        Ok(Walk::PART)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Walk, fmt::Error> {
        Ok(Walk::PART)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Walk, fmt::Error> {
        Ok(Walk::PART)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Walk, fmt::Error> {
        Ok(Walk::PART)
    }

    fn collect_str<T: ?Sized + fmt::Display>(self, _: &T) -> fmt::Result {
        Ok(())
    }
}

/// Parts of what has several are walked through one by one.
macro_rules! parts {
    ($($of:ident: $($name:ident($($more:ty)?)),+;)*) => {
        $(impl $of for Walk {
            type Ok = ();
            type Error = fmt::Error;

            $(fn $name<T: ?Sized + Serialize>(&mut self, $(_: $more,)? value: &T) -> fmt::Result {
                value.serialize(Walk::PART)
            })+

            fn end(self) -> fmt::Result {
                Ok(())
            }
        })*
    };
}

parts!(
    SerializeSeq: serialize_element();
    SerializeTuple: serialize_element();
    SerializeTupleStruct: serialize_field();
    SerializeTupleVariant: serialize_field();
    SerializeMap: serialize_key(), serialize_value();
    SerializeStruct: serialize_field(&'static str);
    SerializeStructVariant: serialize_field(&'static str);
);

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use proptest::prelude::*;
    use serde::Deserialize;

    #[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
    struct Unit;

    #[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
    struct Wrapped(Option<f64>);

    #[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
    enum Any {
        Unit,
        Number(f64),
        Narrow(f32),
        Pair(f64, Option<u8>),
        Named {
            here: Wrapped,
            there: Option<Wrapped>,
        },
        List(Vec<Option<f64>>),
        Map(BTreeMap<u8, f64>),
        Twice(Option<Option<bool>>),
        Nothing(Option<Unit>),
        Text(String, char, i64),
    }

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            any::<f64>(),
            Just(f64::NAN),
            Just(f64::INFINITY),
            Just(-0.0)
        ]
    }

    fn anything() -> impl Strategy<Value = Any> {
        let wrapped = || prop::option::of(number()).prop_map(Wrapped);
        prop_oneof![
            Just(Any::Unit),
            number().prop_map(Any::Number),
            any::<f32>().prop_map(Any::Narrow),
            Just(Any::Narrow(f32::NEG_INFINITY)),
            (number(), any::<Option<u8>>()).prop_map(|(one, two)| Any::Pair(one, two)),
            (wrapped(), prop::option::of(wrapped()))
                .prop_map(|(here, there)| Any::Named { here, there }),
            prop::collection::vec(prop::option::of(number()), 0..4).prop_map(Any::List),
            prop::collection::btree_map(any::<u8>(), number(), 0..4).prop_map(Any::Map),
            any::<Option<Option<bool>>>().prop_map(Any::Twice),
            prop::option::of(Just(Unit)).prop_map(Any::Nothing),
            (".{0,9}", any::<char>(), any::<i64>()).prop_map(|(a, b, c)| Any::Text(a, b, c)),
        ]
    }

    proptest! {
        #[test]
        fn what_is_lossless_is_what_comes_back(values in prop::collection::vec(anything(), 0..6)) {
            let text = serde_json::to_string(&values).unwrap();
            let read: Option<Vec<Any>> = serde_json::from_str(&text).ok();
            prop_assert_eq!(is_lossless(&values), read == Some(values), "{}", text);
        }
    }
}
