//! The registry of ground methods, and the run of a requested one.

use super::finder::{GroundFinder, GroundTiling, Method, Request};
use super::lowest_points::LowestPoints;
use super::method_call::FinderRegistry;
use super::surface::GroundSurface;
use super::{csf, csf_ptd, outliers, pmf, ptd, smrf};

/// All methods. A new one is a file in this folder and a line here.
pub const METHODS: &[Method] =
    &[csf_ptd::METHOD, csf::METHOD, ptd::METHOD, smrf::METHOD, pmf::METHOD];

impl FinderRegistry for GroundFinder {
    const KIND: &'static str = "ground method";
    const METHODS: &'static [Method] = METHODS;
}

impl Request {
    /// The morphological filter.
    pub const PMF: Self = Self::plain(&pmf::METHOD);
    /// The default method.
    pub const DEFAULT: Self = Self::plain(&csf_ptd::METHOD);

    /// Tiling of the plane, for points `spacing` metres apart.
    pub fn tiling(&self, spacing: f64) -> GroundTiling {
        let tiling = (self.finder().tiling)(self, spacing);
        let reach = if tiling.core.is_none() { outliers::REACH } else { 0 };
        GroundTiling { halo: tiling.halo + reach, ..tiling }
    }

    /// Most memory of [`find`](Self::find) for each cell of the window, in bytes, with the lowest points.
    pub fn bytes_per_cell(&self) -> u64 {
        self.finder().bytes_per_cell
    }

