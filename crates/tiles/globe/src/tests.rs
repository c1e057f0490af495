//! Tiles of small grids, checked independently.

use proptest::prelude::*;

use super::*;
use crate::border::TileSide;
use crate::globe::{EQUATOR, Vector};
use terrane_base::geom::{Affine, Rect};

/// A grid of one arc second with noise in metres on a slope, and voids.
struct Land {
    heights: Vec<f64>,
    side: u32,
    map: Affine,
    fill: VoidFill,
    chart: GridGeolocation,
}

impl Land {
    fn new(side: u32, south: f64, relief: f64, seed: u32, voids: u32) -> Self {
        let noise = |i: u32| f64::from((i ^ seed).wrapping_mul(0x9e37_79b9) >> 16) / 65536.0;
        let height = |i: u32| {
            let [col, row] = [i % side, i / side].map(f64::from);
            let smooth = (col / 17.0).sin() * (row / 23.0).cos() + (col + row) / 97.0;
            match voids > 0 && (i / 5).wrapping_mul(2_654_435_761) >> 16 < voids {
                true => f64::NAN,
                false => {
                    relief
                        * (smooth
                            + noise(i / side / 9 * 1000 + i % side / 9) * 0.3
                            + noise(i) * 0.02)
                }
            }
        };
        let heights = (0..side * side).map(height).collect();
        Self::of(heights, side, [10.0, south])
    }

    /// From heights, row by row from the north.
    fn of(heights: Vec<f64>, side: u32, [west, south]: [f64; 2]) -> Self {
        let step = 1.0 / 3600.0;
        let north = south + step * f64::from(side - 1);
        let map = Affine { x0: west, a: step, b: 0.0, y0: north, d: 0.0, e: -step };
        let mut means = VoidFillSums::new([side; 2]);
        for (row, line) in (0..).zip(heights.chunks(side as usize)) {
            means.add(0, row, line);
        }
        Self {
            fill: means.fill().unwrap(),
            heights,
            side,
            map,
            chart: GridGeolocation::straight(map, [side; 2]),
        }
    }

    fn patch(&self) -> HeightPatch<'_> {
        let all = Rect::new(0, 0, self.side, self.side);
        HeightPatch::new(&self.heights, all, &self.chart, &self.fill)
    }

    fn bounds(&self) -> GeodeticBounds {
        let [west, north] = self.map.apply(0.0, 0.0);
        let last = f64::from(self.side - 1);
        let [east, south] = self.map.apply(last, last);
        GeodeticBounds { west, south, east, north }
    }

    fn level(&self, level: u8) -> TileLevel {
        TileLevel::new(
            level,
            1.0 / 3600.0,
            &LevelRelief { reach: 9000.0, range: 4000.0, ..LevelRelief::default() },
        )
    }

    fn tiles(&self, level: u8) -> Vec<GlobeTileId> {
        let [[west, east], [south, north]] = GlobeTileId::meeting(level, &self.bounds());
        (south..=north)
            .flat_map(|y| (west..=east).map(move |x| GlobeTileId { level, x, y }))
            .collect()
    }
}

/// Distance of a sample from the surface, by all triangles: the nearest hit of its vertical.
fn distance(tile: &TerrainTile, sample: &TerrainSample) -> Option<f64> {
    let (point, [east, north]) = (sample.upright.point(sample.height), sample.upright.across());
    let look =
        |place: Vector| [east, north, sample.upright.normal].map(|axis| axis.dot(place - point));
    let hit = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| look(tile.point(tile.vertices[corner as usize])));
        let sides = [[b, c], [c, a], [a, b]].map(|[a, b]| a[0] * b[1] - a[1] * b[0]);
        let whole: f64 = sides.iter().sum();
        let is_in = sides.iter().all(|side| *side >= -1e-12 * whole);
        let along = (a[2] * sides[0] + b[2] * sides[1] + c[2] * sides[2]) / whole;
        is_in.then_some(along.abs())
    };
    tile.triangles.iter().filter_map(hit).reduce(f64::max)
}

