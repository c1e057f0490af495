//! Decoded arcs of a topology.

use crate::json::JsonCursor;
use terrane_base::error::Result;

/// Quantisation transform: integers to coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct TopoJsonTransform {
    pub(super) scale: [f64; 2],
    pub(super) translate: [f64; 2],
}

/// All arcs.
pub(super) struct TopoJsonArcs {
    xy: Vec<[f64; 2]>,
    ends: Vec<usize>,
    transform: Option<TopoJsonTransform>,
}

impl TopoJsonArcs {
    /// Decodes the arcs array. With a transform, positions are delta-encoded.
    pub(super) fn read(
        cursor: &mut JsonCursor<'_>,
        transform: Option<TopoJsonTransform>,
    ) -> Result<Self> {
        let mut arcs = Self { xy: Vec::new(), ends: Vec::new(), transform };
        let mut is_first = true;
        cursor.expect(b'[')?;
        while cursor.item(&mut is_first)? {
            // Empty arcs count too, so each is read by itself.
            let (deep, arc) = cursor.coordinates()?;
            if deep != 2 && deep != 0 {
                return Err(cursor.bad("arc is not an array of positions"));
            }
            let mut at = [0.0; 2];
            for [x, y] in arc.xy {
                at = if transform.is_some() { [at[0] + x, at[1] + y] } else { [x, y] };
                arcs.xy.push(arcs.place(at));
            }
            arcs.ends.push(arcs.xy.len());
        }
        Ok(arcs)
    }

    /// Number of arcs.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// Number of vertices of all arcs.
    pub(super) fn vertices(&self) -> usize {
        self.xy.len()
    }

    /// Coordinates of a quantised position.
    pub(super) fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.transform {
            None => [x, y],
            Some(TopoJsonTransform { scale, translate }) => {
                [x * scale[0] + translate[0], y * scale[1] + translate[1]]
            }
        }
    }

    /// The vertices of arc `index`; ~index is the reversed arc.
    pub(super) fn get(&self, index: i64) -> Option<&[[f64; 2]]> {
        let arc = usize::try_from(if index < 0 { !index } else { index }).ok()?;
        let end = *self.ends.get(arc)?;
        let start = if arc == 0 { 0 } else { self.ends[arc - 1] };
        Some(&self.xy[start..end])
    }
}