    /// The ground under the cells of a window, or of a tile with its halo. Low outliers are removed before the
    /// method begins.
    pub fn find(&self, lows: &LowestPoints<'_>) -> GroundSurface {
        let is_fixed = (self.finder().tiling)(self, lows.cell).core.is_some();
        let passes = if is_fixed { outliers::PASSES } else { outliers::FEW_PASSES };
        let points = outliers::without_outliers(lows, passes);
        (self.finder().find)(self, &LowestPoints { points: &points, ..*lows })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_read_with_their_parameters() {
        let asked = Request::parse("CSF:rigidness=1, cloth=0.5").unwrap();
        assert_eq!(
            (asked.name(), asked.value("rigidness"), asked.value("cloth")),
            ("csf", 1.0, 0.5)
        );
        assert_eq!(Request::parse(&asked.to_string()).unwrap(), asked, "{asked}");
        assert_eq!(asked.value("iterations"), 500.0, "what is not given is as published");
        assert_eq!(Request::parse("pmf").unwrap(), Request::PMF);
        assert_ne!(asked, Request::parse("csf").unwrap());
        for method in METHODS {
            assert!(
                method.parameters.len() <= terrane_base::parameters::MAX_PARAMETERS,
                "{}",
                method.name
            );
            assert!(method.parameters.iter().all(|p| p.allows(p.default)), "{}", method.name);
            let plain = Request::plain(method);
            assert_eq!(Request::parse(method.name).unwrap(), plain);
            assert_eq!(Request::parse(&plain.to_string()).unwrap(), plain, "{plain}");
        }
    }

    #[test]
    fn what_is_not_known_is_told_with_what_is() {
        let told = |text: &str| Request::parse(text).unwrap_err().to_string();
        assert!(METHODS.iter().all(|m| told("moss").contains(m.name)), "{}", told("moss"));
        for wrong in
            ["csf:rigid=1", "csf:rigidness=9", "csf:rigidness=1.5", "csf:cloth=nan", "csf:cloth"]
        {
            assert!(told(wrong).contains("rigidness=3 (a whole number from 1 to 3)"), "{wrong}");
        }
        assert!(told("csf:cloth=1,cloth=2").contains("twice"));
        assert!(told("pmf:cell=1").contains("takes none"));
    }

    /// A slope with a shed on it, a hole, and a cell without points.
    #[test]
    fn every_method_takes_off_a_shed_and_keeps_the_slope() {
        use crate::lowest_points::NO_POINT;
        use terrane_base::geom::Point;
        let (width, rows) = (120, 110);
        let plane = |k: usize| (k % width) as f64 * 0.1 - (k / width) as f64 * 0.05;
        let shed = |k: usize| (50..62).contains(&(k % width)) && (40..55).contains(&(k / width));
        let point = |k: usize| {
            let z = plane(k) + if shed(k) { 3.0 } else { 0.0 };
            let at = |v: usize| v as i32 * 100 + 50;
            Point::new(at(k % width), at(k / width), (z * 100.0).round() as i32)
        };
        let hole = |k: usize| (20..30).contains(&(k % width)) && (70..80).contains(&(k / width));
        let points: Vec<Point> =
            (0..width * rows).map(|k| if hole(k) { NO_POINT } else { point(k) }).collect();
        let lows =
            LowestPoints { points: &points, width, cell: 1.0, corner: [0.0; 2], step: [0.01; 3] };
        for method in METHODS {
            let ground = Request::plain(method).find(&lows);
            for at in (0..points.len()).filter(|&at| !hole(at)) {
                let is = ground.is_ground(at % width, at / width, [0.5; 2], points[at].z);
                assert_eq!(is, !shed(at), "{}: {at}", method.name);
            }
            let empty = LowestPoints { points: &[], ..lows };
            Request::plain(method).find(&empty);
            let none = LowestPoints { points: &[NO_POINT; 9], width: 3, ..lows };
            assert!(!Request::plain(method).find(&none).is_ground(1, 1, [0.5; 2], 0));
        }
    }

    /// Which cells of a gentle slope with something on it a method takes for ground, 12 cells and more from the
    /// border.
    fn kept(asked: &str, on: impl Fn(usize, usize) -> f64) -> Vec<(usize, usize)> {
        use terrane_base::geom::Point;
        let (width, rows) = (160, 150);
        let at = |v: usize| v as i32 * 100 + 50;
        let z = |col: usize, row: usize| (col as f64 * 0.05 + on(col, row)) * 100.0;
        let cells: Vec<_> = (0..width * rows).map(|k| (k % width, k / width)).collect();
        let point =
            |&(col, row): &(usize, usize)| Point::new(at(col), at(row), z(col, row).round() as i32);
        let points: Vec<Point> = cells.iter().map(point).collect();
        let lows =
            LowestPoints { points: &points, width, cell: 1.0, corner: [0.0; 2], step: [0.01; 3] };
        let ground = Request::parse(asked).unwrap().find(&lows);
        let is_in = |&(col, row): &(usize, usize)| {
            (12..width - 12).contains(&col) && (12..rows - 12).contains(&row)
        };
        let is_ground = |(col, row): &(usize, usize)| {
            ground.is_ground(*col, *row, [0.5; 2], point(&(*col, *row)).z)
        };
        cells.into_iter().filter(is_in).filter(is_ground).collect()
    }

    #[test]
    fn ground_that_a_cell_of_a_hundred_sees_is_found_under_crowns() {
        let hash = |col: usize, row: usize| {
            let bits = crate::landscapes::mixed((col as u64) << 32 | row as u64);
            (bits % 1000, (bits >> 32) as f64 / 2.0_f64.powi(32))
        };
        let is_seen = |col: usize, row: usize| hash(col, row).0 < 8;
        let on = |col: usize, row: usize| match hash(col, row) {
            (0..8, _) => 0.0,
            (_, share) => 8.0 + 9.0 * share,
        };
        // The others open what they see by windows that are full of crowns.
        for method in ["csf-ptd", "csf", "ptd"] {
            let kept = kept(method, on);
            let seen = kept.iter().filter(|(col, row)| is_seen(*col, *row)).count();
            assert!(seen > 120 && seen == kept.len(), "{method}: {seen} of {}", kept.len());
        }
    }

    #[test]
    fn a_roof_that_a_cloth_lies_down_on_is_no_ground_of_both() {
        let is_roof = |col: usize, row: usize| (30..96).contains(&col) && (30..96).contains(&row);
        let on = |col, row| if is_roof(col, row) { 8.0 } else { 0.0 };
        let kept = kept("csf-ptd", on);
        assert!(kept.iter().all(|&(col, row)| !is_roof(col, row)));
        assert!(kept.len() > 136 * 126 - 66 * 66 - 400, "{}", kept.len());
    }

    #[test]
    fn bushes_are_no_ground_of_triangulations() {
        let is_bush = |col: usize, row: usize| col % 9 < 2 && row % 8 < 2;
        let on = |col, row| if is_bush(col, row) { 1.2 } else { 0.0 };
        for method in ["csf-ptd", "ptd"] {
            let kept = kept(method, on);
            let bushes = kept.iter().filter(|(col, row)| is_bush(*col, *row)).count();
            assert!(bushes == 0 && kept.len() > 15_000, "{method}: {bushes} of {}", kept.len());
        }
    }

    #[test]
    fn a_cloth_that_is_mended_keeps_a_hill_that_a_stiff_one_cuts_off() {
        let hill = |col: usize, row: usize| {
            let away = (col as f64 - 80.0).hypot(row as f64 - 75.0);
            (1.0 - away / 40.0).max(0.0) * 9.0
        };
        let is_top = |&&(col, row): &&(usize, usize)| hill(col, row) > 4.0;
        let tops = |asked: &str| kept(asked, hill).iter().filter(is_top).count();
        let [mended, cut] = ["csf:rigidness=3", "csf:rigidness=3,smooth=0"].map(tops);
        assert!(mended > cut + 100, "{mended} {cut}");
    }

    /// Up to the border of the cloud, where its squares end, and where it ends within one.
    #[test]
    fn a_steep_slope_is_ground_up_to_its_edge() {
        use crate::lowest_points::NO_POINT;
        use terrane_base::geom::Point;
        let (width, rows) = (150, 140);
        let at = |v: usize| v as i32 * 100 + 50;
        for (by_x, by_y) in [(0.577, 0.0), (-0.35, 0.46), (0.0, -0.577)] {
            for cut in [0, 90] {
                let point = |k: usize| {
                    let (col, row) = (k % width, k / width);
                    let z = (col as f64 * by_x + row as f64 * by_y) * 100.0;
                    match col + row < cut {
                        true => NO_POINT,
                        false => Point::new(at(col), at(row), z.round() as i32),
                    }
                };
                let points: Vec<Point> = (0..width * rows).map(point).collect();
                let lows = LowestPoints {
                    points: &points,
                    width,
                    cell: 1.0,
                    corner: [0.0; 2],
                    step: [0.01; 3],
                };
                for method in ["csf-ptd", "ptd"] {
                    let ground = Request::parse(method).unwrap().find(&lows);
                    let is_ground =
                        |k: &usize| ground.is_ground(k % width, k / width, [0.5; 2], points[*k].z);
                    let there = (0..points.len()).filter(|k| points[*k] != NO_POINT);
                    let lost: Vec<_> =
                        there.filter(|k| !is_ground(k)).map(|k| (k % width, k / width)).collect();
                    assert_eq!(lost, [], "{method} {by_x} {by_y} {cut}");
                }
            }
        }
    }

    #[test]
    fn squares_are_as_large_as_cells_allow() {
        let sizes = |cell: f64| (GroundTiling::fixed(cell).core, GroundTiling::fixed(cell).halo);
        assert_eq!(sizes(1.0), (Some(512), 128));
        assert_eq!(sizes(0.01), (Some(768), 192));
        assert_eq!(sizes(1000.0), (Some(16), 16));
    }
}
