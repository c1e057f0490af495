//! Parser of GDAL VRTs: size, georeference and the sources of one band. Unsupported elements that would
//! change samples are rejected by name; elements that do not affect samples are ignored.

use std::io::BufRead;

use crate::format::some_band;
use crate::grid::SampleType;
use terrane_base::error::{Error, Result};
use terrane_base::limits;

use crate::xml::{RasterXmlElement, RasterXmlReader, RasterXmlTag, geotransform, parsed, short};

/// A VRT.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Vrt {
    pub(super) width: u32,
    pub(super) height: u32,
    /// GDAL's six coefficients.
    pub(super) transform: Option<[f64; 6]>,
    pub(super) srs: Option<String>,
    pub(super) is_point: bool,
    pub(super) bands: u32,
    pub(super) band: VrtBand,
    /// True if the VRT has a mask band made of the masks of its sources.
    pub(super) has_mask: bool,
}

/// The selected band.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct VrtBand {
    pub(super) kind: SampleType,
    pub(super) nodata: Option<f64>,
    pub(super) scale: f64,
    pub(super) offset: f64,
    pub(super) unit: Option<String>,
    pub(super) block: Option<[u32; 2]>,
    pub(super) sources: Vec<VrtSource>,
}

impl Default for VrtBand {
    fn default() -> Self {
        Self {
            kind: SampleType::U8,
            nodata: None,
            scale: 1.0,
            offset: 0.0,
            unit: None,
            block: None,
            sources: Vec::new(),
        }
    }
}

/// A rectangle of a file and its target.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct VrtSource {
    /// Position in the VRT file.
    pub(super) place: String,
    pub(super) file: String,
    pub(super) is_relative: bool,
    pub(super) band: u32,
    /// Column, row, width, height in the file; `None` for all of it.
    pub(super) from: Option<[i64; 4]>,
    /// Column, row, width, height in the VRT.
    pub(super) to: Option<[i64; 4]>,
    /// Value that is transparent.
    pub(super) nodata: Option<f64>,
    pub(super) ratio: f64,
    pub(super) shift: f64,
    /// True if voids of the file are transparent.
    pub(super) use_mask: bool,
}

/// Maximum distance of pixel offsets from integers: gdalbuildvrt writes offsets with rounding errors.
const SLACK: f64 = 1e-3;

/// Unsupported sources, with the reason.
const OTHER_SOURCES: [(&str, &str); 5] = [
    ("KernelFilteredSource", "a filter"),
    ("AveragedSource", "averages"),
    ("ArraySource", "an array"),
    ("NoDataFromMaskSource", "nodata from a mask"),
    ("FuncSource", "a function"),
];
/// Unsupported elements of a complex source.
const OTHER_CHANGES: [&str; 9] = [
    "LUT",
    "Exponent",
    "SrcMin",
    "SrcMax",
    "DstMin",
    "DstMax",
    "Clamp",
    "ColorTableComponent",
    "OpenOptions",
];

/// Parses a VRT and the sources of band `band` (from 1).
///
/// # Errors
/// Malformed XML, an exceeded limit, an unsupported feature, or a missing band.
pub(super) fn parse(from: impl BufRead, band: u32) -> Result<Vrt> {
    let mut xml = RasterXmlReader::new(from);
    let found = vrt(&mut xml, band);
    found.map_err(|e| e.at(xml.place()))
}

fn vrt<R: BufRead>(xml: &mut RasterXmlReader<R>, band: u32) -> Result<Vrt> {
    let root = xml.root()?;
    if !root.is("VRTDataset") {
        return Err(Error::bad_input(format!(
            "root element is <{}>, expected <VRTDataset>",
            short(&root.name)
        )));
    }
    if let Some(class) = root.attribute("subClass") {
        return Err(refused(&format!("subClass {}", short(class))));
    }
    let mut vrt = Vrt {
        width: side(&root, "rasterXSize")?,
        height: side(&root, "rasterYSize")?,
        ..Vrt::default()
    };
    while let Some(tag) = xml.child()? {
        vrt.element(xml, tag, band)?;
    }
    xml.finish()?;
    some_band(band, vrt.bands)?;
    Ok(vrt)
}

