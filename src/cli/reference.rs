//! Generated pages of the book: verbs with their options, and the registries. A test compares them with the
//! repository.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use clap::{Arg, Command};

/// Command that renews the pages.
const RENEW: &str = "TERRANE_DOCS=renew cargo test --lib reference";

/// Number of verbs from which a shared option is listed once, in a separate table.
const MANY: usize = 4;

/// Every verb by name, plans as `plan tin` and `plan grid`.
fn verbs() -> Vec<(String, Command)> {
    let mut command = super::command();
    command.build();
    let mut verbs = Vec::new();
    for verb in
        command.get_subcommands().filter(|verb| verb.get_name() != "help" && !verb.is_hide_set())
    {
        let name = verb.get_name().to_owned();
        let below: Vec<_> = verb.get_subcommands().filter(|c| c.get_name() != "help").collect();
        if below.is_empty() {
            verbs.push((name.clone(), verb.clone()));
        }
        verbs.extend(below.iter().map(|c| (format!("{name} {}", c.get_name()), (*c).clone())));
    }
    verbs.sort_by(|(a, _), (b, _)| a.cmp(b));
    verbs
}

fn verbs_page() -> String {
    let verbs = verbs();
    let mut users: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for (name, verb) in &verbs {
        for option in options(verb) {
            users.entry(row(option)).or_default().push(name);
        }
    }
    users.retain(|_, verbs| verbs.len() >= MANY);
    let mut page = format!("# Verbs and options\n\n<!-- Written by the code: {RENEW} -->\n");
    page += "\nShared options are at the [end](#options-of-many-verbs).\n";
    for (name, verb) in &verbs {
        page += &section(name, verb, &users);
    }
    page += "\n## Options of many verbs\n\n| option | means | verbs |\n|---|---|---|\n";
    for (row, verbs) in users {
        writeln!(page, "{row} {} |", verbs.join(", ")).unwrap();
    }
    page
}

/// A verb: summary, names, options by heading.
fn section(name: &str, verb: &Command, common: &BTreeMap<String, Vec<&str>>) -> String {
    let about = verb.get_long_about().or(verb.get_about()).unwrap().to_string();
    let usage = verb.clone().render_usage().to_string();
    let usage = usage.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut text = format!(
        "\n## terrane {name}\n\n{}\n",
        about.split("\n\n").map(escaped).collect::<Vec<_>>().join("\n\n")
    );
    write!(text, "\n```text\n{}\n```\n", usage.trim_start_matches("Usage: ")).unwrap();
    let names = verb.get_positionals().map(row);
    text += &table("name", names);
    let own = options(verb).map(row).filter(|row| !common.contains_key(row));
    text += &table("option", own);
    let shared = options(verb).filter(|option| common.contains_key(&row(option)));
    let shared: Vec<_> = shared.filter_map(|o| Some(format!("`--{}`", o.get_long()?))).collect();
    if !shared.is_empty() {
        write!(text, "\nAlso {}.\n", shared.join(", ")).unwrap();
    }
    text
}

fn table(what: &str, rows: impl Iterator<Item = String>) -> String {
    let rows: Vec<_> = rows.collect();
    if rows.is_empty() {
        return String::new();
    }
    format!("\n| {what} | means |\n|---|---|\n{}\n", rows.join("\n"))
}

fn options(verb: &Command) -> impl Iterator<Item = &Arg> {
    let options = verb.get_arguments().filter(|arg| !arg.is_positional() && !arg.is_hide_set());
    options.filter(|arg| !["help", "version"].contains(&arg.get_id().as_str()))
}

/// `| option | means |`.
fn row(arg: &Arg) -> String {
    let values = arg.get_value_names().filter(|_| takes_value(arg)).unwrap_or_default();
    let value: String = values.iter().map(|name| format!(" {name}")).collect();
    let short = arg.get_short().map(|c| format!("`-{c}`, "));
    let name = match arg.get_long() {
        Some(long) => format!("{}`--{long}{value}`", short.unwrap_or_default()),
        None => format!("`{}`", value.trim()),
    };
    format!("| {name} | {} |", meaning(arg))
}

fn takes_value(arg: &Arg) -> bool {
    arg.get_num_args().is_some_and(|n| n.takes_values())
}

/// Help of an option, with values, default and aliases.
fn meaning(arg: &Arg) -> String {
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let mut text = escaped(&help);
    if !takes_value(arg) {
        return text;
    }
    let values: Vec<_> = arg.get_possible_values();
    let values = values.iter().filter(|v| !v.is_hide_set()).map(|v| match v.get_help() {
        Some(help) => format!("`{}`: {}", v.get_name(), escaped(&help.to_string())),
        None => format!("`{}`", v.get_name()),
    });
    let values: Vec<_> = values.collect();
    if !values.is_empty() {
        write!(text, ". {}", values.join("; ")).unwrap();
    }
    let default: Vec<_> = arg.get_default_values().iter().map(|v| v.to_string_lossy()).collect();
    if !default.is_empty() {
        write!(text, " [default: {}]", default.join(",")).unwrap();
    }
    for alias in arg.get_visible_aliases().unwrap_or_default() {
        write!(text, " [also `--{alias}`]").unwrap();
    }
    text
}

fn names_page() -> String {
    let mut page = format!("# Names\n\n<!-- Written by the code: {RENEW} -->\n");
    page += "\nNames of formats, statistics, methods, terrain characters and parameters.\n";
    let mut titles = BTreeSet::new();
    for (_, verb) in verbs() {
        let lists = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
        for (title, rows) in lists.split("\n\n").filter_map(|list| list.split_once(":\n")) {
            if titles.insert(title.to_owned()) {
                page += &listed(title, rows);
            }
        }
    }
    page
}

/// A help list as a table; its columns are two spaces apart.
fn listed(title: &str, rows: &str) -> String {
    let rows = rows.lines().map(|row| row.split("  ").map(str::trim).filter(|c| !c.is_empty()));
    let rows: Vec<Vec<&str>> = rows.map(Iterator::collect).collect();
    let has_middle = rows.iter().any(|row| row.len() > 2);
    let rows = rows.iter().map(|row| {
        let middle = if row.len() > 2 { escaped(row[1]) } else { String::new() };
        let middle = if has_middle { format!(" {middle} |") } else { String::new() };
        format!("| `{}` |{middle} {} |", row[0], escaped(row[row.len() - 1]))
    });
    let rows: Vec<_> = rows.collect();
    let head =
        if has_middle { "| name | | what |\n|---|---|---|" } else { "| name | what |\n|---|---|" };
    let title = title.split(", ").next().unwrap_or(title);
    format!("\n## {title}\n\n{head}\n{}\n", rows.join("\n"))
}

/// Text for a table cell, on one line.
fn escaped(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.replace('|', "\\|").replace('<', "&lt;")
}

#[test]
fn the_pages_are_what_the_code_says() {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/src/reference"));
    for (name, page) in [("verbs.md", verbs_page()), ("names.md", names_page())] {
        let path = folder.join(name);
        if std::env::var_os("TERRANE_DOCS").is_some_and(|what| what == "renew") {
            std::fs::write(&path, &page).unwrap();
        }
        let kept = std::fs::read_to_string(&path).unwrap_or_default();
        let differs = kept.lines().zip(page.lines()).find(|(kept, page)| kept != page);
        assert!(kept == page, "{name} differs from the code ({differs:?}): {RENEW}");
    }
}
