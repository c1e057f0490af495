//! Colours of heights, from a colour table: `height red green blue [opacity]` in a line, or `height name
//! [opacity]`.
//!
//! Fields are separated by blanks, commas, tabs or colons. A height is a number, a percentage of the range of
//! heights (`25%`), or `nv` (also `nan`) for voids; lines that begin with `#` or `/` are comments. This is the
//! format of `gdaldem color-relief`.

/// Red, green, blue and opacity.
pub type Colour = [u8; 4];

/// Named colours.
pub const NAMES: &[(&str, [u8; 3])] = &[
    ("white", [255, 255, 255]),
    ("black", [0, 0, 0]),
    ("red", [255, 0, 0]),
    ("green", [0, 255, 0]),
    ("blue", [0, 0, 255]),
    ("yellow", [255, 255, 0]),
    ("magenta", [255, 0, 255]),
    ("cyan", [0, 255, 255]),
    ("aqua", [0, 191, 191]),
    ("grey", [191, 191, 191]),
    ("gray", [191, 191, 191]),
    ("orange", [255, 127, 0]),
    ("brown", [191, 127, 63]),
    ("purple", [127, 0, 255]),
    ("violet", [127, 0, 255]),
    ("indigo", [0, 127, 255]),
];

/// The colour of a height between two entries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorInterpolation {
    /// Linear interpolation of each component.
    #[default]
    Mixed,
    /// The colour of the nearest entry, of the upper one if both are equally near.
    Nearest,
    /// Transparent black.
    Nothing,
}

/// An error in a colour table, with its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColorTableError {
    /// Line number from 1; 0 for the whole file.
    pub line: usize,
    /// Error message.
    pub message: String,
}

/// The key of an entry.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ColorKey {
    Height(f64),
    /// Fraction of the range of heights, from 0 to 1.
    Share(f64),
    Void,
}

/// The entries of a colour table file.
#[derive(Clone, Debug, PartialEq)]
pub struct Palette(Vec<(ColorKey, Colour)>);

impl Palette {
    /// Parses a colour table.
    ///
    /// # Errors
    /// An invalid line, by its number; a table without entries.
    pub fn parse(text: &str) -> Result<Self, ColorTableError> {
        let mut entries = Vec::new();
        for (line, text) in (1..).zip(text.lines()) {
            let words: Vec<_> =
                text.split([' ', ',', '\t', ':']).filter(|w| !w.is_empty()).collect();
            if words.first().is_none_or(|word| word.starts_with(['#', '/'])) {
                continue;
            }
            entries.push(entry(&words).map_err(|message| ColorTableError { line, message })?);
        }
        match entries.is_empty() {
            true => {
                Err(ColorTableError { line: 0, message: "the colour table is empty".to_owned() })
            }
            false => Ok(Self(entries)),
        }
    }

    /// Whether the table has percentages, which need the range of heights.
    pub fn needs_range(&self) -> bool {
        self.0.iter().any(|(at, _)| matches!(at, ColorKey::Share(_)))
    }

    /// The colour table of a grid with these lowest and highest heights. With an `nv` entry, colours are not
    /// interpolated across the nodata value of the grid. Takes time O(n log n) in the entries.
    pub fn table(
        &self,
        [low, high]: [f64; 2],
        nodata: Option<f64>,
        between: ColorInterpolation,
    ) -> ColorTable {
        let entries = self.0.iter().map(|(key, colour)| {
            let height = match *key {
                ColorKey::Height(height) if Some(height) != nodata => Some(height),
                ColorKey::Share(share) => Some(low + share * (high - low)),
                ColorKey::Height(_) | ColorKey::Void => None,
            };
            (height, *colour)
        });
        let void = entries.clone().rev().find_map(|(height, colour)| match height {
            Some(_) => None,
            None => Some(colour),
        });
        let mut colours: Vec<(f64, Colour)> =
            entries.filter_map(|(height, colour)| Some((height?, colour))).collect();
        colours.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let (Some(value), Some(_), true) = (nodata, void, between != ColorInterpolation::Nothing)
        {
            step(&mut colours, value);
        }
        let (heights, colours) = colours.into_iter().unzip();
        ColorTable { heights, colours, void: void.unwrap_or_default(), between }
    }
}

/// Puts a step between the colours on both sides of a height.
fn step(colours: &mut Vec<(f64, Colour)>, height: f64) {
    let above = colours.partition_point(|(key, _)| *key <= height);
    if above == 0 || above == colours.len() {
        return;
    }
    let sides = [(height.next_down(), colours[above - 1].1), (height.next_up(), colours[above].1)];
    colours.splice(above..above, sides);
}

fn entry(words: &[&str]) -> Result<(ColorKey, Colour), String> {
    let at = place(words[0])?;
    let (rgb, opacity) = match *words {
        [_, r, g, b] => ([byte(r)?, byte(g)?, byte(b)?], 255),
        [_, r, g, b, a] => ([byte(r)?, byte(g)?, byte(b)?], byte(a)?),
        [_, name] => (named(name)?, 255),
        [_, name, a] => (named(name)?, byte(a)?),
        _ => return Err("expected a height and a colour: 1200 255 128 0, or 1200 orange".into()),
    };
    Ok((at, [rgb[0], rgb[1], rgb[2], opacity]))
}

