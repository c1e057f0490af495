//! Faults of a tileset: their kinds, counts and first places.

use super::tiling::ProofTileId;

/// Checks of a tileset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TilesetCheck {
    /// Each tile by itself.
    Structure,
    /// Samples against surfaces.
    Samples,
    /// Tiles beside each other on one level.
    Borders,
    /// Tiles beside those of the next coarser level.
    Levels,
    /// Spheres, horizons and ranges of heights.
    Containment,
    /// Masks of water against polygons.
    Water,
    /// Which tiles there are, and what `layer.json` says of them.
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
        /// Something wrong with a set of tiles.
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
    BrokenSides Structure "sides of tiles that edges do not follow from vertex to vertex, corner to corner";
    Uncovered Structure "tiles whose triangles do not have the area of the tile";
    Duplicates Structure "vertices beyond the first at one place";
    Unused Structure "vertices of no triangle";
    SideLists Structure "lists of the vertices of a side that are not those";
    Normals Structure "normals that do not point outwards";
    NoNormals Structure "tiles without the normals that layer.json announces";
    NoMetadata Structure "tiles without the metadata that layer.json announces";
    NoEdges Structure "tiles without the edges that layer.json announces";
    WalkedOtherwise Structure "lists of the vertices of a side that do not run around the tile";
    SkirtTorn Structure "edges where a skirt is torn from the rim of its tile, or itself";
    SkirtDepth Structure "vertices of skirts that are not as far straight below the rim as layer.json says";
    OffPlace Structure "vertices that are not where their place in the tile and a height of the level put them";
    Ends Structure "tiles whose positions have other ends than they say";
    OverTolerance Samples "samples further from the surface than the tolerance of the level";
    OverRecorded Samples "tiles with a larger error than they record";
    Reckless Samples "tiles that record a larger error than the tolerance of the level";
    LevelError Samples "levels with a larger error than layer.json states";
    NoError Samples "tiles that record no error";
    Differing Borders "borders with other vertices or heights on one side than on the other";
    OffLattice Borders "vertices whose height is no whole number of the steps of the level";
    OffCoordinates Borders "vertices whose coordinates are no whole numbers of the lattice of the level";
    WrongStep Borders "tiles whose own step of heights is no part of the step of the level";
    Gaps Levels "borders with a larger gap to the next coarser level than both tolerances allow";
    SkirtShort Levels "levels whose skirts are less deep than borders of it and the coarser one may differ";
    Sphere Containment "vertices outside of the bounding sphere";
    Range Containment "tiles whose least height is above the largest";
    Heights Containment "triangles lower or higher than the tile says";
    Nested Containment "tiles whose sphere does not hold that of a tile below, or whose error is smaller";
    LooseHeights Containment "tiles that say their heights reach further than they do";
    LooseSphere Containment "tiles with a larger bounding sphere than they and those below need";
    OffSphere Containment "tiles whose bounding sphere is not around their middle";
    Regions Containment "layer.json has regions that do not hold the tiles, or reach further";
    RootErrors Containment "layer.json has other geometric errors at its root than its tiles need";
    Centre Containment "tiles whose centre is not near them, or of ours not in their middle";
    Horizon Containment "vertices that may be seen when the horizon occlusion point is not";
    FarHorizon Containment "tiles whose horizon occlusion point is not the nearest above their middle";
    Spikes Containment "tiles with vertices lower or higher than all samples";
    NoMask Water "tiles without the mask of water that layer.json announces";
    WrongMask Water "pixels of masks that are land in a polygon, or water outside";
    Missing Index "tiles that are not there and have samples";
    Superfluous Index "tiles that are there and have no sample";
    NoRoot Index "roots that are not there";
    NotAvailable Index "tiles that layer.json does not name as available";
    NotThere Index "tiles that layer.json names as available and that are not there";
    NamedTwice Index "tiles that layer.json names as available twice";
    Below Index "tiles that name others below them than there are";
    Bounds Index "layer.json has bounds that do not hold all samples";
    LooseBounds Index "layer.json has bounds that reach beyond the raster";
    OtherHeights Index "layer.json says that heights are counted from something else";
    BeyondWorld Index "layer.json has bounds beyond the world";
    Assumed Index "levels with a larger tolerance than clients assume, and than their samples need";
    Avoidable Index "levels further off than clients assume, though positions tell their samples apart";
    OtherError Index "levels that state a larger error than any of their tiles records";
    OtherStep Index "levels that state another step of heights than such a level has";
    Counts Index "levels with another number of tiles than layer.json states";
    Unannounced Index "tiles with normals, metadata or a mask that layer.json does not name among its extensions";
    Mixed Index "tiles that are packed where most are not, or are not where most are";
    Stray Index "files that are neither layer.json nor a tile";
}

/// How often something was found, and the first tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TilesetFaultCount {
    /// How often.
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

/// All that was found. The same whatever the order it was found in.
#[derive(Clone, Debug, PartialEq)]
pub struct TilesetFaults(Vec<TilesetFaultCount>);

impl Default for TilesetFaults {
    fn default() -> Self {
        Self(vec![TilesetFaultCount::default(); TilesetFault::ALL.len()])
    }
}

impl TilesetFaults {
    /// Adds what was found `count` times in a tile.
    pub fn add(&mut self, fault: TilesetFault, count: u64, at: impl Into<Option<ProofTileId>>) {
        self.0[fault as usize].add(count, at.into());
    }

    /// What was found of one kind.
    pub fn of(&self, fault: TilesetFault) -> TilesetFaultCount {
        self.0[fault as usize]
    }

    /// Adds what was found elsewhere.
    pub fn merge(&mut self, other: &Self) {
        for (mine, theirs) in self.0.iter_mut().zip(&other.0) {
            mine.add(theirs.count, theirs.first);
        }
    }

    /// All that was found of a check, with its name.
    pub fn found(
        &self,
        check: TilesetCheck,
    ) -> impl Iterator<Item = (TilesetFault, &'static str, TilesetFaultCount)> + '_ {
        let all = TilesetFault::ALL.iter().zip(&self.0);
        all.filter(move |((_, own, _), count)| *own == check && count.count > 0)
            .map(|((fault, _, what), count)| (*fault, *what, *count))
    }
}