impl Vrt {
    fn element<R: BufRead>(
        &mut self,
        xml: &mut RasterXmlReader<R>,
        tag: RasterXmlTag,
        band: u32,
    ) -> Result<()> {
        match tag.name.to_ascii_lowercase().as_str() {
            "vrtrasterband" => {
                self.bands += 1;
                limits::check("number of bands", self.bands.into(), limits::MAX_BANDS)?;
                match self.bands == band {
                    true => self.band = VrtBand::read(xml, &tag)?,
                    false => xml.skip()?,
                }
            }
            "geotransform" => self.transform = Some(geotransform(&xml.node(tag)?.text)?),
            "srs" => self.srs = Some(xml.node(tag)?.text).filter(|text| !text.is_empty()),
            "metadata" => {
                self.is_point |= xml.node(tag)?.children.iter().any(|item| {
                    item.tag.attribute("key") == Some("AREA_OR_POINT") && item.text == "Point"
                });
            }
            "maskband" => {
                mask_band(xml)?;
                self.has_mask = true;
            }
            "gcplist" | "group" => return Err(refused(&tag.name)),
            _ => xml.skip()?,
        }
        Ok(())
    }
}

/// A mask made of the masks of the same files equals their voids; other masks are rejected.
fn mask_band<R: BufRead>(xml: &mut RasterXmlReader<R>) -> Result<()> {
    let mut bands = Vec::new();
    while let Some(tag) = xml.child()? {
        while let Some(tag) = xml.child()? {
            match tag.name.ends_with("Source") {
                true => bands.push(xml.node(tag)?.child("SourceBand").map(|b| b.text.clone())),
                false => xml.skip()?,
            }
        }
        drop(tag);
    }
    match bands.iter().flatten().all(|band| band.starts_with("mask")) {
        true => Ok(()),
        false => Err(refused("MaskBand of other bands")),
    }
}

impl VrtBand {
    fn read<R: BufRead>(xml: &mut RasterXmlReader<R>, tag: &RasterXmlTag) -> Result<Self> {
        let class = tag.attribute("subClass").unwrap_or("VRTSourcedRasterBand");
        if class != "VRTSourcedRasterBand" {
            return Err(refused(&format!("band of subClass {}", short(class))));
        }
        let block = ["blockXSize", "blockYSize"]
            .map(|name| tag.attribute(name)?.parse().ok().filter(|size| *size > 0));
        let mut band = Self {
            kind: tag.attribute("dataType").map_or(Ok(SampleType::U8), sample_type)?,
            block: block[0].zip(block[1]).map(|(x, y)| [x, y]),
            ..Self::default()
        };
        let mut hides_nodata = false;
        while let Some(tag) = xml.child()? {
            if let Some((name, what)) = OTHER_SOURCES.iter().find(|(name, _)| tag.is(name)) {
                return Err(refused(&format!("{name} ({what})")));
            }
            match tag.name.to_ascii_lowercase().as_str() {
                "simplesource" | "complexsource" => {
                    let (place, node) = (xml.place(), xml.node(tag)?);
                    band.sources.push(VrtSource::read(&node, place)?);
                    let sources = band.sources.len() as u64;
                    limits::check("number of sources of a VRT", sources, limits::MAX_MEMBERS)?;
                }
                "nodatavalue" => band.nodata = Some(xml.node(tag)?.number()?),
                "hidenodatavalue" => hides_nodata = is_true(&xml.node(tag)?.text),
                "scale" => band.scale = xml.node(tag)?.finite()?,
                "offset" => band.offset = xml.node(tag)?.finite()?,
                "unittype" => band.unit = Some(xml.node(tag)?.text).filter(|t| !t.is_empty()),
                _ => xml.skip()?,
            }
        }
        if band.scale == 0.0 {
            return Err(Error::bad_input("band scale is 0"));
        }
        band.nodata = band.nodata.filter(|_| !hides_nodata);
        Ok(band)
    }
}

impl VrtSource {
    /// True if samples are scaled or shifted.
    pub(super) fn is_changed(&self) -> bool {
        self.ratio != 1.0 || self.shift != 0.0
    }

    fn read(node: &RasterXmlElement, place: String) -> Result<Self> {
        Self::parts(node, &place).map_err(|e| e.at(place))
    }

