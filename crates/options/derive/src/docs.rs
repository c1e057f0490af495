//! Doc comments as plain text.

use syn::{Attribute, Expr, ExprLit, Lit, Meta};

/// The text of a doc comment: lines of a paragraph are joined, paragraphs are separated by an empty line, links are
/// replaced by their text, and the full stop of a single sentence is removed.
pub(crate) fn text(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(pair) if pair.path.is_ident("doc") => match &pair.value {
            Expr::Lit(ExprLit { lit: Lit::Str(line), .. }) => Some(line.value().trim().to_owned()),
            _ => None,
        },
        _ => None,
    });
    let lines: Vec<String> = lines.collect();
    let paragraphs = lines.split(|line| line.is_empty()).filter(|lines| !lines.is_empty());
    let text = paragraphs.map(|lines| lines.join(" ")).collect::<Vec<_>>().join("\n\n");
    let text = without_links(&text);
    match text.contains("\n\n") {
        true => text,
        false => text.trim_end_matches('.').to_owned(),
    }
}

/// Removes the link syntax of `[shown](target)` and ``[`Shown`]``.
fn without_links(text: &str) -> String {
    let (mut plain, mut rest) = (String::new(), text);
    while let Some((before, after)) = rest.split_once('[') {
        let Some((shown, tail)) = after.split_once(']') else { break };
        let target = tail.strip_prefix('(').and_then(|tail| tail.split_once(')'));
        let is_link = target.is_some() || shown.starts_with('`');
        plain += before;
        plain += &if is_link { shown.to_owned() } else { format!("[{shown}]") };
        rest = target.map_or(tail, |(_, tail)| tail);
    }
    plain + rest
}
