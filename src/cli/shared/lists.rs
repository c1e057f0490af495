//! Lists at the end of a verb's help, from the registries.

use terrane_base::attribute;
use terrane_base::parameters::Parameter;
use terrane_baselines as methods;
use terrane_gridding as gridding;
use terrane_ground::noise;
use terrane_lidar::points::KEPT;
use terrane_line as line;
use terrane_mesh as mesh;
use terrane_options::OptionTable;
use terrane_raster as raster;
use terrane_synth as synth;
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
    let mut rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    rows.push((
        "synthetic",
        "synth:...".to_owned(),
        "synthetic terrain, see `terrane synth --help`",
    ));
    list("Grids read", &rows)
}

pub(crate) fn grids_written() -> String {
    let formats = raster::write::FORMATS.iter();
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Grids written, by --format or ending", &rows)
}

pub(crate) fn features_written() -> String {
    let lines = |f: &&vector::VectorFormat| {
        f.create.is_some() && f.holds.kinds.contains(&vector::GeometryType::LineString)
    };
    let formats = vector::FORMATS.iter().filter(lines);
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Lines written, by --format or ending", &rows)
}

/// Function that makes a list.
type List = fn() -> String;

/// Lists of values of some options.
const OF_OPTIONS: &[(&str, List)] = &[
    ("stat", statistics),
    ("ground", grounds),
    ("canopy", canopies),
    ("classify", noises),
    ("thin", thinned),
];

/// Lists for the options of a table.
pub(crate) fn of_options(table: &'static OptionTable) -> impl Iterator<Item = String> {
    let own = OF_OPTIONS.iter().filter(|(name, _)| table.find(name).is_some());
    own.map(|(_, list)| list())
}

fn thinned() -> String {
    let rows = KEPT.map(|(name, about)| (name, String::new(), about));
    list("Point kept in each cell, as in ‹thin=2:lowest›", &rows)
}

pub(crate) fn clouds() -> String {
    let rows = [
        ("LAS", ".las".to_owned(), "1.0 to 1.5"),
        ("LAZ", ".laz".to_owned(), "compressed LAS, and COPC"),
        ("text", "cloud:NAME".to_owned(), "one point per line"),
        ("synthetic", "synth:cloud,...".to_owned(), "synthetic point cloud"),
    ];
    list("Point clouds read", &rows)
}

fn statistics() -> String {
    let row = |m: &gridding::StatisticMethod| (m.name, other_names(m), m.about);
    let methods = list("Statistics", &gridding::METHODS.iter().map(row).collect::<Vec<_>>());
    let own = gridding::METHODS.iter().flat_map(|m| m.parameters.iter().map(move |p| (m, p)));
    let row = |(m, p): (&gridding::StatisticMethod, &gridding::StatisticParameter)| {
        (m.name, format!("{}=", p.key), p.about)
    };
    let of_points = gridding::OF_POINTS.map(|p| ("any", format!("{}=", p.key), p.about));
    let rows: Vec<_> = own.map(row).chain(of_points).collect();
    let parameters = list("Parameters, as in idw:radius=2,power=1", &rows);
    format!("{methods}\n\n{parameters}\n\n{}", attributes())
}

fn attributes() -> String {
    let row = |a: &attribute::PointAttribute| (a.name, a.aliases.join(" "), a.about);
    let rows: Vec<_> = attribute::ATTRIBUTES.iter().map(row).collect();
    list("Attributes of points, in addition to extra bytes", &rows)
}

fn grounds() -> String {
    let all = terrane_ground::METHODS;
    let rows = all.iter().map(|m| (m.name, m.source, m.about, m.parameters));
    with_parameters("--ground", "csf:rigidness=2,cloth=0.5", rows)
}

fn noises() -> String {
    let rows = noise::METHODS.iter().map(|m| (m.name, m.source, m.about, m.parameters));
    with_parameters("--classify noise", "noise:statistical:k=12,m=3", rows)
}

