//! A survey's name, such as `cloud,size=1000,density=8,seed=7`: parsed and printed.

use std::fmt;

use super::LidarSurvey;
use crate::SynthParameter;
use crate::parameters::{GivenSynthParameter, NameGrammar};
use terrane_base::error::{Error, Result};
use terrane_base::geom::REACH;

/// The first word of a survey's name.
const KIND: &str = "cloud";

const fn parameter(
    key: &'static str,
    about: &'static str,
    default: f64,
    range: (f64, f64),
    whole: bool,
) -> SynthParameter {
    SynthParameter { key, about, default, range, whole }
}

const SIDE: (f64, f64) = (1.0, 1e6);

/// The parameters of a survey.
pub const PARAMETERS: &[SynthParameter] = &[
    parameter("size", "metres from west to east and from south to north", 1000.0, SIDE, false),
    parameter("width", "metres from west to east, instead of size", 1000.0, SIDE, false),
    parameter("height", "metres from south to north, instead of size", 1000.0, SIDE, false),
    parameter(
        "density",
        "approximate number of points per square metre",
        8.0,
        (1e-3, 2000.0),
        false,
    ),
    parameter("seed", "random seed, an integer", 1.0, (0.0, u64::MAX as f64), true),
    parameter("noise", "standard deviation of range noise in metres", 0.03, (0.0, 10.0), false),
    parameter("scale", "coordinate resolution in metres", 0.01, (1e-4, 1.0), false),
    parameter("relief", "approximate height range in metres", 150.0, (0.0, 1e4), false),
    parameter("voids", "number of round gaps of 15 to 60 m", 0.0, (0.0, 1e5), true),
    parameter("tile", "metres between the lines that the gaps lie on", 250.0, (1.0, 1e6), false),
    parameter("outliers", "share of noise points and of withheld points", 2e-4, (0.0, 1.0), false),
    parameter(
        "cover",
        "1 for forest, buildings and water, 0 for bare ground",
        1.0,
        (0.0, 1.0),
        true,
    ),
    parameter("zigzag", "1 for zigzag scan lines, 0 for parallel ones", 1.0, (0.0, 1.0), true),
];

fn default(key: &str) -> f64 {
    PARAMETERS.iter().find(|p| p.key == key).map_or(0.0, |p| p.default)
}

impl Default for LidarSurvey {
    fn default() -> Self {
        Self {
            width: default("width"),
            height: default("height"),
            density: default("density"),
            seed: default("seed") as u64,
            noise: default("noise"),
            scale: default("scale"),
            relief: default("relief"),
            voids: default("voids") as u32,
            tile: default("tile"),
            outliers: default("outliers"),
            cover: default("cover") != 0.0,
            zigzag: default("zigzag") != 0.0,
        }
    }
}

impl LidarSurvey {
    /// True if a name is a survey's: its first word is `cloud`.
    pub fn is_named(name: &str) -> bool {
        name.split(',').next().is_some_and(|word| word.trim() == KIND)
    }

    /// The survey with this name: `cloud`, then any of [`PARAMETERS`] as `key=value`, separated by
    /// commas, in any order, each at most once; width and height override size. Fails with
    /// [`ErrorKind::Usage`](terrane_base::ErrorKind::Usage), which lists the parameters.
    pub fn parse(name: &str) -> Result<Self> {
        let mut words = name.split(',').map(str::trim);
        if words.next() != Some(KIND) {
            return Err(Error::usage(format!("not a point cloud name: {name:?}"))
                .remedy(format!("begin the name with {KIND:?}")));
        }
        let known = NameGrammar { what: "cloud", kind: KIND, known: PARAMETERS.iter().collect() };
        let mut survey = Self::default();
        for given in known.read(words, name)? {
            survey.set(&given)?;
        }
        survey.check()?;
        Ok(survey)
    }

    fn set(&mut self, given: &GivenSynthParameter<'_>) -> Result<()> {
        let value = given.value;
        match given.key {
            "size" => (self.width, self.height) = (value, value),
            "width" => self.width = value,
            "height" => self.height = value,
            "density" => self.density = value,
            "seed" => self.seed = given.whole()?,
            "noise" => self.noise = value,
            "scale" => self.scale = value,
            "relief" => self.relief = value,
            "voids" => self.voids = value as u32,
            "tile" => self.tile = value,
            "outliers" => self.outliers = value,
            "cover" => self.cover = value != 0.0,
            _ => self.zigzag = value != 0.0,
        }
        Ok(())
    }

    /// Checks of combined parameters.
    fn check(&self) -> Result<()> {
        let longest = self.width.max(self.height);
        if longest / self.scale > f64::from(REACH) {
            let limit = f64::from(REACH) * self.scale;
            return Err(Error::usage(format!(
                "a side of {longest} m exceeds the coordinate range at a scale of {} m",
                self.scale
            ))
            .remedy(format!("choose at most {limit:.0} m, or a larger scale")));
        }
        if self.voids > 0 && longest <= self.tile {
            let message =
                format!("voids lie on multiples of {} m, none within the cloud", self.tile);
            return Err(Error::usage(message).remedy("choose a tile smaller than the cloud"));
        }
        Ok(())
    }
}

/// The name, which [`LidarSurvey::parse`] parses into the same survey.
impl fmt::Display for LidarSurvey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, density, seed, noise, scale, .. } = self;
        let Self { relief, voids, tile, outliers, .. } = self;
        write!(f, "{KIND},width={width},height={height},density={density},seed={seed}")?;
        write!(f, ",noise={noise},scale={scale},relief={relief},voids={voids},tile={tile}")?;
        let (cover, zigzag) = (u8::from(self.cover), u8::from(self.zigzag));
        write!(f, ",outliers={outliers},cover={cover},zigzag={zigzag}")
    }
}
