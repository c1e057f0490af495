//! Bands between contour levels, as polygons that partition the area with heights.
//!
//! That area is the cells of four heights. Its border runs along lattice edges and is divided where lines end on
//! it. After all tiles, lines and border are followed from end to end ([`walks`]); each walk has one band on its
//! left and is the outer ring of a polygon, or a hole. A walk that touches itself at a sample, between two voids,
//! is cut there.
//!
//! **Holes.** Each tile tells what is met from the lowest vertex of a line backwards ([`probe`]); rims between
//! tiles are searched after all tiles. So the ring around a hole is found without a look at coordinates, and a
//! simplified line does not change it.
//!
//! **Memory.** Borders and lines are kept for all tiles, about 512 bytes for each piece of a line and straight
//! part of the border, vertices of lines in a file. A polygon with its holes must fit into half of the memory.

mod border;
mod loops;
mod probe;
#[cfg(test)]
mod tests;
mod walks;
mod write;

use border::{BorderRun, unpaired};
use loops::{Borders, LineEnd};
use probe::{PieceProbe, ProbeHit};
use walks::BandWalks;

use super::join::ContourPieces;
use super::tiles::ContourTiles;
use terrane_base::error::Result;
use terrane_engine::Cancel;
use terrane_window::contour::{CrossedEdge, WindowContours};

pub(super) use probe::TileBands;
pub(super) use write::{BandWriter, fields};

/// What bands need of all tiles, besides pieces of lines.
#[derive(Default)]
pub(super) struct BandParts {
    /// One for each piece.
    probes: Vec<PieceProbe>,
    corners: Vec<(CrossedEdge, ProbeHit)>,
    runs: Vec<BorderRun>,
    rims: Vec<BorderRun>,
    ends: Vec<LineEnd>,
}

impl BandParts {
    /// Takes over those of a tile, whose lines are the pieces from `first` on.
    pub(super) fn add(&mut self, tile: &TileBands, lines: &WindowContours, first: u32) {
        let moved = |hit| match hit {
            ProbeHit::Piece(line) => ProbeHit::Piece(first + line),
            ProbeHit::Sample(sample) => ProbeHit::Sample(sample),
        };
        let probes = tile.probes.iter();
        self.probes.extend(probes.map(|probe| PieceProbe { hit: moved(probe.hit), ..*probe }));
        let corners = tile.corners.iter();
        self.corners.extend(corners.map(|&(sample, hit)| (sample, moved(hit))));
        self.runs.extend_from_slice(&tile.border.runs);
        self.rims.extend_from_slice(&tile.border.rims);
        for (index, _) in lines.lines.iter().enumerate().filter(|(_, line)| !line.closed) {
            let piece = first + index as u32;
            let vertices = lines.of(index);
            let ends = [(vertices.first(), false), (vertices.last(), true)];
            self.ends.extend(ends.into_iter().filter_map(|(vertex, is_last)| {
                Some(LineEnd { vertex: *vertex?, piece, is_last })
            }));
        }
    }

    /// Number of parts of the border.
    pub(super) fn border_parts(&self) -> usize {
        self.runs.len() + self.rims.len()
    }

    /// All walks around bands.
    fn walks(
        self,
        pieces: &mut ContourPieces,
        tiles: ContourTiles,
        cancel: &Cancel,
    ) -> Result<BandWalks> {
        let Self { probes, corners, mut runs, rims, ends } = self;
        runs.extend(unpaired(rims));
        let borders = Borders::new(runs, ends, tiles, cancel)?;
        BandWalks::new(pieces, borders, probes, corners, cancel)
    }
}
