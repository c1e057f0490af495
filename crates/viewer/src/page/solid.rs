//! The mesh of a page: positions and triangles in memory.

use crate::html::HtmlPage;
use crate::html::pack::{PackedArray, QuantizedAxis};
use terrane_base::error::{Error, Result};

use super::PageReport;

/// Maximum bytes that a page takes for a vertex and for a triangle: positions, codes, planes of bytes, and
/// incompressible texts.
pub(super) const VERTEX_BYTES: u64 = 24 + 12 + 36;
pub(super) const TRIANGLE_BYTES: u64 = 12 + 12 + 36;

/// Positions by axis, and three vertices a triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PageMesh {
    pub(super) axes: [Vec<f64>; 3],
    pub(super) triangles: Vec<[u32; 3]>,
}

impl PageMesh {
    pub(super) fn vertices(&self) -> usize {
        self.axes[0].len()
    }

    pub(super) fn push(&mut self, position: [f64; 3]) {
        self.axes.iter_mut().zip(position).for_each(|(axis, value)| axis.push(value));
    }

    pub(super) fn at(&self, vertex: u32) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.axes[axis][vertex as usize])
    }

    /// Lowest and highest along an axis.
    pub(super) fn range(&self, axis: usize) -> [f64; 2] {
        let start = [f64::INFINITY, f64::NEG_INFINITY];
        self.axes[axis].iter().fold(start, |[low, high], v| [low.min(*v), high.max(*v)])
    }

    /// West, south, east, north.
    pub(super) fn bounds(&self) -> [f64; 4] {
        let [[west, east], [south, north]] = [0, 1].map(|axis| self.range(axis));
        [west, south, east, north]
    }

    /// Keeps the triangles whose boxes touch `bbox` (west, south, east, north), and their vertices.
    pub(super) fn crop(&mut self, bbox: [f64; 4]) {
        let triangles = self.triangles.iter().copied();
        self.triangles = triangles.filter(|triangle| self.touches(triangle, bbox)).collect();
        self.drop_unused();
    }

    /// True if the box around a triangle touches `bbox`.
    fn touches(&self, triangle: &[u32; 3], bbox: [f64; 4]) -> bool {
        let corners = triangle.map(|vertex| self.at(vertex));
        [0, 1].into_iter().all(|axis| {
            let values = corners.map(|corner| corner[axis]);
            let low = values.into_iter().fold(f64::INFINITY, f64::min);
            let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
            low <= bbox[axis + 2] && high >= bbox[axis]
        })
    }

    /// Drops vertices that no triangle uses.
    pub(super) fn drop_unused(&mut self) {
        let mut place = vec![u32::MAX; self.vertices()];
        self.triangles.iter().flatten().for_each(|vertex| place[*vertex as usize] = 0);
        let used = place.iter_mut().filter(|place| **place == 0);
        used.zip(0..).for_each(|(place, id)| *place = id);
        for axis in &mut self.axes {
            let mut places = place.iter();
            axis.retain(|_| places.next() != Some(&u32::MAX));
        }
        self.triangles.iter_mut().flatten().for_each(|vertex| *vertex = place[*vertex as usize]);
    }

    /// Puts positions and triangles into a page, with their metadata.
    ///
    /// # Errors
    /// A surface without a triangle.
    pub(super) fn put(self, page: &mut HtmlPage) -> Result<PageReport> {
        if self.triangles.is_empty() {
            return Err(Error::bad_input("no surface to show")
                .remedy("name another file, or change ‹bounds›"));
        }
        let [lowest, highest] = self.range(2);
        let mut report = PageReport {
            page: "surface",
            vertices: Some(self.vertices() as u64),
            triangles: Some(self.triangles.len() as u64),
            bounds: self.bounds(),
            lowest: Some(lowest),
            highest: Some(highest),
            ..PageReport::default()
        };
        for (name, values) in ["x", "y", "z"].into_iter().zip(self.axes) {
            let axis = QuantizedAxis::of(&values);
            drop(values);
            report.rounding = report.rounding.max(axis.rounding);
            page.axis(name, &axis);
        }
        let first: Vec<u32> = self.triangles.iter().map(|triangle| triangle[0]).collect();
        page.array("first", PackedArray::steps(&first));
        drop(first);
        for (name, corner) in [("second", 1), ("third", 2)] {
            // Differences to the first corner are small, and deflate well.
            let differences = self.triangles.iter().map(|t| t[corner].wrapping_sub(t[0]) as i32);
            page.array(name, PackedArray::signed(differences));
        }
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles side by side, and a vertex of none.
    fn two() -> PageMesh {
        let mut shape = PageMesh::default();
        let all =
            [[9.0, 9.0, 9.0], [0.0, 0.0, 1.0], [2.0, 0.0, 2.0], [0.0, 2.0, 3.0], [4.0, 4.0, 4.0]];
        all.into_iter().for_each(|position| shape.push(position));
        shape.triangles = vec![[1, 2, 3], [2, 4, 3]];
        shape
    }

    /// The text of a page between two texts.
    fn between<'a>(html: &'a str, from: &str, to: &str) -> &'a str {
        html.split(from).nth(1).unwrap().split(to).next().unwrap()
    }

    #[test]
    fn a_page_holds_the_surface() {
        let shape = two();
        let mut page = HtmlPage::new("surface", "x").unwrap();
        let report = shape.clone().put(&mut page).unwrap();
        assert_eq!((report.vertices, report.triangles, report.rounding), (Some(5), Some(2), 0.0));
        let html = page.html();
        let facts = between(&html, "type=\"application/json\">", "</script>");
        let facts: serde_json::Value = serde_json::from_str(facts).unwrap();
        let array = |name: &str| {
            let of = &facts["arrays"][name];
            let text = between(&html, &format!("id=\"array-{name}\" type=\"text/plain\">"), "<");
            let count = of["count"].as_u64().unwrap() as usize;
            let differences = of["differences"].as_bool().unwrap();
            PackedArray { count, differences, text: text.to_owned() }.unpack().unwrap()
        };
        for (name, values) in ["x", "y", "z"].into_iter().zip(&shape.axes) {
            let [low, step] = ["low", "step"].map(|of| facts[name][of].as_f64().unwrap());
            let found: Vec<f64> = array(name).iter().map(|c| low + f64::from(*c) * step).collect();
            assert_eq!(&found, values);
        }
        let [first, second, third] = ["first", "second", "third"].map(array);
        let triangle = |t: usize| {
            [first[t], first[t].wrapping_add(second[t]), first[t].wrapping_add(third[t])]
        };
        assert_eq!([triangle(0), triangle(1)], shape.triangles[..]);
    }

    #[test]
    fn a_part_has_its_triangles_and_their_vertices_alone() {
        let mut shape = two();
        shape.crop([3.0, 3.0, 5.0, 5.0]);
        assert_eq!(shape.triangles, [[0, 2, 1]]);
        assert_eq!(shape.axes[2], [2.0, 3.0, 4.0]);
        let mut whole = two();
        whole.crop([0.0, 0.0, 1.0, 1.0]);
        assert_eq!((whole.triangles.len(), whole.vertices()), (2, 4), "boxes touch");
        whole.crop([50.0, 50.0, 60.0, 60.0]);
        assert_eq!((whole.triangles.len(), whole.vertices()), (0, 0));
        let mut page = HtmlPage::new("surface", "x").unwrap();
        assert!(whole.put(&mut page).is_err());
    }
}
