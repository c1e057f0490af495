//! Lists at the end of a verb's help, from the registries.

use terrane_base::attribute;
use terrane_base::parameters::Parameter;
use terrane_baselines as methods;
use terrane_gridding as gridding;
use terrane_ground::noise;
use terrane_lidar::points::{KEPT, stage_names};
use terrane_line as line;
use terrane_mesh as mesh;
use terrane_options::OptionTable;
use terrane_raster as raster;
use terrane_synth as synth;
use terrane_terrain::zonal::ZONE_STATISTICS;
use terrane_vector as vector;

/// The last list of verbs that can fail in every way.
pub(crate) const EXIT_CODES: &str = "Exit codes: 0 success, 1 a check failed, 2 usage error, \
3 no check failed but some could not be decided, 65 bad input, 69 not ready yet, \
70 internal error, 73 cannot write, 74 read or write failed, 75 out of memory, \
130 interrupted";

/// Name of the engine's own meshing method.
pub(crate) const ENGINE: &str = "greedy";

pub(crate) fn grids() -> String {
    let formats = raster::FORMATS.iter();
    let rows = formats.map(|f| (f.name, endings(f.extensions), f.about));
    let synthetic =
        ("synthetic", "synth:...".to_owned(), "synthetic terrain, see `terrane synth --help`");
    list("Grids read", rows.chain([synthetic]))
}

pub(crate) fn grids_written() -> String {
    let formats = raster::write::FORMATS.iter();
    let rows = formats.map(|f| (f.name, endings(f.extensions), f.about));
    list("Grids written, by --format or ending", rows)
}

pub(crate) fn features_written() -> String {
    let formats = vector::FORMATS.iter().filter(|format| {
        format.create.is_some() && format.holds.kinds.contains(&vector::GeometryType::LineString)
    });
    let rows = formats.map(|f| (f.name, endings(f.extensions), f.about));
    list("Features written, by --format or ending", rows)
}

/// Function that makes a list.
type List = fn() -> String;

/// Lists of values of some options.
const OF_OPTIONS: &[(&str, List)] = &[
    ("ground", grounds),
    ("canopy", canopies),
    ("classify", noises),
    ("thin", thinned),
    ("stage", stages),
];

/// Lists for the options of a table.
pub(crate) fn of_options(table: &'static OptionTable) -> impl Iterator<Item = String> {
    // Points in cells and samples in zones have statistics of their own.
    let stat: Option<List> = table.find("stat").map(|field| match field.value {
        Some("STATISTICS") => zone_statistics,
        _ => statistics,
    });
    let lists = OF_OPTIONS.iter().filter(|(name, _)| table.find(name).is_some());
    stat.into_iter().chain(lists.map(|(_, list)| *list)).map(|list| list())
}

fn zone_statistics() -> String {
    let rows = ZONE_STATISTICS.iter().map(|own| (own.name, own.aliases.join(" "), own.about));
    list("Statistics", rows)
}

fn thinned() -> String {
    let rows = KEPT.map(|(name, about)| (name, String::new(), about));
    list("Point kept in each cell, as in ‹thin=2:lowest›", rows)
}

fn stages() -> String {
    let rows = stage_names().map(|stage| (stage.name, stage.arguments.to_owned(), stage.about));
    list(
        "Stages, as in --stage ground:csf --stage height-above-ground --stage \"where:z > 2\"",
        rows,
    )
}

pub(crate) fn clouds() -> String {
    let rows = [
        ("LAS", ".las".to_owned(), "1.0 to 1.5"),
        ("LAZ", ".laz".to_owned(), "compressed LAS, and COPC"),
        ("text", "cloud:NAME".to_owned(), "one point per line"),
        ("synthetic", "synth:cloud,...".to_owned(), "synthetic point cloud"),
    ];
    list("Point clouds read", rows)
}

fn statistics() -> String {
    let rows = gridding::METHODS.iter().map(|m| (m.name, m.aliases.join(" "), m.about));
    let methods = list("Statistics", rows);
    let of_methods = gridding::METHODS
        .iter()
        .flat_map(|m| m.parameters.iter().map(|p| (m.name, format!("{}=", p.key), p.about)));
    let of_points = gridding::OF_POINTS.map(|p| ("any", format!("{}=", p.key), p.about));
    let parameters = list("Parameters, as in idw:radius=2,power=1", of_methods.chain(of_points));
    format!("{methods}\n\n{parameters}\n\n{}", attributes())
}

fn attributes() -> String {
    let rows = attribute::ATTRIBUTES.iter().map(|a| (a.name, a.aliases.join(" "), a.about));
    list("Attributes of points, in addition to extra bytes", rows)
}

fn grounds() -> String {
    let methods = terrane_ground::METHODS.iter().map(|m| ListedMethod {
        name: m.name,
        source: m.source,
        about: m.about,
        parameters: m.parameters,
    });
    with_parameters("--ground", "csf:rigidness=2,cloth=0.5", methods)
}

