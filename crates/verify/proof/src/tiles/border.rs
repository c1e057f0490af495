//! Borders: the steps that heights are whole numbers of, the vertices of a side, and gaps between two sides.

use super::decode::DecodedTile;
use super::ellipsoid::{ProofMeridian, ProofParallel, Vector, dot, minus};
use super::fault::{TilesetFault, TilesetFaults};
use super::structure::along;
use super::tiling::{LAST, ProofTileId, ProofTileSide};

/// True for 2^k.
fn is_power_of_two(value: f64) -> bool {
    value.is_normal() && value > 0.0 && value.to_bits() << 12 == 0
}

/// Holds the heights of a tile to be whole numbers of the level's `step` (a power of two): then they are exact as
/// `f64`, and equal heights are equal numbers.
///
/// The tile's own step is 1/32767 of what lies between its two heights, and has to be `step` / 2^j; the lower of
/// the two is a whole number of it.
pub fn lattice(id: ProofTileId, tile: &DecodedTile, step: f64, faults: &mut TilesetFaults) {
    let [low, high] = tile.heights.map(f64::from);
    let own = (high - low) / f64::from(LAST);
    let is_level = own == 0.0;
    // Sums and multiples of so few bits are exact.
    let is_exact = is_power_of_two(own) && own * f64::from(LAST) == high - low && own <= step;
    let is_whole = |height: f64, step: f64| (height / step).fract() == 0.0;
    let is_right = is_power_of_two(step) && (is_level || (is_exact && is_whole(low, own)));
    faults.add(TilesetFault::WrongStep, u64::from(!is_right), id);
    let off = tile.vertices.iter().filter(|&&vertex| !is_whole(tile.height(vertex), step)).count();
    faults.add(TilesetFault::OffLattice, off as u64, id);
}

/// The vertices of a side, from the west or south on.
#[derive(Clone, Debug, PartialEq)]
pub struct TileSideChain {
    id: ProofTileId,
    side: ProofTileSide,
    /// Where along the side, and the height.
    stops: Vec<(u16, f64)>,
    /// Where they are in space, where a tile says so.
    placed: Vec<Vector>,
}

impl TileSideChain {
    /// That of a side of a tile.
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

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        let placed = self.placed.len() * size_of::<Vector>();
        self.stops.len() * size_of::<(u16, f64)>() + placed + size_of::<Self>()
    }

    /// True where both have the same vertices at the same heights, and at the same places, bit by bit.
    pub fn is_same(&self, other: &Self) -> bool {
        self.stops == other.stops && self.placed == other.placed
    }

    /// Longitude or latitude where it begins and ends.
    fn reach(&self) -> [f64; 2] {
        let [west, south, east, north] = self.id.bounds();
        if self.side.is_meridian() { [south, north] } else { [west, east] }
    }

    fn degrees(&self, stop: u16) -> f64 {
        let [low, high] = self.reach();
        if stop == LAST { high } else { low + f64::from(stop) / f64::from(LAST) * (high - low) }
    }

    /// The place of this longitude or latitude on the border.
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
        let part = before / (before - after);
        let [low, high] = [from, to].map(|end| dot(end, parallel.normal(meridian)));
        // At a pole all of a parallel is one place.
        Some(if part.is_finite() { low + part * (high - low) } else { begin.1 })
    }
}

/// The largest vertical distance of two chains along the part of one border that they have in common, measured at
/// the vertices of both: between these both are straight.
pub fn gap(a: &TileSideChain, b: &TileSideChain) -> f64 {
    let reaches = [a.reach(), b.reach()];
    let common = reaches[0][0].max(reaches[1][0])..=reaches[0][1].min(reaches[1][1]);
    let all = [a, b].into_iter().flat_map(|chain| {
        chain.stops.iter().map(|stop| chain.degrees(stop.0)).filter(|at| common.contains(at))
    });
    let apart = all.filter_map(|at| Some((a.height(at)? - b.height(at)?).abs()));
    apart.fold(0.0, f64::max)
}
