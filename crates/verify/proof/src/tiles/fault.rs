//! Faults of a tileset: their kinds, counts and first places.

use super::tiling::ProofTileId;

/// Checks of a tileset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TilesetCheck {
    /// Each tile by itself.
    Structure,
    /// Samples against surfaces.
    Samples,
    /// Borders of tiles of a level.
    Borders,
    /// Borders to tiles of the next coarser level.
    Levels,
    /// Spheres, horizons and ranges of heights.
    Containment,
    /// Masks of water against polygons.
    Water,
    /// The list of tiles, and the metadata in `layer.json`.
    Index,
}

impl TilesetCheck {
    /// All of them with their names, in the order of reports.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Structure, "structure"),
        (Self::Samples, "samples"),
        (Self::Borders, "borders"),
        (Self::Levels, "levels"),
        (Self::Containment, "containment"),
        (Self::Water, "water"),
        (Self::Index, "index"),
    ];
}

macro_rules! faults {
    ($($name:ident $check:ident $what:literal;)*) => {
        /// A kind of fault of a set of tiles.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs)]
        pub enum TilesetFault {
            $($name,)*
        }

        impl TilesetFault {
            /// All faults, with their check and name.
            pub const ALL: &'static [(Self, TilesetCheck, &'static str)] =
                &[$((Self::$name, TilesetCheck::$check, $what),)*];
        }
    };
}

faults! {
    Unreadable Structure "tiles that cannot be read";
    Clockwise Structure "clockwise triangles";
    Flat Structure "triangles without area";
    Cracks Structure "edges of one triangle inside a tile (cracks, T-junctions)";
    Tangled Structure "edges of more than two triangles, or passed twice in one direction";
    BrokenSides Structure "sides of tiles without edges from vertex to vertex, corner to corner";
    Uncovered Structure "tiles whose triangles differ from the tile in area";
    Duplicates Structure "duplicate vertices";
    Unused Structure "unused vertices";
    SideLists Structure "wrong lists of the vertices of a side";
    Normals Structure "normals that do not point outwards";
    NoNormals Structure "tiles without the normals that layer.json announces";
    NoMetadata Structure "tiles without the metadata that layer.json announces";
    NoEdges Structure "tiles without the edges that layer.json announces";
    WalkedOtherwise Structure "lists of the vertices of a side in the wrong order";
    SkirtTorn Structure "open edges between a skirt and its tile, or within a skirt";
    SkirtDepth Structure "vertices of skirts that are not vertically below the rim at the depth in layer.json";
    OffPlace Structure "vertices whose position differs from that of their texture coordinates and height";
    Ends Structure "tiles with a wrong minimum or maximum of positions";
    OverTolerance Samples "samples further from the surface than the tolerance of the level";
    OverRecorded Samples "tiles with a larger error than they record";
    Reckless Samples "tiles that record a larger error than the tolerance of the level";
    LevelError Samples "levels with a larger error than layer.json states";
    NoError Samples "tiles without a recorded error";
    Differing Borders "borders whose vertices or heights differ between the two tiles";
    OffLattice Borders "vertices whose height is not a multiple of the height step of the level";
    OffCoordinates Borders "vertices whose coordinates are not multiples of the lattice of the level";
    WrongStep Borders "tiles whose height step does not divide that of the level";
    Gaps Levels "borders with a larger gap to the next coarser level than both tolerances allow";
    SkirtShort Levels "levels whose skirts are shorter than the expected gap to the coarser level";
    Sphere Containment "vertices outside the bounding sphere";
    Range Containment "tiles whose minimum height exceeds the maximum";
    Heights Containment "triangles outside the stated height range of the tile";
    Nested Containment "tiles whose sphere does not contain that of a child, or whose error is smaller";
    LooseHeights Containment "tiles whose stated height range is too large";
    LooseSphere Containment "tiles with a larger bounding sphere than they and their children need";
    OffSphere Containment "tiles whose bounding sphere is not centred on them";
    Regions Containment "layer.json has regions that do not contain the tiles, or are too large";
    RootErrors Containment "layer.json has other geometric errors at its root than its tiles need";
    Centre Containment "tiles whose centre is far from them, or not in the middle of a tile of terrane";
    Horizon Containment "vertices visible where the horizon occlusion point is hidden";
    FarHorizon Containment "tiles whose horizon occlusion point is not the nearest above their middle";
    Spikes Containment "tiles with vertices lower or higher than all samples";
    NoMask Water "tiles without the water mask that layer.json announces";
    WrongMask Water "pixels of water masks that are land in a polygon, or water outside";
    Missing Index "missing tiles with samples";
    Superfluous Index "tiles without samples";
    NoRoot Index "missing roots";
    NotAvailable Index "tiles not listed as available in layer.json";
    NotThere Index "missing tiles listed as available in layer.json";
    NamedTwice Index "tiles listed twice as available in layer.json";
    Below Index "tiles with a wrong list of the tiles below them";
    Bounds Index "layer.json has bounds that do not contain all samples";
    LooseBounds Index "layer.json has bounds that reach beyond the raster";
    OtherHeights Index "layer.json states another vertical reference";
    BeyondWorld Index "layer.json has bounds beyond the world";
    Assumed Index "levels with a larger tolerance than clients assume, and than their samples need";
    Avoidable Index "levels with a larger error than clients assume, though their positions resolve the samples";
    OtherError Index "levels that state a larger error than any of their tiles records";
    OtherStep Index "levels with an unexpected height step";
    Counts Index "levels with another number of tiles than layer.json states";
    Unannounced Index "tiles with normals, metadata or a mask that layer.json does not list as extensions";
    Mixed Index "tiles with another compression than most";
    Stray Index "files that are neither layer.json nor a tile";
}

/// Number of faults of a kind, and the first tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TilesetFaultCount {
    /// Number of faults.
    pub count: u64,
    /// The first in the order of tiles.
    pub first: Option<ProofTileId>,
}

impl TilesetFaultCount {
    fn add(&mut self, count: u64, at: Option<ProofTileId>) {
        if count > 0 {
            self.count = self.count.saturating_add(count);
            self.first = self.first.into_iter().chain(at).min();
        }
    }
}

/// All faults; independent of the order of work.
#[derive(Clone, Debug, PartialEq)]
pub struct TilesetFaults(Vec<TilesetFaultCount>);

impl Default for TilesetFaults {
    fn default() -> Self {
        Self(vec![TilesetFaultCount::default(); TilesetFault::ALL.len()])
    }
}

impl TilesetFaults {
    /// Adds `count` faults of a tile.
    pub fn add(&mut self, fault: TilesetFault, count: u64, at: impl Into<Option<ProofTileId>>) {
        self.0[fault as usize].add(count, at.into());
    }

    /// The faults of a kind.
    pub fn of(&self, fault: TilesetFault) -> TilesetFaultCount {
        self.0[fault as usize]
    }

    /// Adds other faults.
    pub fn merge(&mut self, other: &Self) {
        for (sum, count) in self.0.iter_mut().zip(&other.0) {
            sum.add(count.count, count.first);
        }
    }

    /// The faults of a check, with their descriptions.
    pub fn found(
        &self,
        check: TilesetCheck,
    ) -> impl Iterator<Item = (TilesetFault, &'static str, TilesetFaultCount)> + '_ {
        let all = TilesetFault::ALL.iter().zip(&self.0);
        all.filter(move |((_, of, _), count)| *of == check && count.count > 0)
            .map(|((fault, _, what), count)| (*fault, *what, *count))
    }
}
