//! A page put together: markup, style, scripts, facts and arrays in one text.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use crate::html::pack::{PackedArray, QuantizedAxis};
use terrane_base::error::{Error, ErrorKind, Result};

/// Parts of a page other than its data.
#[derive(Clone, Copy, Debug)]
pub struct Template {
    /// Its name.
    pub name: &'static str,
    /// HTML of its body.
    body: &'static str,
    /// Its scripts in their order: one scope for all.
    scripts: &'static [&'static str],
    /// True if it requests further data from its server.
    requests: bool,
}

/// Every kind of page. A new one is its files in `web/` and an entry here.
pub const TEMPLATES: &[Template] = &[
    Template {
        name: "surface",
        body: include_str!("../../web/surface.html"),
        scripts: &[
            include_str!("../../web/common.js"),
            include_str!("../../web/camera.js"),
            include_str!("../../web/tools.js"),
            include_str!("../../web/planar.js"),
            include_str!("../../web/surface_index.js"),
            include_str!("../../web/surface_draw.js"),
            include_str!("../../web/surface.js"),
        ],
        requests: false,
    },
    Template {
        name: "cloud",
        body: include_str!("../../web/cloud.html"),
        scripts: &[
            include_str!("../../web/common.js"),
            include_str!("../../web/camera.js"),
            include_str!("../../web/tools.js"),
            include_str!("../../web/planar.js"),
            include_str!("../../web/cloud_draw.js"),
            include_str!("../../web/cloud.js"),
        ],
        requests: false,
    },
    Template {
        name: "lines",
        body: include_str!("../../web/lines.html"),
        scripts: &[
            include_str!("../../web/common.js"),
            include_str!("../../web/camera.js"),
            include_str!("../../web/lines_filter.js"),
            include_str!("../../web/lines_draw.js"),
            include_str!("../../web/lines.js"),
        ],
        requests: false,
    },
    Template {
        name: "insertion",
        body: include_str!("../../web/insertion.html"),
        scripts: &[
            include_str!("../../web/common.js"),
            include_str!("../../web/insertion_mesh.js"),
            include_str!("../../web/insertion.js"),
        ],
        requests: false,
    },
    Template {
        name: "tiles",
        body: include_str!("../../web/tiles.html"),
        scripts: &[
            include_str!("../../web/common.js"),
            include_str!("../../web/camera.js"),
            include_str!("../../web/tools.js"),
            include_str!("../../web/globe.js"),
            include_str!("../../web/tiles_ask.js"),
            include_str!("../../web/tiles_decode.js"),
            include_str!("../../web/tiles_three.js"),
            include_str!("../../web/tiles_stream.js"),
            include_str!("../../web/tiles_draw.js"),
            include_str!("../../web/tiles_section.js"),
            include_str!("../../web/tiles.js"),
        ],
        requests: true,
    },
];

/// The style of all pages.
const STYLE: &str = include_str!("../../web/page.css");

/// A page to be filled.
#[derive(Clone, Debug)]
pub struct HtmlPage {
    template: &'static Template,
    title: String,
    facts: Map<String, Value>,
    arrays: Vec<(&'static str, PackedArray)>,
}

impl HtmlPage {
    /// An empty page of the template called `name`.
    ///
    /// # Errors
    /// `Internal`: there is no such template.
    pub fn new(name: &str, title: &str) -> Result<Self> {
        let template =
            TEMPLATES.iter().find(|template| template.name == name).ok_or_else(|| {
                Error::new(ErrorKind::Internal, format!("the page template {name} is missing"))
            })?;
        Ok(Self { template, title: title.to_owned(), facts: Map::new(), arrays: Vec::new() })
    }

    /// Adds a fact under a name.
    pub fn fact(&mut self, name: &str, value: impl Into<Value>) {
        self.facts.insert(name.to_owned(), value.into());
    }

    /// Adds an array under a name of letters.
    pub fn array(&mut self, name: &'static str, packed: PackedArray) {
        self.arrays.push((name, packed));
    }

    /// Adds the coordinates along an axis, and how to get them from their codes.
    pub fn axis(&mut self, name: &'static str, axis: &QuantizedAxis) {
        let facts = json!({ "low": axis.low, "step": axis.step, "rounding": axis.rounding });
        self.fact(name, facts);
        self.array(name, PackedArray::steps(&axis.codes));
    }

