//! Numbers of JSON documents, those included that JSON has no word for.
//!
//! A finite number is a number. What is not finite stands between quotes: `"inf"`, `"-inf"` and
//! `"nan"`, as TOML writes them, and as `float` of Python, `parse` of Rust and `strtod` of C read
//! them. Older documents have `null` in their place; it is read where it can only mean one number.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, Unexpected, Visitor};
use serde::ser::{Serialize, Serializer};

/// A number, or what holds numbers: a list, or one that may be absent.
pub(crate) trait Numbers: Sized {
    /// Writes them.
    fn write<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error>;
    /// Reads them, `null` as `N` says.
    fn read<'de, N: Null, D: Deserializer<'de>>(from: D) -> Result<Self, D::Error>;
}

/// What `null` stands for in place of a number.
pub(crate) trait Null {
    /// The number; none where it could be any.
    const NUMBER: Option<f64>;
}

/// Any number: `null` is refused.
struct Unknown;
/// A number that is finite or NaN.
struct Nan;
/// A number that is finite or positive infinity.
struct Infinite;
/// A number that is finite or minus infinity.
struct MinusInfinite;

impl Null for Unknown {
    const NUMBER: Option<f64> = None;
}

impl Null for Nan {
    const NUMBER: Option<f64> = Some(f64::NAN);
}

impl Null for Infinite {
    const NUMBER: Option<f64> = Some(f64::INFINITY);
}

impl Null for MinusInfinite {
    const NUMBER: Option<f64> = Some(f64::NEG_INFINITY);
}

/// The word for a number that JSON has none for.
pub(crate) fn word(number: f64) -> Option<&'static str> {
    match number {
        f64::INFINITY => Some("inf"),
        f64::NEG_INFINITY => Some("-inf"),
        _ if number.is_nan() => Some("nan"),
        _ => None,
    }
}

/// The number that a word stands for.
pub(crate) fn of_word(word: &str) -> Option<f64> {
    match word {
        "inf" => Some(f64::INFINITY),
        "-inf" => Some(f64::NEG_INFINITY),
        "nan" => Some(f64::NAN),
        _ => None,
    }
}

struct OneNumber<N>(PhantomData<N>);

impl<N: Null> Visitor<'_> for OneNumber<N> {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, \"inf\", \"-inf\" or \"nan\"")
    }

    fn visit_f64<E>(self, number: f64) -> Result<f64, E> {
        Ok(number)
    }

    fn visit_i64<E>(self, number: i64) -> Result<f64, E> {
        Ok(number as f64)
    }

    fn visit_u64<E>(self, number: u64) -> Result<f64, E> {
        Ok(number as f64)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<f64, E> {
        of_word(text).ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }

    fn visit_unit<E: Error>(self) -> Result<f64, E> {
        N::NUMBER.ok_or_else(|| E::invalid_type(Unexpected::Unit, &self))
    }
}

impl Numbers for f64 {
    fn write<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match word(*self) {
            Some(word) => to.serialize_str(word),
            None => to.serialize_f64(*self),
        }
    }

    fn read<'de, N: Null, D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(OneNumber::<N>(PhantomData))
    }
}

impl Numbers for f32 {
    fn write<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match word(f64::from(*self)) {
            Some(word) => to.serialize_str(word),
            None => to.serialize_f32(*self),
        }
    }

    fn read<'de, N: Null, D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        f64::read::<N, D>(from).map(|number| number as f32)
    }
}

/// Numbers inside of others, on their way out.
struct Written<'a, T>(&'a T);

impl<T: Numbers> Serialize for Written<'_, T> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.write(to)
    }
}

/// Numbers inside of others, on their way in.
struct Read<T, N>(T, PhantomData<N>);

impl<'de, T: Numbers, N: Null> Deserialize<'de> for Read<T, N> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        T::read::<N, D>(from).map(|numbers| Self(numbers, PhantomData))
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn write<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.as_ref().map(Written).serialize(to)
    }

    /// `null` is no number here.
    fn read<'de, N: Null, D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let read = Option::<Read<T, N>>::deserialize(from)?;
        Ok(read.map(|numbers| numbers.0))
    }
}

impl<T: Numbers> Numbers for Vec<T> {
    fn write<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(self.iter().map(Written))
    }

    fn read<'de, N: Null, D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let read = Vec::<Read<T, N>>::deserialize(from)?;
        Ok(read.into_iter().map(|numbers| numbers.0).collect())
    }
}

impl<T: Numbers, const LENGTH: usize> Numbers for [T; LENGTH] {
    fn write<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(self.iter().map(Written))
    }

    fn read<'de, N: Null, D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let read = Vec::<T>::read::<N, D>(from)?;
        let length = read.len();
        let expected = format!("{LENGTH} numbers");
        read.try_into().map_err(|_| D::Error::invalid_length(length, &expected.as_str()))
    }
}

/// Writes a field of numbers.
pub(crate) fn serialize<T: Numbers, S: Serializer>(numbers: &T, to: S) -> Result<S::Ok, S::Error> {
    numbers.write(to)
}

