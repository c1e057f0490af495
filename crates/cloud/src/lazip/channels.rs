//! Decoder contexts of the four scanner channels.

/// Decoder context of a channel.
pub(super) trait ChannelContext {
    /// State that a new channel takes over from the previous point.
    type Last;

    /// A channel without a point.
    fn new() -> Self;

    /// Restarts after a point.
    fn begin(&mut self, last: Self::Last);
}

/// Contexts of four channels. They are large: allocated once per thread and reused.
pub(super) struct ChannelContexts<S> {
    channels: Box<[S; 4]>,
    /// Whether the chunk has a point of a channel.
    is_used: [bool; 4],
}

impl<S: ChannelContext> ChannelContexts<S> {
    /// Channels without a point.
    pub(super) fn new() -> Self {
        let channels: Vec<_> = (0..4).map(|_| S::new()).collect();
        let channels = channels.into_boxed_slice().try_into();
        Self { channels: channels.unwrap_or_else(|_| unreachable!()), is_used: [false; 4] }
    }

    /// Begins a chunk with a point of `channel`.
    pub(super) fn begin(&mut self, channel: usize, last: S::Last) {
        self.is_used = [false; 4];
        self.switch(channel, last);
    }

    #[inline(always)]
    pub(super) fn get(&mut self, channel: usize) -> &mut S {
        &mut self.channels[channel & 3]
    }

    /// A channel that has a point.
    #[inline(always)]
    pub(super) fn used(&self, channel: usize) -> Option<&S> {
        self.is_used[channel & 3].then(|| &self.channels[channel & 3])
    }

    /// Switches to a channel; a new one begins after the previous point.
    #[inline(never)]
    pub(super) fn switch(&mut self, channel: usize, last: S::Last) -> &mut S {
        let state = &mut self.channels[channel & 3];
        if !std::mem::replace(&mut self.is_used[channel & 3], true) {
            state.begin(last);
        }
        state
    }
}
