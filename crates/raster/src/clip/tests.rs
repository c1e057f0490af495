//! The scan of rows against each sample by itself, by crossings of a ray in another direction.

use std::cmp::Ordering;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use proptest::prelude::*;

use super::scan::PolygonScan;
use super::{Clip, ClipRings, PolygonEdgeIndex, Xy, clipped};
use crate::{GridInfo, GridOpenOptions, GridSource, SampleType};
use terrane_base::error::{ErrorKind, Result};
use terrane_base::geom::{Affine, Crs, Rect, plane};

/// Features, each of some rings.
type Features = Vec<Vec<Vec<Xy>>>;

fn clip_of(features: &Features, crs: Crs) -> Arc<Clip> {
    let mut rings = ClipRings::default();
    for feature in features {
        rings.begin_feature().unwrap();
        feature.iter().for_each(|ring| rings.push(ring).unwrap());
    }
    Arc::new(Clip::new(rings, Path::new("areas.wkt"), crs))
}

/// A grid whose heights tell where they are.
struct Told {
    info: GridInfo,
}

impl Told {
    fn read<H>(&self, rect: Rect, out: &mut [H], height: impl Fn(u32, u32) -> H) -> Result<()> {
        for (i, out) in (0..).zip(out) {
            *out = height(rect.col + i % rect.width, rect.row + i / rect.width);
        }
        Ok(())
    }
}

impl GridSource for Told {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.read(rect, out, |col, row| (row * 1000 + col) as f32)
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.read(rect, out, |col, row| f64::from(row * 1000 + col))
    }
}

fn transformed(transform: Affine, size: [u32; 2], crs: Crs) -> Box<dyn GridSource> {
    let plain = GridInfo::plain("told", size[0], size[1], SampleType::F32);
    Box::new(Told { info: GridInfo { transform, crs, ..plain } })
}

/// Inside one of the features by crossings of a ray to the north, or on a border.
fn is_inside(features: &Features, at: Xy) -> bool {
    let edges = |ring: &Vec<Xy>| {
        let nexts: Vec<Xy> = ring.iter().skip(1).chain(ring.first()).copied().collect();
        ring.iter().copied().zip(nexts).collect::<Vec<_>>()
    };
    features.iter().any(|feature| {
        let mut is_odd = false;
        for (a, b) in feature.iter().flat_map(edges) {
            let side = plane::orient(a, b, at);
            let within =
                |axis: usize| a[axis].min(b[axis]) <= at[axis] && at[axis] <= a[axis].max(b[axis]);
            if side == Ordering::Equal && within(0) && within(1) {
                return true;
            }
            let is_crossed = (a[0] <= at[0]) != (b[0] <= at[0]);
            let is_below = (side == Ordering::Less) == (a[0] < b[0]);
            is_odd ^= is_crossed && is_below;
        }
        is_odd
    })
}

/// Maps of grids: plain, of cells that are no floats, turned over, turned around, turned by a part.
const MAPS: [Affine; 6] = [
    Affine::LATTICE,
    Affine { x0: 500_000.05, a: 0.1, b: 0.0, y0: 4_100_000.7, d: 0.0, e: -0.1 },
    Affine { x0: 10.0, a: -1.0 / 3.0, b: 0.0, y0: -7.0, d: 0.0, e: 0.3 },
    Affine { x0: -0.05, a: 0.01, b: 0.0, y0: 0.03, d: 0.0, e: 0.007 },
    Affine { x0: 3.0, a: 0.0, b: 2.0, y0: 5.0, d: -2.0, e: 0.0 },
    Affine { x0: 100.1, a: 0.8, b: 0.6, y0: 7.3, d: 0.6, e: -0.8 },
];

const SIDE: u32 = 9;

/// Positions on samples, between them on lines of the lattice, and anywhere, beyond the grid, too; some so
/// far away that floats do not tell columns apart where their edges cross a row.
fn position() -> impl Strategy<Value = [f64; 2]> {
    let halves = || (-2i32..2 * SIDE as i32 + 2).prop_map(|half| f64::from(half) / 2.0);
    let whole = || (-1i32..=SIDE as i32).prop_map(f64::from);
    let far = || prop::sample::select(vec![-1e20, -3e17, 7e18, 2e19]);
    prop_oneof![
        1 => (far(), halves()).prop_map(|(col, row)| [col, row]),
        1 => [far(), far()],
        8 => [whole(), whole()],
        4 => [halves(), halves()],
        2 => [-1.0..f64::from(SIDE), -1.0..f64::from(SIDE)],
    ]
}

