//! The command as clap sees it, with lists taken from the registries.

use clap::{Command, CommandFactory};

use crate::{gridding, line, mesh, raster, synth, vector};

/// The whole command line, for parsing, help, completions and man pages.
pub(super) fn command() -> Command {
    let verbs = ["tin", "verify", "view", "info", "convert", "grid", "contour", "line", "synth"];
    verbs.iter().fold(super::Cli::command(), |command, verb| {
        command.mut_subcommand(verb, |c| with_usage(c.after_help(lists(verb)), verb))
    })
}

/// The output is the last of the names, which clap does not know.
fn with_usage(command: Command, verb: &str) -> Command {
    let goal = match verb {
        "tin" => "<--max-error <E>|--max-vertices <N>|--max-triangles <N>> ",
        "line" => {
            "<--tolerance <LENGTH>|--area <A>|--keep-ratio <SHARE>|--keep-count <N>|--target-size <SIZE>> "
        }
        "convert" | "grid" => "",
        _ => return command,
    };
    command.override_usage(format!("terrane {verb} [OPTIONS] {goal}<INPUT>... <OUTPUT>"))
}

/// The lists that a verb's help ends in.
fn lists(verb: &str) -> String {
    let parts = match verb {
        "tin" => vec![grids(), meshes(), EXIT_CODES.to_owned()],
        "verify" => vec![meshes(), grids(), EXIT_CODES.to_owned()],
        "synth" => {
            vec![characters(), parameters(), cloud_parameters(), shapes(), line_parameters()]
        }
        "convert" => vec![grids(), grids_written(), creation_options(), EXIT_CODES.to_owned()],
        "grid" => vec![statistics(), grids_written(), creation_options(), EXIT_CODES.to_owned()],
        "contour" => vec![grids(), features_written(), EXIT_CODES.to_owned()],
        "line" => vec![simplifiers(), features(), EXIT_CODES.to_owned()],
        _ => vec![grids(), meshes()],
    };
    parts.join("\n\n")
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 a promise is broken, 2 usage, \
3 nothing wrong was found but something promised could not be judged, 65 bad input, 69 not yet, \
70 a fault of terrane itself, 73 cannot write, 74 read or write failed, 75 too little memory, \
130 stopped";

fn grids() -> String {
    let formats = raster::FORMATS.iter();
    let mut rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    rows.push((
        "synthetic",
        "synth:...".to_owned(),
        "a terrain by name, see `terrane synth --help`",
    ));
    list("Grids read", &rows)
}

fn grids_written() -> String {
    let formats = raster::write::FORMATS.iter();
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Grids written, by --format or ending", &rows)
}

fn features_written() -> String {
    let lines = |f: &&vector::VectorFormat| {
        f.create.is_some() && f.holds.kinds.contains(&vector::Kind::LineString)
    };
    let formats = vector::FORMATS.iter().filter(lines);
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Lines written, by --format or ending", &rows)
}

fn statistics() -> String {
    let row = |m: &gridding::Method| (m.name, other_names(m), m.about);
    let methods = list("Statistics", &gridding::METHODS.iter().map(row).collect::<Vec<_>>());
    let own = gridding::METHODS.iter().flat_map(|m| m.parameters.iter().map(move |p| (m, p)));
    let row = |(m, p): (&gridding::Method, &gridding::Parameter)| {
        (m.name, format!("{}=", p.key), p.about)
    };
    let rows: Vec<_> = own.map(row).collect();
    format!("{methods}\n\n{}", list("Parameters, as in idw:radius=2,power=1", &rows))
}

fn other_names(method: &gridding::Method) -> String {
    method.aliases.join(" ")
}

fn creation_options() -> String {
    let of = |f: &raster::write::GridFormat| {
        let row = |o: &raster::write::CreationOption| (o.key, o.accepts.text(), o.about);
        list(&format!("--co of {}", f.name), &f.options.iter().map(row).collect::<Vec<_>>())
    };
    let formats = raster::write::FORMATS.iter().filter(|f| !f.options.is_empty());
    formats.map(of).collect::<Vec<_>>().join("\n\n")
}

fn meshes() -> String {
    let formats = mesh::FORMATS.iter();
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Meshes read and written", &rows)
}

fn simplifiers() -> String {
    let row = |m: &line::Method| (m.name, String::new(), m.summary);
    list("Methods", &line::METHODS.iter().map(row).collect::<Vec<_>>())
}

fn features() -> String {
    let formats = vector::FORMATS.iter();
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Files of features", &rows)
}

fn characters() -> String {
    let row = |c: &synth::Character| (c.name, String::new(), c.about);
    list("Characters", &synth::CHARACTERS.iter().map(row).collect::<Vec<_>>())
}

fn parameters() -> String {
    let own = synth::CHARACTERS.iter().filter_map(|c| Some((c.own.as_ref()?, c.name)));
    let all = synth::PARAMETERS.iter().map(|p| (p, "")).chain(own);
    let value = |p: &synth::Parameter, of: &str| match of {
        "" => format!("{}", p.default),
        of => format!("{} ({of} only)", p.default),
    };
    let rows: Vec<_> = all.map(|(p, of)| (p.key, value(p, of), p.about)).collect();
    list("Parameters of terrains, as key=value, with their defaults", &rows)
}

fn cloud_parameters() -> String {
    list(
        "Parameters of a cloud, as key=value, with their defaults",
        &rows(synth::cloud::PARAMETERS),
    )
}

fn shapes() -> String {
    let row = |s: &synth::lines::Shape| (s.name, String::new(), s.about);
    list("Lines", &synth::lines::SHAPES.iter().map(row).collect::<Vec<_>>())
}

fn line_parameters() -> String {
    list("Parameters of lines, as key=value, with their defaults", &rows(synth::lines::PARAMETERS))
}

fn rows(parameters: &[synth::Parameter]) -> Vec<(&'static str, String, &'static str)> {
    parameters.iter().map(|p| (p.key, format!("{}", p.default), p.about)).collect()
}

fn endings(extensions: &[&str]) -> String {
    extensions.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" ")
}

