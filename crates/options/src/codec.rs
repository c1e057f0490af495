//! Values as texts and as JSON.

use std::marker::PhantomData;

use serde_json::Value as Json;

use crate::table::{ChoiceName, OptionArity, OptionKind};

/// How values of a type are written, as texts and as JSON. All that a door is given becomes texts first, so that there is
/// one way to read a value.
pub trait OptionCodec<T> {
    /// What values are.
    const KIND: OptionKind;
    /// How many a field takes.
    const SHAPE: OptionArity = OptionArity::One;

    /// A value from its text.
    ///
    /// # Errors
    /// What was expected instead.
    fn parse(text: &str) -> Result<T, String>;

    /// A value from all texts that were given: the last one counts, unless values are repeated.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    fn parse_all(texts: &[String]) -> Result<T, String> {
        Self::parse(texts.last().map_or("", String::as_str))
    }

    /// A value as JSON, from which [`texts_of`](crate::texts_of) makes the same value.
    fn json(value: &T) -> Json;

    /// A value as a number, where it is one that a range is for.
    fn number(_value: &T) -> Option<f64> {
        None
    }
}

/// The usual way to write flags, numbers, texts and choices.
#[derive(Debug)]
pub struct PlainCodec;

/// An enum whose values have names.
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

    /// The value of a name, letter case and underscores aside.
    ///
    /// # Errors
    /// The names that there are.
    fn named(name: &str) -> Result<Self, String> {
        let wanted = name.trim().to_ascii_lowercase().replace('_', "-");
        let found = Self::ALL.iter().find(|(_, named)| named.name == wanted);
        found.map(|(value, _)| *value).ok_or_else(|| {
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

    /// JSON has no infinite numbers and no NaN: these are texts.
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

/// Given again and again, each time one more.
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

/// A value of any type to look at.
pub trait AnyValue {
    /// As JSON.
    fn json(&self) -> Json;

    /// As a number, where it is one.
    fn number(&self) -> Option<f64>;
}

/// A value of any type to set.
pub trait SetValue {
    /// Sets it from the texts that were given.
    ///
    /// # Errors
    /// What was expected instead.
    fn set(&mut self, texts: &[String]) -> Result<(), String>;
}

/// A value that is looked at by way of its codec.
#[derive(Debug)]
pub struct CodecValue<'a, T, C>(&'a T, PhantomData<C>);

impl<'a, T, C> CodecValue<'a, T, C> {
    /// Of this value.
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

/// A value that is set by way of its codec.
#[derive(Debug)]
pub struct Settable<'a, T, C>(&'a mut T, PhantomData<C>);

impl<'a, T, C> Settable<'a, T, C> {
    /// Of this value.
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

/// The value of a text as JSON, however it is written.
///
/// # Errors
/// Those of [`OptionCodec::parse`].
pub fn read_text<T, C: OptionCodec<T>>(text: &str) -> Result<Json, String> {
    C::parse(text).map(|value| C::json(&value))
}