    /// The whole page. It takes as much memory again as its arrays.
    pub fn html(self) -> String {
        let size: usize = self.arrays.iter().map(|(_, packed)| packed.text.len() + 128).sum();
        let mut out = String::with_capacity(size + (1 << 18));
        let script =
            format!("'use strict';(() => {{\n{}\n}})();\n", self.template.scripts.concat());
        let title = escape(&self.title);
        // Writing to a text cannot fail.
        let _ = write!(
            out,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n\
             <body class=\"{}\">\n{}\n",
            policy(&script, self.template.requests),
            self.template.name,
            self.template.body.replace("{{title}}", &title),
        );
        let described = self.arrays.iter().map(|(name, packed)| {
            let of = json!({ "count": packed.count, "differences": packed.differences });
            ((*name).to_owned(), of)
        });
        let described: Map<String, Value> = described.collect();
        let mut facts = self.facts;
        facts.insert("title".to_owned(), Value::from(self.title));
        facts.insert("arrays".to_owned(), Value::from(described));
        data(&mut out, "facts", "application/json", &in_script(&Value::from(facts)));
        for (name, packed) in self.arrays {
            data(&mut out, &format!("array-{name}"), "text/plain", &packed.text);
        }
        let _ = write!(out, "<script>{script}</script>\n</body>\n</html>\n");
        out
    }
}

/// A block that no browser runs.
fn data(out: &mut String, id: &str, kind: &str, text: &str) {
    let _ = writeln!(out, "<script id=\"{id}\" type=\"{kind}\">{text}</script>");
}

/// Content security policy of a page: run this one script, and fetch nothing, or nothing from elsewhere.
fn policy(script: &str, requests: bool) -> String {
    let connect = if requests { "connect-src 'self'; " } else { "" };
    format!(
        "default-src 'none'; {connect}script-src 'sha256-{}'; style-src 'sha256-{}'; img-src data: blob:; \
         base-uri 'none'; form-action 'none'",
        sha256_base64(script),
        sha256_base64(STYLE)
    )
}

fn sha256_base64(text: &str) -> String {
    STANDARD.encode(Sha256::digest(text))
}

/// JSON that no tag can end.
fn in_script(value: &Value) -> String {
    value
        .to_string()
        .replace('<', "\\u003c")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029")
}

/// Text that stands for itself in HTML, in and between tags.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTILE: &str = "</script><script>alert(1)</script><!--\"'&\u{2028}";

    fn page(template: &Template) -> String {
        let mut page = HtmlPage::new(template.name, HOSTILE).unwrap();
        page.fact("input", HOSTILE);
        page.axis("x", &QuantizedAxis::of(&[1.0, 2.5]));
        page.html()
    }

    #[test]
    fn names_from_files_cannot_end_a_tag() {
        for template in TEMPLATES {
            let html = page(template);
            assert!(!html.contains("<script>alert"), "{}", template.name);
            assert_eq!(html.matches("<script>").count(), 1, "{}", template.name);
            assert_eq!(html.matches("</script>").count(), 3, "facts, an array, the script");
            assert!(html.contains("<title>&lt;/script&gt;&lt;script&gt;alert(1)"));
            let facts = html.split("type=\"application/json\">").nth(1).unwrap();
            let facts = facts.split("</script>").next().unwrap();
            let facts: Value = serde_json::from_str(facts).unwrap();
            assert_eq!((&facts["input"], &facts["title"]), (&json!(HOSTILE), &json!(HOSTILE)));
            assert_eq!(facts["x"]["step"], json!(1.5));
        }
    }

    #[test]
    fn pages_load_nothing() {
        for template in TEMPLATES {
            let html = page(template);
            for word in [
                "http:",
                "https:",
                "//cdn",
                "import(",
                "fetch(",
                "XMLHttpRequest",
                "eval(",
                "WebSocket",
                "src=",
                "@import",
                "url(",
                "innerHTML",
                "document.write",
            ] {
                let may_fetch = template.requests && word == "fetch(";
                assert!(may_fetch || !html.contains(word), "{}: {word}", template.name);
            }
            assert!(html.contains("default-src 'none'"));
            assert_eq!(
                html.contains("connect-src 'self';"),
                template.requests,
                "{}",
                template.name
            );
            assert_eq!(html.contains("connect-src"), template.requests, "{}", template.name);
            assert!(!html.contains("{{"), "{}: all is filled in", template.name);
        }
    }

    #[test]
    fn the_policy_names_the_script_that_is_there() {
        let html = page(&TEMPLATES[0]);
        let script = html.split("<script>").nth(1).unwrap().split("</script>").next().unwrap();
        let hash = STANDARD.encode(Sha256::digest(script));
        assert!(html.contains(&format!("script-src 'sha256-{hash}'")));
        assert!(HtmlPage::new("no such", "").is_err());
    }
}