fn byte(word: &str) -> Result<u8, String> {
    word.parse().map_err(|_| format!("{word:?} is not an integer from 0 to 255"))
}

fn finite(word: &str) -> Option<f64> {
    word.parse::<f64>().ok().filter(|value| value.is_finite())
}

fn place(word: &str) -> Result<ColorKey, String> {
    if word.eq_ignore_ascii_case("nv") || word.eq_ignore_ascii_case("nan") {
        return Ok(ColorKey::Void);
    }
    match word.strip_suffix('%') {
        Some(share) => finite(share)
            .filter(|share| (0.0..=100.0).contains(share))
            .map(|share| ColorKey::Share(share / 100.0))
            .ok_or_else(|| format!("{word:?} is not a percentage from 0% to 100%")),
        None => finite(word).map(ColorKey::Height).ok_or_else(|| {
            format!("{word:?} is not a height: expected a number, a percentage such as 25%, or nv")
        }),
    }
}

fn named(word: &str) -> Result<[u8; 3], String> {
    let colour = NAMES.iter().find(|(name, _)| word.eq_ignore_ascii_case(name));
    colour.map(|(_, rgb)| *rgb).ok_or_else(|| {
        let names: Vec<_> = NAMES.iter().map(|(name, _)| *name).collect();
        format!("unknown colour {word:?}; known: {}", names.join(", "))
    })
}

/// Colours by height.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorTable {
    /// Ascending; of equal heights the first applies from below, the last from above.
    heights: Vec<f64>,
    colours: Vec<Colour>,
    void: Colour,
    between: ColorInterpolation,
}

impl ColorTable {
    /// Colours of heights, as by [`ColorTable::at`]. A height in the same interval as the one before, as
    /// neighbours mostly are, takes constant time.
    pub fn paint(&self, heights: &[f64], colours: &mut [Colour]) {
        let mut span = ColorSpan::default();
        for (colour, height) in colours.iter_mut().zip(heights) {
            if !span.holds(*height) {
                span = self.span(*height);
            }
            *colour = if span.holds(*height) { span.at(*height) } else { self.at(*height) };
        }
    }

    /// The interval of a height, if colours are interpolated.
    fn span(&self, height: f64) -> ColorSpan {
        let above = self.heights.partition_point(|own| *own < height);
        match (above.checked_sub(1), self.heights.get(above), self.between) {
            (Some(below), Some(high), ColorInterpolation::Mixed) => ColorSpan {
                ends: [self.heights[below], *high],
                colours: [self.colours[below], self.colours[above]],
            },
            _ => ColorSpan::default(),
        }
    }

    /// The colour of a height; that of voids for NaN. Takes time logarithmic in the entries.
    #[inline]
    pub fn at(&self, height: f64) -> Colour {
        let above = self.heights.partition_point(|own| *own < height);
        let is_exact = self.heights.get(above) == Some(&height);
        match (above, self.between) {
            _ if height.is_nan() || self.heights.is_empty() => self.void,
            _ if is_exact => self.colours[above],
            (_, ColorInterpolation::Nothing) => [0; 4],
            (0, _) => self.colours[0],
            (above, _) if above == self.heights.len() => self.colours[above - 1],
            (above, ColorInterpolation::Nearest) => {
                let [low, high] = [self.heights[above - 1], self.heights[above]];
                self.colours[if height - low < high - height { above - 1 } else { above }]
            }
            (above, ColorInterpolation::Mixed) => {
                let ends = [self.heights[above - 1], self.heights[above]];
                ColorSpan { ends, colours: [self.colours[above - 1], self.colours[above]] }
                    .at(height)
            }
        }
    }
}

/// Two heights that follow each other in a table, and their colours.
#[derive(Clone, Copy, Default)]
struct ColorSpan {
    ends: [f64; 2],
    colours: [Colour; 2],
}

impl ColorSpan {
    /// True for heights between the ends.
    #[inline(always)]
    fn holds(&self, height: f64) -> bool {
        self.ends[0] < height && height < self.ends[1]
    }

    #[inline(always)]
    fn at(&self, height: f64) -> Colour {
        let ([low, high], [from, to]) = (self.ends, self.colours);
        let share = (height - low) / (high - low);
        std::array::from_fn(|part| mixed(from[part], to[part], share))
    }
}

