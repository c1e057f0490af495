//! Text encodings.

use std::borrow::Cow;
use std::path::Path;

use encoding_rs::{UTF_8, WINDOWS_1252};
use terrane_base::error::{Error, Result};

/// Encoding of the text of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TextEncoding {
    /// Declared. ISO 8859-1 is read as Windows-1252, a superset of its printable characters.
    Known(&'static encoding_rs::Encoding),
    /// Not declared: UTF-8 if valid, else ISO 8859-1.
    Unknown,
    /// Declared, but unknown: only ASCII can be read.
    Other(String),
}

impl TextEncoding {
    /// The encoding declared in the `.cpg` sidecar of the table at `path`, or else by the language driver id
    /// of the table header.
    pub(super) fn find(path: &Path, driver: u8) -> Self {
        let names = ["cpg", "CPG", "cst"].map(|ending| path.with_extension(ending));
        let mut small =
            names.iter().filter(|path| std::fs::metadata(path).is_ok_and(|file| file.len() <= 256));
        match small.find_map(|path| std::fs::read(path).ok()) {
            Some(text) => Self::by_name(String::from_utf8_lossy(&text).trim()),
            None => match driver {
                0 => Self::Unknown,
                0x03 | 0x57 | 0x58 | 0x59 => Self::Known(WINDOWS_1252),
                code => Self::Other(format!("language driver {code:#04x}")),
            },
        }
    }

    fn by_name(name: &str) -> Self {
        let mut plain: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
        plain.make_ascii_lowercase();
        match plain.as_str() {
            "" => return Self::Unknown,
            "65001" => return Self::Known(UTF_8),
            "ldid87" | "ldid3" => return Self::Known(WINDOWS_1252),
            _ => {}
        }
        // Programs write the code page number alone, or after a prefix.
        let number = plain.trim_start_matches(|c: char| c.is_ascii_alphabetic());
        let labels = [name, &plain, &format!("cp{number}"), &format!("iso{number}")]
            .map(|label| encoding_rs::Encoding::for_label(label.as_bytes()));
        match labels.into_iter().flatten().next() {
            Some(encoding) => Self::Known(encoding),
            None => Self::Other(name.chars().take(40).collect()),
        }
    }

    /// Decodes bytes.
    pub(super) fn text<'a>(&self, bytes: &'a [u8]) -> Result<Cow<'a, str>> {
        match (self, std::str::from_utf8(bytes)) {
            (Self::Unknown, Ok(text)) => Ok(Cow::Borrowed(text)),
            (_, Ok(text)) if text.is_ascii() => Ok(Cow::Borrowed(text)),
            (Self::Unknown, Err(_)) => Ok(WINDOWS_1252.decode_without_bom_handling(bytes).0),
            (Self::Known(encoding), _) => {
                let text = encoding.decode_without_bom_handling_and_without_replacement(bytes);
                text.ok_or_else(|| {
                    let name = encoding.name();
                    Error::bad_input(format!(
                        "text is not valid {name}, the encoding declared in the .cpg"
                    ))
                    .remedy("correct the encoding in the .cpg, for example ISO-8859-1")
                })
            }
            (Self::Other(name), _) => {
                Err(Error::unsupported(format!("text encoding {name:?} is not supported"))
                    .remedy("convert the file to UTF-8: ogr2ogr -lco ENCODING=UTF-8"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_texts() {
        let latin = ["ISO-8859-1", "88591", "ISO 8859-1", "latin1", "1252", "CP1252", "ANSI 1252"];
        let names = latin.map(|name| (name, "Ã©"));
        let others = [
            ("UTF-8", "é"),
            ("utf8", "é"),
            ("65001", "é"),
            ("LDID/87", "Ã©"),
            ("1251", "Г©"),
            ("windows-1251", "Г©"),
            ("88592", "ĂŠ"),
        ];
        for (name, text) in names.into_iter().chain(others) {
            assert_eq!(TextEncoding::by_name(name).text("é".as_bytes()).unwrap(), text, "{name}");
        }
        let latin = TextEncoding::Known(WINDOWS_1252);
        assert_eq!(latin.text(&[b'a', 0x80, 0x81, 0xe9]).unwrap(), "a€\u{81}é");
        assert_eq!(TextEncoding::Unknown.text(&[0xe9]).unwrap(), "é");
        assert!(TextEncoding::Known(UTF_8).text(&[0xe9]).is_err());
        let other = TextEncoding::by_name("CP437");
        assert!(other.text(b"abc").is_ok());
        assert!(other.text(&[0xe9]).unwrap_err().to_string().contains("CP437"));
    }
}
