//! Codecs of options of grids.

use terrane_gridding::{Canopy, parse_list};
use terrane_options::{Json, OptionCodec, OptionKind};

use super::surface_model::kinds::GroundFrom;

/// A value represented by its text.
pub struct AsText;

terrane_engine::by_text!(AsText, OptionKind::Text, Canopy GroundFrom);

/// A list of statistics.
pub struct StatisticList;

impl OptionCodec<String> for StatisticList {
    const KIND: OptionKind = OptionKind::Shaped("str | Sequence[str]");

    fn parse(text: &str) -> Result<String, String> {
        parse_list(text).map(|_| text.to_owned()).map_err(|error| error.to_string())
    }

    fn json(value: &String) -> Json {
        value.as_str().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_have_to_be_known() {
        let parse = <StatisticList as OptionCodec<String>>::parse;
        assert!(parse("mean,max").is_ok() && parse("mean,modus").is_err());
    }
}
