//! WKT as a tree: `KEYWORD["text",1,WORD,KEYWORD[...]]`, in any version.

/// Maximum nesting; a compound bound CRS needs nine levels.
const DEEPEST: u32 = 32;

/// A keyword and its arguments in brackets.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CrsWktNode<'a> {
    pub(super) keyword: &'a str,
    pub(super) values: Vec<CrsWktValue<'a>>,
    /// Source text of the node.
    pub(super) text: &'a str,
}

/// An argument in brackets.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum CrsWktValue<'a> {
    /// Quoted text; a doubled quotation mark is escaped.
    Text(String),
    Number(f64),
    /// Unquoted word, such as the direction of an axis.
    Word(&'a str),
    Node(CrsWktNode<'a>),
}

impl<'a> CrsWktNode<'a> {
    /// The root nodes of `text`: Esri writes the vertical CRS after the horizontal one. `None` if the text is not
    /// WKT.
    pub(super) fn all(text: &'a str) -> Option<Vec<Self>> {
        let mut pen = CrsWktParser { text, at: 0 };
        let mut nodes = Vec::new();
        loop {
            let CrsWktValue::Node(node) = pen.value(0)? else { return None };
            nodes.push(node);
            if !pen.takes(',') {
                break;
            }
        }
        pen.skip_space();
        (pen.at == text.len()).then_some(nodes)
    }

    pub(super) fn is(&self, keywords: &[&str]) -> bool {
        keywords.iter().any(|known| self.keyword.eq_ignore_ascii_case(known))
    }

    /// The first quoted text.
    pub(super) fn name(&self) -> &str {
        self.texts().next().unwrap_or_default()
    }

    fn texts(&self) -> impl Iterator<Item = &str> {
        self.values.iter().filter_map(|value| match value {
            CrsWktValue::Text(text) => Some(text.as_str()),
            _ => None,
        })
    }

    /// The number at index `place` among the numbers.
    pub(super) fn number(&self, place: usize) -> Option<f64> {
        let numbers = self.values.iter().filter_map(|value| match value {
            CrsWktValue::Number(number) => Some(*number),
            _ => None,
        });
        numbers.into_iter().nth(place)
    }

    pub(super) fn children(&self) -> impl Iterator<Item = &CrsWktNode<'a>> {
        self.values.iter().filter_map(|value| match value {
            CrsWktValue::Node(node) => Some(node),
            _ => None,
        })
    }

    /// The first child with one of `keywords`.
    pub(super) fn child(&self, keywords: &[&str]) -> Option<&CrsWktNode<'a>> {
        self.children().find(|child| child.is(keywords))
    }

    /// The first node with one of `keywords`, in depth-first order from this node.
    pub(super) fn find(&self, keywords: &[&str]) -> Option<&CrsWktNode<'a>> {
        match self.is(keywords) {
            true => Some(self),
            false => self.children().find_map(|child| child.find(keywords)),
        }
    }

    /// True if the node has this word, such as UP.
    pub(super) fn has_word(&self, word: &str) -> bool {
        self.values.iter().any(|value| match value {
            CrsWktValue::Word(own) => own.eq_ignore_ascii_case(word),
            _ => false,
        })
    }

    /// The EPSG code of its own `AUTHORITY` or `ID`.
    pub(super) fn code(&self) -> Option<u32> {
        let ids = self.children().filter(|child| child.is(&["AUTHORITY", "ID"]));
        let codes = ids.filter(|id| id.name().eq_ignore_ascii_case("EPSG")).filter_map(|id| {
            let number = id.number(0).filter(|n| n.fract() == 0.0 && (1.0..1e9).contains(n));
            id.texts().nth(1).and_then(|text| text.parse().ok()).or(number.map(|n| n as u32))
        });
        codes.last()
    }
}

struct CrsWktParser<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> CrsWktParser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn skip_space(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    /// Consumes a character if it is next.
    fn takes(&mut self, c: char) -> bool {
        self.skip_space();
        let is_next = self.rest().starts_with(c);
        self.at += if is_next { c.len_utf8() } else { 0 };
        is_next
    }

    // At most `DEEPEST` levels.
    fn value(&mut self, depth: u32) -> Option<CrsWktValue<'a>> {
        if self.takes('"') {
            return self.quoted().map(CrsWktValue::Text);
        }
        let start = self.at;
        let rest = self.rest();
        let length = rest.find(|c| "[](),\"".contains(c)).unwrap_or(rest.len());
        let word = rest[..length].trim();
        self.at += length;
        let is_round = self.rest().starts_with('(');
        if self.takes('[') || self.takes('(') {
            let close = if is_round { ')' } else { ']' };
            let values = self.values(close, depth)?;
            let text = self.text[start..self.at].trim();
            return Some(CrsWktValue::Node(CrsWktNode { keyword: word, values, text }));
        }
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Some(CrsWktValue::Number(number)),
            _ => Some(CrsWktValue::Word(word)),
        }
    }

    fn values(&mut self, close: char, depth: u32) -> Option<Vec<CrsWktValue<'a>>> {
        let mut values = Vec::new();
        if depth == DEEPEST {
            return None;
        }
        if self.takes(close) {
            return Some(values);
        }
        loop {
            values.push(self.value(depth + 1)?);
            if self.takes(close) {
                return Some(values);
            }
            if !self.takes(',') {
                return None;
            }
        }
    }

    /// Text up to the closing quotation mark.
    fn quoted(&mut self) -> Option<String> {
        let mut text = String::new();
        loop {
            let rest = self.rest();
            let end = rest.find('"')?;
            text.push_str(&rest[..end]);
            self.at += end + 1;
            if !self.rest().starts_with('"') {
                return Some(text);
            }
            text.push('"');
            self.at += 1;
        }
    }
}

/// A text in quotation marks.
pub(super) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_is_read_in_either_kind_of_brackets() {
        let text = r#" A[ "x ""y"" (]" , B(1.5,-2e3,UP), C["EPSG",7],ID["EPSG","12"] ] , D["z"]"#;
        let nodes = CrsWktNode::all(text).unwrap();
        let [a, d] = nodes.as_slice() else { panic!("{nodes:?}") };
        assert_eq!((a.name(), d.name(), d.text), (r#"x "y" (]"#, "z", r#"D["z"]"#));
        let b = a.child(&["b"]).unwrap();
        assert_eq!((b.number(1), b.has_word("up"), a.code()), (Some(-2000.0), true, Some(12)));
        assert_eq!(a.find(&["C"]).unwrap().number(0), Some(7.0));
    }

    #[test]
    fn damage_is_no_tree() {
        let deep = "A[".repeat(100_000);
        for text in ["", "[", "A", "A[", "A[\"", "A[1)", "A]", "A[1]]", "A[1] B", "é[é", &deep] {
            assert!(
                CrsWktNode::all(text).is_none_or(|nodes| nodes[0].keyword.is_empty()),
                "{text:.20}"
            );
        }
    }
}
