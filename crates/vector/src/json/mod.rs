//! JSON for features: finding the end of a value without parsing it, and a cursor that parses a value.
//! Nothing here recurses.

mod coordinates;
mod cursor;
mod extent;

pub(super) use cursor::{JsonCursor, JsonToken};
pub(super) use extent::JsonEndSearch;

/// Appends `text` as a JSON string.
pub(super) fn push_text(text: &str, out: &mut Vec<u8>) {
    // Writing into a vector cannot fail.
    let _ = serde_json::to_writer(out, text);
}

/// `json` without white space between tokens, on one line.
pub(super) fn compact(json: &str) -> String {
    let (mut quoted, mut escaped) = (false, false);
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if quoted || !matches!(c, ' ' | '\t' | '\n' | '\r') {
            out.push(c);
        }
        quoted ^= c == '"' && !escaped;
        escaped = c == '\\' && !escaped && quoted;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_space_goes_but_not_from_texts() {
        let json = "{ \"a b\\\" c\" : [ 1,\n 2 ],\t\"d\\\\\" : \" \" }";
        assert_eq!(compact(json), "{\"a b\\\" c\":[1,2],\"d\\\\\":\" \"}");
    }
}
