//! Grouping of points by return numbers, for the choice of contexts.

/// Return number in the low half, number of returns of its pulse in the high half.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct ReturnNumbers(pub(super) u8);

/// Group of a point by number of returns (row) and return number (column), one of six.
const GROUPS: [&[u8; 16]; 16] = [
    b"0123453445555555",
    b"1013333333333333",
    b"2124444444433333",
    b"3345444444444444",
    b"4344544444444444",
    b"5344454444444444",
    b"3344445444444444",
    b"4344444544444444",
    b"4344444454444444",
    b"5344444445444444",
    b"5344444444544444",
    b"5334444444455444",
    b"5334444444455544",
    b"5334444444445554",
    b"5334444444444555",
    b"5334444444444455",
];

/// Group by number of returns and return number up to seven, one of sixteen (hexadecimal digits).
const OLD_GROUPS: [&[u8; 8]; 8] = [
    b"fedcba98",
    b"e0136aa9",
    b"d1247bba",
    b"c3458ccb",
    b"b6789ddc",
    b"aabcdeed",
    b"9abcdefe",
    b"89abcdef",
];

static GROUP: [u8; 256] = {
    let mut table = [0; 256];
    let mut at = 0;
    while at < 256 {
        table[at] = GROUPS[at >> 4][at & 15] - b'0';
        at += 1;
    }
    table
};

impl ReturnNumbers {
    /// Return `number` of `of`, each below 16.
    #[inline(always)]
    pub(super) fn new(number: u8, of: u8) -> Self {
        Self(of << 4 | number & 15)
    }

    /// Return number.
    #[inline(always)]
    pub(super) fn number(self) -> u8 {
        self.0 & 15
    }

    /// Number of returns of the pulse.
    #[inline(always)]
    pub(super) fn of(self) -> u8 {
        self.0 >> 4
    }

    /// Group of similar points, one of six.
    #[inline(always)]
    pub(super) fn group(self) -> usize {
        usize::from(GROUP[usize::from(self.0)])
    }

    /// Group of similar points, one of sixteen; for return numbers below eight.
    pub(super) fn old_group(self) -> usize {
        let digit = OLD_GROUPS[usize::from(self.of() & 7)][usize::from(self.number() & 7)];
        usize::from(match digit {
            b'a'.. => digit - b'a' + 10,
            _ => digit - b'0',
        })
    }

    /// Distance of the return from the last one, at most seven.
    #[inline(always)]
    pub(super) fn depth(self) -> usize {
        usize::from(self.of().abs_diff(self.number()).min(7))
    }

    /// Whether this is the only return of its pulse.
    #[inline(always)]
    pub(super) fn is_single(self) -> bool {
        self.of() == 1
    }

    #[inline(always)]
    pub(super) fn is_first(self) -> bool {
        self.number() == 1
    }

    #[inline(always)]
    pub(super) fn is_last(self) -> bool {
        self.number() >= self.of()
    }
}
