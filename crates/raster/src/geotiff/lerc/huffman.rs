//! The prefix code of LERC's 8-bit samples.

use super::bits::{Bytes, Words};

/// Values an 8-bit sample has.
const VALUES: usize = 256;
/// The longest code.
const MOST_BITS: u32 = 32;

/// A code as a binary tree: each node has a branch for a 0 and one for a 1.
pub(super) struct Code {
    nodes: Vec<[Branch; 2]>,
}

#[derive(Clone, Copy, PartialEq)]
enum Branch {
    None,
    Node(u32),
    Value(u8),
}

impl Code {
    /// Reads lengths and codes of a range of values, which may go round from the last to the first.
    pub(super) fn read(bytes: &mut Bytes<'_>) -> Option<Self> {
        let [version, size, first, end] = [(); 4].map(|()| bytes.i32());
        let (size, first, end) = (size?, first?, end?);
        let range = usize::try_from(first).ok()?..usize::try_from(end).ok()?;
        let in_range = !range.is_empty() && range.start < VALUES && range.len() <= VALUES;
        if version? < 2 || size != VALUES as i32 || !in_range {
            return None;
        }
        let lengths = bytes.packed(range.len()).filter(|lengths| lengths.len() == range.len())?;
        let mut words = Words::new(bytes.0);
        let mut code = Self { nodes: vec![[Branch::None; 2]] };
        for (value, length) in range.zip(lengths) {
            code.add((value % VALUES) as u8, length, &mut words)?;
        }
        bytes.take(4 * words.words())?;
        Some(code)
    }

    /// Adds the code of `value`, the next `length` bits of `words`.
    fn add(&mut self, value: u8, length: u32, words: &mut Words<'_>) -> Option<()> {
        if length > MOST_BITS {
            return None;
        }
        let mut node = 0;
        for left in (0..length).rev() {
            let bit = words.bit()? as usize;
            let next = self.nodes.len() as u32;
            node = match (self.nodes[node][bit], left) {
                (Branch::None, 0) => {
                    self.nodes[node][bit] = Branch::Value(value);
                    return Some(());
                }
                (Branch::None, _) => {
                    self.nodes[node][bit] = Branch::Node(next);
                    self.nodes.push([Branch::None; 2]);
                    next as usize
                }
                (Branch::Node(next), 1..) => next as usize,
                _ => return None,
            };
        }
        Some(())
    }

    /// The value whose code comes next.
    pub(super) fn next(&self, words: &mut Words<'_>) -> Option<u8> {
        let mut node = 0;
        loop {
            match self.nodes[node][words.bit()? as usize] {
                Branch::Value(value) => return Some(value),
                Branch::Node(next) => node = next as usize,
                Branch::None => return None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A code for 254, 255, 0 and 1 with lengths 1, 2, 0 and 2: 0, 10 and 11.
    fn blob(lengths: u8, codes: [u8; 4]) -> Vec<u8> {
        let head = [4, 256, 254, 258].map(i32::to_le_bytes).concat();
        [head, vec![0x80 | 2, 4, lengths], codes.to_vec()].concat()
    }

    #[test]
    fn a_code_that_goes_round() {
        let blob = blob(0b10_00_10_01, [0, 0, 0, 0b0101_1000]);
        let mut bytes = Bytes(&blob);
        let code = Code::read(&mut bytes).unwrap();
        assert!(bytes.0.is_empty());
        let mut words = Words::new(&[0, 0, 0, 0b1101_0000]);
        let values: Vec<_> = (0..3).map(|_| code.next(&mut words)).collect();
        assert_eq!(values, [Some(1), Some(254), Some(255)]);
    }

    #[test]
    fn codes_that_clash_are_refused() {
        let clash = blob(0b10_00_10_01, [0, 0, 0, 0b0001_1000]);
        assert!(Code::read(&mut Bytes(&clash)).is_none());
        let short = blob(0b10_00_10_01, [0, 0, 0, 0b0101_1000]);
        assert!(Code::read(&mut Bytes(&short[..short.len() - 1])).is_none());
    }
}
