//! Codecs of options of meshes.

use terrane_base::{error::Error, registry};
use terrane_baselines::{METHODS, TriangulationRule};
use terrane_options::{ChoiceName, Json, OptionCodec, OptionKind};

/// The name of a triangulation.
pub struct TriangulationName;

impl OptionCodec<TriangulationRule> for TriangulationName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        let about = |triangulation| match triangulation {
            TriangulationRule::Delaunay => "Delaunay on the lattice of samples",
            TriangulationRule::Split3 => "without edge flips; not for the method greedy",
            TriangulationRule::DataDependent => {
                "edges chosen by error: 20 to 33 % fewer vertices, about two times slower; other methods flip \
                    edges that reduce the sum of maximum errors"
            }
        };
        TriangulationRule::ALL
            .map(|own| ChoiceName { name: own.name(), about: about(own) })
            .to_vec()
    });

    fn parse(text: &str) -> Result<TriangulationRule, String> {
        text.trim().parse().map_err(|error: Error| error.to_string())
    }

    fn json(value: &TriangulationRule) -> Json {
        value.name().into()
    }
}

/// The name of a method that makes meshes of grids.
pub struct MeshMethodName;

/// Name of the default method.
pub const GREEDY: &str = "greedy";

impl OptionCodec<String> for MeshMethodName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        let own = ChoiceName {
            name: GREEDY,
            about: "greedy insertion in tiles with shared borders, out of core",
        };
        let others = METHODS.iter().map(|own| ChoiceName { name: own.name, about: own.about });
        std::iter::once(own).chain(others).collect()
    });

    fn parse(text: &str) -> Result<String, String> {
        let text = text.trim();
        if text.eq_ignore_ascii_case(GREEDY) {
            return Ok(GREEDY.to_owned());
        }
        let found = registry::named(METHODS, text);
        found.map(|own| own.name.to_owned()).map_err(|error| error.to_string())
    }

    fn json(value: &String) -> Json {
        value.as_str().into()
    }
}