/// Reads a field of numbers that may be any.
pub(crate) fn deserialize<'de, T: Numbers, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    T::read::<Unknown, D>(from)
}

/// A field of numbers none of which can be infinite: `null` is NaN.
pub(crate) mod or_nan {
    pub(crate) use super::serialize;
    use super::{Deserializer, Nan, Numbers};

    pub(crate) fn deserialize<'de, T: Numbers, D: Deserializer<'de>>(
        from: D,
    ) -> Result<T, D::Error> {
        T::read::<Nan, D>(from)
    }
}

/// An upper end, which is no NaN: `null` is infinity.
pub(crate) mod or_infinite {
    pub(crate) use super::serialize;
    use super::{Deserializer, Infinite, Numbers};

    pub(crate) fn deserialize<'de, T: Numbers, D: Deserializer<'de>>(
        from: D,
    ) -> Result<T, D::Error> {
        T::read::<Infinite, D>(from)
    }
}

/// A lower end, which is no NaN: `null` is minus infinity.
pub(crate) mod or_minus_infinite {
    pub(crate) use super::serialize;
    use super::{Deserializer, MinusInfinite, Numbers};

    pub(crate) fn deserialize<'de, T: Numbers, D: Deserializer<'de>>(
        from: D,
    ) -> Result<T, D::Error> {
        T::read::<MinusInfinite, D>(from)
    }
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    const NOT_FINITE: [f64; 3] = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN];

    /// A field of every kind.
    #[derive(Debug, Serialize, Deserialize)]
    struct Fields {
        #[serde(with = "super")]
        one: f64,
        #[serde(with = "super")]
        single: f32,
        #[serde(with = "super", default)]
        absent: Option<f64>,
        #[serde(with = "super", default)]
        present: Option<f64>,
        #[serde(with = "super")]
        rows: Vec<Vec<f32>>,
        #[serde(with = "super")]
        pair: [f64; 2],
        #[serde(with = "super::or_nan")]
        margins: Vec<f32>,
        #[serde(with = "super::or_infinite")]
        high: f32,
        #[serde(with = "super::or_minus_infinite")]
        low: f32,
    }

    fn fields(number: f64) -> Fields {
        let single = number as f32;
        Fields {
            one: number,
            single,
            absent: None,
            present: Some(number),
            rows: vec![vec![single, 0.1], vec![]],
            pair: [number, 1e-300],
            margins: vec![single, 2.0],
            high: single,
            low: single,
        }
    }

    #[test]
    fn numbers_come_back_as_they_were() {
        for number in NOT_FINITE.into_iter().chain([0.1, -0.0, f64::from(f32::MAX), 3.0]) {
            let (there, text) = (fields(number), serde_json::to_string(&fields(number)).unwrap());
            let back: Fields = serde_json::from_str(&text).unwrap();
            // NaN is no number that equals itself.
            assert_eq!(format!("{back:?}"), format!("{there:?}"), "{text}");
        }
    }

    #[test]
    fn finite_numbers_are_written_as_ever() {
        let text = serde_json::to_string(&fields(0.1)).unwrap();
        let plain = "{\"one\":0.1,\"single\":0.1,\"absent\":null,\"present\":0.1,\
            \"rows\":[[0.1,0.1],[]],\"pair\":[0.1,1e-300],\"margins\":[0.1,2.0],\
            \"high\":0.1,\"low\":0.1}";
        assert_eq!(text, plain);
        let whole = plain.replace("0.1", "7");
        assert_eq!(serde_json::from_str::<Fields>(&whole).unwrap().one, 7.0);
    }

    #[test]
    fn null_is_a_number_where_it_can_be_one_only() {
        let text = serde_json::to_string(&fields(0.5)).unwrap();
        let with = |from: &str, to: &str| serde_json::from_str::<Fields>(&text.replace(from, to));
        assert!(with("\"margins\":[0.5", "\"margins\":[null").unwrap().margins[0].is_nan());
        assert_eq!(with("\"high\":0.5", "\"high\":null").unwrap().high, f32::INFINITY);
        assert_eq!(with("\"low\":0.5", "\"low\":null").unwrap().low, f32::NEG_INFINITY);
        assert_eq!(with("\"present\":0.5", "\"present\":null").unwrap().present, None);
        for field in ["\"one\":", "\"single\":", "\"pair\":["] {
            let wrong = |to: &str| with(&format!("{field}0.5"), &format!("{field}{to}"));
            let refused = wrong("null").expect_err(field).to_string();
            assert!(refused.contains("null, expected a number, \"inf\""), "{refused}");
            for word in ["\"NaN\"", "\"infinity\"", "\"0.5\"", "true"] {
                assert!(wrong(word).is_err(), "{field}{word}");
            }
        }
        assert!(with("\"pair\":[0.5,", "\"pair\":[0.5,1,").is_err(), "three are no pair");
    }
}
