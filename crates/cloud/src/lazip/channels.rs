//! What is learnt of each of the four scanner channels.

/// What is learnt of a channel.
pub(super) trait ChannelContext {
    /// What a new channel takes over from the point before it.
    type Last;

    /// A channel without a point.
    fn new() -> Self;

    /// Begins anew after a point.
    fn begin(&mut self, last: Self::Last);
}

/// Four channels. They are large: made once per thread, used again and again.
pub(super) struct ChannelContexts<S> {
    channels: Box<[S; 4]>,
    /// Whether the chunk had a point of a channel.
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

    /// Goes on to a channel, which begins after the point before if it is new.
    #[inline(never)]
    pub(super) fn switch(&mut self, channel: usize, last: S::Last) -> &mut S {
        let state = &mut self.channels[channel & 3];
        if !std::mem::replace(&mut self.is_used[channel & 3], true) {
            state.begin(last);
        }
        state
    }
}