/// Fails unless the triangles are counter-clockwise, meet edge to edge, and cover the square.
fn validate(tile: &TerrainTile) {
    let mut edges = std::collections::HashSet::new();
    let mut area = 0;
    for corners in &tile.triangles {
        let [a, b, c] = corners.map(|corner| tile.vertices[corner as usize].at.map(i64::from));
        let double = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(double > 0, "{corners:?}");
        area += double;
        for k in 0..3 {
            assert!(edges.insert([corners[k], corners[(k + 1) % 3]]));
        }
    }
    assert_eq!(area, 2 * i64::from(STEPS) * i64::from(STEPS));
    for [from, to] in &edges {
        let ends = [from, to].map(|end| tile.vertices[*end as usize].at);
        let on_side =
            TileSide::ALL.iter().any(|side| ends.iter().all(|end| side.along(*end).is_some()));
        assert!(edges.contains(&[*to, *from]) || on_side, "{ends:?}");
    }
}

/// Position along a side, and height, of its vertices.
fn side(tile: &TerrainTile, side: TileSide) -> Vec<(i32, i32)> {
    let on_side = tile.vertices.iter().filter_map(|v| Some((side.along(v.at)?, v.height)));
    let mut found: Vec<_> = on_side.collect();
    found.sort_unstable();
    found
}

fn check(land: &Land, level: u8) -> usize {
    let (level, patch) = (land.level(level), land.patch());
    let tiles: Vec<TerrainTile> =
        land.tiles(level.level).iter().map(|id| build(*id, &level, &patch).unwrap()).collect();
    for tile in &tiles {
        validate(tile);
        let (mut count, mut most) = (0, 0.0_f64);
        patch.each(&tile.id.bounds(), 1, &mut |sample| {
            count += 1;
            // At a border the vertical may pass beside the tile.
            let off = distance(tile, &sample).unwrap_or(0.0);
            assert!(off <= level.tolerance, "{:?} {off}", tile.id);
            most = most.max(off);
        });
        assert_eq!(tile.measure.samples, count);
        assert!(tile.measure.largest <= level.tolerance);
        assert!(most <= tile.measure.largest * (1.0 + 1e-6) + 1e-6, "{most} {:?}", tile.measure);
        for other in &tiles {
            if (other.id.x, other.id.y) == (tile.id.x + 1, tile.id.y) {
                assert_eq!(side(tile, TileSide::East), side(other, TileSide::West));
            }
            if (other.id.x, other.id.y) == (tile.id.x, tile.id.y + 1) {
                assert_eq!(side(tile, TileSide::North), side(other, TileSide::South));
            }
        }
    }
    tiles.len()
}

