//! Water levels: bank heights are collected once, then levels are propagated downstream through lines and
//! lakes.

use std::collections::{BTreeSet, HashMap};

use super::axis::{RiverAxis, length};
use super::mask::WaterMask;
use super::profile::{RiverProfile, Stations, rises};
use super::{Water, WaterReport, Xy};
use crate::{GridInfo, GridSource, SampleType};
use terrane_base::bits::BitSet;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// Side in samples of the windows in which banks are collected.
const SIDE: u32 = 256;
/// Maximum number of stations of all lines; stations are longer than cells if necessary.
const STATIONS: u64 = 1 << 14;

/// Maximum memory for stations and a window, in bytes.
pub(super) fn memory_use(line_vertices: usize) -> u64 {
    let window = u64::from(SIDE + 2).pow(2) * (size_of::<f64>() as u64 + 1);
    max_stations(line_vertices) * 64 + 2 * window
}

fn max_stations(line_vertices: usize) -> u64 {
    STATIONS + 4 * line_vertices as u64
}

/// Levels of all water bodies of a grid.
#[derive(Debug)]
pub(super) struct WaterLevels {
    pub(super) mask: WaterMask,
    rounding: LevelRounding,
    lakes: Vec<f64>,
    /// Centre lines of each body that is a river.
    axes: Vec<Option<RiverAxis>>,
    profiles: Vec<RiverProfile>,
    banks: BankLevels,
}

/// Collected bank heights.
#[derive(Debug)]
struct BankLevels {
    /// Lowest bank of each body.
    lowest: Vec<f64>,
    /// True for bodies with at least one sample.
    is_there: Vec<bool>,
    /// Sets of bodies that share a sample with a valid height.
    valid: BTreeSet<Vec<u32>>,
    /// Lowest banks along each line.
    stations: Vec<Stations>,
    /// Range of stations with water along each line.
    reaches: Vec<Option<[f64; 2]>>,
}

impl WaterLevels {
    /// Levels of `water` on `grid`. Reads all samples near water once.
    ///
    /// # Errors
    /// As [`WaterMask::new`]; cyclic centre lines; water without a bank; read errors.
    pub(super) fn new(water: &Water, grid: &dyn GridSource) -> Result<Self> {
        let info = grid.info();
        let mask = WaterMask::new(water, info)?;
        let lines: Vec<_> = water.features.lines().collect();
        let station = station(info, &lines);
        let axes = water.bodies.iter().map(|numbers| {
            let of_body = numbers.iter().map(|&number| (number, lines[number as usize]));
            (!numbers.is_empty()).then(|| RiverAxis::new(of_body, station))
        });
        let axes: Vec<_> = axes.collect();
        let banks = BankLevels::new(grid, &mask, &axes, lines.len())?;
        let network = RiverNetwork::new(water, &mask, info, &lines, station);
        let (lakes, profiles) =
            network.solve(&banks.lowest, &banks.stations).map_err(|e| e.in_file(&water.path))?;
        let rounding = LevelRounding::of(info);
        let levels = Self { mask, rounding, lakes, axes, profiles, banks };
        levels.check(water).map_err(|e| e.in_file(&water.path))?;
        Ok(levels)
    }

    /// True if the level of a body is known.
    fn is_known(&self, water: &Water, body: u32) -> bool {
        match water.bodies[body as usize][..] {
            [] => self.lakes[body as usize].is_finite(),
            ref lines => lines.iter().all(|&line| {
                let line = line as usize;
                self.banks.reaches[line].is_none() || !self.profiles[line].is_unknown()
            }),
        }
    }

    /// Fails if water samples with heights belong to bodies of unknown level.
    fn check(&self, water: &Water) -> Result<()> {
        let mut samples = self.banks.valid.iter();
        let unknown = samples.find(|bodies| !bodies.iter().any(|&body| self.is_known(water, body)));
        let Some(bodies) = unknown else { return Ok(()) };
        let area = water.body_of.iter().position(|of| *of == bodies[0]).unwrap_or_default();
        Err(Error::bad_input("water body without a bank: no valid sample is adjacent")
            .at(format_args!("polygon {}", area + 1))
            .remedy("pass a grid that covers the bank, or remove the polygon"))
    }

    /// The level of a body at a position, infinite if unknown; `last` is a hint for rivers.
    pub(super) fn at(&self, body: u32, at: Xy, last: &mut usize) -> f64 {
        let level = match &self.axes[body as usize] {
            None => self.lakes[body as usize],
            Some(axis) => {
                let place = axis.nearest(at, last);
                self.profiles[place.line as usize].at(place.along)
            }
        };
        self.rounding.down(level)
    }

