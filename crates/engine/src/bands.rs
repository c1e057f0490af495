//! Several bands of one grid, with weights of their errors.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_mesh::{ChannelKind, HeightBand, MaxError, Promises};
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource, Inputs, SampleType};

/// Bands of a mesh, each with a weight. A sample that is void in one of them is void in all.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshBands {
    /// At least one.
    list: Vec<(u32, f64)>,
    /// The band of heights; `None` places all vertices at 0.
    heights: Option<u32>,
}

/// Report on a band.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshBandReport {
    /// Its number, from 1.
    pub band: u32,
    /// Factor of its errors.
    pub weight: f64,
    /// Maximum difference to the mesh, unweighted.
    pub max_error: Option<f64>,
    /// Root mean square of these differences.
    pub rmse: Option<f64>,
}

impl MeshBands {
    /// Bands by number, from 1; without weights, all weights are 1.
    ///
    /// # Errors
    /// Usage: no band, a repeated band or number 0, a different number of weights, a weight that is not finite and
    /// positive, a band of heights that is not among the bands.
    pub fn new(bands: &[u32], weights: &[f64], heights: Option<u32>) -> Result<Self> {
        let label = label(bands);
        if bands.is_empty() || bands.contains(&0) {
            return Err(Error::usage(format!("\"{label}\" is not a list of bands"))
                .remedy("give band numbers from 1, such as ‹bands› 1,2,3"));
        }
        let twice = bands.iter().enumerate().find(|(place, band)| bands[..*place].contains(band));
        if let Some((_, band)) = twice {
            return Err(Error::usage(format!("band {band} is repeated in ‹bands› {label}"))
                .remedy("name each band once; set its importance with ‹weights›"));
        }
        if !weights.is_empty() && weights.len() != bands.len() {
            let (given, needed) = (weights.len(), bands.len());
            return Err(Error::usage(format!("‹weights› has {given} weights for {needed} bands"))
                .remedy("give one weight for each band of ‹bands›, or none"));
        }
        if let Some(weight) = weights.iter().find(|w| !(w.is_normal() && **w > 0.0)) {
            return Err(Error::usage(format!(
                "band weight {weight} is not a finite number above 0"
            ))
            .remedy("give finite numbers above 0; to ignore a band, leave it out of ‹bands›"));
        }
        if let Some(band) = heights.filter(|band| !bands.contains(band)) {
            let message = format!("‹band› {band} is not among ‹bands› {label}");
            return Err(Error::usage(message)
                .remedy(format!("add {band} to ‹bands›, or leave ‹band› out for heights of 0")));
        }
        let weights = weights.iter().copied().chain(std::iter::repeat(1.0));
        Ok(Self { list: bands.iter().copied().zip(weights).collect(), heights })
    }

    /// Numbers and weights, in the order given.
    pub fn list(&self) -> &[(u32, f64)] {
        &self.list
    }

    /// The band of heights.
    pub fn heights(&self) -> Option<u32> {
        self.heights
    }

    /// The band numbers as an option value: "1,2,3".
    pub fn label(&self) -> String {
        label(&self.list.iter().map(|(band, _)| *band).collect::<Vec<_>>())
    }

    /// Adds the bands to the promises of a mesh; their tolerance has no unit.
    pub fn promise(&self, promises: &mut Promises, tolerance: f64) {
        let (bands, weights) = self.list.iter().copied().unzip();
        promises.max_error = Some(MaxError { value: tolerance, unit: None });
        promises.bands = Some(bands);
        promises.weights = Some(weights);
        promises.heights = Some(self.heights.map_or(HeightBand::None, HeightBand::Band));
    }

    /// Open options of one band.
    pub fn options(band: u32, options: &GridOpenOptions) -> GridOpenOptions {
        GridOpenOptions { band, colours: true, ..options.clone() }
    }

    /// Fails if the grid lacks a band.
    pub fn check(&self, info: &GridInfo) -> Result<()> {
        match self.list.iter().find(|(band, _)| *band > info.bands) {
            None => Ok(()),
            Some((band, _)) => Err(out_of_range(*band, info.bands)),
        }
    }

    /// Opens all bands as grids that share their voids; `open` opens them by number.
    pub fn open(&self, inputs: &Inputs, options: &GridOpenOptions) -> Result<JoinedBands> {
        // Band 1 is always there, and tells how many there are.
        let cache_bytes = options.cache_bytes / self.list.len();
        let options = GridOpenOptions { cache_bytes, ..options.clone() };
        let open = |band| raster::open_all(inputs.names(), &Self::options(band, &options));
        self.check(open(1)?.info())?;
        let all = self.list.iter().map(|(band, _)| open(*band)).collect::<Result<Vec<_>>>()?;
        let first = all[0].info();
        for info in all.iter().map(|band| band.info()) {
            if (info.width, info.height, info.transform)
                != (first.width, first.height, first.transform)
            {
                let message = format!(
                    "bands {} and {} differ in size or georeference",
                    first.band, info.band
                );
                return Err(Error::unsupported(message).remedy("use bands with the same grid"));
            }
        }
        Ok(JoinedBands(all.into()))
    }
}

/// Band numbers as an option value: "1,2,3".
pub fn label(bands: &[u32]) -> String {
    bands.iter().map(u32::to_string).collect::<Vec<_>>().join(",")
}