#[test]
fn every_level_is_within_its_error_and_borders_are_one() {
    for (south, relief, voids) in [(46.0, 900.0, 0), (-0.01, 300.0, 9000), (79.99, 2000.0, 500)] {
        let land = Land::new(101, south, relief, 7, voids);
        let tiles: usize = (0..=14).map(|level| check(&land, level)).sum();
        assert!(tiles > 25, "{tiles}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn any_land_is_within_the_error(
        side in 2_u32..120, south in -89.0..88.0_f64, relief in 0.0..3000.0_f64, seed: u32,
        voids in 0_u32..40_000, level in 6_u8..=16,
    ) {
        let voids = if side < 12 { 0 } else { voids };
        check(&Land::new(side, south, relief, seed, voids), level);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Bit-identical, with samples beyond the tolerance, voids and poles.
    #[test]
    fn rows_are_measured_and_taken_as_their_samples_are(
        side in 12_u32..120, south in -90.0..89.9_f64, relief in 0.0..3000.0_f64, seed: u32,
        voids in prop_oneof![Just(0), 0_u32..40_000], number in 0_u8..=15, fine in 0.001..2.0_f64,
    ) {
        let land = Land::new(side, south.min(90.0 - f64::from(side - 1) / 3600.0), relief, seed, voids);
        let (level, patch) = (land.level(number), land.patch());
        for id in land.tiles(number) {
            let bounds = id.bounds();
            let [mut rows, mut samples] = [0; 2].map(|_| TileBuilder::new(id, &level, &patch).unwrap());
            let middle = bounds.west + (bounds.east - bounds.west) * fine / 2.0;
            let parts = [GeodeticBounds { west: middle, ..bounds }, GeodeticBounds { east: middle, ..bounds }, bounds];
            rows.fit(|take| {
                for part in &parts {
                    patch.runs(part, level.stride, &mut |run| take(run));
                }
            });
            samples.fit(|take| {
                for part in &parts {
                    patch.each(part, level.stride, &mut |sample| take(TerrainSampleRun::One(sample)));
                }
            });
            prop_assert_eq!(rows.finish(TileErrorMeasure::default()), samples.finish(TileErrorMeasure::default()));
            let tolerance = level.tolerance * fine;
            let [mut by_rows, mut one_by_one] = [0; 2].map(|_| rows.shell());
            patch.runs(&bounds, 1, &mut |run| by_rows.add_run(&run, tolerance));
            patch.each(&bounds, 1, &mut |sample| one_by_one.add(sample, tolerance));
            let [found, expected] = [by_rows, one_by_one].map(|shell| {
                let (measure, beyond) = shell.end();
                (measure, beyond.iter().map(|sample| (sample.place, sample.height)).collect::<Vec<_>>())
            });
            prop_assert_eq!(found, expected);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Rough ground without free positions: a tile is made, borders match, and the stated error holds.
    #[test]
    fn rough_land_is_made_and_measured(
        across in 2_u32..60, south in -89.0..88.0_f64, relief in 0.0..60_000.0_f64, seed: u32,
        voids in 0_u32..20_000, number in 3_u8..=16, shorts: bool, slope in prop_oneof![Just(0.0), Just(0.5)],
    ) {
        let noise = |i: u32| f64::from((i ^ seed).wrapping_mul(0x9e37_79b9) >> 8) / 16_777_216.0;
        let height = |i: u32| match i > 0 && noise(i + 7777) * 65_536.0 < f64::from(voids) {
            true => f64::NAN,
            false => relief * (noise(i) - 0.5),
        };
        let mut land = Land::of((0..across * across).map(height).collect(), across, [10.0, south]);
        land.chart = land.chart.clone().sloping(slope);
        let relief = LevelRelief { reach: relief, range: relief, ..LevelRelief::default() };
        let level = TileLevel::new(number, 1.0 / 3600.0, &relief);
        let level = match shorts {
            true => in_shorts(level.on_lattice([-relief.reach, relief.reach])),
            false => level,
        };
        let patch = land.patch();
        let tiles = land.tiles(number).into_iter().take(6);
        let tiles: Vec<TerrainTile> = tiles.map(|id| build(id, &level, &patch).unwrap()).collect();
        for tile in &tiles {
            validate(tile);
            let mut most = 0.0_f64;
            patch.each(&tile.id.bounds(), 1, &mut |sample| {
                most = most.max(distance(tile, &sample).unwrap_or(0.0));
            });
            let told = tile.measure.largest;
            prop_assert!(most <= told * (1.0 + 1e-6) + 1e-6, "{} {most} {told}", tile.id.level);
            prop_assert!(told < 2.0 * relief.range + level.tolerance, "{told}");
            for other in &tiles {
                if (other.id.x, other.id.y) == (tile.id.x + 1, tile.id.y) {
                    prop_assert_eq!(side(tile, TileSide::East), side(other, TileSide::West));
                }
            }
        }
    }
}

/// Beyond the grid the ground descends evenly to the ellipsoid, from below as from above, and stays there;
/// where it reaches it a border has a vertex.
#[test]
fn the_ground_beyond_a_grid_falls_to_the_ellipsoid() {
    for height in [800.0, -300.0] {
        let mut land = Land::of(vec![height; 101 * 101], 101, [10.0, 46.0]);
        land.chart = land.chart.clone().sloping(0.5);
        let patch = land.patch();
        let metre = (1.0 / EQUATOR).to_degrees();
        let at = |far: f64| patch.height([10.01, 46.0 - far * metre]).unwrap();
        assert_eq!((at(-20.0), at(0.0)), (height, height));
        for far in [10.0, 100.0, 550.0, 1500.0, 1700.0, 1e5] {
            let expected = height.signum() * (height.abs() - far / 2.0).max(0.0);
            assert!((at(far) - expected).abs() < 1e-6, "{far} {}", at(far));
        }
        // Both sides together.
        let corner = patch.height([10.0 - 100.0 * metre, 46.0 - 100.0 * metre]).unwrap();
        let along = 100.0 * 46_f64.to_radians().cos();
        assert!((corner.abs() - (height.abs() - 50.0 - along / 2.0)).abs() < 1e-3, "{corner}");
        let level = land.level(9);
        for id in land.tiles(9) {
            let tile = build(id, &level, &patch).unwrap();
            validate(&tile);
            let far = |vertex: &&TileVertex| {
                let [lon, lat] = id.place(vertex.at);
                let past = |low: f64, at: f64, high: f64| (low - at).max(at - high).max(0.0);
                let GeodeticBounds { west, south, east, north } = land.bounds();
                (past(west, lon, east) * lat.to_radians().cos() + past(south, lat, north)) / metre
            };
            let beyond = tile.vertices.iter().filter(|v| far(v) > 2.1 * height.abs());
            assert!(beyond.clone().count() > 3);
            assert!(beyond.clone().all(|vertex| vertex.height == 0), "{id:?}");
        }
    }
}

/// The ground lies above a border and then below it by the tolerance. Vertices one step inside are joined with
/// its distant ends: a sample between is in a triangle from the lower to the upper side.
#[test]
fn samples_between_a_border_and_what_is_a_step_beside_it_are_held() {
    let (id, side) = (GlobeTileId { level: 10, x: 1081, y: 776 }, 633);
    let GeodeticBounds { east, south, .. } = id.bounds();
    let step = tiling::degrees(10) / f64::from(STEPS);
    for (part, share) in [(0.1, 0.62), (0.4, 0.62), (0.6, 0.62), (0.65, 0.55), (0.8, 0.64)] {
        // The last column is a part of a step of positions from the border.
        let west = east - part * step - f64::from(side - 1) / 3600.0;
        let bump = |along: f64, middle: f64| (1.0 - (along - middle).abs() / 0.1).max(0.0);
        let height = |i: u32| {
            let along = 1.0 - f64::from(i / side) / f64::from(side - 1);
            share * tiling::level_error(10) * (bump(along, 0.3) - bump(along, 0.5))
        };
        let land = Land::of((0..side * side).map(height).collect(), side, [west, south]);
        let (level, patch) = (land.level(10), land.patch());
        let column: Vec<TerrainSample> = (0..side)
            .map(|row| {
                TerrainSample::new(
                    land.map.apply(f64::from(side - 1), f64::from(row)),
                    height(row * side),
                )
            })
            .collect();
        let mut builder = TileBuilder::new(id, &level, &patch).unwrap();
        builder.insert(&[0.3, 0.5].map(|along| column[((1.0 - along) * 632.0) as usize]));
        let is_held = |_| {
            let mut shell = builder.shell();
            column.iter().for_each(|sample| shell.add(*sample, level.tolerance));
            let beyond = shell.end().1;
            builder.insert(&beyond);
            beyond.is_empty()
        };
        assert!((0..32).any(is_held), "{part} {share}");
    }
}

/// Borders belong to two tiles: a sample on one, whatever its error, becomes a vertex beside it.
#[test]
fn samples_at_borders_do_not_become_vertices_of_them() {
    let land = Land::new(101, 46.0, 900.0, 3, 0);
    let (level, patch) = (land.level(12), land.patch());
    let id = land.tiles(12)[0];
    let finished = |builder: &TileBuilder<'_>| {
        let tile = builder.finish(builder.shell().end().0);
        validate(&tile);
        tile
    };
    let sides = |tile: &TerrainTile| TileSide::ALL.map(|s| side(tile, s));
    for along in [1, STEPS / 2 + 1, STEPS] {
        let mut builder = TileBuilder::new(id, &level, &patch).unwrap();
        let before = finished(&builder);
        for side in TileSide::ALL {
            let sample = TerrainSample::new(id.place(side.position(along)), 8000.0);
            builder.insert(&[sample]);
            builder.fit(|take| take(TerrainSampleRun::One(sample)));
        }
        let after = finished(&builder);
        assert!(after.vertices.len() > before.vertices.len());
        assert_eq!(sides(&after), sides(&before));
    }
}

#[test]
fn bytes_are_those_of_the_format() {
    let land = Land::new(101, 46.0, 900.0, 3, 0);
    let (level, patch) = (land.level(12), land.patch());
    let tile = build(land.tiles(12)[0], &level, &patch).unwrap();
    let bytes = quantized_mesh(&tile, Some((&level, &patch)), TileExtensions::default()).unwrap();
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let count = number(88) as usize;
    assert_eq!(count, tile.vertices.len());
    let triangles = 92 + 6 * count;
    assert_eq!(number(triangles) as usize, tile.triangles.len());
    let mut edges = triangles + 4 + 6 * tile.triangles.len();
    for side in TileSide::ALL {
        let on_side = tile.vertices.iter().filter(|v| side.along(v.at).is_some()).count();
        assert_eq!(number(edges) as usize, on_side);
        edges += 4 + 2 * on_side;
    }
    assert_eq!((bytes[edges], number(edges + 1) as usize), (1, 2 * count));
    let text = String::from_utf8_lossy(&bytes[edges + 5 + 2 * count..]).into_owned();
    assert!(text.ends_with('}') && text.contains(r#"{"error":"#), "{text}");
    let none: Option<(&TileLevel, &HeightPatch<'_>)> = None;
    assert_eq!(
        quantized_mesh(&tile, none, TileExtensions::default()).unwrap().len(),
        bytes.len() - 5 - 2 * count
    );
}

/// Also where meridians converge, far beyond the land.
#[test]
fn normals_point_outwards_everywhere() {
    let land = Land::new(101, 46.0, 900.0, 3, 0);
    let patch = land.patch();
    for level in 0..=4 {
        let level = land.level(level);
        for id in land.tiles(level.level) {
            let north = (0..=16).map(|part| id.place([STEPS * part / 16, STEPS]));
            for place in north.chain([[10.014, 90.0], [10.02, 89.9999]]) {
                let normal = crate::encode::normal(place, &level, &patch);
                assert!(
                    normal.dot(EllipsoidNormal::at(place).normal) > 0.5,
                    "{place:?} {normal:?}"
                );
            }
        }
    }
}

/// Vertices of binary glTF as decoded by a client: the offsets are first in the buffer.
fn decoded(bytes: &[u8], count: usize) -> Vec<Vector> {
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    assert_eq!((&bytes[..4], number(4), number(8) as usize), (&b"glTF"[..], 2, bytes.len()));
    let text = std::str::from_utf8(&bytes[20..20 + number(12) as usize]).unwrap();
    let matrix = text.split(r#""matrix":["#).nth(1).unwrap().split(']').next().unwrap();
    let matrix: Vec<f64> = matrix.split(',').map(|value| value.parse().unwrap()).collect();
    let float = |at: usize| f64::from(f32::from_bits(number(at)));
    let from = 28 + number(12) as usize;
    // From y up to z up: z of the earth is y of the file, and y is -z.
    let centre = Vector([matrix[12], -matrix[14], matrix[13]]);
    let vertex = |i: usize| Vector([0, 4, 8].map(|part| float(from + 12 * i + part))) + centre;
    (0..count).map(vertex).collect()
}

/// On all levels: the decoded surface is the measured one, and identical on both sides of each border.
#[test]
fn tiles_of_earth_centred_coordinates_are_decoded_as_they_were_measured() {
    let none: Option<(&TileLevel, &HeightPatch<'_>)> = None;
    let mut borders = 0;
    for (south, relief, voids, first) in [(-0.01, 300.0, 9000, 0), (79.99, 2000.0, 500, 1)] {
        let land = Land::new(101, south, relief, 5, voids);
        let patch = land.patch();
        for level in (first..=14).step_by(2) {
            let level = land.level(level).on_lattice([-9000.0, 9000.0]);
            let mut sides = std::collections::HashMap::new();
            for id in land.tiles(level.level) {
                let tile = build(id, &level, &patch).unwrap();
                validate(&tile);
                patch.each(&id.bounds(), 1, &mut |sample| {
                    let off = distance(&tile, &sample).unwrap_or(0.0);
                    assert!(off <= tile.measure.largest * (1.0 + 1e-6) + 1e-6, "{id:?} {off}");
                });
                assert!(tile.measure.largest <= level.tolerance);
                let (bytes, facts) =
                    glb(&tile, none, GlbTileOptions { edges: true, ..GlbTileOptions::default() })
                        .unwrap();
                let found = decoded(&bytes, tile.vertices.len());
                let bits = |point: &Vector| point.0.map(f64::to_bits);
                let mut own: Vec<_> = tile.vertices.iter().map(|v| bits(&tile.point(*v))).collect();
                let mut all: Vec<_> = found.iter().map(bits).collect();
                own.sort_unstable();
                all.sort_unstable();
                assert!(own == all, "{id:?}");
                let (centre, radius) = facts.sphere;
                assert!(found.iter().all(|point| (*point - centre).length() <= radius));
                for side in TileSide::ALL {
                    let on_side = tile.vertices.iter().filter(|v| side.along(v.at).is_some());
                    let mut on_side: Vec<_> = on_side.map(|v| bits(&tile.point(*v))).collect();
                    on_side.sort_unstable();
                    sides.insert((id.x, id.y, side as u8), on_side);
                }
            }
            for ((x, y, side), own) in &sides {
                let beside = match *side {
                    side if side == TileSide::East as u8 => (x + 1, *y, TileSide::West as u8),
                    side if side == TileSide::North as u8 => (*x, y + 1, TileSide::South as u8),
                    _ => continue,
                };
                if let Some(other) = sides.get(&beside) {
                    assert!(own == other, "{x} {y}");
                    borders += 1;
                }
            }
        }
    }
    assert!(borders > 20, "{borders}");
}

/// Spheres contain those of children, and the height range covers each triangle of any size.
#[test]
fn volumes_hold_triangles_and_what_is_below() {
    let land = Land::new(101, 46.0, 900.0, 5, 0);
    let patch = land.patch();
    let none: Option<(&TileLevel, &HeightPatch<'_>)> = None;
    let facts = |id: GlobeTileId| {
        let level = land.level(id.level).on_lattice([-9000.0, 9000.0]);
        let tile = build(id, &level, &patch).unwrap();
        let facts = glb(&tile, none, GlbTileOptions::default()).unwrap().1;
        for corners in &tile.triangles {
            let [a, b, c] = corners.map(|corner| tile.point(tile.vertices[corner as usize]));
            for part in [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 0.0]] {
                let sum: f64 = part.iter().sum();
                let place = (a * part[0] + b * part[1] + c * part[2]) * (1.0 / sum);
                let height = height(place);
                assert!(
                    facts.heights[0] <= height && height <= facts.heights[1],
                    "{id:?} {height}"
                );
            }
        }
        facts
    };
    for level in 0..12 {
        let id = land.tiles(level)[0];
        let mut whole = facts(id);
        let meets = land.tiles(level + 1);
        for part in id.children().into_iter().filter(|id| meets.contains(id)).map(facts) {
            whole.hold(&part);
            let apart = (part.sphere.0 - whole.sphere.0).length();
            assert!(apart + part.sphere.1 <= whole.sphere.1);
            assert!(whole.error >= part.error);
        }
    }
}

/// Metres above the ellipsoid, by bisection: the latitude whose vertical passes through a position.
fn height(place: Vector) -> f64 {
    let [x, y, _] = place.0;
    let lon = y.atan2(x).to_degrees();
    let (mut low, mut high) = (-90.0, 90.0);
    let above = |lat: f64| {
        let upright = EllipsoidNormal::at([lon, lat]);
        let foot = upright.point(0.0);
        let off = place - foot;
        let along = off.dot(upright.normal);
        let [_, north] = upright.across();
        (along, off.dot(north))
    };
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if above(middle).1 > 0.0 { low = middle } else { high = middle }
    }
    above((low + high) / 2.0).0
}

/// The whole northern border is one position there, and two corners of a triangle may be.
#[test]
fn tiles_at_a_pole_are_measured_there_too() {
    // Of the second ones, many a sample is south of a vertex at the pole, to the bit.
    let lattice = tiling::degrees(14) / 16.0;
    let grids = [(10.0, 1.0 / 3600.0), (10.01953125, lattice), (-180.0, lattice)];
    let levels = [(3.0, 14), (3.0, 12), (30.0, 9), (200.0, 5), (200.0, 0)];
    for ((west, step), (relief, level)) in
        grids.into_iter().flat_map(|grid| levels.map(|level| (grid, level)))
    {
        let mut land = Land::new(40, 89.9, relief, 5, 0);
        land.map = Affine { x0: west, a: step, y0: 90.0, e: -step, ..land.map };
        land.chart = GridGeolocation::straight(land.map, [land.side; 2]);
        let (level, patch) = (land.level(level), land.patch());
        let mut polar = 0;
        for id in land.tiles(level.level) {
            let tile = build(id, &level, &patch).unwrap();
            validate(&tile);
            let heights = tile.vertices.iter().filter(|vertex| vertex.at[1] == STEPS);
            let heights: Vec<f64> = heights.map(|v| f64::from(v.height) * tile.step).collect();
            patch.each(&id.bounds(), 1, &mut |sample| {
                let off = match sample.place[1] == 90.0 {
                    true => {
                        polar += 1;
                        heights.iter().map(|z| (z - sample.height).abs()).fold(0.0, f64::max)
                    }
                    false => distance(&tile, &sample).unwrap_or_default(),
                };
                assert!(off <= tile.measure.largest + 1e-6, "{id:?} {off} {:?}", tile.measure);
            });
            assert!(tile.measure.largest <= level.tolerance);
        }
        assert!(polar >= 40);
    }
}