    fn parts(node: &RasterXmlElement, place: &str) -> Result<Self> {
        let is_complex = node.tag.is("ComplexSource");
        let change = OTHER_CHANGES.iter().find(|name| node.child(name).is_some());
        if let Some(name) = change {
            return Err(refused(name));
        }
        let file = node.child("SourceFilename");
        let Some(file) = file.filter(|file| !file.text.is_empty()) else {
            return Err(Error::bad_input("source without SourceFilename"));
        };
        let band = node.child("SourceBand").map_or("1", |band| &band.text);
        let (from, to) = (rectangle(node, "SrcRect")?, rectangle(node, "DstRect")?);
        check_rectangles(from, to)?;
        // A simple source has no scaling, even if its elements are there.
        let scaling = |name| node.child(name).filter(|_| is_complex);
        Ok(Self {
            place: place.to_owned(),
            file: file.text.clone(),
            is_relative: file.tag.attribute("relativeToVRT").is_some_and(is_true),
            band: band.parse().map_err(|_| refused(&format!("SourceBand {}", short(band))))?,
            from: from.map(whole).transpose()?,
            to: to.map(whole).transpose()?,
            nodata: node
                .child("NODATA")
                .filter(|_| is_complex)
                .map(RasterXmlElement::number)
                .transpose()?,
            ratio: scaling("ScaleRatio").map_or(Ok(1.0), RasterXmlElement::finite)?,
            shift: scaling("ScaleOffset").map_or(Ok(0.0), RasterXmlElement::finite)?,
            use_mask: is_complex && node.child("UseMaskBand").is_some_and(|n| is_true(&n.text)),
        })
    }
}

/// Requires both or neither, of equal size: anything else needs resampling.
fn check_rectangles(from: Option<[f64; 4]>, to: Option<[f64; 4]>) -> Result<()> {
    match (from, to) {
        (Some(from), Some(to)) if [2, 3].iter().any(|i| (from[*i] - to[*i]).abs() > SLACK) => {
            Err(Error::unsupported(format!(
                "resampling of a source from {} x {} to {} x {} samples is not supported",
                from[2], from[3], to[2], to[3]
            ))
            .remedy("resample it first: gdalwarp -tr X Y IN OUT"))
        }
        (Some(_), None) => Err(refused("SrcRect without DstRect")),
        _ => Ok(()),
    }
}

/// Column, row, width, height.
fn rectangle(node: &RasterXmlElement, name: &str) -> Result<Option<[f64; 4]>> {
    let Some(node) = node.child(name) else { return Ok(None) };
    let mut numbers = [0.0; 4];
    for (number, key) in numbers.iter_mut().zip(["xOff", "yOff", "xSize", "ySize"]) {
        let text = node.tag.attribute(key).unwrap_or_default();
        *number = parsed(text).filter(|n| n.is_finite() && n.abs() < 1e15).ok_or_else(|| {
            Error::bad_input(format!("{key} of {name} is not a number: {:?}", short(text)))
        })?;
    }
    Ok(Some(numbers))
}

/// Rectangle of integers with a positive size.
fn whole(numbers: [f64; 4]) -> Result<[i64; 4]> {
    if let Some(part) = numbers.iter().find(|n| (*n - n.round()).abs() > SLACK) {
        return Err(Error::unsupported(format!(
            "source is not aligned with the samples of the VRT ({part})"
        ))
        .remedy("align it first: gdalwarp -tr X Y -te XMIN YMIN XMAX YMAX IN OUT"));
    }
    let whole = numbers.map(|n| n.round() as i64);
    if whole[2] < 1 || whole[3] < 1 {
        return Err(Error::bad_input("source rectangle is empty"));
    }
    Ok(whole)
}

fn side(root: &RasterXmlTag, name: &str) -> Result<u32> {
    let text = root.attribute(name).unwrap_or_default();
    let size = text.trim().parse::<u64>().ok().filter(|size| *size > 0);
    let size = size.ok_or_else(|| {
        Error::bad_input(format!("{name} is not a positive integer: {:?}", short(text)))
    })?;
    limits::check(name, size, limits::MAX_SIDE)?;
    Ok(size as u32)
}

