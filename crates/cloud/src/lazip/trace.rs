//! Data of points that the columns of a layered chunk share.

/// Bits of the symbol of changed fields.
pub(super) const CHANNEL: usize = 1 << 6;
pub(super) const SOURCE: usize = 1 << 5;
pub(super) const TIME: usize = 1 << 4;
pub(super) const ANGLE: usize = 1 << 3;

/// Scanner channel of a point, changed fields, and the size of the prediction error of its position.
#[derive(Clone, Copy, Default)]
pub(super) struct PointChanges {
    changes: u8,
    spread: u8,
}

impl PointChanges {
    /// From the symbol of changed fields.
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

    /// Whether the previous point was in another channel.
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

    /// Context of its height.
    #[inline(always)]
    pub(super) fn spread(self) -> usize {
        usize::from(self.spread)
    }
}
