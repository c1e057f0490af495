//! What the columns of a layered chunk have to know of a point that the places tell.

/// Bits of the symbol that says what differs from the point before.
pub(super) const CHANNEL: usize = 1 << 6;
pub(super) const SOURCE: usize = 1 << 5;
pub(super) const TIME: usize = 1 << 4;
pub(super) const ANGLE: usize = 1 << 3;

/// The scanner channel of a point, what differs from the point before it in the channel, and how far it
/// is from where it was expected.
#[derive(Clone, Copy, Default)]
pub(super) struct PointChanges {
    changes: u8,
    spread: u8,
}

impl PointChanges {
    /// From the symbol that says what differs.
    #[inline(always)]
    pub(super) fn new(changes: usize, channel: usize, spread: usize) -> Self {
        let changes = changes & (CHANNEL | SOURCE | TIME | ANGLE) | channel & 3;
        Self { changes: changes as u8, spread: spread as u8 }
    }

    #[inline(always)]
    fn has(self, change: usize) -> bool {
        usize::from(self.changes) & change != 0
    }

    #[inline(always)]
    pub(super) fn channel(self) -> usize {
        usize::from(self.changes & 3)
    }

    /// Whether the point before it was in another channel.
    #[inline(always)]
    pub(super) fn is_other_channel(self) -> bool {
        self.has(CHANNEL)
    }

    /// Whether the time differs.
    #[inline(always)]
    pub(super) fn is_later(self) -> bool {
        self.has(TIME)
    }

    #[inline(always)]
    pub(super) fn has_other_angle(self) -> bool {
        self.has(ANGLE)
    }

    #[inline(always)]
    pub(super) fn has_other_source(self) -> bool {
        self.has(SOURCE)
    }

    /// The circumstance that its height comes in.
    #[inline(always)]
    pub(super) fn spread(self) -> usize {
        usize::from(self.spread)
    }
}