/// Interpolates a component; rounds up from 0.55, as gdaldem does.
#[inline(always)]
fn mixed(from: u8, to: u8, share: f64) -> u8 {
    let [from, to] = [from, to].map(f64::from);
    (0.45 + from + share * (to - from)) as u8
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn texts_are_read_as_gdaldem_reads_them() {
        let text =
            "# heights\n/ of\n\n 0 0 0 255\n50%,0:255,0  128\n1e3\tred\n-5.5 GREY 7\nnv 1 2 3 4\n";
        let palette = Palette::parse(text).unwrap();
        assert!(palette.needs_range());
        let table = palette.table([200.0, 600.0], Some(-9999.0), ColorInterpolation::Mixed);
        for (height, colour) in [
            (0.0, [0, 0, 255, 255]),
            (400.0, [0, 255, 0, 128]),
            (1000.0, [255, 0, 0, 255]),
            (2000.0, [255, 0, 0, 255]),
            (-5.5, [191, 191, 191, 7]),
            (-100.0, [191, 191, 191, 7]),
            (f64::NAN, [1, 2, 3, 4]),
            (200.0, [0, 127, 127, 191]),
        ] {
            assert_eq!(table.at(height), colour, "{height}");
        }
    }

    #[test]
    fn other_texts_are_faults_by_line() {
        for (text, line, words) in [
            ("", 0, "the colour table is empty"),
            ("# 1 2 3 4\n", 0, "the colour table is empty"),
            ("1 2 3 4\n5\n", 2, "a height and a colour"),
            ("1 2 3 4 5 6", 1, "a height and a colour"),
            ("1 2 3 256", 1, "256"),
            ("1 2 3 -4", 1, "-4"),
            ("1 mauve", 1, "mauve"),
            ("101% red", 1, "101%"),
            ("x red", 1, "is not a height"),
            ("inf red", 1, "is not a height"),
        ] {
            let fault = Palette::parse(text).unwrap_err();
            assert!(fault.line == line && fault.message.contains(words), "{text:?}: {fault:?}");
        }
    }

    #[test]
    fn between_heights_colours_are_mixed_or_the_nearest_or_none() {
        let palette = Palette::parse("0 0 10 100\n10 255 20 0\n10 7 7 7\n20 9 9 9").unwrap();
        let at = |between, height| palette.table([0.0; 2], None, between).at(height);
        assert_eq!(at(ColorInterpolation::Mixed, 4.0), [102, 14, 60, 255]);
        assert_eq!(at(ColorInterpolation::Nearest, 5.0), [255, 20, 0, 255]);
        assert_eq!(at(ColorInterpolation::Nearest, 4.9), [0, 10, 100, 255]);
        assert_eq!(at(ColorInterpolation::Nothing, 4.9), [0; 4]);
        assert_eq!(
            (at(ColorInterpolation::Nothing, 0.0), at(ColorInterpolation::Nothing, 30.0)),
            ([0, 10, 100, 255], [0; 4])
        );
        // A step: from below and from above.
        assert_eq!(at(ColorInterpolation::Mixed, 9.999_999), [255, 20, 0, 255]);
        assert_eq!(at(ColorInterpolation::Mixed, 10.000_001), [7, 7, 7, 255]);
        // Voids that no line names cannot be seen; colours are not mixed across their value.
        assert_eq!(at(ColorInterpolation::Mixed, f64::NAN), [0; 4]);
        let palette = Palette::parse("nv white\n-1 red\n1 blue").unwrap();
        let table = palette.table([0.0; 2], Some(0.0), ColorInterpolation::Mixed);
        assert_eq!((table.at(-0.1), table.at(0.1)), ([255, 0, 0, 255], [0, 0, 255, 255]));
    }

    proptest! {
        /// By a look at all pairs of neighbours.
        #[test]
        fn tables_are_as_a_search_through_all(
            entries in prop::collection::vec((-50..50_i32, any::<[u8; 3]>()), 1..9), height in -60.0..60.0_f64, whole: bool,
        ) {
            let height = if whole { height.round() } else { height };
            let mut entries: Vec<(f64, [u8; 3])> = entries.into_iter().map(|(z, rgb)| (f64::from(z), rgb)).collect();
            entries.sort_by(|a, b| a.0.total_cmp(&b.0));
            entries.dedup_by_key(|entry| entry.0);
            let text: String = entries.iter().rev().map(|(z, [r, g, b])| format!("{z} {r} {g} {b}\n")).collect();
            let table = Palette::parse(&text).unwrap().table([0.0; 2], None, ColorInterpolation::Mixed);
            let (first, last) = (entries[0], entries[entries.len() - 1]);
            let pairs = entries.windows(2).find(|pair| (pair[0].0..=pair[1].0).contains(&height));
            let expected = match pairs {
                // Nine twentieths go up.
                Some(pair) => [0, 1, 2].map(|i| {
                    let [a, b] = [f64::from(pair[0].1[i]), f64::from(pair[1].1[i])];
                    a + (height - pair[0].0) / (pair[1].0 - pair[0].0) * (b - a) - 0.05
                }),
                None => (if height < first.0 { first } else { last }).1.map(f64::from),
            };
            let found = table.at(height);
            prop_assert_eq!(found[3], 255);
            let mut painted = [Colour::default(); 7];
            let heights = [height, height + 0.5, last.0, f64::NAN, first.0 - 1.0, -height, height];
            table.paint(&heights, &mut painted);
            prop_assert_eq!(painted, heights.map(|height| table.at(height)));
            prop_assert!((0..3).all(|i| (f64::from(found[i]) - expected[i]).abs() <= 0.5 + 1e-9));
        }
    }
}