fn out_of_range(band: u32, bands: u32) -> Error {
    let (noun, remedy) = match bands {
        1 => ("band", "leave out ‹bands›".to_owned()),
        _ => ("bands", format!("name bands from 1 to {bands} with ‹bands›")),
    };
    Error::usage(format!("band {band} is out of range: the file has {bands} {noun}")).remedy(remedy)
}

/// How band values are stored at vertices, by the sample type.
pub fn kind_of(info: &GridInfo) -> ChannelKind {
    match info.sample_type {
        SampleType::U8 if info.exact_in_f32() => ChannelKind::Byte,
        _ if info.exact_in_f32() => ChannelKind::Single,
        _ => ChannelKind::Double,
    }
}

/// The bands of a grid.
pub struct JoinedBands(Arc<[Box<dyn GridSource>]>);

impl JoinedBands {
    /// A single band.
    pub fn of(band: Box<dyn GridSource>) -> Self {
        Self(Arc::new([band]))
    }

    /// The band at an index, void wherever another band is void.
    pub fn band(&self, place: usize) -> Box<dyn GridSource> {
        let info = self.0[place].info().clone();
        Box::new(JointlyValidBand { info, all: self.0.clone(), place, is_flat: false })
    }

    /// The same samples, with 0 wherever all bands are valid.
    pub fn flat(&self) -> Box<dyn GridSource> {
        let info = self.0[0].info().clone();
        Box::new(JointlyValidBand { info, all: self.0.clone(), place: 0, is_flat: true })
    }
}

/// A band among others.
struct JointlyValidBand {
    info: GridInfo,
    all: Arc<[Box<dyn GridSource>]>,
    place: usize,
    is_flat: bool,
}

impl GridSource for JointlyValidBand {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        let mut exact = vec![0.0; out.len()];
        self.read_f64(rect, &mut exact)?;
        out.iter_mut().zip(exact).for_each(|(out, value)| *out = value as f32);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.all[self.place].read_f64(rect, out)?;
        if self.is_flat {
            out.iter_mut().filter(|value| !value.is_nan()).for_each(|value| *value = 0.0);
        }
        let mut other = vec![0.0; out.len()];
        for band in self.all.iter().enumerate().filter(|(at, _)| *at != self.place).map(|(_, b)| b)
        {
            band.read_f64(rect, &mut other)?;
            let voids = out.iter_mut().zip(&other).filter(|(_, other)| other.is_nan());
            voids.for_each(|(value, _)| *value = f64::NAN);
        }
        Ok(())
    }

    fn block_bytes(&self) -> u64 {
        self.all.iter().map(|band| band.block_bytes()).sum()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.all[self.place].members()
    }

    fn release(&self, rect: Rect) {
        self.all.iter().for_each(|band| band.release(rect));
    }

    fn copied(&self, rect: Rect) {
        self.all.iter().for_each(|band| band.copied(rect));
    }

    fn advise_read(&self, rect: Rect) {
        self.all.iter().for_each(|band| band.advise_read(rect));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;

    #[test]
    fn what_makes_no_sense_is_refused_by_name() {
        let refused = |bands: &[u32], weights: &[f64], heights, words: &[&str]| {
            let error = MeshBands::new(bands, weights, heights).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Usage);
            let text = error.to_string();
            assert!(words.iter().all(|word| text.contains(word)), "{words:?} in {text}");
        };
        refused(&[], &[], None, &["is not a list of bands"]);
        refused(&[1, 0], &[], None, &["\"1,0\""]);
        refused(&[1, 2, 1], &[], None, &["band 1 is repeated", "‹weights›"]);
        refused(&[1, 2], &[1.0], None, &["1 weights for 2 bands"]);
        for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            refused(&[1, 2], &[1.0, weight], None, &["is not a finite number", "above 0"]);
        }
        refused(&[1, 2], &[], Some(4), &["‹band› 4", "‹bands› 1,2", "add 4"]);
        let info = GridInfo { bands: 3, ..GridInfo::plain("test", 2, 2, SampleType::U8) };
        let error =
            MeshBands::new(&[3, 4], &[], None).unwrap().check(&info).unwrap_err().to_string();
        assert!(
            error.contains("band 4 is out of range: the file has 3 bands; name bands from 1 to 3")
        );
    }

    #[test]
    fn meshes_state_bands_weights_and_heights() {
        let stated = |weights: &[f64], heights| {
            let mut promises = Promises::default();
            MeshBands::new(&[3, 1], weights, heights).unwrap().promise(&mut promises, 2.5);
            promises.to_lines().join("; ")
        };
        assert_eq!(stated(&[], None), "max error 2.5; bands 3,1; weights 1,1; heights none");
        let weighted = "max error 2.5; bands 3,1; weights 0.5,2; heights band 1";
        assert_eq!(stated(&[0.5, 2.0], Some(1)), weighted);
    }

    #[test]
    fn bytes_are_told_by_type_and_scale() {
        let info =
            |sample_type, scale| GridInfo { scale, ..GridInfo::plain("test", 2, 2, sample_type) };
        assert_eq!(kind_of(&info(SampleType::U8, 1.0)), ChannelKind::Byte);
        assert_eq!(kind_of(&info(SampleType::U8, 0.1)), ChannelKind::Double);
        assert_eq!(kind_of(&info(SampleType::I16, 1.0)), ChannelKind::Single);
        assert_eq!(kind_of(&info(SampleType::F64, 1.0)), ChannelKind::Double);
    }
}