    /// True for a body with one level.
    pub(super) fn is_level(&self, body: u32) -> bool {
        self.axes[body as usize].is_none()
    }

    /// Summary of the flattening.
    pub(super) fn report(&self, water: &Water) -> WaterReport {
        let BankLevels { is_there, stations, reaches, .. } = &self.banks;
        let bodies = 0..water.bodies.len() as u32;
        let present: Vec<u32> = bodies.filter(|body| is_there[*body as usize]).collect();
        let (rivers, lakes): (Vec<u32>, Vec<u32>) =
            present.iter().partition(|&&body| water.is_river(body));
        let of_lakes = lakes.iter().map(|&body| self.lakes[body as usize]);
        let reaches = reaches.iter().zip(&self.profiles);
        let of_rivers = reaches
            .flat_map(|(reach, profile)| reach.iter().flatten().map(|&along| profile.at(along)));
        let [mut low, mut high] = [f64::INFINITY, f64::NEG_INFINITY];
        let all_levels = of_lakes.chain(of_rivers).filter(|level| level.is_finite());
        for level in all_levels.map(|level| self.rounding.down(level)) {
            (low, high) = (low.min(level), high.max(level));
        }
        let dug = stations.iter().zip(&self.profiles).flat_map(|(stations, profile)| {
            stations.iter().map(|(&at, lowest)| lowest - profile.at(f64::from(at)))
        });
        let rising = (1..).zip(stations).filter(|(_, stations)| rises(stations));
        WaterReport {
            file: water.path.display().to_string(),
            lakes: lakes.len() as u64,
            rivers: rivers.len() as u64,
            outside: (water.bodies.len() - present.len()) as u64,
            without_bank: present.iter().filter(|&&body| !self.is_known(water, body)).count()
                as u64,
            levels: (low <= high).then_some([low, high]),
            dug: dug.fold(0.0, f64::max),
            rising: rising.map(|(number, _)| number).collect(),
        }
    }
}

/// Length of a station: the cell width, or more if there would be too many stations.
fn station(info: &GridInfo, lines: &[&[Xy]]) -> f64 {
    let vertices = lines.iter().map(|line| line.len()).sum();
    let cell = info.transform.determinant().abs().sqrt();
    let all: f64 = lines.iter().map(|line| length(line, 1.0)).sum();
    cell.max(all / max_stations(vertices) as f64)
}

impl BankLevels {
    fn new(
        grid: &dyn GridSource,
        mask: &WaterMask,
        axes: &[Option<RiverAxis>],
        lines: usize,
    ) -> Result<Self> {
        let bodies = axes.len();
        let mut banks = Self {
            lowest: vec![f64::INFINITY; bodies],
            is_there: vec![false; bodies],
            valid: BTreeSet::new(),
            stations: vec![Stations::new(); lines],
            reaches: vec![None; lines],
        };
        let GridInfo { width, height, .. } = *grid.info();
        let mut heights = Vec::new();
        for row in (0..height).step_by(SIDE as usize) {
            for col in (0..width).step_by(SIDE as usize) {
                let core = Rect::new(col, row, SIDE.min(width - col), SIDE.min(height - row));
                if mask.may_be_in(core) {
                    banks.add_window(grid, mask, axes, core, &mut heights)?;
                }
            }
        }
        Ok(banks)
    }

