//! Cells to pixels, and the legend below them.

use serde::Serialize;
use terrane_options::Choice;

use super::map::PointDensityMap;
use super::voids::VoidCells;
use crate::render::{HeightColors, PictureHeights, class_colour, text_size, write_text};
use terrane_base::geom::PointFrame;
use terrane_cloud::{CloudInfo, class_name};

/// Cell value shown by a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Choice)]
#[serde(rename_all = "lowercase")]
pub enum PictureContent {
    /// Points per unit area
    #[default]
    Density,
    /// Empty cells within the convex hull of the others
    Voids,
    /// Height of the highest point
    Height,
    /// Class of the highest point
    Class,
}

/// Sides of a picture that is not enlarged are longer than half of this.
const SMALL: usize = 800;
/// Minimum columns, so that the legend fits.
const MIN_COLUMNS: usize = 480;
/// Pixels of a dot of a letter, between lines of the legend, of its bar and swatches.
const DOT: usize = 2;
const LEADING: usize = 7;
const BAR: usize = 16;
const MARGIN: usize = 10;
const PAPER: [u8; 4] = [255; 4];
const INK: [u8; 4] = [26, 33, 51, 255];
const CLEAR: [u8; 4] = [0; 4];
/// Colours of densities, low to high.
pub(crate) const DENSITIES: [[u8; 3]; 6] =
    [[250, 240, 206], [186, 214, 150], [96, 172, 152], [44, 118, 152], [46, 66, 126], [44, 20, 70]];
const FILLED: [u8; 3] = [206, 216, 210];
const VOID: [u8; 3] = [200, 54, 48];
/// Percentage of cells at the upper end that the colours of densities do not distinguish.
const BEYOND: usize = 2;

/// A picture and its legend.
pub(super) struct CloudPicture<'a> {
    map: &'a PointDensityMap,
    voids: &'a VoidCells,
    colours: CellColoring,
    /// Pixels along the side of a cell.
    zoom: usize,
    width: usize,
    legend: Vec<[u8; 4]>,
}

/// Quantity that determines the colours of cells.
enum CellColoring {
    /// Points of a cell that have the last colour.
    Density(f64),
    Voids,
    Height(HeightColors, PointFrame),
    Class,
}

/// A line of the legend.
enum LegendLine {
    /// 256 colours from side to side.
    Bar(Vec<[u8; 3]>),
    /// At the left and at the right.
    Text(String, String),
    /// A colour and its label.
    Swatch([u8; 3], String),
}

impl LegendLine {
    /// The colours of heights from `low` to `high`.
    fn height_bar(tint: &HeightColors, low: f64, high: f64) -> Self {
        let heights = (0..256).map(|i| low + (high - low) * f64::from(i) / 255.0);
        Self::Bar(heights.map(|z| rounded(tint.colour(z as f32))).collect())
    }

    fn class_swatch(class: u8) -> Self {
        Self::Swatch(class_colour(class), format!("{class} {}", class_name(class)))
    }

    /// Rows of pixels, with the space below.
    fn height(&self) -> usize {
        LEADING + if matches!(self, Self::Text(..)) { text_size("", DOT)[1] } else { BAR + 2 }
    }
}

impl<'a> CloudPicture<'a> {
    pub(super) fn new(
        map: &'a PointDensityMap,
        voids: &'a VoidCells,
        shows: PictureContent,
        info: &CloudInfo,
    ) -> Self {
        let [columns, rows] = map.cells.size;
        let zoom = (SMALL / columns.max(rows)).max(1);
        let width = (columns * zoom).max(MIN_COLUMNS);
        let colours = CellColoring::new(map, shows, &info.frame);
        let lines = colours.lines(map, voids, info);
        let legend = legend(&lines, width);
        Self { map, voids, colours, zoom, width, legend }
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.width, self.map.cells.size[1] * self.zoom + self.legend.len() / self.width]
    }

    /// Fills a row of pixels.
    pub(super) fn row(&self, row: usize, line: &mut [u8]) {
        let [columns, rows] = self.map.cells.size;
        let (pixels, _) = line.as_chunks_mut::<4>();
        if row >= rows * self.zoom {
            let from = (row - rows * self.zoom) * self.width;
            pixels.copy_from_slice(&self.legend[from..from + self.width]);
            return;
        }
        for (col, pixel) in pixels.iter_mut().enumerate() {
            let place = [col / self.zoom, row / self.zoom];
            *pixel = if place[0] < columns { self.cell(place) } else { CLEAR };
        }
    }

    fn cell(&self, [col, row]: [usize; 2]) -> [u8; 4] {
        let cell = row * self.map.cells.size[0] + col;
        match (self.map.is_filled(cell), &self.colours) {
            (true, colours) => opaque(colours.of(self.map, cell)),
            (false, CellColoring::Voids) if self.voids.is_inside([col, row]) => opaque(VOID),
            (false, _) => CLEAR,
        }
    }
}

