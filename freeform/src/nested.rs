//! Reading solids from files: a union is refused at the depth limit while it is read, so that a file of a million brackets cannot exhaust the stack.

use std::fmt;

use serde::{
    Deserialize, Deserializer,
    de::{self, DeserializeSeed, EnumAccess, MapAccess, SeqAccess, VariantAccess, Visitor},
};

use crate::{
    FormError, Psi, Solid,
    solid::{DEPTH_LIMIT, Union},
};

impl<'de> Deserialize<'de> for Solid {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        SolidSeed { room: DEPTH_LIMIT }.deserialize(deserializer)
    }
}

impl<'de> Deserialize<'de> for Union {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        UnionSeed { room: DEPTH_LIMIT }.deserialize(deserializer)
    }
}

#[derive(Deserialize)]
#[serde(variant_identifier, rename_all = "snake_case")]
enum Kind {
    Form,
    Union,
}

#[derive(Deserialize)]
#[serde(field_identifier, rename_all = "snake_case")]
enum Field {
    Psi,
    Parts,
}

/// Reads a solid of at most `room` nested unions.
#[derive(Clone, Copy)]
struct SolidSeed {
    room: usize,
}

impl<'de> DeserializeSeed<'de> for SolidSeed {
    type Value = Solid;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Solid, D::Error> {
        deserializer.deserialize_enum("Solid", &["form", "union"], self)
    }
}

impl<'de> Visitor<'de> for SolidSeed {
    type Value = Solid;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a solid: `form` or `union`")
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<Solid, A::Error> {
        match data.variant()? {
            (Kind::Form, variant) => variant.newtype_variant().map(Solid::Form),
            (Kind::Union, _) if self.room == 0 => Err(de::Error::custom(FormError::TooDeep)),
            (Kind::Union, variant) => variant.newtype_variant_seed(UnionSeed { room: self.room }).map(Solid::Union),
        }
    }
}

/// Reads a union that may hold `room - 1` further ones inside each other.
#[derive(Clone, Copy)]
struct UnionSeed {
    room: usize,
}

impl<'de> DeserializeSeed<'de> for UnionSeed {
    type Value = Union;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Union, D::Error> {
        deserializer.deserialize_struct("Union", &["psi", "parts"], self)
    }
}

impl<'de> Visitor<'de> for UnionSeed {
    type Value = Union;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a union of `psi` and `parts`")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Union, A::Error> {
        let (mut psi, mut parts) = (None, None);
        while let Some(field) = map.next_key()? {
            match field {
                Field::Psi if psi.is_some() => return Err(de::Error::duplicate_field("psi")),
                Field::Parts if parts.is_some() => return Err(de::Error::duplicate_field("parts")),
                Field::Psi => psi = Some(map.next_value::<Psi>()?),
                Field::Parts => parts = Some(map.next_value_seed(PartsSeed { room: self.room - 1 })?),
            }
        }
        let parts = parts.ok_or_else(|| de::Error::missing_field("parts"))?;
        Union::new(psi.unwrap_or_default(), parts).map_err(de::Error::custom)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Union, A::Error> {
        let psi = seq.next_element()?.ok_or_else(|| de::Error::invalid_length(0, &self))?;
        let parts = seq
            .next_element_seed(PartsSeed { room: self.room - 1 })?
            .ok_or_else(|| de::Error::invalid_length(1, &self))?;
        Union::new(psi, parts).map_err(de::Error::custom)
    }
}

/// Reads the parts of a union.
struct PartsSeed {
    room: usize,
}

impl<'de> DeserializeSeed<'de> for PartsSeed {
    type Value = Vec<Solid>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Vec<Solid>, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for PartsSeed {
    type Value = Vec<Solid>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of solids")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Vec<Solid>, A::Error> {
        let mut parts = Vec::new();
        while let Some(part) = seq.next_element_seed(SolidSeed { room: self.room })? {
            parts.push(part);
        }
        Ok(parts)
    }
}