fn features() -> impl Strategy<Value = Features> {
    let ring = prop::collection::vec(position(), 1..7);
    let feature = prop::collection::vec(ring, 1..4);
    prop::collection::vec(feature, 1..4)
}

fn placed(features: &Features, map: &Affine) -> Features {
    let mut placed = features.clone();
    placed.iter_mut().flatten().flatten().for_each(|at| *at = map.apply(at[0], at[1]));
    placed
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn rows_are_what_each_sample_is_by_itself(
        features in features(),
        map in prop::sample::select(MAPS.to_vec()),
        [col, row, width, height] in [0..SIDE, 0..SIDE, 1..SIDE, 1..SIDE],
    ) {
        let features = placed(&features, &map);
        let whole = Rect::new(0, 0, SIDE, SIDE);
        let inside = |col: u32, row: u32| is_inside(&features, map.apply(f64::from(col), f64::from(row)));
        let any = (0..SIDE * SIDE).any(|i| inside(i % SIDE, i / SIDE));
        let clip = clip_of(&features, Crs::default());
        let opened = clipped(&clip, &GridOpenOptions::default(), |_| {
            Ok(transformed(map, [SIDE; 2], Crs::default()))
        });
        prop_assert_eq!(opened.is_ok(), any);
        for rect in [whole, Rect::new(col, row, width, height).intersect(&whole)] {
            let Ok(grid) = &opened else { break };
            let mut heights = vec![0.0; rect.len()];
            grid.read_f64(rect, &mut heights).unwrap();
            let mut narrow = vec![0.0; rect.len()];
            grid.read_f32(rect, &mut narrow).unwrap();
            for (i, height) in (0..).zip(&heights) {
                let (col, row) = (rect.col + i % rect.width, rect.row + i / rect.width);
                let stays = inside(col, row);
                prop_assert_eq!(stays.then(|| f64::from(row * 1000 + col)), Some(*height).filter(|h| !h.is_nan()));
                prop_assert_eq!(narrow[i as usize].is_nan(), !stays);
            }
        }
    }

    #[test]
    fn parts_of_areas_tell_of_a_box_what_all_do(
        features in features(),
        // Whose rows run to the east.
        map in prop::sample::select(vec![MAPS[0], MAPS[1], MAPS[3]]),
        [col, row, width, height] in [0..SIDE, 0..SIDE, 1..SIDE, 1..SIDE],
        inner in [0..4u32, 0..4u32],
    ) {
        let features = placed(&features, &map);
        let all = clip_of(&features, Crs::default()).areas.clone();
        // Of a box, and of one in it, whose borders samples lie on.
        let rows = |areas: &PolygonEdgeIndex, [col, row]: [u32; 2], size: [u32; 2]| {
            let from = map.shifted(f64::from(col), f64::from(row));
            let mut found = vec![Vec::new(); size[1] as usize];
            areas.rows(from, size, |row, runs| found[row as usize] = runs.to_vec());
            found
        };
        // Of the very positions that are asked for.
        let box_of = |[col, row]: [u32; 2], size: [u32; 2]| {
            let from = map.shifted(f64::from(col), f64::from(row));
            let last = size.map(|count| f64::from(count - 1));
            let ends = [from.apply(0.0, 0.0), from.apply(last[0], last[1])];
            let side = |axis: usize| {
                [ends[0][axis].min(ends[1][axis]), ends[0][axis].max(ends[1][axis])]
            };
            let ([west, east], [south, north]) = (side(0), side(1));
            [west, south, east, north]
        };
        let part = all.within(box_of([col, row], [width, height]));
        prop_assert!(part.edges.len() <= all.edges.len());
        prop_assert_eq!(rows(&part, [col, row], [width, height]), rows(&all, [col, row], [width, height]));
        // A box in it, whose borders rounding may move by a hair beyond it.
        let near = [col + inner[0].min(width - 1), row + inner[1].min(height - 1)];
        let less = [col + width - near[0], row + height - near[1]];
        let [outer, own] = [box_of([col, row], [width, height]), box_of(near, less)];
        if own[0] >= outer[0] && own[1] >= outer[1] && own[2] <= outer[2] && own[3] <= outer[3] {
            let parts = part.within(own);
            prop_assert_eq!(rows(&parts, near, less), rows(&all, near, less));
        }
    }

    #[test]
    fn no_edge_at_a_height_is_passed_over(
        ends in prop::collection::vec([0i32..40, 0i32..40], 3..700),
        y in -1i32..41,
    ) {
        let ring: Vec<Xy> = ends.iter().map(|end| end.map(f64::from)).collect();
        let clip = clip_of(&vec![vec![ring]], Crs::default());
        let mut found = Vec::new();
        let mut next = 0;
        while let Some(edge) = clip.areas.reaching(next, y.into()) {
            found.push(edge);
            next = edge + 1;
        }
        let reach = |edge: &usize| clip.areas.edges[*edge].high[1] >= y.into();
        prop_assert_eq!(found, (0..clip.areas.edges.len()).filter(reach).collect::<Vec<_>>());
        let at = |y: f64| clip.areas.edges.iter().filter(|e| e.low[1] <= y && y <= e.high[1]).count();
        prop_assert_eq!(clip.areas.max_at_once, (0..40).map(|y| at(f64::from(y))).max().unwrap());
    }
}