impl CellColoring {
    fn new(map: &PointDensityMap, shows: PictureContent, frame: &PointFrame) -> Self {
        match shows {
            PictureContent::Density => Self::Density(dense(map)),
            PictureContent::Voids => Self::Voids,
            PictureContent::Class => Self::Class,
            PictureContent::Height => {
                let heights = (0..map.counts.len()).map(|cell| match map.is_filled(cell) {
                    true => height(frame, map.top(cell).0),
                    false => f32::NAN,
                });
                let z = heights.collect();
                let [width, height] = map.cells.size;
                Self::Height(HeightColors::of(&PictureHeights { width, height, z }), *frame)
            }
        }
    }

    /// The colour of a cell with points.
    fn of(&self, map: &PointDensityMap, cell: usize) -> [u8; 3] {
        match self {
            Self::Density(max) => density_colour(&DENSITIES, map.counts[cell] as f64 / max),
            Self::Voids => FILLED,
            Self::Height(tint, frame) => rounded(tint.colour(height(frame, map.top(cell).0))),
            Self::Class => class_colour(map.top(cell).1),
        }
    }

    fn lines(&self, map: &PointDensityMap, voids: &VoidCells, info: &CloudInfo) -> Vec<LegendLine> {
        let unit = info.crs.horizontal_unit();
        let cells = LegendLine::Text(format!("cells of {} {unit}", map.cells.side), String::new());
        match self {
            Self::Density(max) => vec![
                LegendLine::Bar(
                    (0..256).map(|i| density_colour(&DENSITIES, f64::from(i) / 255.0)).collect(),
                ),
                LegendLine::Text(
                    "0".to_owned(),
                    format!("{} and more", short(max / map.cells.area())),
                ),
                LegendLine::Text(format!("points per square {unit}"), String::new()),
                cells,
            ],
            Self::Voids => {
                let percent = short(100.0 * voids.statistics.share);
                let (filled, voids) = (map.filled(), voids.statistics.cells);
                vec![
                    LegendLine::Swatch(FILLED, format!("{filled} cells with points")),
                    LegendLine::Swatch(VOID, format!("{voids} cells without, {percent} percent")),
                    cells,
                ]
            }
            Self::Height(tint, _) => {
                let (low, high) = ends(map, &info.frame);
                vec![
                    LegendLine::height_bar(tint, low, high),
                    LegendLine::Text(short(low), short(high)),
                    LegendLine::Text("highest points".to_owned(), String::new()),
                    cells,
                ]
            }
            Self::Class => {
                let mut counts = [0u64; 256];
                let filled = (0..map.counts.len()).filter(|cell| map.is_filled(*cell));
                filled.for_each(|cell| counts[usize::from(map.top(cell).1)] += 1);
                let present = (0..=255u8).filter(|class| counts[usize::from(*class)] > 0);
                let highest = LegendLine::Text("class of highest points".to_owned(), String::new());
                present.map(LegendLine::class_swatch).chain([highest, cells]).collect()
            }
        }
    }
}

fn height(frame: &PointFrame, steps: i32) -> f32 {
    (f64::from(steps) * frame.scale[2] + frame.offset[2]) as f32
}

/// The lowest and highest of the highest points.
fn ends(map: &PointDensityMap, frame: &PointFrame) -> (f64, f64) {
    let filled = (0..map.counts.len()).filter(|cell| map.is_filled(*cell));
    let heights = filled.map(|cell| f64::from(height(frame, map.top(cell).0)));
    heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)))
}

/// Points of a cell that only [`BEYOND`] percent of the cells exceed.
fn dense(map: &PointDensityMap) -> f64 {
    let mut counts: Vec<u64> = map.counts.iter().copied().filter(|count| *count > 0).collect();
    let at = (counts.len() - counts.len() * BEYOND / 100).saturating_sub(1);
    counts.select_nth_unstable(at).1.max(&mut 1).to_owned() as f64
}

/// The colour at 0 to 1 between colours from low to high.
pub(crate) fn density_colour(colours: &[[u8; 3]], at: f64) -> [u8; 3] {
    let place = at.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let stop = (place as usize).min(colours.len() - 2);
    let mix = place - stop as f64;
    let [from, to] = [colours[stop], colours[stop + 1]];
    std::array::from_fn(|i| {
        let (from, to) = (f64::from(from[i]), f64::from(to[i]));
        (from + (to - from) * mix).round() as u8
    })
}

fn rounded(colour: [f32; 3]) -> [u8; 3] {
    colour.map(|channel| (channel * 255.0).round() as u8)
}

fn opaque([red, green, blue]: [u8; 3]) -> [u8; 4] {
    [red, green, blue, 255]
}

