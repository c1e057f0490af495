//! Encodings of texts.

use std::borrow::Cow;
use std::path::Path;

use terrane_base::error::{Error, Result};

/// How bytes are text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// UTF-8.
    Utf8,
    /// ISO 8859-1, with the printable characters of Windows-1252 where that has control characters.
    Latin1,
    /// Not said: UTF-8 where it is sound, or else as ISO 8859-1.
    Unknown,
    /// Said, and not known: only ASCII can be read.
    Other(String),
}

/// Windows-1252 from 0x80 to 0x9f; where it has none, the control characters of ISO 8859-1.
const WINDOWS: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}',
    '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

impl Encoding {
    /// That which the `.cpg` beside the table at `path` names, or else the language driver in the
    /// table's header.
    pub(super) fn find(path: &Path, driver: u8) -> Self {
        let names = ["cpg", "CPG", "cst"].map(|ending| path.with_extension(ending));
        let is_small = |path: &Path| std::fs::metadata(path).is_ok_and(|m| m.len() <= 256);
        let text = names.iter().filter(|path| is_small(path)).find_map(|p| std::fs::read(p).ok());
        match text {
            Some(text) => Self::by_name(String::from_utf8_lossy(&text).trim()),
            None => match driver {
                0 => Self::Unknown,
                0x03 | 0x57 | 0x58 | 0x59 => Self::Latin1,
                code => Self::Other(format!("language driver {code:#04x}")),
            },
        }
    }

    fn by_name(name: &str) -> Self {
        let plain: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
        match plain.to_ascii_uppercase().as_str() {
            "UTF8" | "65001" => Self::Utf8,
            "ISO88591" | "88591" | "LATIN1" | "1252" | "CP1252" | "WINDOWS1252" | "ANSI1252"
            | "LDID87" | "LDID3" => Self::Latin1,
            "" => Self::Unknown,
            _ => Self::Other(name.chars().take(40).collect()),
        }
    }

    /// The text of bytes.
    pub(super) fn text<'a>(&self, bytes: &'a [u8]) -> Result<Cow<'a, str>> {
        let utf8 = std::str::from_utf8(bytes);
        match (self, utf8) {
            (Self::Utf8 | Self::Unknown, Ok(text)) => Ok(Cow::Borrowed(text)),
            (_, Ok(text)) if text.is_ascii() => Ok(Cow::Borrowed(text)),
            (Self::Utf8, Err(_)) => {
                Err(Error::bad_input("a text is not UTF-8, as the .cpg has it")
                    .remedy("correct the .cpg: it may be ISO-8859-1"))
            }
            (Self::Latin1 | Self::Unknown, _) => Ok(bytes.iter().map(|&b| latin1(b)).collect()),
            (Self::Other(name), _) => {
                Err(Error::unsupported(format!("texts in {name:?} are not supported"))
                    .remedy("write the file anew in UTF-8: ogr2ogr -lco ENCODING=UTF-8"))
            }
        }
    }
}

fn latin1(byte: u8) -> char {
    match byte {
        0x80..=0x9f => WINDOWS[usize::from(byte - 0x80)],
        _ => char::from(byte),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_texts() {
        for (name, text) in
            [("UTF-8", "é"), ("utf8", "é"), ("ISO-8859-1", "Ã©"), ("ANSI 1252", "Ã©")]
        {
            assert_eq!(Encoding::by_name(name).text("é".as_bytes()).unwrap(), text, "{name}");
        }
        assert_eq!(Encoding::Latin1.text(&[b'a', 0x80, 0xe9]).unwrap(), "a€é");
        assert_eq!(Encoding::Unknown.text(&[0xe9]).unwrap(), "é");
        assert!(Encoding::Utf8.text(&[0xe9]).is_err());
        let other = Encoding::by_name("CP437");
        assert!(other.text(b"abc").is_ok());
        assert!(other.text(&[0xe9]).unwrap_err().to_string().contains("CP437"));
    }
}
