//! Water mask: pixels of a tile whose centre lies in a polygon, or on its border.
//!
//! Polygon sides are straight in the CRS of the grid. They are transformed to WGS 84 once, in pieces that are
//! straight there to a hundredth of the smallest pixel; pixels of a tile are a lattice in WGS 84. A
//! transformation of every pixel would cost a projection each, and would fail where tiles extend beyond the
//! domain of the projection.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_engine::Resources;
use terrane_engine::globe::OnGlobe;
use terrane_engine::memory::short;
use terrane_engine::transform::extent_of;
use terrane_globe::{GeodeticBounds, GlobeTileId, MASK_SIDE, MASK_WATER, degrees};
use terrane_raster::{ClipRings, GridInfo, PolygonEdgeIndex, Water};

/// Largest error of a side, as a fraction of a pixel.
const OF_PIXEL: f64 = 0.01;
/// Largest number of halvings of a side.
const MAX_HALVINGS: u32 = 16;

/// A position (x, y).
type Xy = [f64; 2];

/// Water polygons in longitude and latitude.
pub(super) struct TileWaterMask(PolygonEdgeIndex);

impl TileWaterMask {
    /// Polygons that intersect a grid, for tiles up to level `last`.
    ///
    /// # Errors
    /// A polygon that cannot be transformed to WGS 84; segments that need more than a quarter of the memory.
    pub(super) fn of(
        water: &Water,
        info: &GridInfo,
        last: u8,
        resources: &Resources,
    ) -> Result<Self> {
        let (on_globe, _) = OnGlobe::of(info)?;
        let extent = extent_of(info);
        let off = degrees(last) / f64::from(MASK_SIDE) * OF_PIXEL;
        let (mut rings, mut transformed, mut bytes) = (ClipRings::default(), Vec::new(), 0);
        let (mut area, mut is_near, max_bytes) = (None, false, resources.memory / 4);
        for (number, ring) in water.rings() {
            if area.replace(number) != Some(number) {
                rings.begin_feature()?;
                // The first ring of a polygon is its outer ring.
                is_near = meets(ring, extent);
            }
            if !is_near {
                continue;
            }
            transformed.clear();
            match &on_globe {
                OnGlobe::Straight(_) => transformed.extend_from_slice(ring),
                OnGlobe::Moved(_, operation) => {
                    transform(ring, off, |at| operation.position(at), &mut transformed).map_err(
                        |e| e.in_file(water.path()).remedy("clip it to the extent of the grid"),
                    )?;
                }
            }
            bytes += transformed.len() as u64 * ClipRings::EDGE_BYTES;
            // Beyond the limit segments are only counted.
            if bytes <= max_bytes {
                rings.push(&transformed).map_err(|e| e.in_file(water.path()))?;
            }
        }
        if bytes > max_bytes {
            return Err(too_many(bytes).in_file(water.path()));
        }
        Ok(Self(PolygonEdgeIndex::new(rings)))
    }

    /// Memory in bytes of the mask, and of each worker that uses it.
    pub(super) fn bytes(&self, threads: usize) -> [u64; 2] {
        // The part near a region, and of that the part near a tile.
        [self.0.memory_use(threads), 2 * self.0.bytes() + u64::from(MASK_SIDE * MASK_SIDE)]
    }

    /// The part near a tile.
    pub(super) fn near(&self, id: GlobeTileId) -> Self {
        Self(within(&self.0, id))
    }

    /// The pixels of a tile.
    pub(super) fn pixels(&self, id: GlobeTileId) -> Vec<u8> {
        let areas = within(&self.0, id);
        if areas.is_empty() {
            return vec![0];
        }
        let GeodeticBounds { west, north, .. } = id.bounds();
        let side = degrees(id.level) / f64::from(MASK_SIDE);
        let map = Affine {
            x0: west + side / 2.0,
            a: side,
            b: 0.0,
            y0: north - side / 2.0,
            d: 0.0,
            e: -side,
        };
        let mut pixels = vec![0; (MASK_SIDE * MASK_SIDE) as usize];
        areas.rows(map, [MASK_SIDE; 2], |row, runs| {
            let row = &mut pixels[(row * MASK_SIDE) as usize..][..MASK_SIDE as usize];
            for run in runs {
                row[run.start as usize..run.end as usize].fill(MASK_WATER);
            }
        });
        let first = pixels[0];
        if pixels.iter().all(|pixel| *pixel == first) { vec![first] } else { pixels }
    }
}

fn within(areas: &PolygonEdgeIndex, id: GlobeTileId) -> PolygonEdgeIndex {
    let GeodeticBounds { west, south, east, north } = id.bounds();
    areas.within([west, south, east, north])
}

fn meets(ring: &[Xy], [west, south, east, north]: [f64; 4]) -> bool {
    let [[x0, x1], [y0, y1]] = [0, 1].map(|axis: usize| {
        let along = ring.iter().map(|at| at[axis]);
        along
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
    });
    x0 <= east && x1 >= west && y0 <= north && y1 >= south
}