#[test]
fn a_window_is_done_with_the_edges_at_its_height() {
    // A comb: two edges a row and its spine, 40,000 rows high.
    let teeth = (0..40_000).flat_map(|i| [[5.0, f64::from(-i)], [2.0, -f64::from(i) - 0.5]]);
    let ring: Vec<Xy> = teeth.chain([[0.0, -40_000.0], [0.0, 0.0]]).collect();
    let clip = clip_of(&vec![vec![ring]], Crs::default());
    assert!(clip.areas.max_at_once <= 5, "{}", clip.areas.max_at_once);
    let mut rows = 0;
    let scan = PolygonScan::new(&clip.areas, Affine::LATTICE, Rect::new(0, 30_000, 8, 16));
    let _ = scan.rows(|_, inside| {
        rows += 1;
        assert_eq!(inside, [(0, 0..6)]);
        ControlFlow::<()>::Continue(())
    });
    assert_eq!(rows, 16);
}

fn refusal(features: &Features, crs: [Crs; 2], cache_bytes: usize) -> (ErrorKind, String) {
    let [own, grids] = crs;
    let clip = clip_of(features, own);
    let options = GridOpenOptions { cache_bytes, ..GridOpenOptions::default() };
    let opened = clipped(&clip, &options, |_| Ok(transformed(Affine::LATTICE, [9, 9], grids)));
    let error = opened.err().expect("a refusal");
    (error.kind(), error.to_string())
}

#[test]
fn what_cannot_be_clipped_to_is_refused_with_its_file() {
    let square = |at: f64| vec![vec![vec![[at, -at], [at + 2.0, -at], [at + 2.0, -at - 2.0]]]];
    let utm = |zone: u32| Crs { epsg: Some(32600 + zone), ..Crs::default() };
    let unnamed = Crs::default;
    let (kind, told) = refusal(&square(1.0), [utm(33), utm(32)], 1 << 20);
    assert_eq!(kind, ErrorKind::BadInput);
    let parts = ["areas.wkt: its CRS is", "32633", "32632", "reproject one"];
    assert!(parts.iter().all(|part| told.contains(part)), "{told}");
    let (_, told) = refusal(&square(1.0), [unnamed(), utm(32)], 1 << 20);
    assert!(told.contains("set it in the file"), "{told}");
    let (_, told) = refusal(&square(1.0), [utm(32), unnamed()], 1 << 20);
    assert!(told.contains("set the CRS of the grid"), "{told}");
    let (kind, told) = refusal(&square(100.0), [unnamed(), unnamed()], 1 << 20);
    assert_eq!(kind, ErrorKind::BadInput);
    assert!(told.contains("areas.wkt: polygons contain no sample of the grid"), "{told}");
    let (kind, told) = refusal(&square(1.0), [unnamed(), unnamed()], 100);
    assert_eq!(kind, ErrorKind::Resource);
    assert!(told.contains("polygons take 1 MiB") && told.contains("‹memory› 68M"), "{told}");
}

#[test]
fn positions_that_cannot_be_decided_about_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, 1e141, 1e-131] {
        let told = ClipRings::default().push(&[[0.0, bad]]).unwrap_err().to_string();
        assert!(told.contains("is not finite or out of range"), "{told}");
    }
}
