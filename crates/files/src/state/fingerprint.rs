//! The layout of a type as it is read from a checkpoint, and its fingerprint.
//!
//! Postcard writes values without names or types: a build with different structs would read other fields from the same
//! bytes, mostly without noticing. The layout is what a type requests from a deserializer, in order: the names of
//! structs, fields and variants, and the primitive types. It is recorded from the type alone, by supplying made-up
//! values, so that no list of fields needs manual updates.
//!
//! The meaning and the order of numbers in a list are not covered: if these change, change the version of the
//! [envelope](super::envelope).

use std::collections::BTreeMap;

use serde::{
    Deserialize,
    de::{
        Deserializer, EnumAccess, Error as _, IntoDeserializer, MapAccess, SeqAccess, VariantAccess, Visitor,
        value::{Error, U32Deserializer},
    },
    forward_to_deserialize_any,
};

/// A number that differs if the layout of `T` differs.
///
/// # Panics
/// If `T` has [no layout](layout); a test lays out all types that are written.
pub fn fingerprint<T: for<'de> Deserialize<'de>>() -> u32 {
    crc32c::crc32c(layout::<T>().expect("a type that postcard can read").as_bytes())
}

/// The requests of `T` when it is read, in words.
///
/// # Errors
/// For a type that refuses made-up values, that asks for the type of the next value, or that has variants out of reach.
pub fn layout<T: for<'de> Deserialize<'de>>() -> Result<String, Error> {
    let mut tracer = Tracer::default();
    // A value has one variant of each enum, so values are made until all variants were seen.
    loop {
        let seen = tracer.seen();
        T::deserialize(&mut tracer)?;
        match tracer.hidden() {
            None => return Ok(tracer.record),
            Some(name) if tracer.seen() == seen => {
                return Err(Error::custom(format!("variants of {name} lie in a variant of another enum")));
            }
            Some(_) => {}
        }
    }
}

/// Supplies values of any type, and records the requests.
#[derive(Default)]
struct Tracer {
    record: String,
    /// For each enum, how many variants were supplied, and how many there are.
    enums: BTreeMap<&'static str, (usize, usize)>,
}

impl Tracer {
    fn note(&mut self, what: &str) {
        self.record.push_str(what);
        self.record.push(' ');
    }

    /// Number of variants supplied.
    fn seen(&self) -> usize {
        self.enums.values().map(|(seen, _)| seen).sum()
    }

    /// An enum with variants that were not supplied.
    fn hidden(&self) -> Option<&'static str> {
        self.enums.iter().find(|(_, (seen, all))| seen < all).map(|(name, _)| *name)
    }

    /// A list of `left` values, with names if they have any.
    fn list<'de, V: Visitor<'de>>(
        &mut self,
        open: &str,
        left: usize,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.note(open);
        let value = visitor.visit_seq(Values { tracer: self, left, names: names.iter() })?;
        self.note("end");
        Ok(value)
    }
}

/// Remaining values of a list.
struct Values<'a> {
    tracer: &'a mut Tracer,
    left: usize,
    names: std::slice::Iter<'static, &'static str>,
}

impl<'de> SeqAccess<'de> for Values<'_> {
    type Error = Error;

    fn next_element_seed<S: serde::de::DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Error> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        if let Some(name) = self.names.next() {
            self.tracer.note(&format!("{name}:"));
        }
        seed.deserialize(&mut *self.tracer).map(Some)
    }
}

impl<'de> MapAccess<'de> for Values<'_> {
    type Error = Error;

    fn next_key_seed<S: serde::de::DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Error> {
        self.next_element_seed(seed)
    }

    fn next_value_seed<S: serde::de::DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Error> {
        seed.deserialize(&mut *self.tracer)
    }
}

/// One variant of an enum.
struct ChosenVariant<'a> {
    tracer: &'a mut Tracer,
    index: u32,
}

impl<'a, 'de> EnumAccess<'de> for ChosenVariant<'a> {
    type Error = Error;
    type Variant = &'a mut Tracer;

    fn variant_seed<S: serde::de::DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, &'a mut Tracer), Error> {
        let index: U32Deserializer<Error> = self.index.into_deserializer();
        Ok((seed.deserialize(index)?, self.tracer))
    }
}

impl<'de> VariantAccess<'de> for &mut Tracer {
    type Error = Error;

    fn unit_variant(self) -> Result<(), Error> {
        Ok(())
    }

    fn newtype_variant_seed<S: serde::de::DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Error> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Error> {
        self.list("(", length, &[], visitor)
    }

    fn struct_variant<V: Visitor<'de>>(self, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Error> {
        self.list("{", fields.len(), fields, visitor)
    }
}

/// A primitive type, recorded by its name.
macro_rules! primitives {
    ($($method:ident $visit:ident $value:expr, $name:literal;)+) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
            self.note($name);
            visitor.$visit($value)
        })+
    };
}

impl<'de> Deserializer<'de> for &mut Tracer {
    type Error = Error;

