//! Solids in files: a tree is refused at the depth limit while it is read, so that a file of a million brackets cannot
//! exhaust the stack.

use std::fmt;

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{self, DeserializeSeed, EnumAccess, MapAccess, SeqAccess, VariantAccess, Visitor},
    ser::{SerializeSeq, SerializeStruct},
};

use crate::{
    FormError, FreeForm, Operation, Psi, Solid,
    solid::DEPTH_LIMIT,
    tree::{Join, Place, Token},
};

const VARIANTS: [&str; 5] = ["form", "union", "intersection", "difference", "complement"];

impl Serialize for Solid {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Part { tokens: &self.tokens, forms: &self.forms, place: Place::default() }.serialize(serializer)
    }
}

/// A subtree to write.
#[derive(Clone, Copy)]
struct Part<'a> {
    tokens: &'a [Token],
    forms: &'a [FreeForm],
    place: Place,
}

/// An operation to write, and where its first part is.
struct Group<'a> {
    join: Join,
    first: Part<'a>,
}

/// The parts of an operation to write.
struct Parts<'a> {
    count: u32,
    first: Part<'a>,
}

impl Serialize for Part<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut first = *self;
        let form = first.place.form;
        match first.place.next(self.tokens) {
            Token::Form => serializer.serialize_newtype_variant("Solid", 0, VARIANTS[0], &self.forms[form]),
            Token::Join(join) => {
                let group = Group { join, first };
                match join.operation {
                    Operation::Union => serializer.serialize_newtype_variant("Solid", 1, VARIANTS[1], &group),
                    Operation::Intersection => serializer.serialize_newtype_variant("Solid", 2, VARIANTS[2], &group),
                    Operation::Difference => serializer.serialize_newtype_variant("Solid", 3, VARIANTS[3], &group),
                    Operation::Complement => serializer.serialize_newtype_variant("Solid", 4, VARIANTS[4], &first),
                }
            }
        }
    }
}

impl Serialize for Group<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut group = serializer.serialize_struct("Group", 2)?;
        group.serialize_field("psi", &self.join.psi)?;
        group.serialize_field("parts", &Parts { count: self.join.parts, first: self.first })?;
        group.end()
    }
}

impl Serialize for Parts<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut parts = serializer.serialize_seq(usize::try_from(self.count).ok())?;
        let mut part = self.first;
        for _ in 0..self.count {
            parts.serialize_element(&part)?;
            part.place = part.place.after(part.tokens);
        }
        parts.end()
    }
}

impl<'de> Deserialize<'de> for Solid {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        SolidSeed { room: DEPTH_LIMIT }.deserialize(deserializer)
    }
}

#[derive(Deserialize)]
#[serde(variant_identifier, rename_all = "snake_case")]
enum Kind {
    Form,
    Union,
    Intersection,
    Difference,
    Complement,
}

#[derive(Deserialize)]
#[serde(field_identifier, rename_all = "snake_case")]
enum Field {
    Psi,
    Parts,
}

/// Reads a solid of at most `room` nested operations.
#[derive(Clone, Copy)]
struct SolidSeed {
    room: usize,
}

impl<'de> DeserializeSeed<'de> for SolidSeed {
    type Value = Solid;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Solid, D::Error> {
        deserializer.deserialize_enum("Solid", &VARIANTS, self)
    }
}

impl<'de> Visitor<'de> for SolidSeed {
    type Value = Solid;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a solid: `form`, `union`, `intersection`, `difference` or `complement`")
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<Solid, A::Error> {
        let (kind, variant) = data.variant()?;
        let operation = match kind {
            Kind::Form => return variant.newtype_variant::<FreeForm>().map(Solid::from),
            Kind::Union => Operation::Union,
            Kind::Intersection => Operation::Intersection,
            Kind::Difference => Operation::Difference,
            Kind::Complement => Operation::Complement,
        };
        let room = self.room.checked_sub(1).ok_or_else(|| de::Error::custom(FormError::TooDeep))?;
        if operation == Operation::Complement {
            return variant.newtype_variant_seed(Self { room })?.complement().map_err(de::Error::custom);
        }
        variant.newtype_variant_seed(GroupSeed { operation, room })
    }
}

/// Reads the psi and the parts of an operation; each part may hold `room` further ones.
#[derive(Clone, Copy)]
struct GroupSeed {
    operation: Operation,
    room: usize,
}

impl<'de> DeserializeSeed<'de> for GroupSeed {
    type Value = Solid;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Solid, D::Error> {
        deserializer.deserialize_struct("Group", &["psi", "parts"], self)
    }
}

impl<'de> Visitor<'de> for GroupSeed {
    type Value = Solid;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("`psi` and `parts`")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Solid, A::Error> {
        let (mut psi, mut parts) = (None, None);
        while let Some(field) = map.next_key()? {
            match field {
                Field::Psi if psi.is_some() => return Err(de::Error::duplicate_field("psi")),
                Field::Parts if parts.is_some() => return Err(de::Error::duplicate_field("parts")),
                Field::Psi => psi = Some(map.next_value::<Psi>()?),
                Field::Parts => parts = Some(map.next_value_seed(PartsSeed { room: self.room })?),
            }
        }
        let parts = parts.ok_or_else(|| de::Error::missing_field("parts"))?;
        Solid::join(self.operation, psi.unwrap_or_default(), parts).map_err(de::Error::custom)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Solid, A::Error> {
        let psi = seq.next_element()?.ok_or_else(|| de::Error::invalid_length(0, &self))?;
        let parts =
            seq.next_element_seed(PartsSeed { room: self.room })?.ok_or_else(|| de::Error::invalid_length(1, &self))?;
        Solid::join(self.operation, psi, parts).map_err(de::Error::custom)
    }
}

/// Reads the parts of an operation.
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
