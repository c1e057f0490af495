//! GDAL's TIFF extensions: the nodata tag, and band metadata (scale, offset, unit) as XML.

use crate::xml::{RasterXmlElement, RasterXmlReader};
use terrane_base::error::{Error, Result};

use super::ifd::GeoTiffDirectory;
use super::tags;

/// Metadata of a band, and the kind of grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct BandItems {
    pub(super) scale: f64,
    pub(super) offset: f64,
    pub(super) unit: Option<String>,
    pub(super) description: Option<String>,
    /// TYPE of geodetic grids, such as `VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL`.
    pub(super) kind: Option<String>,
}

/// The declared nodata value.
pub(super) fn nodata(directory: &GeoTiffDirectory<'_>) -> Result<Option<f64>> {
    let Some(text) = directory.text(tags::GDAL_NODATA)? else { return Ok(None) };
    let text = text.trim();
    if text.is_empty() {
        return Ok(None);
    }
    text.parse().map(Some).map_err(|_| {
        Error::bad_input(format!("nodata value is not a number: {:?}", shortened(text)))
            .remedy("pass the value as ‹nodata›")
    })
}

/// A prefix of untrusted text for error messages.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

/// The metadata of band `band` (from 1).
pub(super) fn band_items(directory: &GeoTiffDirectory<'_>, band: u32) -> Result<BandItems> {
    let xml = directory.text(tags::GDAL_METADATA)?.unwrap_or_default();
    items_of(&xml, band)
}

fn items_of(text: &str, band: u32) -> Result<BandItems> {
    let mut found = BandItems { scale: 1.0, ..BandItems::default() };
    let sample = (band - 1).to_string();
    for RasterXmlElement { tag, text, .. } in items(text).map_err(|e| e.at("tag GDAL_METADATA"))? {
        if tag.attribute("sample") != Some(&sample) {
            if tag.attribute("name") == Some("TYPE") && tag.attribute("sample").is_none() {
                found.kind = Some(text);
            }
            continue;
        }
        match tag.attribute("role") {
            Some("scale") => found.scale = number("scale", &text)?,
            Some("offset") => found.offset = number("offset", &text)?,
            Some("unittype") => found.unit = Some(text),
            Some("description") => found.description = Some(text),
            _ => {}
        }
    }
    if found.scale == 0.0 {
        return Err(Error::bad_input("band scale is 0"));
    }
    Ok(found)
}

/// All elements inside the root element.
fn items(text: &str) -> Result<Vec<RasterXmlElement>> {
    let (mut xml, mut items) = (RasterXmlReader::new(text.as_bytes()), Vec::new());
    if text.trim().is_empty() {
        return Ok(items);
    }
    xml.root()?;
    while let Some(tag) = xml.child()? {
        items.push(xml.node(tag)?);
    }
    xml.finish().map(|()| items)
}

fn number(name: &str, text: &str) -> Result<f64> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(Error::bad_input(format!("band {name} is not a number: {:?}", shortened(text)))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const XML: &str = r#"<GDALMetadata>
  <Item name="TYPE">HEIGHT</Item>
  <Item name="SCALE" sample="0" role="scale">0.001</Item>
  <Item name="OFFSET" sample="0" role="offset">-5</Item>
  <Item name="UNITTYPE" sample="1" role="unittype">a &lt;b&gt; &amp;lt;</Item>
</GDALMetadata>"#;

    #[test]
    fn items_belong_to_their_band() {
        let first = items_of(XML, 1).unwrap();
        assert_eq!((first.scale, first.offset, first.unit), (0.001, -5.0, None));
        assert_eq!(first.kind.as_deref(), Some("HEIGHT"), "of the whole file");
        let second = items_of(XML, 2).unwrap();
        assert_eq!((second.scale, second.offset), (1.0, 0.0));
        assert_eq!(second.unit.as_deref(), Some("a <b> &lt;"));
    }

    #[test]
    fn damage_is_an_error() {
        assert!(items_of(&XML.replace("0.001", "much"), 1).is_err());
        assert!(items_of(&XML.replace("0.001", "0"), 1).is_err());
        assert!(items_of(&XML.replace("0.001", "nan"), 1).is_err());
        for cut in 1..XML.len() {
            assert!(items_of(&XML[..cut], 1).is_err(), "{cut}");
        }
        assert!(items_of("", 1).is_ok());
    }
}
