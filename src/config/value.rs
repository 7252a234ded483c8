//! Values of a configuration that are more than a number, a word or a list.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::SeqAccessDeserializer;
use serde::de::{MapAccess, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A Lipschitz constant: computed from the system over the box, or given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constant {
    /// `"computed"`.
    Computed,
    /// A number.
    Given(f64),
}

/// The coordinates that vary.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// `"all"`.
    All,
    /// The states of these names.
    Named(Vec<String>),
}

/// Values by name that keep their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Named<T>(pub Vec<(String, T)>);

impl<T: Serialize> Serialize for Named<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Named<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = Named<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table with the names of states as keys")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Named(entries))
            }
        }
        deserializer.deserialize_map(Entries(PhantomData))
    }
}

impl Serialize for Constant {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Computed => serializer.serialize_str("computed"),
            Self::Given(value) => serializer.serialize_f64(*value),
        }
    }
}

impl<'de> Deserialize<'de> for Constant {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ConstantVisitor;
        impl Visitor<'_> for ConstantVisitor {
            type Value = Constant;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or \"computed\"")
            }
            fn visit_f64<E>(self, value: f64) -> Result<Constant, E> {
                Ok(Constant::Given(value))
            }
            fn visit_i64<E>(self, value: i64) -> Result<Constant, E> {
                Ok(Constant::Given(value as f64))
            }
            fn visit_u64<E>(self, value: u64) -> Result<Constant, E> {
                Ok(Constant::Given(value as f64))
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Constant, E> {
                match text {
                    "computed" => Ok(Constant::Computed),
                    _ => Err(E::invalid_value(Unexpected::Str(text), &self)),
                }
            }
        }
        deserializer.deserialize_any(ConstantVisitor)
    }
}

impl Serialize for Coordinates {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All => serializer.serialize_str("all"),
            Self::Named(names) => names.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Coordinates {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CoordinatesVisitor;
        impl<'de> Visitor<'de> for CoordinatesVisitor {
            type Value = Coordinates;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"all\" or a list of names of states")
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Coordinates, E> {
                match text {
                    "all" => Ok(Coordinates::All),
                    _ => Err(E::invalid_value(Unexpected::Str(text), &self)),
                }
            }
            fn visit_seq<A: SeqAccess<'de>>(self, names: A) -> Result<Coordinates, A::Error> {
                let names = Vec::deserialize(SeqAccessDeserializer::new(names));
                names.map(Coordinates::Named)
            }
        }
        deserializer.deserialize_any(CoordinatesVisitor)
    }
}