/// A titled list in aligned columns.
fn list(title: &str, rows: &[(&str, String, &str)]) -> String {
    let name = rows.iter().map(|r| r.0.len()).max().unwrap_or(0);
    let ending = rows.iter().map(|r| r.1.len()).max().unwrap_or(0);
    let gap = if ending > 0 { ending + 2 } else { 0 };
    let line = |(n, e, about): &(&str, String, &str)| format!("\n  {n:name$}  {e:gap$}{about}");
    rows.iter().fold(format!("{title}:"), |text, row| text + &line(row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_is_sound() {
        command().debug_assert();
    }

    #[test]
    fn exit_codes_are_the_same_everywhere() {
        let code = include_str!("../../crates/base/src/error.rs");
        let arms = code.split("fn exit_code").nth(1).unwrap().split("\n    }\n").next().unwrap();
        let first_number = |text: &str| {
            let digits: String = text.trim().chars().take_while(char::is_ascii_digit).collect();
            digits.parse::<u8>().ok()
        };
        let mut codes: Vec<u8> = arms.split("=>").skip(1).filter_map(first_number).collect();
        codes.extend([0, crate::cli::shared::NOT_JUDGED]);
        codes.sort_unstable();
        assert!(codes.len() > 9, "{codes:?}");
        let table = |text: &str, title: &str| -> Vec<u8> {
            let rows = text.split(title).nth(1).unwrap().lines().skip(2);
            rows.map_while(|row| first_number(row.strip_prefix("|")?)).collect()
        };
        let told = EXIT_CODES.strip_prefix("Exit codes: ").unwrap().split(", ");
        assert_eq!(told.filter_map(first_number).collect::<Vec<_>>(), codes);
        assert_eq!(table(include_str!("../../README.md"), "| exit code | means |"), codes);
        assert_eq!(table(include_str!("../../ARCHITECTURE.md"), "| exit | kind |"), codes);
    }

    #[test]
    fn help_names_every_registered_thing() {
        let help = |verb: &str| {
            let mut command = command();
            let help = command.find_subcommand_mut(verb).unwrap().render_help().to_string();
            // However lines are broken.
            help.split_whitespace().collect::<Vec<_>>().join(" ")
        };
        for format in raster::FORMATS {
            assert!(help("tin").contains(format.name), "{}", format.name);
        }
        for format in mesh::FORMATS {
            assert!(help("tin").contains(format.name), "{}", format.name);
        }
        for format in raster::write::FORMATS {
            assert!(help("convert").contains(format.name), "{}", format.name);
            for option in format.options {
                assert!(help("convert").contains(option.key), "{}", option.key);
            }
        }
        for format in vector::FORMATS.iter().filter(|format| format.create.is_some()) {
            assert!(help("contour").contains(format.name), "{}", format.name);
        }
        for method in gridding::METHODS {
            assert!(help("grid").contains(method.about), "{}", method.name);
        }
        for character in synth::CHARACTERS {
            assert!(help("synth").contains(character.name), "{}", character.name);
        }
    }
}