fn sample_type(name: &str) -> Result<SampleType> {
    Ok(match name {
        "Byte" | "UInt8" => SampleType::U8,
        "Int8" => SampleType::I8,
        "UInt16" => SampleType::U16,
        "Int16" => SampleType::I16,
        "UInt32" => SampleType::U32,
        "Int32" => SampleType::I32,
        "Float16" => SampleType::F16,
        "Float32" => SampleType::F32,
        "Float64" => SampleType::F64,
        _ => return Err(refused(&format!("dataType {}", short(name)))),
    })
}

fn is_true(text: &str) -> bool {
    ["1", "true", "yes", "on"].iter().any(|word| text.trim().eq_ignore_ascii_case(word))
}

fn refused(what: &str) -> Error {
    Error::unsupported(format!("VRT with {what} is not supported"))
        .remedy("convert it to a GeoTIFF: gdal_translate IN.vrt OUT.tif")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = r#"<ComplexSource resampling="nearest">
      <SourceFilename relativeToVRT="1" shared="0">d/a&amp;b.tif</SourceFilename>
      <SourceBand>2</SourceBand>
      <SourceProperties RasterXSize="20" RasterYSize="30" DataType="Int16" BlockXSize="20" BlockYSize="1"/>
      <SrcRect xOff="0" yOff="1" xSize="20" ySize="10"/>
      <DstRect xOff="5.0000001" yOff="-6" xSize="20" ySize="10.0000000001"/>
      <NODATA>-9999</NODATA><ScaleOffset>1.5</ScaleOffset><ScaleRatio>0.1</ScaleRatio>
    </ComplexSource>"#;

    fn text(band: &str) -> String {
        format!(
            r#"<VRTDataset rasterXSize="40" rasterYSize="50">
  <SRS dataAxisToSRSAxisMapping="1,2">GEOGCS["WGS 84"]</SRS>
  <GeoTransform> 1.0e+00,  0.1, 0,  5.0, 0, -0.1</GeoTransform>
  <Metadata><MDI key="AREA_OR_POINT">Point</MDI></Metadata>
  <VRTRasterBand dataType="Float32" band="1"><Unknown><X/></Unknown></VRTRasterBand>
  <VRTRasterBand dataType="Int16" band="2" blockXSize="256" blockYSize="128">
    <NoDataValue>-32768</NoDataValue><Scale>0.5</Scale><Offset>2</Offset><UnitType>ft</UnitType>
    <ColorInterp>Gray</ColorInterp>
    {band}
  </VRTRasterBand>
</VRTDataset>"#
        )
    }

    fn refusal(text: &str) -> String {
        parse(text.as_bytes(), 2).unwrap_err().to_string()
    }

    #[test]
    fn a_vrt_is_read() {
        let vrt = parse(text(SOURCE).as_bytes(), 2).unwrap();
        assert_eq!((vrt.width, vrt.height, vrt.bands, vrt.is_point), (40, 50, 2, true));
        assert_eq!(vrt.transform, Some([1.0, 0.1, 0.0, 5.0, 0.0, -0.1]));
        assert_eq!(vrt.srs.as_deref(), Some("GEOGCS[\"WGS 84\"]"));
        let VrtBand { kind, nodata, scale, offset, unit, block, sources } = vrt.band;
        assert_eq!((kind, nodata, scale, offset), (SampleType::I16, Some(-32768.0), 0.5, 2.0));
        assert_eq!((unit.as_deref(), block), (Some("ft"), Some([256, 128])));
        let [source] = &sources[..] else { panic!("{sources:?}") };
        assert_eq!((source.file.as_str(), source.is_relative, source.band), ("d/a&b.tif", true, 2));
        assert_eq!(source.from, Some([0, 1, 20, 10]));
        assert_eq!(source.to, Some([5, -6, 20, 10]));
        assert_eq!((source.nodata, source.ratio, source.shift), (Some(-9999.0), 0.1, 1.5));
        assert!(parse(text("").as_bytes(), 1).unwrap().band.sources.is_empty());
    }

    #[test]
    fn a_simple_source_has_no_nodata() {
        let simple = SOURCE.replace("ComplexSource", "SimpleSource");
        let vrt = parse(text(&simple).as_bytes(), 2).unwrap();
        let source = &vrt.band.sources[0];
        assert_eq!((source.nodata, source.ratio, source.shift), (None, 1.0, 0.0));
    }

    #[test]
    fn what_is_not_supported_is_named() {
        let with = |from: &str, to: &str| {
            let changed = text(SOURCE).replace(from, to);
            assert_ne!(changed, text(SOURCE), "{from}");
            refusal(&changed)
        };
        for (from, to, said) in [
            ("<VRTDataset ", "<VRTDataset subClass=\"VRTWarpedDataset\" ", "VRTWarpedDataset"),
            ("band=\"2\"", "subClass=\"VRTDerivedRasterBand\"", "VRTDerivedRasterBand"),
            ("ComplexSource", "KernelFilteredSource", "KernelFilteredSource (a filter)"),
            ("ComplexSource", "AveragedSource", "AveragedSource"),
            ("<NODATA>", "<LUT>0:1</LUT><NODATA>", "LUT"),
            ("<NODATA>", "<Exponent>2</Exponent><NODATA>", "Exponent"),
            ("<NODATA>", "<OpenOptions/><NODATA>", "OpenOptions"),
            ("xSize=\"20\" ySize=\"10\"/", "xSize=\"40\" ySize=\"10\"/", "source from 40 x 10"),
            ("5.0000001", "5.4", "not aligned with the samples of the VRT (5.4)"),
            ("<SourceBand>2", "<SourceBand>mask,2", "SourceBand mask,2"),
            ("<Metadata>", "<GCPList/><Metadata>", "GCPList"),
            (
                "<Metadata>",
                "<MaskBand><VRTRasterBand><SimpleSource><SourceBand>4</SourceBand>\
              </SimpleSource></VRTRasterBand></MaskBand><Metadata>",
                "MaskBand",
            ),
            ("\"Int16\" band", "\"CFloat32\" band", "dataType CFloat32"),
            ("<DstRect", "<Other", "SrcRect without DstRect"),
        ] {
            let told = with(from, to);
            assert!(told.contains(said) && told.contains("byte "), "{told}");
        }
        let mask = "<MaskBand><VRTRasterBand dataType=\"Byte\"><SimpleSource><SourceBand>mask,1\
                    </SourceBand></SimpleSource></VRTRasterBand></MaskBand><Metadata>";
        assert!(parse(text(SOURCE).replace("<Metadata>", mask).as_bytes(), 2).is_ok());
    }

    #[test]
    fn offsets_are_rounded_to_the_nearest_sample() {
        assert_eq!(whole([4.9999, -6.0001, 19.9999, 10.0001]).unwrap(), [5, -6, 20, 10]);
        assert!(whole([4.99, 0.0, 1.0, 1.0]).is_err());
    }

    #[test]
    fn damage_is_an_error() {
        let good = text(SOURCE);
        for (from, to, said) in [
            ("rasterXSize=\"40\"", "rasterXSize=\"-4\"", "rasterXSize"),
            ("rasterYSize=\"50\"", "rasterYSize=\"9999999999\"", "exceeds the limit"),
            ("5.0, 0, -0.1", "5.0, 0", "six numbers"),
            ("<NoDataValue>-32768", "<NoDataValue>none", "NoDataValue is not a number"),
            ("<Scale>0.5", "<Scale>0", "scale is 0"),
            ("<Offset>2", "<Offset>inf", "not finite"),
            ("d/a&amp;b.tif", "", "source without SourceFilename"),
            ("xSize=\"20\"", "xSize=\"0\"", "source rectangle is empty"),
            ("xOff=\"0\"", "xOff=\"zero\"", "xOff of SrcRect"),
            ("VRTDataset", "Dataset", "root element is <Dataset>"),
        ] {
            let told = refusal(&good.replace(from, to));
            assert!(told.contains(said), "{from} {to}: {told}");
        }
        assert!(parse(good.as_bytes(), 3).unwrap_err().to_string().contains("out of range"));
        for cut in 0..good.len() - 1 {
            assert!(parse(&good.as_bytes()[..cut], 2).is_err(), "{cut}");
        }
    }
}