/// Transforms a ring to WGS 84 in pieces within `off` degrees of the original.
fn transform(
    ring: &[Xy],
    off: f64,
    to: impl Fn(Xy) -> Result<Xy>,
    out: &mut Vec<Xy>,
) -> Result<()> {
    let Some(first) = ring.first() else { return Ok(()) };
    out.push(to(*first)?);
    let mut open = Vec::new();
    for side in ring.windows(2) {
        open.push(([side[0], side[1]], [to(side[0])?, to(side[1])?], 0));
        while let Some((ends, transformed, halvings)) = open.pop() {
            // The middle alone may be exact on a side that bends both ways.
            let mut worst = 0_f64;
            for part in [0.25, 0.5, 0.75] {
                worst = worst.max(apart(to(along(ends, part))?, along(transformed, part)));
            }
            if worst > off && halvings < MAX_HALVINGS {
                let middle = along(ends, 0.5);
                let there = to(middle)?;
                open.push(([middle, ends[1]], [there, transformed[1]], halvings + 1));
                open.push(([ends[0], middle], [transformed[0], there], halvings + 1));
            } else {
                out.push(transformed[1]);
            }
        }
    }
    Ok(())
}

/// The same from either end.
fn along([a, b]: [Xy; 2], part: f64) -> Xy {
    [0, 1].map(|axis| a[axis] * (1.0 - part) + b[axis] * part)
}

fn apart(a: Xy, b: Xy) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn too_many(bytes: u64) -> Error {
    let message = format!("its segments require {} MiB for a mask", bytes.div_ceil(1 << 20));
    short(message, 4 * bytes).or("a smaller ‹max_level›, or simplify it with ‹terrane simplify›")
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::wkt;
    use terrane_raster::{SampleType, WaterFeatures};

    const DEEPEST: u8 = 13;

    /// Sides of 200 km, which bow by hundreds of metres where they are brought to longitudes and latitudes.
    #[test]
    fn pixels_are_what_each_is_in_the_system_of_the_grid() {
        let crs = wkt::of_srs("EPSG:32631");
        let transform =
            Affine { x0: 499_000.0, a: 30.0, b: 0.0, y0: 4_740_000.0, d: 0.0, e: -30.0 };
        let plain = GridInfo::plain("g", 300, 300, SampleType::F32);
        let info = GridInfo { transform, georeferenced: true, crs: crs.clone(), ..plain };
        let corners =
            [[400_000.0, 4_600_000.0], [650_000.0, 4_733_000.0], [480_000.0, 4_900_000.0]];
        let mut features = WaterFeatures::default();
        features.begin_area().unwrap();
        features.push_ring(&[corners[0], corners[1], corners[2], corners[0]]).unwrap();
        // One beside the grid is left out, wherever it is.
        features.begin_area().unwrap();
        features.push_ring(&[[1e7, 2e7], [1.1e7, 2e7], [1e7, 3e7], [1e7, 2e7]]).unwrap();
        let water = Water::new(features, std::path::Path::new("lakes.wkt"), crs);
        let mask = TileWaterMask::of(&water, &info, DEEPEST, &Resources::default()).unwrap();
        let (OnGlobe::Moved(_, operation), _) = OnGlobe::of(&info).unwrap() else { panic!() };
        let back = operation.inverse();
        // Metres within, at the nearest side.
        let depth = |[x, y]: Xy| {
            let of = |k: usize| {
                let ([ax, ay], [bx, by]) = (corners[k], corners[(k + 1) % 3]);
                ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / (bx - ax).hypot(by - ay)
            };
            of(0).min(of(1)).min(of(2))
        };
        let (mut kinds, mut looked) = ([0, 0], 0);
        for level in [6, 9, DEEPEST] {
            // On the middles of sides, where they bow most.
            for k in 0..3 {
                let middle = along([corners[k], corners[(k + 1) % 3]], 0.5);
                let [lon, lat] = operation.position(middle).unwrap();
                let [x, y] = [lon + 180.0, lat + 90.0].map(|at| (at / degrees(level)) as u32);
                let id = GlobeTileId { level, x, y };
                let pixels = mask.near(id).pixels(id);
                assert_eq!(pixels, mask.pixels(id));
                let side = degrees(level) / f64::from(MASK_SIDE);
                for i in (0..pixels.len()).step_by(3).filter(|_| pixels.len() > 1) {
                    let [col, row] = [i % 256, i / 256].map(|at| (at as f64 + 0.5) * side);
                    let GeodeticBounds { west, north, .. } = id.bounds();
                    let depth = depth(back.position([west + col, north - row]).unwrap());
                    // Two hundredths of the smallest pixel.
                    if depth.abs() > degrees(DEEPEST) / 256.0 * 111_320.0 * 0.02 {
                        assert_eq!(pixels[i] == MASK_WATER, depth > 0.0, "{id:?} {i} {depth}");
                        kinds[usize::from(depth > 0.0)] += 1;
                        looked += 1;
                    }
                }
            }
        }
        assert!(kinds.iter().all(|count| *count > 20_000), "{kinds:?} {looked}");
    }
}
