//! Codecs of options of meshes.

use terrane_base::{error::Error, registry};
use terrane_baselines::{METHODS, TriangulationRule};
use terrane_options::{ChoiceName, Json, OptionCodec, OptionKind};

/// The name of a triangulation.
pub struct TriangulationName;

impl OptionCodec<TriangulationRule> for TriangulationName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        TriangulationRule::ALL
            .map(|rule| ChoiceName { name: rule.name(), about: about(rule) })
            .to_vec()
    });

    fn parse(text: &str) -> Result<TriangulationRule, String> {
        text.trim().parse().map_err(|error: Error| error.to_string())
    }

    fn json(value: &TriangulationRule) -> Json {
        value.name().into()
    }
}

/// The help text of a triangulation.
fn about(rule: TriangulationRule) -> &'static str {
    match rule {
        TriangulationRule::Delaunay => "Delaunay on the lattice of samples",
        TriangulationRule::Split3 => "without edge flips; not for the method greedy",
        TriangulationRule::DataDependent => {
            "edges chosen by error: 20 to 33 % fewer vertices, about two times slower; other methods flip \
                    edges that reduce the sum of maximum errors"
        }
    }
}

/// The name of a method that makes meshes of grids.
pub struct MeshMethodName;

/// Name of the default method.
pub const GREEDY: &str = "greedy";

impl OptionCodec<String> for MeshMethodName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        let greedy = ChoiceName {
            name: GREEDY,
            about: "greedy insertion in tiles with shared borders, out of core",
        };
        let others =
            METHODS.iter().map(|method| ChoiceName { name: method.name, about: method.about });
        std::iter::once(greedy).chain(others).collect()
    });

    fn parse(text: &str) -> Result<String, String> {
        let text = text.trim();
        if text.eq_ignore_ascii_case(GREEDY) {
            return Ok(GREEDY.to_owned());
        }
        let method = registry::named(METHODS, text);
        method.map(|method| method.name.to_owned()).map_err(|error| error.to_string())
    }

    fn json(value: &String) -> Json {
        value.as_str().into()
    }
}
