//! Storing of numbers in the fields of records.

use crate::column::{ColumnEncoding, PointColumn};

/// 2^63, the range of 64-bit integers as a double.
const LONG: f64 = (1_u64 << 63) as f64;

impl PointColumn {
    /// Name of the column.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Stores a number, rounded to the nearest step of the field.
    ///
    /// # Errors
    /// A number out of range, the nodata value, or NaN.
    pub fn set(&self, record: &mut [u8], number: f64) -> Result<(), String> {
        let [scale, offset] = self.scale.unwrap_or([1.0, 0.0]);
        let stored = match self.value {
            // Steps are three 500ths of a degree.
            ColumnEncoding::Angle => (number * 500.0 / 3.0).round(),
            ColumnEncoding::Float(4) => f64::from(((number - offset) / scale) as f32),
            ColumnEncoding::Float(_) => (number - offset) / scale,
            _ => ((number - offset) / scale).round(),
        };
        let [low, high] = self.value.range();
        if !(low..=high).contains(&stored) {
            return Err(format!("{number} does not fit into {}", self.name));
        }
        if self.none == Some(stored) {
            return Err(format!("{number} is the nodata value of {}", self.name));
        }
        self.value.put(stored, &mut record[self.at..]);
        Ok(())
    }
}

impl ColumnEncoding {
    /// Minimum and maximum number.
    fn range(self) -> [f64; 2] {
        match self {
            Self::Bits(_, count) => [0.0, f64::from((1_u32 << count) - 1)],
            Self::Unsigned(8) => [0.0, (2.0 * LONG).next_down()],
            Self::Signed(8) => [-LONG, LONG.next_down()],
            Self::Unsigned(bytes) => [0.0, 256_f64.powi(bytes as i32) - 1.0],
            Self::Signed(bytes) => {
                let half = 256_f64.powi(bytes as i32) / 2.0;
                [-half, half - 1.0]
            }
            Self::Angle => [f64::from(i16::MIN), f64::from(i16::MAX)],
            Self::Float(4) => [f64::from(f32::MIN), f64::from(f32::MAX)],
            Self::Float(_) => [f64::MIN, f64::MAX],
        }
    }

    /// Stores a value within range at the start of `bytes`.
    fn put(self, stored: f64, bytes: &mut [u8]) {
        let mut all =
            |value: [u8; 8], count: usize| bytes[..count].copy_from_slice(&value[..count]);
        match self {
            Self::Bits(first, count) => {
                let mask = ((1_u32 << count) - 1) << first;
                bytes[0] = bytes[0] & !(mask as u8) | (stored as u8) << first;
            }
            Self::Unsigned(count) => all((stored as u64).to_le_bytes(), count),
            Self::Signed(count) => all((stored as i64).to_le_bytes(), count),
            Self::Angle => all((stored as i64).to_le_bytes(), 2),
            Self::Float(4) => all(u64::from((stored as f32).to_bits()).to_le_bytes(), 4),
            Self::Float(_) => all(stored.to_le_bytes(), 8),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(value: ColumnEncoding, scale: Option<[f64; 2]>, none: Option<f64>) -> PointColumn {
        PointColumn { name: "field".into(), at: 3, value, scale, none }
    }

    #[test]
    fn what_is_put_is_read_again_and_nothing_else_changes() {
        for (value, scale, number, read) in [
            (ColumnEncoding::Bits(0, 5), None, 31.0, 31.0),
            (ColumnEncoding::Bits(3, 3), None, 5.4, 5.0),
            (ColumnEncoding::Unsigned(1), None, 255.0, 255.0),
            (ColumnEncoding::Unsigned(2), None, 65_535.4, 65_535.0),
            (ColumnEncoding::Unsigned(8), None, 9e18, 9e18),
            (ColumnEncoding::Signed(1), None, -128.0, -128.0),
            (ColumnEncoding::Signed(4), Some([0.01, 5.0]), -20.0, -20.0),
            (ColumnEncoding::Signed(8), None, -9e18, -9e18),
            (ColumnEncoding::Float(4), None, 0.5, 0.5),
            (ColumnEncoding::Float(8), Some([2.0, 1.0]), 0.1, 0.1),
            (ColumnEncoding::Angle, None, -15.0, -15.0),
        ] {
            let column = column(value, scale, None);
            for fill in [0, 255] {
                let mut record = vec![fill; 16];
                column.set(&mut record, number).unwrap();
                assert!((column.number(&record) - read).abs() < 1e-12, "{value:?}");
                let size = match value {
                    ColumnEncoding::Bits(first, count) => {
                        let own = (((1_u32 << count) - 1) << first) as u8;
                        assert_eq!(record[3] & !own, fill & !own);
                        1
                    }
                    ColumnEncoding::Unsigned(size)
                    | ColumnEncoding::Signed(size)
                    | ColumnEncoding::Float(size) => size,
                    ColumnEncoding::Angle => 2,
                };
                assert!(record[..3].iter().chain(&record[3 + size..]).all(|byte| *byte == fill));
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_told_and_changes_nothing() {
        for (value, scale, none, number) in [
            (ColumnEncoding::Bits(0, 5), None, None, 32.0),
            (ColumnEncoding::Bits(0, 5), None, None, -1.0),
            (ColumnEncoding::Unsigned(2), None, None, 65_535.5),
            (ColumnEncoding::Unsigned(8), None, None, 2e19),
            (ColumnEncoding::Signed(1), None, None, 128.0),
            (ColumnEncoding::Signed(4), Some([0.01, 0.0]), None, 3e7),
            (ColumnEncoding::Signed(4), Some([0.01, 0.0]), Some(100.0), 1.0),
            (ColumnEncoding::Float(4), None, None, 1e39),
            (ColumnEncoding::Float(8), None, None, f64::NAN),
            (ColumnEncoding::Unsigned(1), None, None, f64::NAN),
            (ColumnEncoding::Angle, None, None, 200.0),
        ] {
            let mut record = vec![7; 16];
            let told = column(value, scale, none).set(&mut record, number).unwrap_err();
            assert!(told.contains("field") && record == [7; 16], "{told}");
        }
    }
}
