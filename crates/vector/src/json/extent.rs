//! Finds the end of an object or array without parsing it.

/// Bytes compared at a time.
const LANES: usize = 32;

/// Search for the end of an object or array, resumable when more text arrives.
pub(crate) struct JsonEndSearch {
    open: u8,
    close: u8,
    /// Open objects (or arrays).
    depth: u64,
    is_quoted: bool,
    /// Bytes searched.
    seen: usize,
}

impl JsonEndSearch {
    /// A search for the end of the value that begins with `open`, a brace or a bracket.
    pub(crate) fn new(open: u8) -> Self {
        let close = if open == b'{' { b'}' } else { b']' };
        Self { open, close, depth: 0, is_quoted: false, seen: 0 }
    }

    /// Length of the value if it ends within `text`, which extends the text of the earlier calls. Only
    /// brackets of the kind of `open` are counted. O(new text).
    pub(crate) fn end(&mut self, text: &[u8]) -> Option<usize> {
        while self.seen < text.len() {
            let rest = &text[self.seen..];
            if self.is_quoted {
                let Some(found) = find(rest, |b| (b == b'"') | (b == b'\\')) else {
                    self.seen = text.len();
                    break;
                };
                if rest[found] == b'"' {
                    self.is_quoted = false;
                } else if found + 1 == rest.len() {
                    // The escaped character is not buffered yet.
                    self.seen += found;
                    break;
                }
                self.seen += found + 1 + usize::from(rest[found] == b'\\');
                continue;
            }
            let (open, close) = (self.open, self.close);
            let Some(found) = find(rest, |b| (b == b'"') | (b == open) | (b == close)) else {
                self.seen = text.len();
                break;
            };
            self.seen += found + 1;
            match rest[found] {
                b'"' => self.is_quoted = true,
                byte if byte == open => self.depth += 1,
                _ => {
                    self.depth -= 1;
                    if self.depth == 0 {
                        return Some(self.seen);
                    }
                }
            }
        }
        None
    }
}

/// The first byte that satisfies `is_it`; vectorised, as nearly all bytes are digits.
#[inline(always)]
fn find(text: &[u8], is_it: impl Fn(u8) -> bool) -> Option<usize> {
    let (lanes, rest) = text.as_chunks::<LANES>();
    for (at, some) in lanes.iter().enumerate() {
        if some.iter().fold(false, |any, &byte| any | is_it(byte)) {
            return some.iter().position(|&byte| is_it(byte)).map(|found| at * LANES + found);
        }
    }
    let done = text.len() - rest.len();
    rest.iter().position(|&byte| is_it(byte)).map(|found| done + found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Byte by byte.
    fn plain(text: &[u8]) -> Option<usize> {
        let open = text[0];
        let close = if open == b'{' { b'}' } else { b']' };
        let (mut depth, mut quoted, mut at) = (0, false, 0);
        while at < text.len() {
            match text[at] {
                b'\\' if quoted => at += 1,
                b'"' => quoted = !quoted,
                b if b == open && !quoted => depth += 1,
                b if b == close && !quoted => {
                    depth -= 1;
                    if depth == 0 {
                        return Some(at + 1);
                    }
                }
                _ => {}
            }
            at += 1;
        }
        None
    }

    proptest! {
        #[test]
        fn like_byte_by_byte(body in "[]{}\\[\"\\\\1x ]{0,90}", cuts in prop::collection::vec(0_usize..90, 0..4)) {
            for open in ["{", "["] {
                let text = format!("{open}{body}");
                let mut cuts = cuts.clone();
                cuts.sort_unstable();
                let mut extent = JsonEndSearch::new(open.as_bytes()[0]);
                let parts = cuts.iter().map(|&cut| cut.min(text.len())).chain([text.len()]);
                let found = parts.map(|cut| extent.end(&text.as_bytes()[..cut])).find(Option::is_some);
                prop_assert_eq!(found.flatten(), plain(text.as_bytes()), "{}", text);
            }
        }
    }
}
