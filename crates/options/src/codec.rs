//! Values as text and as JSON.

use std::marker::PhantomData;

use serde_json::Value as Json;

use crate::table::{ChoiceName, OptionArity, OptionKind};

/// Text and JSON notation of the values of a type. All front ends convert values to text first, so that there is a
/// single parser.
pub trait OptionCodec<T> {
    /// Kind of values.
    const KIND: OptionKind;
    /// Number of values of a field.
    const SHAPE: OptionArity = OptionArity::One;

    /// Parses a value.
    ///
    /// # Errors
    /// A description of the expected value.
    fn parse(text: &str) -> Result<T, String>;

    /// Parses all given texts: the last one counts, unless values are repeated.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    fn parse_all(texts: &[String]) -> Result<T, String> {
        Self::parse(texts.last().map_or("", String::as_str))
    }

    /// A value as JSON; [`texts_of`](crate::texts_of) converts it back.
    fn json(value: &T) -> Json;

    /// A value as a number, for range checks.
    fn number(_value: &T) -> Option<f64> {
        None
    }
}

/// Default notation of flags, numbers, texts and choices.
#[derive(Debug)]
pub struct PlainCodec;

/// An enum with named values.
pub trait Choice: Copy + PartialEq + 'static {
    /// All values, with their names.
    const ALL: &'static [(Self, ChoiceName)];

    /// All names.
    fn names() -> Vec<ChoiceName> {
        Self::ALL.iter().map(|(_, named)| *named).collect()
    }

    /// Its name.
    fn name(self) -> &'static str {
        let named = Self::ALL.iter().find(|(value, _)| *value == self);
        named.map_or("", |(_, named)| named.name)
    }

    /// The value of a name, ignoring letter case; underscores equal dashes.
    ///
    /// # Errors
    /// The valid names.
    fn named(name: &str) -> Result<Self, String> {
        let name = name.trim().to_ascii_lowercase().replace('_', "-");
        let choice = Self::ALL.iter().find(|(_, named)| named.name == name);
        choice.map(|(value, _)| *value).ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|(_, named)| named.name).collect();
            format!("expected {}", names.join(" or "))
        })
    }
}

impl OptionCodec<bool> for PlainCodec {
    const KIND: OptionKind = OptionKind::Flag;

    fn parse(text: &str) -> Result<bool, String> {
        text.parse().map_err(|_| "expected true or false".to_owned())
    }

    fn json(value: &bool) -> Json {
        (*value).into()
    }
}

macro_rules! whole {
    ($($type:ty)*) => {$(
        impl OptionCodec<$type> for PlainCodec {
            const KIND: OptionKind = OptionKind::Whole;

            fn parse(text: &str) -> Result<$type, String> {
                text.trim().parse().map_err(|_| {
                    match text.trim().parse::<f64>() {
                        Ok(value) if value.fract() == 0.0 => {
                            format!("expected a whole number from {} to {}", <$type>::MIN, <$type>::MAX)
                        }
                        _ => "expected a whole number".to_owned(),
                    }
                })
            }

            fn json(value: &$type) -> Json {
                (*value).into()
            }

            fn number(value: &$type) -> Option<f64> {
                Some(*value as f64)
            }
        }
    )*};
}

whole!(u8 u16 u32 u64 usize i32 i64);

impl OptionCodec<f64> for PlainCodec {
    const KIND: OptionKind = OptionKind::Number;

    fn parse(text: &str) -> Result<f64, String> {
        text.trim().parse().map_err(|_| "expected a number".to_owned())
    }

    /// JSON has no infinite numbers and no NaN: these are written as text.
    fn json(value: &f64) -> Json {
        if value.is_finite() { (*value).into() } else { value.to_string().into() }
    }

    fn number(value: &f64) -> Option<f64> {
        Some(*value)
    }
}

impl OptionCodec<String> for PlainCodec {
    const KIND: OptionKind = OptionKind::Text;

    fn parse(text: &str) -> Result<String, String> {
        if text.is_empty() { Err("expected text".to_owned()) } else { Ok(text.to_owned()) }
    }

    fn json(value: &String) -> Json {
        value.as_str().into()
    }
}

impl<T, C: OptionCodec<T>> OptionCodec<Option<T>> for C {
    const KIND: OptionKind = <C as OptionCodec<T>>::KIND;
    const SHAPE: OptionArity = OptionArity::Optional;

    fn parse(text: &str) -> Result<Option<T>, String> {
        <C as OptionCodec<T>>::parse(text).map(Some)
    }

    fn json(value: &Option<T>) -> Json {
        value.as_ref().map_or(Json::Null, <C as OptionCodec<T>>::json)
    }

    fn number(value: &Option<T>) -> Option<f64> {
        value.as_ref().and_then(<C as OptionCodec<T>>::number)
    }
}

/// Repeatable options: each use adds a value.
impl<T, C: OptionCodec<T>> OptionCodec<Vec<T>> for C {
    const KIND: OptionKind = <C as OptionCodec<T>>::KIND;
    const SHAPE: OptionArity = OptionArity::Repeated;

    fn parse(text: &str) -> Result<Vec<T>, String> {
        <C as OptionCodec<T>>::parse(text).map(|value| vec![value])
    }

    fn parse_all(texts: &[String]) -> Result<Vec<T>, String> {
        texts.iter().map(|text| <C as OptionCodec<T>>::parse(text)).collect()
    }

    fn json(value: &Vec<T>) -> Json {
        value.iter().map(<C as OptionCodec<T>>::json).collect()
    }
}

/// A readable value of any type.
pub trait AnyValue {
    /// As JSON.
    fn json(&self) -> Json;

    /// As a number, if it is one.
    fn number(&self) -> Option<f64>;
}

/// A settable value of any type.
pub trait SetValue {
    /// Sets it from the given texts.
    ///
    /// # Errors
    /// A description of the expected value.
    fn set(&mut self, texts: &[String]) -> Result<(), String>;
}

/// A value read through its codec.
#[derive(Debug)]
pub struct CodecValue<'a, T, C>(&'a T, PhantomData<C>);

impl<'a, T, C> CodecValue<'a, T, C> {
    /// Wraps a value.
    pub fn new(value: &'a T) -> Self {
        Self(value, PhantomData)
    }
}

impl<T, C: OptionCodec<T>> AnyValue for CodecValue<'_, T, C> {
    fn json(&self) -> Json {
        C::json(self.0)
    }

    fn number(&self) -> Option<f64> {
        C::number(self.0)
    }
}

/// A value set through its codec.
#[derive(Debug)]
pub struct Settable<'a, T, C>(&'a mut T, PhantomData<C>);

impl<'a, T, C> Settable<'a, T, C> {
    /// Wraps a value.
    pub fn new(value: &'a mut T) -> Self {
        Self(value, PhantomData)
    }
}

impl<T, C: OptionCodec<T>> SetValue for Settable<'_, T, C> {
    fn set(&mut self, texts: &[String]) -> Result<(), String> {
        *self.0 = C::parse_all(texts)?;
        Ok(())
    }
}

/// Parses a text and returns the value as JSON.
///
/// # Errors
/// Errors of [`OptionCodec::parse`].
pub fn read_text<T, C: OptionCodec<T>>(text: &str) -> Result<Json, String> {
    C::parse(text).map(|value| C::json(&value))
}