fn canopies() -> String {
    let all = gridding::canopy::METHODS;
    let rows = all.iter().map(|m| (m.name, m.source, m.about, m.parameters));
    with_parameters("--canopy", "spike-free:freeze=1.5", rows)
}

/// Methods of an option (name, source, summary, parameters) and their parameters, with an example.
fn with_parameters(
    option: &str,
    example: &str,
    methods: impl Iterator<Item = (&'static str, &'static str, &'static str, &'static [Parameter])>
    + Clone,
) -> String {
    let rows = methods.clone().map(|(name, source, about, _)| (name, source.to_owned(), about));
    let all = list(&format!("Methods of {option}"), &rows.collect::<Vec<_>>());
    let own =
        methods.flat_map(|(name, .., own)| own.iter().map(move |p| (name, p.usual(), p.about)));
    let heading = format!("Parameters, as in {example}, with defaults");
    format!("{all}\n\n{}", list(&heading, &own.collect::<Vec<_>>()))
}

fn other_names(method: &gridding::StatisticMethod) -> String {
    method.aliases.join(" ")
}

pub(crate) fn creation_options() -> String {
    let of = |f: &raster::write::GridFormat| {
        let row = |o: &raster::write::CreationOption| (o.key, o.accepts.text(), o.about);
        list(&format!("--co of {}", f.name), &f.options.iter().map(row).collect::<Vec<_>>())
    };
    let formats = raster::write::FORMATS.iter().filter(|f| !f.options.is_empty());
    formats.map(of).collect::<Vec<_>>().join("\n\n")
}

pub(crate) fn meshes() -> String {
    let formats = mesh::FORMATS.iter();
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Meshes read and written", &rows)
}

pub(crate) fn meshers() -> String {
    let engine = (
        ENGINE,
        "Garland & Heckbert 1995".to_owned(),
        "out-of-core greedy insertion: any size, all cores, fewest vertices",
    );
    let row = |m: &methods::BaselineMethod| (m.name, m.source.to_owned(), m.about);
    let rows: Vec<_> = std::iter::once(engine).chain(methods::METHODS.iter().map(row)).collect();
    list("Methods for grids", &rows)
}

pub(crate) fn simplifiers() -> String {
    let row = |m: &line::SimplifyMethod| (m.name, String::new(), m.summary);
    list("Methods", &line::METHODS.iter().map(row).collect::<Vec<_>>())
}

pub(crate) fn features() -> String {
    let formats = vector::FORMATS.iter();
    let rows: Vec<_> = formats.map(|f| (f.name, endings(f.extensions), f.about)).collect();
    list("Feature files", &rows)
}

pub(crate) fn characters() -> String {
    let row = |c: &synth::TerrainKind| (c.name, String::new(), c.about);
    list("Terrains", &synth::CHARACTERS.iter().map(row).collect::<Vec<_>>())
}

pub(crate) fn parameters() -> String {
    let own = synth::CHARACTERS.iter().filter_map(|c| Some((c.own.as_ref()?, c.name)));
    let all = synth::PARAMETERS.iter().map(|p| (p, "")).chain(own);
    let value = |p: &synth::SynthParameter, of: &str| match of {
        "" => format!("{}", p.default),
        of => format!("{} ({of} only)", p.default),
    };
    let rows: Vec<_> = all.map(|(p, of)| (p.key, value(p, of), p.about)).collect();
    list("Parameters of terrains, as key=value, with their defaults", &rows)
}

pub(crate) fn cloud_parameters() -> String {
    list(
        "Parameters of a cloud, as key=value, with their defaults",
        &rows(synth::cloud::PARAMETERS),
    )
}

pub(crate) fn shapes() -> String {
    let row = |s: &synth::lines::LineFamily| (s.name, String::new(), s.about);
    list("Lines", &synth::lines::SHAPES.iter().map(row).collect::<Vec<_>>())
}

pub(crate) fn line_parameters() -> String {
    list("Parameters of lines, as key=value, with their defaults", &rows(synth::lines::PARAMETERS))
}

fn rows(parameters: &[synth::SynthParameter]) -> Vec<(&'static str, String, &'static str)> {
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