fn noises() -> String {
    let methods = noise::METHODS.iter().map(|m| ListedMethod {
        name: m.name,
        source: m.source,
        about: m.about,
        parameters: m.parameters,
    });
    with_parameters("--classify noise", "noise:statistical:k=12,m=3", methods)
}

fn canopies() -> String {
    let methods = gridding::canopy::METHODS.iter().map(|m| ListedMethod {
        name: m.name,
        source: m.source,
        about: m.about,
        parameters: m.parameters,
    });
    with_parameters("--canopy", "spike-free:freeze=1.5", methods)
}

/// Registry entry of a method with parameters.
struct ListedMethod {
    name: &'static str,
    source: &'static str,
    about: &'static str,
    parameters: &'static [Parameter],
}

/// Methods of an option and their parameters, with an example.
fn with_parameters(
    option: &str,
    example: &str,
    methods: impl Iterator<Item = ListedMethod> + Clone,
) -> String {
    let rows = methods.clone().map(|m| (m.name, m.source.to_owned(), m.about));
    let all = list(&format!("Methods of {option}"), rows);
    let parameters =
        methods.flat_map(|m| m.parameters.iter().map(move |p| (m.name, p.usual(), p.about)));
    let heading = format!("Parameters, as in {example}, with defaults");
    format!("{all}\n\n{}", list(&heading, parameters))
}

pub(crate) fn creation_options() -> String {
    let formats = raster::write::FORMATS.iter().filter(|f| !f.options.is_empty());
    let lists = formats.map(|f| {
        let rows = f.options.iter().map(|o| (o.key, o.accepts.text(), o.about));
        list(&format!("--co of {}", f.name), rows)
    });
    lists.collect::<Vec<_>>().join("\n\n")
}

pub(crate) fn meshes() -> String {
    let formats = mesh::FORMATS.iter();
    let rows = formats.map(|f| (f.name, endings(f.extensions), f.about));
    list("Meshes read and written", rows)
}

pub(crate) fn meshers() -> String {
    let engine = (
        ENGINE,
        "Garland & Heckbert 1995".to_owned(),
        "out-of-core greedy insertion: any size, all cores, fewest vertices",
    );
    let baselines = methods::METHODS.iter().map(|m| (m.name, m.source.to_owned(), m.about));
    list("Methods for grids", std::iter::once(engine).chain(baselines))
}

pub(crate) fn simplifiers() -> String {
    list("Methods", line::METHODS.iter().map(|m| (m.name, String::new(), m.summary)))
}

pub(crate) fn features() -> String {
    let formats = vector::FORMATS.iter();
    let rows = formats.map(|f| (f.name, endings(f.extensions), f.about));
    list("Feature files", rows)
}

pub(crate) fn characters() -> String {
    list("Terrains", synth::CHARACTERS.iter().map(|c| (c.name, String::new(), c.about)))
}

pub(crate) fn parameters() -> String {
    let of_one = synth::CHARACTERS.iter().filter_map(|character| {
        let p = character.own.as_ref()?;
        Some((p.key, format!("{} ({} only)", p.default, character.name), p.about))
    });
    let rows = rows(synth::PARAMETERS).chain(of_one);
    list("Parameters of terrains, as key=value, with their defaults", rows)
}

pub(crate) fn cloud_parameters() -> String {
    list("Parameters of a cloud, as key=value, with their defaults", rows(synth::cloud::PARAMETERS))
}

pub(crate) fn shapes() -> String {
    list("Lines", synth::lines::SHAPES.iter().map(|s| (s.name, String::new(), s.about)))
}

pub(crate) fn line_parameters() -> String {
    list("Parameters of lines, as key=value, with their defaults", rows(synth::lines::PARAMETERS))
}

fn rows(parameters: &'static [synth::SynthParameter]) -> impl Iterator<Item = ListRow> {
    parameters.iter().map(|p| (p.key, format!("{}", p.default), p.about))
}

fn endings(extensions: &[&str]) -> String {
    extensions.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" ")
}

/// Name, extensions or default or source, and summary.
type ListRow = (&'static str, String, &'static str);

/// A titled list in aligned columns.
fn list(title: &str, rows: impl IntoIterator<Item = ListRow>) -> String {
    let rows: Vec<ListRow> = rows.into_iter().collect();
    let name = rows.iter().map(|r| r.0.len()).max().unwrap_or(0);
    let ending = rows.iter().map(|r| r.1.len()).max().unwrap_or(0);
    let gap = if ending > 0 { ending + 2 } else { 0 };
    rows.iter().fold(format!("{title}:"), |text, (n, e, about)| {
        text + &format!("\n  {n:name$}  {e:gap$}{about}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_codes_are_the_same_everywhere() {
        let code = include_str!("../../../crates/base/src/error.rs");
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
        let book = include_str!("../../../docs/src/guide/programs.md");
        assert_eq!(table(book, "| exit code | means |"), codes);
    }
}
