//! Cursor over JSON text.

use std::borrow::Cow;

use serde::de::IgnoredAny;

use super::JsonEndSearch;
use terrane_base::error::{Error, Result};

/// A cursor over the text of one value.
pub(crate) struct JsonCursor<'a> {
    text: &'a [u8],
    at: usize,
    /// File offset of the text.
    base: u64,
}

/// A value: a scalar, or the text of an object or array.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum JsonToken<'a> {
    Null,
    Bool(bool),
    /// A number's text.
    Number(&'a str),
    Text(Cow<'a, str>),
    /// An object or array, as valid JSON.
    Nested(&'a str),
}

impl<'a> JsonCursor<'a> {
    pub(crate) fn new(text: &'a [u8], base: u64) -> Self {
        Self { text, at: 0, base }
    }

    /// Offset of the cursor in the file.
    pub(crate) fn offset(&self) -> u64 {
        self.base + self.at as u64
    }

    /// The remaining text.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.text[self.at..]
    }

    pub(super) fn advance(&mut self, bytes: usize) {
        self.at += bytes;
    }

    /// The next byte that is not white space, without consuming it.
    #[inline]
    pub(crate) fn peek(&mut self) -> Option<u8> {
        while let Some(&byte) = self.text.get(self.at) {
            if byte > b' ' {
                return Some(byte);
            }
            if !matches!(byte, b' ' | b'\n' | b'\r' | b'\t') {
                return Some(byte);
            }
            self.at += 1;
        }
        None
    }

    /// Consumes `byte` if it is next.
    #[inline]
    pub(crate) fn take(&mut self, byte: u8) -> bool {
        let is_next = self.peek() == Some(byte);
        self.at += usize::from(is_next);
        is_next
    }

    /// Consumes `byte`, which must be next.
    pub(crate) fn expect(&mut self, byte: u8) -> Result<()> {
        if self.take(byte) {
            return Ok(());
        }
        Err(self.bad(format!("{:?} is missing", char::from(byte))))
    }

    /// The name of the next member of an object, with its colon; `None` at the end of the object. `is_first`
    /// is true before the first member and cleared by the call.
    pub(crate) fn member(&mut self, is_first: &mut bool) -> Result<Option<Cow<'a, str>>> {
        if self.take(b'}') {
            return Ok(None);
        }
        if !std::mem::take(is_first) {
            self.expect(b',')?;
        }
        let name = self.string()?;
        self.expect(b':')?;
        Ok(Some(name))
    }

    /// True if another item of an array follows; consumes the end of the array.
    pub(crate) fn item(&mut self, is_first: &mut bool) -> Result<bool> {
        if self.take(b']') {
            return Ok(false);
        }
        if !std::mem::take(is_first) {
            self.expect(b',')?;
        }
        Ok(true)
    }

    /// A string.
    pub(crate) fn string(&mut self) -> Result<Cow<'a, str>> {
        if self.peek() != Some(b'"') {
            return Err(self.bad("string expected"));
        }
        let rest = self.rest();
        let end = rest[1..].iter().position(|&b| b == b'"' || b == b'\\').map(|end| end + 1);
        match end {
            Some(end) if rest[end] == b'"' => {
                let text = std::str::from_utf8(&rest[1..end]);
                let text = text.map_err(|_| self.bad("string is not UTF-8"))?;
                self.at += end + 1;
                Ok(Cow::Borrowed(text))
            }
            _ => self.escaped(),
        }
    }

    /// A string with escapes.
    fn escaped(&mut self) -> Result<Cow<'a, str>> {
        let rest = self.rest();
        let mut end = 1;
        while let Some(&byte) = rest.get(end) {
            match byte {
                b'"' => break,
                b'\\' => end += 2,
                _ => end += 1,
            }
        }
        if end >= rest.len() {
            return Err(self.bad("unterminated string"));
        }
        let text: String = serde_json::from_slice(&rest[..=end])
            .map_err(|e| self.bad(format!("string is not valid JSON: {e}")))?;
        self.at += end + 1;
        Ok(Cow::Owned(text))
    }

    /// Any value; objects and arrays are validated and skipped.
    pub(crate) fn value(&mut self) -> Result<JsonToken<'a>> {
        match self.peek() {
            Some(b'"') => self.string().map(JsonToken::Text),
            Some(b'{' | b'[') => self.nested().map(JsonToken::Nested),
            Some(b'n') => self.literal("null", JsonToken::Null),
            Some(b't') => self.literal("true", JsonToken::Bool(true)),
            Some(b'f') => self.literal("false", JsonToken::Bool(false)),
            _ => self.number(),
        }
    }

    /// The text of an object or array, validated.
    fn nested(&mut self) -> Result<&'a str> {
        let start = self.at;
        let json = self.skip_nested()?;
        let mut deserializer = serde_json::Deserializer::from_slice(json.as_bytes());
        let sound = serde::Deserialize::deserialize(&mut deserializer);
        match sound {
            Ok(IgnoredAny) => Ok(json),
            Err(e) => {
                self.at = start;
                Err(self.bad(format!("not valid JSON: {e}")))
            }
        }
    }

    /// The text of an object or array, not validated.
    pub(crate) fn skip_nested(&mut self) -> Result<&'a str> {
        let open = self.peek().filter(|byte| matches!(byte, b'{' | b'['));
        let open = open.ok_or_else(|| self.bad("object or array expected"))?;
        let rest = self.rest();
        let end = JsonEndSearch::new(open).end(rest);
        let end = end.ok_or_else(|| self.bad("unterminated object or array"))?;
        let json = std::str::from_utf8(&rest[..end]);
        let json = json.map_err(|_| self.bad("text is not UTF-8"))?;
        self.at += end;
        Ok(json)
    }

    fn literal(&mut self, word: &str, token: JsonToken<'a>) -> Result<JsonToken<'a>> {
        if !self.rest().starts_with(word.as_bytes()) {
            return Err(self.bad("not valid JSON: value expected"));
        }
        self.at += word.len();
        Ok(token)
    }

    fn number(&mut self) -> Result<JsonToken<'a>> {
        let rest = self.rest();
        let digits =
            rest.iter().take_while(|b| matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
        let end = digits.count();
        // The number grammar is checked by the JSON library.
        let sound = serde_json::from_slice::<IgnoredAny>(&rest[..end]).is_ok();
        match std::str::from_utf8(&rest[..end]) {
            Ok(number) if sound => {
                self.at += end;
                Ok(JsonToken::Number(number))
            }
            _ => Err(self.bad("not valid JSON: value expected")),
        }
    }

    /// An error at the cursor.
    pub(crate) fn bad(&self, message: impl std::fmt::Display) -> Error {
        Error::bad_input(format!("byte {}: {message}", self.offset()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Result<Vec<JsonToken<'_>>> {
        let mut cursor = JsonCursor::new(text.as_bytes(), 0);
        cursor.expect(b'[')?;
        let (mut first, mut found) = (true, Vec::new());
        while cursor.item(&mut first)? {
            found.push(cursor.value()?);
        }
        Ok(found)
    }

    #[test]
    fn every_kind_of_value() {
        let found =
            values(r#" [ null,true , false,-1.5e3,"a\"\u00e9", "é", {"b":[1]}, [] ]"#).unwrap();
        let text = |text: &'static str| JsonToken::Text(text.into());
        assert_eq!(
            found,
            [
                JsonToken::Null,
                JsonToken::Bool(true),
                JsonToken::Bool(false),
                JsonToken::Number("-1.5e3"),
                text("a\"é"),
                text("é"),
                JsonToken::Nested("{\"b\":[1]}"),
                JsonToken::Nested("[]"),
            ]
        );
    }

    #[test]
    fn damage_is_told_with_its_byte() {
        for (text, place) in [
            ("[1 2]", "byte 3"),
            ("[nul]", "byte 1"),
            ("[01]", "byte 1"),
            ("[1", "byte 2"),
            ("[\"a", "byte 1"),
            ("[\"\\x\"]", "byte 1"),
            ("[{\"a\":}]", "byte 1"),
            ("[{\"a\":1]", "byte 1"),
            ("[\"\\", "byte 1"),
            ("", "byte 0"),
        ] {
            let error = values(text).unwrap_err().to_string();
            assert!(error.contains(place), "{text}: {error}");
        }
    }
}
