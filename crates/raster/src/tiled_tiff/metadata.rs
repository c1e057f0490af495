//! The GDAL_METADATA tag of a store: scale, offset, vertical unit, and parts of the CRS that GeoKeys cannot
//! store.

use super::crs::GeoKeyTags;
use crate::grid::{GridInfo, unit_and_text};
use terrane_base::geom::Crs;

/// Name of a band.
#[derive(Clone, Debug, PartialEq)]
pub struct BandName {
    /// Band description, as in GDAL.
    pub name: String,
    /// Whether its values are in the vertical unit of the grid.
    pub in_vertical_unit: bool,
    /// Whether 0 means no value.
    pub counts: bool,
}

/// Metadata items in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GdalMetadata(Vec<GdalMetadataItem>);

/// A metadata item: name, optional role, and value.
#[derive(Clone, Debug, PartialEq)]
struct GdalMetadataItem {
    name: String,
    role: Option<String>,
    /// Band of an item with a role, from 0.
    sample: u32,
    value: String,
}

const OPEN: &str = "<GDALMetadata>\n";
const CLOSE: &str = "</GDALMetadata>\n";

impl GdalMetadata {
    /// Band items that GDAL knows: offset, scale and vertical unit.
    pub(super) fn of_band(info: &GridInfo) -> Self {
        let crs = &info.crs;
        let mut items = Self::default();
        if (info.scale, info.offset) != (1.0, 0.0) {
            items.push("OFFSET", Some("offset"), Some(number(info.offset)));
            items.push("SCALE", Some("scale"), Some(number(info.scale)));
        }
        let unit = crs.vertical_unit_text.as_ref().or(crs.vertical_unit.as_ref());
        items.push("UNITTYPE", Some("unittype"), unit.cloned());
        items
    }

    /// As [`of_band`](Self::of_band) for several bands, with their names.
    pub(super) fn of_bands(info: &GridInfo, bands: &[BandName]) -> Self {
        let mut items = Self::default();
        for (sample, band) in (0..).zip(bands) {
            let mut own = Self::of_band(info).0;
            own.retain(|item| item.name != "UNITTYPE" || band.in_vertical_unit);
            own.iter_mut().for_each(|item| item.sample = sample);
            items.0.extend(own);
            items.push("DESCRIPTION", Some("description"), Some(band.name.clone()));
            items.0.last_mut().into_iter().for_each(|item| item.sample = sample);
        }
        if bands.is_empty() { Self::of_band(info) } else { items }
    }

    /// The items of a store; on request with the exact position of sample (0, 0).
    pub(super) fn new(info: &GridInfo, with_origin: bool) -> Self {
        let crs = &info.crs;
        let mut items = Self::of_band(info);
        items.push("TERRANE_EPSG", None, crs.epsg.map(|code| code.to_string()));
        items.push("TERRANE_VERTICAL_EPSG", None, crs.vertical_epsg.map(|code| code.to_string()));
        items.push("TERRANE_CITATION", None, crs.citation.clone());
        items.push("TERRANE_WKT", None, crs.wkt.clone());
        items.push("TERRANE_GEOGRAPHIC", None, crs.geographic.map(|yes| yes.to_string()));
        let origin = [info.transform.x0, info.transform.y0].map(|v| format!("{v:?}")).join(" ");
        items.push("TERRANE_ORIGIN", None, with_origin.then_some(origin));
        items
    }

    fn push(&mut self, name: &str, role: Option<&str>, value: Option<String>) {
        let Some(value) = value else { return };
        let role = role.map(str::to_owned);
        let value = value.replace('\0', " ");
        self.0.push(GdalMetadataItem { name: name.to_owned(), role, sample: 0, value });
    }

    fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|item| item.name == name).map(|item| item.value.as_str())
    }

    /// The value of an item, `default` if missing, `None` if it is not a `T`.
    fn parse<T: std::str::FromStr>(&self, name: &str, default: T) -> Option<T> {
        self.get(name).map_or(Some(default), |text| text.parse().ok())
    }

    pub(super) fn scale(&self) -> Option<f64> {
        self.parse("SCALE", 1.0)
    }

    pub(super) fn offset(&self) -> Option<f64> {
        self.parse("OFFSET", 0.0)
    }

    pub(super) fn origin(&self) -> Option<[f64; 2]> {
        let (x, y) = self.get("TERRANE_ORIGIN")?.split_once(' ')?;
        Some([x.parse().ok()?, y.parse().ok()?])
    }

    /// The CRS, with the given GeoKeys; `None` if an item is invalid.
    pub(super) fn crs(&self, keys: &GeoKeyTags) -> Option<Crs> {
        let text = |name| self.get(name).map(str::to_owned);
        let (vertical_unit, vertical_unit_text) = self.get("UNITTYPE").map(unit_and_text).unzip();
        Some(Crs {
            epsg: self.optional("TERRANE_EPSG")?,
            vertical_epsg: self.optional("TERRANE_VERTICAL_EPSG")?,
            citation: text("TERRANE_CITATION"),
            wkt: text("TERRANE_WKT"),
            geographic: self.optional("TERRANE_GEOGRAPHIC")?,
            vertical_unit,
            vertical_unit_text: vertical_unit_text.flatten(),
            geo_keys: keys.directory.clone(),
            geo_doubles: keys.doubles.clone(),
            geo_ascii: keys.ascii.clone(),
        })
    }

    fn optional<T: std::str::FromStr>(&self, name: &str) -> Option<Option<T>> {
        self.get(name).map(|text| text.parse().ok()).map_or(Some(None), |value| value.map(Some))
    }

    /// The XML text of the tag; `None` if there are no items.
    pub(super) fn xml(&self) -> Option<String> {
        let lines: String = self.0.iter().map(GdalMetadataItem::line).collect();
        (!self.0.is_empty()).then(|| format!("{OPEN}{lines}{CLOSE}"))
    }

    /// Parses the output of [`xml`](Self::xml).
    pub(super) fn from_xml(xml: &str) -> Option<Self> {
        let body = xml.strip_prefix(OPEN)?.strip_suffix(CLOSE)?;
        body.lines().map(GdalMetadataItem::parse).collect::<Option<Vec<_>>>().map(Self)
    }
}

impl GdalMetadataItem {
    fn line(&self) -> String {
        let of = self.sample;
        let role = self.role.as_ref().map(|role| format!(" sample=\"{of}\" role=\"{role}\""));
        let (name, role, value) = (&self.name, role.unwrap_or_default(), escape(&self.value));
        format!("  <Item name=\"{name}\"{role}>{value}</Item>\n")
    }

    fn parse(line: &str) -> Option<Self> {
        let rest = line.strip_prefix("  <Item name=\"")?.strip_suffix("</Item>")?;
        let (head, value) = rest.split_once('>')?;
        let (name, rest) = head.split_once('"')?;
        let role = rest.strip_prefix(" sample=\"0\" role=\"").and_then(|r| r.strip_suffix('"'));
        let role = role.map(str::to_owned);
        Some(Self { name: name.to_owned(), role, sample: 0, value: unescape(value) })
    }
}

/// Characters that must be escaped in XML text. The ampersand is first.
const ESCAPES: &[(char, &str)] = &[
    ('&', "&amp;"),
    ('<', "&lt;"),
    ('>', "&gt;"),
    ('"', "&quot;"),
    ('\n', "&#10;"),
    ('\r', "&#13;"),
];

fn escape(text: &str) -> String {
    ESCAPES.iter().fold(text.to_owned(), |text, (plain, name)| text.replace(*plain, name))
}

fn unescape(text: &str) -> String {
    // "&amp;" last: "&amp;lt;" stands for "&lt;" and not for "<".
    let escapes = ESCAPES.iter().rev();
    escapes.fold(text.to_owned(), |text, (plain, name)| text.replace(name, &plain.to_string()))
}

/// The shortest text that round-trips, in GDAL's notation ("-9999", "nan").
pub(crate) fn number(value: f64) -> String {
    if value.is_nan() {
        return "nan".to_owned();
    }
    if value.fract() == 0.0 && value.abs() < 1e15 {
        format!("{value}")
    } else {
        format!("{value:?}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn awkward_values_round_trip() {
        let mut items = GdalMetadata::default();
        items.push("A", None, Some("GEOGCS[\"a & b\",\r\n <c>] &amp;lt; é".to_owned()));
        items.push("B", Some("scale"), Some("0.001".to_owned()));
        items.push("C", None, Some(String::new()));
        let xml = items.xml().unwrap();
        assert_eq!(GdalMetadata::from_xml(&xml), Some(items));
        assert_eq!(xml.lines().count(), 5);
    }
}
