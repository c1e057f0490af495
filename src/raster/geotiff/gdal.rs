//! What GDAL writes into TIFFs beyond GeoTIFF: the nodata tag, and band items (scale, offset, unit)
//! in a small XML text.

use crate::error::{Error, Result};

use super::ifd::Directory;
use super::tags;

/// Per-band facts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BandItems {
    pub(super) scale: f64,
    pub(super) offset: f64,
    pub(super) unit: Option<String>,
    pub(super) description: Option<String>,
}

/// The declared nodata value.
pub(super) fn nodata(directory: &Directory<'_>) -> Result<Option<f64>> {
    let Some(text) = directory.text(tags::GDAL_NODATA)? else { return Ok(None) };
    let text = text.trim();
    if text.is_empty() {
        return Ok(None);
    }
    text.parse().map(Some).map_err(|_| {
        Error::bad_input(format!("nodata value is not a number: {:?}", shortened(text)))
            .remedy("give the value with --nodata")
    })
}

/// Enough of a hostile text to recognise it by.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

/// The items of band `band` (from 1).
pub(super) fn band_items(directory: &Directory<'_>, band: u32) -> Result<BandItems> {
    let xml = directory.text(tags::GDAL_METADATA)?.unwrap_or_default();
    items_of(&xml, band)
}

fn items_of(xml: &str, band: u32) -> Result<BandItems> {
    let mut found = BandItems { scale: 1.0, offset: 0.0, unit: None, description: None };
    let sample = (band - 1).to_string();
    for (attributes, value) in items(xml) {
        if attribute(attributes, "sample") != Some(&sample) {
            continue;
        }
        match attribute(attributes, "role") {
            Some("scale") => found.scale = number("scale", value)?,
            Some("offset") => found.offset = number("offset", value)?,
            Some("unittype") => found.unit = Some(unescape(value)),
            Some("description") => found.description = Some(unescape(value)),
            _ => {}
        }
    }
    if found.scale == 0.0 {
        return Err(Error::bad_input("band scale is 0"));
    }
    Ok(found)
}

/// `(attributes, text)` of each `<Item attributes>text</Item>`.
fn items(xml: &str) -> impl Iterator<Item = (&str, &str)> {
    xml.split("<Item").skip(1).filter_map(|item| {
        let (attributes, rest) = item.split_once('>')?;
        let (text, _) = rest.split_once("</Item")?;
        Some((attributes, text))
    })
}

fn attribute<'a>(attributes: &'a str, name: &str) -> Option<&'a str> {
    let mut rest = attributes;
    loop {
        let (key, after) = rest.split_once("=\"")?;
        let (value, after) = after.split_once('"')?;
        if key.trim() == name {
            return Some(value);
        }
        rest = after;
    }
}

fn number(name: &str, text: &str) -> Result<f64> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(Error::bad_input(format!("band {name} is not a number: {:?}", shortened(text)))),
    }
}

fn unescape(text: &str) -> String {
    let text = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
    text.replace("&apos;", "'").replace("&amp;", "&").trim().to_owned()
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
        let second = items_of(XML, 2).unwrap();
        assert_eq!((second.scale, second.offset), (1.0, 0.0));
        assert_eq!(second.unit.as_deref(), Some("a <b> &lt;"));
    }

    #[test]
    fn damage_is_an_error_or_nothing() {
        assert!(items_of(&XML.replace("0.001", "much"), 1).is_err());
        assert!(items_of(&XML.replace("0.001", "0"), 1).is_err());
        assert!(items_of(&XML.replace("0.001", "nan"), 1).is_err());
        for cut in 0..XML.len() {
            let _ = items_of(&XML[..cut], 1);
        }
    }
}