/// A number in few digits, with no letter that the legend cannot write.
fn short(value: f64) -> String {
    let digits = (2 - value.abs().max(1e-6).log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Lines on paper, as wide as the picture.
fn legend(lines: &[LegendLine], width: usize) -> Vec<[u8; 4]> {
    let rows = lines.iter().map(LegendLine::height).sum::<usize>() + MARGIN + LEADING;
    let mut paper = vec![PAPER; width * rows];
    let mut top = MARGIN;
    for line in lines {
        draw(line, &mut paper, width, top);
        top += line.height();
    }
    paper
}

fn draw(line: &LegendLine, paper: &mut [[u8; 4]], width: usize, top: usize) {
    let right = width - MARGIN;
    match line {
        LegendLine::Bar(colours) => {
            for col in MARGIN..right {
                let colour = colours[(col - MARGIN) * colours.len() / (right - MARGIN)];
                (top..top + BAR).for_each(|row| paper[row * width + col] = opaque(colour));
            }
        }
        LegendLine::Text(left, other) => {
            write(left, paper, width, [MARGIN, top]);
            let from = right.saturating_sub(text_size(other, DOT)[0]);
            write(other, paper, width, [from, top]);
        }
        LegendLine::Swatch(colour, text) => {
            let square = (0..BAR * BAR).map(|i| [MARGIN + i % BAR, top + i / BAR]);
            square.for_each(|[col, row]| paper[row * width + col] = opaque(*colour));
            write(text, paper, width, [MARGIN + BAR + LEADING, top]);
        }
    }
}

fn write(text: &str, paper: &mut [[u8; 4]], width: usize, [left, top]: [usize; 2]) {
    write_text(text, DOT, |col, row| {
        let col = left + col;
        if let Some(pixel) = paper.get_mut((top + row) * width + col).filter(|_| col < width) {
            *pixel = INK;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::voids::find;
    use super::*;
    use terrane_base::geom::Crs;

    fn info() -> CloudInfo {
        let frame = PointFrame { scale: [0.01; 3], offset: [0.0; 3] };
        CloudInfo { frame, bounds: None, count: 0, crs: Crs::default() }
    }

    /// The pixels in the middle of cells.
    fn painted(map: &PointDensityMap, shows: PictureContent) -> Vec<[u8; 4]> {
        let found = find(map);
        let sheet = CloudPicture::new(map, &found, shows, &info());
        let [width, rows] = sheet.size();
        let mut line = vec![0; width * 4];
        // No row of the picture fails.
        (0..rows).for_each(|row| sheet.row(row, &mut line));
        let [columns, rows] = map.cells.size;
        let middles = (0..columns * rows)
            .map(|i| [i % columns, i / columns].map(|k| k * sheet.zoom + sheet.zoom / 2));
        let pixel = |[col, row]: [usize; 2]| {
            let mut line = vec![0; width * 4];
            sheet.row(row, &mut line);
            [0, 1, 2, 3].map(|k| line[4 * col + k])
        };
        middles.map(pixel).collect()
    }

    #[test]
    fn cells_have_the_colours_of_what_is_shown() {
        let map = PointDensityMap::of_rows(&[&[1, 2, 0], &[0, 0, 9], &[3, 0, 4]]);
        let density = painted(&map, PictureContent::Density);
        assert_eq!(density[2], CLEAR, "outside");
        assert_eq!(density[4], CLEAR, "a void");
        assert_eq!(density[5], opaque(DENSITIES[5]), "the densest");
        assert!(density[0][0] > density[1][0] && density[1][0] > density[6][0], "{density:?}");
        let voids = painted(&map, PictureContent::Voids);
        assert_eq!([voids[0], voids[4], voids[2]], [opaque(FILLED), opaque(VOID), CLEAR]);
        let classes = painted(&map, PictureContent::Class);
        assert_eq!([classes[0], classes[1]], [1, 2].map(|class| opaque(class_colour(class))));
        let heights = painted(&map, PictureContent::Height);
        let land = crate::render::palette()[0];
        assert_eq!([heights[5], heights[2]], [opaque(land[land.len() - 1]), CLEAR]);
    }

    #[test]
    fn legends_fit_and_numbers_are_short() {
        assert_eq!(
            [0.0, 12.345, 1234.5, 0.012, -4.5].map(short),
            ["0", "12.3", "1234", "0.012", "-4.5"]
        );
        let lines = [
            LegendLine::Text("x".repeat(400), "y".repeat(400)),
            LegendLine::Swatch(VOID, "z".repeat(400)),
        ];
        let paper = legend(&lines, MIN_COLUMNS);
        assert_eq!(paper.len() % MIN_COLUMNS, 0);
        assert!(paper.contains(&INK) && paper.contains(&opaque(VOID)));
    }
}
