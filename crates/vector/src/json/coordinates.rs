//! Coordinate arrays: the hot loop of reading GeoJSON and TopoJSON.

use super::JsonCursor;
use crate::decimal;
use crate::geometry::CoordinateSequence;
use terrane_base::error::Result;

/// Deepest nesting, of a MultiPolygon.
const MAX_DEPTH: usize = 4;

impl JsonCursor<'_> {
    /// Parses a coordinate array. Returns the nesting depth of positions (0 if there are none) and the
    /// positions, cut into parts and polygons at the ends of arrays. A fourth number is a measure, further
    /// numbers are ignored. O(text).
    pub(crate) fn coordinates(&mut self) -> Result<(usize, CoordinateSequence)> {
        let mut found = CoordinateSequence::default();
        // Open arrays, and the depth of positions once known.
        let (mut open, mut deep) = (0, 0);
        loop {
            match self.peek() {
                Some(b'[') => {
                    self.advance(1);
                    open += 1;
                    if open > MAX_DEPTH {
                        return Err(self.bad("coordinates are nested too deeply"));
                    }
                    if matches!(self.peek(), Some(b'-' | b'0'..=b'9')) {
                        if deep != 0 && deep != open {
                            return Err(self.bad("positions are nested at different depths"));
                        }
                        deep = open;
                        self.position(&mut found)?;
                        open -= 1;
                    } else if self.take(b']') {
                        open -= 1;
                    } else {
                        continue;
                    }
                }
                _ => return Err(self.bad("array or number expected in coordinates")),
            }
            // After an item: ends of arrays, then a comma before the next item.
            loop {
                if open == 0 {
                    return Ok((deep, found));
                }
                if self.take(b',') {
                    break;
                }
                self.expect(b']')?;
                match deep.checked_sub(open) {
                    Some(1) => found.end_part(),
                    Some(2) => found.end_polygon(),
                    _ => {}
                }
                open -= 1;
            }
        }
    }

    /// The numbers of one position, up to the end of its array.
    #[inline]
    fn position(&mut self, found: &mut CoordinateSequence) -> Result<()> {
        let x = self.coordinate()?;
        self.expect(b',')?;
        let y = self.coordinate()?;
        if self.take(b']') {
            found.push([x, y], None, None);
            return Ok(());
        }
        self.expect(b',')?;
        let z = Some(self.coordinate()?);
        let m = if self.take(b',') { Some(self.coordinate()?) } else { None };
        while self.take(b',') {
            self.coordinate()?;
        }
        self.expect(b']')?;
        found.push([x, y], z, m);
        Ok(())
    }

    #[inline]
    fn coordinate(&mut self) -> Result<f64> {
        self.peek();
        let Some((value, bytes)) = decimal::leading(self.rest()) else {
            return Err(self.bad("number expected in a position"));
        };
        self.advance(bytes);
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<(usize, CoordinateSequence)> {
        JsonCursor::new(text.as_bytes(), 100).coordinates()
    }

    #[test]
    fn depths_parts_and_polygons() {
        let (deep, point) = read("[1,-2.5,3]").unwrap();
        assert_eq!((deep, point.xy, point.z), (1, vec![[1.0, -2.5]], vec![3.0]));
        let (deep, line) = read(" [ [1,2] , [3,4,5,6,7] ]").unwrap();
        assert_eq!((deep, line.xy.len(), line.ends, line.m[1]), (2, 2, vec![2], 6.0));
        assert!(line.z[0].is_nan());
        let (deep, lines) = read("[[[1,2],[3,4]],[],[[5,6]]]").unwrap();
        assert_eq!((deep, lines.ends), (3, vec![2, 3]));
        let (deep, polygons) = read("[[],[[[1,2],[3,4]],[[5,6]]],[[]],[[[7,8]]]]").unwrap();
        assert_eq!((deep, polygons.ends, polygons.polygons), (4, vec![2, 3, 4], vec![2, 3]));
        for empty in ["[]", "[[]]", "[[[]],[]]"] {
            assert_eq!(read(empty).unwrap(), (0, CoordinateSequence::default()), "{empty}");
        }
    }

    #[test]
    fn damage_is_told() {
        for text in [
            "",
            "[",
            "[1]",
            "[1,]",
            "[1,2",
            "[1,2,]",
            "[,1]",
            "[[1,2],[[3,4]]]",
            "[[1,2] [3,4]]",
            "[[1,2],]",
            "[null,1]",
            "[1,null]",
            "[[[[[1,2]]]]]",
            "[1,2,3,4,x]",
            "{}",
            "1",
            "[[1,2],3]",
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.starts_with("byte 1"), "{text}: {error}");
        }
    }
}
