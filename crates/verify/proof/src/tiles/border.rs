//! Borders: the height lattice of a level, the vertices of a side, and gaps between two sides.

use super::decode::DecodedTile;
use super::ellipsoid::{ProofMeridian, ProofParallel, Vector, dot, minus};
use super::fault::{TilesetFault, TilesetFaults};
use super::structure::along;
use super::tiling::{LAST, ProofTileId, ProofTileSide, coordinate};

/// True for 2^k.
fn is_power_of_two(value: f64) -> bool {
    value.is_normal() && value > 0.0 && value.to_bits() << 12 == 0
}

/// Checks that the heights of a tile are multiples of the level's `step` (a power of two): then they are exact as
/// `f64`, and equal heights are equal numbers.
///
/// The height step of the tile is 1/32767 of its height range, and has to be `step` / 2^j; its lower height is a multiple
/// of it.
pub fn lattice(id: ProofTileId, tile: &DecodedTile, step: f64, faults: &mut TilesetFaults) {
    let [low, high] = tile.heights.map(f64::from);
    let tile_step = (high - low) / f64::from(LAST);
    let is_level = tile_step == 0.0;
    // Exact: a power of two times 15 bits.
    let is_exact = is_power_of_two(tile_step)
        && tile_step * f64::from(LAST) == high - low
        && tile_step <= step;
    let is_right = is_power_of_two(step) && (is_level || (is_exact && is_multiple(low, tile_step)));
    faults.add(TilesetFault::WrongStep, u64::from(!is_right), id);
    let heights = tile.vertices.iter().map(|&vertex| tile.height(vertex));
    let off = heights.filter(|&height| !is_multiple(height, step)).count();
    faults.add(TilesetFault::OffLattice, off as u64, id);
}

fn is_multiple(height: f64, step: f64) -> bool {
    (height / step).fract() == 0.0
}

/// The vertices of a side, from the west or south on.
#[derive(Clone, Debug, PartialEq)]
pub struct TileSideChain {
    id: ProofTileId,
    side: ProofTileSide,
    /// Step along the side, and height in metres.
    stops: Vec<(u16, f64)>,
    /// Earth-centred positions, if the tile stores them.
    placed: Vec<Vector>,
}

impl TileSideChain {
    /// The chain of a side of a tile.
    pub fn of(id: ProofTileId, tile: &DecodedTile, side: ProofTileSide) -> Self {
        let on_it = tile.vertices.iter().enumerate();
        let on_it = on_it.filter(|(_, vertex)| DecodedTile::is_on(**vertex, side));
        let mut found: Vec<_> = on_it
            .map(|(number, &vertex)| ((along(vertex, side), tile.height(vertex)), number))
            .collect();
        found.sort_unstable_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let placed = found.iter().filter_map(|(_, number)| tile.placed.get(*number).copied());
        let placed = placed.collect();
        let stops = found.into_iter().map(|(stop, _)| stop).collect();
        Self { id, side, stops, placed }
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        let placed = self.placed.len() * size_of::<Vector>();
        self.stops.len() * size_of::<(u16, f64)>() + placed + size_of::<Self>()
    }

    /// True if both have the same vertices, heights and positions, bit by bit.
    pub fn is_same(&self, other: &Self) -> bool {
        self.stops == other.stops && self.placed == other.placed
    }

    /// Longitude or latitude of its ends.
    fn reach(&self) -> [f64; 2] {
        let [west, south, east, north] = self.id.bounds();
        if self.side.is_meridian() { [south, north] } else { [west, east] }
    }

    fn degrees(&self, stop: u16) -> f64 {
        let [low, high] = self.reach();
        coordinate(stop, low, high)
    }

    /// Meridian and parallel at a longitude or latitude on the border.
    fn place(&self, degrees: f64) -> (ProofMeridian, ProofParallel) {
        let [west, south, east, north] = self.id.bounds();
        let [longitude, latitude] = match self.side {
            ProofTileSide::West => [west, degrees],
            ProofTileSide::East => [east, degrees],
            ProofTileSide::South => [degrees, south],
            ProofTileSide::North => [degrees, north],
        };
        (ProofMeridian::at(longitude), ProofParallel::at(latitude))
    }

    fn position(&self, stop: (u16, f64)) -> Vector {
        let (meridian, parallel) = self.place(self.degrees(stop.0));
        parallel.position(meridian, stop.1)
    }

    /// Height of the straight edge above a longitude or latitude, along the normal there.
    fn height(&self, degrees: f64) -> Option<f64> {
        let next = self.stops.partition_point(|stop| self.degrees(stop.0) < degrees);
        let end = *self.stops.get(next)?;
        if self.degrees(end.0) == degrees {
            return Some(end.1);
        }
        let begin = *self.stops.get(next.checked_sub(1)?)?;
        let (meridian, parallel) = self.place(degrees);
        let foot = parallel.position(meridian, 0.0);
        let on = if self.side.is_meridian() { parallel.north(meridian) } else { meridian.east() };
        let [from, to] = [begin, end].map(|stop| minus(self.position(stop), foot));
        let [before, after] = [from, to].map(|end| dot(end, on));
        let share = before / (before - after);
        let [low, high] = [from, to].map(|end| dot(end, parallel.normal(meridian)));
        // At a pole the whole parallel is one point.
        Some(if share.is_finite() { low + share * (high - low) } else { begin.1 })
    }
}

/// The largest vertical distance of two chains along their common part of a border. Both are straight between the vertices
/// of either, so these suffice.
pub fn gap(a: &TileSideChain, b: &TileSideChain) -> f64 {
    let reaches = [a.reach(), b.reach()];
    let common = reaches[0][0].max(reaches[1][0])..=reaches[0][1].min(reaches[1][1]);
    let all = [a, b].into_iter().flat_map(|chain| {
        chain.stops.iter().map(|stop| chain.degrees(stop.0)).filter(|at| common.contains(at))
    });
    let apart = all.filter_map(|at| Some((a.height(at)? - b.height(at)?).abs()));
    apart.fold(0.0, f64::max)
}