    /// Adds the banks of the water in `core`, from the samples in and around it.
    fn add_window(
        &mut self,
        grid: &dyn GridSource,
        mask: &WaterMask,
        axes: &[Option<RiverAxis>],
        core: Rect,
        heights: &mut Vec<f64>,
    ) -> Result<()> {
        let info = grid.info();
        let (col, row) = (core.col.saturating_sub(1), core.row.saturating_sub(1));
        let end_col = (core.end_col() + 1).min(info.width);
        let end_row = (core.end_row() + 1).min(info.height);
        let rect = Rect::new(col, row, end_col - col, end_row - row);
        let rows = mask.rows(rect);
        if rows.iter().all(Vec::is_empty) {
            return Ok(());
        }
        heights.resize(rect.len(), 0.0);
        grid.read_f64(rect, heights)?;
        // Drops all pages read: a column of samples touches as many pages as a tile has.
        grid.copied(rect);
        let width = rect.width as usize;
        let mut is_water = BitSet::new(rect.len());
        for (row, runs) in rows.iter().enumerate() {
            let cols = runs.iter().flat_map(|(_, cols)| cols.clone());
            for col in cols {
                is_water.insert(row * width + col as usize);
            }
        }
        let (mut here, mut before) = (Vec::new(), Vec::new());
        for (row, runs) in (0..rect.height).zip(&rows) {
            let first = row as usize * width;
            for col in 0..rect.width {
                let sample = first + col as usize;
                if !is_water.contains(sample) || heights[sample].is_nan() {
                    continue;
                }
                here.clear();
                let of_sample = runs.iter().filter(|(_, cols)| cols.contains(&col));
                here.extend(of_sample.map(|(body, _)| *body));
                if here != before {
                    before.clone_from(&here);
                    if !self.valid.contains(&here) {
                        self.valid.insert(here.clone());
                    }
                }
            }
            for &(body, ref cols) in runs {
                let mut last = 0;
                for col in cols.clone().filter(|col| core.contains(rect.col + col, rect.row + row))
                {
                    let at = [rect.col + col, rect.row + row].map(f64::from);
                    let at = info.transform.apply(at[0], at[1]);
                    let axis = axes[body as usize].as_ref();
                    let bank = lowest_bank(col, row, rect, &is_water, heights);
                    self.add_sample(body, axis, at, bank, &mut last);
                }
            }
        }
        Ok(())
    }

    /// Records a sample of a body, and its lowest bank.
    fn add_sample(
        &mut self,
        body: u32,
        axis: Option<&RiverAxis>,
        at: Xy,
        bank: f64,
        last: &mut usize,
    ) {
        self.is_there[body as usize] = true;
        let lowest = &mut self.lowest[body as usize];
        *lowest = lowest.min(bank);
        let Some(axis) = axis else { return };
        let place = axis.nearest(at, last);
        let [from, to] = self.reaches[place.line as usize].unwrap_or([place.along; 2]);
        self.reaches[place.line as usize] = Some([from.min(place.along), to.max(place.along)]);
        if bank.is_finite() {
            let stations = &mut self.stations[place.line as usize];
            let lowest = stations.entry(place.along as u32).or_insert(bank);
            *lowest = lowest.min(bank);
        }
    }
}

/// The lowest height of the samples around one of a window that are not water; infinite if there is none.
#[inline]
fn lowest_bank(col: u32, row: u32, window: Rect, is_water: &BitSet, heights: &[f64]) -> f64 {
    let cols = col.saturating_sub(1)..(col + 2).min(window.width);
    let rows = row.saturating_sub(1)..(row + 2).min(window.height);
    let around = rows.flat_map(|row| cols.clone().map(move |col| (col, row)));
    let samples = around.map(|(col, row)| row as usize * window.width as usize + col as usize);
    let banks = samples.filter(|&sample| !is_water.contains(sample));
    banks.map(|sample| heights[sample]).fold(f64::INFINITY, f64::min)
}

/// The lake at the sample nearest to a position.
fn lake_at(at: Xy, water: &Water, mask: &WaterMask, info: &GridInfo) -> Option<usize> {
    let [col, row] = info.transform.invert(at[0], at[1]).map(|c| (c + 0.5).floor());
    let is_on_grid =
        (0.0..f64::from(info.width)).contains(&col) && (0.0..f64::from(info.height)).contains(&row);
    let bodies = if is_on_grid { mask.at([col as u32, row as u32]) } else { Vec::new() };
    bodies.into_iter().find(|&body| !water.is_river(body)).map(|lake| lake as usize)
}

/// Graph of centre lines: nodes are lakes and line ends.
struct RiverNetwork {
    /// Start node, end node, and length in stations.
    lines: Vec<([usize; 2], f64)>,
    /// Number of nodes, the bodies first.
    nodes: usize,
    bodies: usize,
}

impl RiverNetwork {
    fn new(
        water: &Water,
        mask: &WaterMask,
        info: &GridInfo,
        lines: &[&[Xy]],
        station: f64,
    ) -> Self {
        let bodies = water.bodies.len();
        let mut numbers: HashMap<[u64; 2], usize> = HashMap::new();
        let lines = lines.iter().map(|line| {
            let nodes = [line[0], line[line.len() - 1]].map(|end| {
                lake_at(end, water, mask, info).unwrap_or_else(|| {
                    let next = bodies + numbers.len();
                    // Adding 0.0 turns -0.0 into 0.0: both are one place, but differ in their bits.
                    *numbers.entry(end.map(|c| (c + 0.0).to_bits())).or_insert(next)
                })
            });
            (nodes, length(line, station))
        });
        let lines: Vec<_> = lines.collect();
        Self { lines, nodes: bodies + numbers.len(), bodies }
    }

