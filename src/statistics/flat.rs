//! Estimates as three fields of a row, for `#[serde(flatten, serialize_with)]`.
//!
//! The value, and the ends of the 95 % interval under its name with `_lower` and `_upper`; null
//! without an interval.

use serde::Serializer;
use serde::ser::SerializeStruct;

use super::Estimate;

macro_rules! fields {
    ($($name:ident)*) => {$(
        pub fn $name<S: Serializer>(found: &Option<Estimate>, out: S) -> Result<S::Ok, S::Error> {
            let mut fields = out.serialize_struct(stringify!($name), 3)?;
            fields.serialize_field(stringify!($name), &found.map(|found| found.value))?;
            let [lower, upper] = found.map_or([None; 2], |found| [found.lower, found.upper]);
            fields.serialize_field(concat!(stringify!($name), "_lower"), &lower)?;
            fields.serialize_field(concat!(stringify!($name), "_upper"), &upper)?;
            fields.end()
        }
    )*};
}

fields! { break_even_ns ns_per_step query_ns ratio stage_ns us_per_second }