    primitives! {
        deserialize_bool visit_bool true, "bool";
        deserialize_i8 visit_i8 1, "i8";
        deserialize_i16 visit_i16 1, "i16";
        deserialize_i32 visit_i32 1, "i32";
        deserialize_i64 visit_i64 1, "i64";
        deserialize_i128 visit_i128 1, "i128";
        deserialize_u8 visit_u8 1, "u8";
        deserialize_u16 visit_u16 1, "u16";
        deserialize_u32 visit_u32 1, "u32";
        deserialize_u64 visit_u64 1, "u64";
        deserialize_u128 visit_u128 1, "u128";
        deserialize_f32 visit_f32 1.0, "f32";
        deserialize_f64 visit_f64 1.0, "f64";
        deserialize_char visit_char 'c', "char";
        deserialize_str visit_str "", "string";
        deserialize_string visit_str "", "string";
        deserialize_bytes visit_bytes &[], "bytes";
        deserialize_byte_buf visit_bytes &[], "bytes";
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.note("option");
        visitor.visit_some(self)
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.note("unit");
        visitor.visit_unit()
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Error> {
        self.note(name);
        visitor.visit_unit()
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Error> {
        self.note(name);
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.list("list", 1, &[], visitor)
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Error> {
        self.list("(", length, &[], visitor)
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.note(name);
        self.list("(", length, &[], visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.note("map");
        visitor.visit_map(Values { tracer: self, left: 1, names: [].iter() })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.note(name);
        self.list("{", fields.len(), fields, visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let (seen, all) = self.enums.entry(name).or_insert((0, variants.len()));
        let index = if *seen < *all { *seen } else { 0 };
        *seen = (*all).min(*seen + 1);
        self.note(&format!("{name} {} of {}", index, variants.join("|")));
        visitor.visit_enum(ChosenVariant { tracer: self, index: index as u32 })
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(Error::custom("the type asks what comes next, which postcard does not write"))
    }

    forward_to_deserialize_any! { identifier ignored_any }

    fn is_human_readable(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A type called `Example` in a separate module.
    macro_rules! example {
        ($module:ident: $($item:item)+) => {
            #[allow(dead_code)]
            mod $module {
                use std::collections::BTreeMap;
                #[derive(serde::Deserialize)]
                pub struct Inner { pub first: u32, pub second: f64 }
                $(#[derive(serde::Deserialize)] $item)+
                pub fn print() -> u32 { super::fingerprint::<Example>() }
            }
        };
    }

    example!(base: pub struct Example { a: u32, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(same: pub struct Example { a: u32, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(name: pub struct Example { z: u32, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(kind: pub struct Example { a: u64, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(order: pub struct Example { b: Option<f64>, a: u32, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(more: pub struct Example { a: u32, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3], f: () }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(optional: pub struct Example { a: u32, b: f64, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(length: pub struct Example { a: u32, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 4] }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(nested: pub struct Example { a: u32, b: Option<f64>, c: Vec<Other>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub struct Other { second: f64, first: u32 }
        pub enum Fate { Lost, Found(u32), Moved { to: f64 } });
    example!(variants: pub struct Example { a: u32, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Found(u32), Lost, Moved { to: f64 } });
    example!(last_variant: pub struct Example { a: u32, b: Option<f64>, c: Vec<Inner>, d: BTreeMap<u64, Fate>, e: [f64; 3] }
        pub enum Fate { Lost, Found(u32), Moved { to: f32 } });

    #[test]
    fn another_name_type_order_or_variant_is_another_fingerprint() {
        assert_eq!(base::print(), same::print());
        let others = [
            ("name", name::print()),
            ("type", kind::print()),
            ("order", order::print()),
            ("a field more", more::print()),
            ("optional", optional::print()),
            ("length", length::print()),
            ("in a list", nested::print()),
            ("order of variants", variants::print()),
            ("in the last variant", last_variant::print()),
        ];
        let mut all: Vec<u32> = others.iter().map(|(_, print)| *print).collect();
        for (what, print) in others {
            assert_ne!(print, base::print(), "{what}");
        }
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), others.len(), "each change is told from the others");
    }

    #[test]
    fn a_layout_is_written_in_words() {
        assert_eq!(layout::<base::Inner>().unwrap(), "Inner { first: u32 second: f64 end ");
        assert_eq!(layout::<(bool, Option<String>)>().unwrap(), "( bool option string end ");
        assert_eq!(layout::<Vec<[u8; 2]>>().unwrap(), "list ( u8 u8 end end ");
        let enums = layout::<base::Fate>().unwrap();
        assert_eq!(
            enums,
            "Fate 0 of Lost|Found|Moved Fate 1 of Lost|Found|Moved u32 Fate 2 of Lost|Found|Moved { to: f64 end "
        );
    }

    #[test]
    fn types_that_cannot_be_laid_out_are_refused() {
        assert!(layout::<serde_json::Value>().unwrap_err().to_string().contains("asks what comes next"));
        assert!(layout::<curvelax_ensemble::Shard>().is_err(), "no shard is written as an empty text");
    }
}