    /// The level of each lake and profile of each line; infinite if unknown.
    fn solve(
        &self,
        lowest: &[f64],
        stations: &[Stations],
    ) -> Result<(Vec<f64>, Vec<RiverProfile>)> {
        let order = self.downstream()?;
        let mut levels = vec![f64::INFINITY; self.nodes];
        // Nodes of rivers have no lines.
        levels[..self.bodies].copy_from_slice(lowest);
        // A line from a lake to itself has the level of the lake.
        let side_lines: Vec<_> =
            (0..self.lines.len()).filter(|&line| self.is_of_lake(line)).collect();
        for &line in &side_lines {
            let lake = &mut levels[self.lines[line].0[0]];
            *lake = stations[line].values().copied().fold(*lake, f64::min);
        }
        let mut profiles = vec![RiverProfile::default(); self.lines.len()];
        for &line in &order {
            let ([from, to], length) = self.lines[line];
            profiles[line] = RiverProfile::new(levels[from], &stations[line]);
            levels[to] = levels[to].min(profiles[line].at(length));
        }
        // If no level is known upstream, the level downstream applies.
        let is_open: Vec<_> = levels.iter().map(|level| level.is_infinite()).collect();
        for &line in order.iter().rev() {
            let ([from, to], _) = self.lines[line];
            if profiles[line].is_unknown() {
                profiles[line] = RiverProfile::new(levels[to], &Stations::new());
            }
            if is_open[from] {
                let known = if levels[from].is_finite() { levels[from] } else { f64::NEG_INFINITY };
                levels[from] = known.max(profiles[line].at(0.0));
            }
        }
        for line in side_lines {
            profiles[line] = RiverProfile::new(levels[self.lines[line].0[0]], &Stations::new());
        }
        levels.truncate(self.bodies);
        Ok((levels, profiles))
    }

    fn is_of_lake(&self, line: usize) -> bool {
        let [from, to] = self.lines[line].0;
        from == to && from < self.bodies
    }

    /// Topological order of the lines (Kahn 1962), ignoring lines with both ends in one lake.
    fn downstream(&self) -> Result<Vec<usize>> {
        let mut ending = vec![0_usize; self.nodes];
        let mut beginning: Vec<Vec<usize>> = vec![Vec::new(); self.nodes];
        for (number, &([from, to], _)) in self.lines.iter().enumerate() {
            if self.is_of_lake(number) {
                continue;
            }
            ending[to] += 1;
            beginning[from].push(number);
        }
        let mut open: Vec<usize> = (0..self.nodes).filter(|&node| ending[node] == 0).collect();
        let mut order = Vec::with_capacity(self.lines.len());
        while let Some(node) = open.pop() {
            for &line in &beginning[node] {
                order.push(line);
                let ([_, to], _) = self.lines[line];
                ending[to] -= 1;
                if ending[to] == 0 {
                    open.push(to);
                }
            }
        }
        match (0..self.lines.len()).find(|&line| ending[self.lines[line].0[1]] > 0) {
            None => Ok(order),
            Some(line) => {
                Err(Error::bad_input("centre line is part of a cycle or downstream of one")
                    .at(format_args!("line {}", line + 1))
                    .remedy("draw centre lines downstream and without cycles"))
            }
        }
    }
}

/// Values that samples of a grid can have.
#[derive(Clone, Copy, Debug)]
enum LevelRounding {
    /// Any `f64`.
    None,
    /// Any `f32`.
    Single,
    /// Integers, with height = stored * scale + offset.
    Whole { scale: f64, offset: f64 },
}

impl LevelRounding {
    fn of(info: &GridInfo) -> Self {
        use SampleType::{F16, F32, F64};
        let GridInfo { scale, offset, .. } = *info;
        match info.sample_type {
            F16 | F32 if info.exact_in_f32() => Self::Single,
            F16 | F32 | F64 => Self::None,
            _ => Self::Whole { scale, offset },
        }
    }

    /// The nearest possible sample value; for integers the nearest one that is not above.
    fn down(self, height: f64) -> f64 {
        match self {
            Self::None => height,
            Self::Single => f64::from(height as f32),
            Self::Whole { scale, offset } => {
                let stored = (height - offset) / scale;
                let whole = if scale < 0.0 { stored.ceil() } else { stored.floor() };
                // Rounding may have decreased an integer slightly.
                let near = stored.round();
                let is_near = (stored - near).abs() < 1e-6;
                (if is_near { near } else { whole }) * scale + offset
            }
        }
    }
}
