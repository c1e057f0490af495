//! Anti-aliased strokes: how much of each pixel is covered by lines.

/// Share of each pixel covered by strokes, 0 to 255, top row first. Strokes combine by maximum, so
/// their order does not matter and an edge drawn twice looks like one.
#[derive(Clone, Debug)]
pub struct StrokeCoverage {
    width: usize,
    height: usize,
    share: Vec<u8>,
}

impl StrokeCoverage {
    /// Nothing covered.
    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, share: vec![0; width * height] }
    }

    /// Coverage (0 to 1) of the pixel (`col`, `row`).
    pub fn at(&self, col: usize, row: usize) -> f32 {
        f32::from(self.share[row * self.width + col]) / 255.0
    }

    /// Draws the segment from `a` to `b` (picture positions) `thickness` pixels wide, with at most
    /// `strength` (0 to 1) of coverage. Cost: pixels touched.
    pub fn stroke(&mut self, a: [f64; 2], b: [f64; 2], thickness: f64, strength: f64) {
        let size = [self.width as f64, self.height as f64];
        let Some((a, b)) = clip_segment(a, b, size) else { return };
        let steep = (b[1] - a[1]).abs() > (b[0] - a[0]).abs();
        let (major, minor) = if steep { (1, 0) } else { (0, 1) };
        let (a, b) = if a[major] <= b[major] { (a, b) } else { (b, a) };
        let run = b[major] - a[major];
        let slope = if run > 0.0 { (b[minor] - a[minor]) / run } else { 0.0 };
        // Distances along the minor axis shrink by the cosine when measured square to the line.
        let cosine = 1.0 / (1.0 + slope * slope).sqrt();
        let reach = (thickness / 2.0 + 0.5) / cosine;
        let last = (b[major].floor().max(0.0) as usize).min(size[major] as usize - 1);
        for step in (a[major].floor().max(0.0) as usize)..=last {
            let at = (step as f64 + 0.5).clamp(a[major], b[major]);
            let centre = a[minor] + slope * (at - a[major]);
            let from = (centre - reach - 0.5).ceil().max(0.0) as usize;
            let to = ((centre + reach - 0.5).floor() + 1.0).clamp(0.0, size[minor]) as usize;
            for across in from..to {
                let distance = (across as f64 + 0.5 - centre).abs() * cosine;
                let share = (thickness / 2.0 + 0.5 - distance).clamp(0.0, 1.0) * strength;
                let (col, row) = if steep { (across, step) } else { (step, across) };
                let old = &mut self.share[row * self.width + col];
                *old = (*old).max((share * 255.0).round() as u8);
            }
        }
    }
}

/// The part of a segment inside the picture with a margin of two pixels (Liang-Barsky).
fn clip_segment(a: [f64; 2], b: [f64; 2], size: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
    const MARGIN: f64 = 2.0;
    let finite = a.iter().chain(&b).all(|v| v.is_finite());
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let d = b[axis] - a[axis];
        let (low, high) = (-MARGIN - a[axis], size[axis] + MARGIN - a[axis]);
        if d == 0.0 && (low > 0.0 || high < 0.0) {
            return None;
        }
        if d != 0.0 {
            t0 = t0.max((low / d).min(high / d));
            t1 = t1.min((low / d).max(high / d));
        }
    }
    let is_visible = finite && t0 <= t1 && size[0] > 0.0 && size[1] > 0.0;
    is_visible.then(|| (between(a, b, t0), between(a, b, t1)))
}

/// The position at `t` (0 to 1) from `a` to `b`.
fn between(a: [f64; 2], b: [f64; 2], t: f64) -> [f64; 2] {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_between_pixel_rows_is_shared_by_both() {
        let mut picture = StrokeCoverage::empty(8, 4);
        picture.stroke([0.0, 2.0], [8.0, 2.0], 1.0, 1.0);
        for col in 0..8 {
            assert!((picture.at(col, 1) - 0.5).abs() < 0.01);
            assert!((picture.at(col, 2) - 0.5).abs() < 0.01);
            assert_eq!(picture.at(col, 0), 0.0);
        }
    }

    #[test]
    fn order_and_direction_do_not_matter() {
        let lines = [([0.3, 1.0], [7.0, 3.1]), ([6.2, 0.4], [1.0, 3.9]), ([2.0, 0.0], [2.0, 4.0])];
        let (mut one, mut other) = (StrokeCoverage::empty(8, 4), StrokeCoverage::empty(8, 4));
        lines.iter().for_each(|&(a, b)| one.stroke(a, b, 1.2, 0.8));
        lines.iter().rev().for_each(|&(a, b)| other.stroke(b, a, 1.2, 0.8));
        let worst = one.share.iter().zip(&other.share).map(|(x, y)| x.abs_diff(*y)).max();
        assert!(worst <= Some(1));
    }

    #[test]
    fn far_away_and_broken_lines_leave_no_mark() {
        let mut picture = StrokeCoverage::empty(4, 4);
        picture.stroke([-1e300, 50.0], [1e300, 60.0], 1.0, 1.0);
        picture.stroke([f64::NAN, 0.0], [2.0, 2.0], 1.0, 1.0);
        picture.stroke([f64::INFINITY, 0.0], [2.0, 2.0], 1.0, 1.0);
        assert!(picture.share.iter().all(|&s| s == 0));
        picture.stroke([-1e6, 1.5], [1e6, 1.5], 1.0, 1.0);
        assert_eq!(picture.at(3, 1), 1.0);
    }
}
