//! Integer hashes: the only source of randomness, a pure function of seed and position.

/// Mixes 64 bits; the finaliser of SplitMix64 (Steele, Lea & Flood, "Fast splittable pseudorandom
/// number generators", 2014).
pub(super) fn mix64(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

/// Mixes 32 bits; the "lowbias32" finaliser of Chris Wellons' hash prospector (public domain).
#[inline(always)]
pub(super) fn mix32(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x7FEB_352D);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846C_A68B);
    x ^ (x >> 16)
}

/// The hash of one lattice row: makes the hashes of its columns cheap.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowHash {
    low: u32,
    high: u32,
}

impl RowHash {
    /// The row `row` of the lattice known by `key`.
    pub(super) fn new(key: u64, row: u32) -> Self {
        let mixed = mix64(key ^ mix64(u64::from(row)));
        Self { low: mixed as u32, high: (mixed >> 32) as u32 }
    }

    /// 32 random bits for the lattice node (`col`, row).
    #[inline(always)]
    pub(super) fn at(self, col: u32) -> u32 {
        mix32(mix32(col ^ self.low).wrapping_add(self.high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_even_along_rows_and_columns() {
        let mut ones = [0_u32; 32];
        for k in 0..10_000 {
            let h = RowHash::new(7, k / 100).at(k % 100);
            for (bit, count) in ones.iter_mut().enumerate() {
                *count += h >> bit & 1;
            }
        }
        assert!(ones.iter().all(|&n| (4_700..5_300).contains(&n)), "{ones:?}");
    }
}
