//! When rays are worth running together.

/// Whether packets of late were worth it.
#[derive(Default)]
pub(super) struct Trust {
    failed: u32,
    /// Cells that go one by one before the next packet is tried.
    pause: u32,
}

/// The longest pause.
const PAUSE: u32 = 7;

impl Trust {
    #[inline(always)]
    pub(super) fn tries(&mut self) -> bool {
        let tries = self.pause == 0;
        self.pause = self.pause.saturating_sub(1);
        tries
    }

    #[inline(always)]
    pub(super) fn saw(&mut self, worth: bool) {
        self.failed = if worth { 0 } else { self.failed + 1 };
        self.pause = ((1 << self.failed.min(8)) - 1).min(PAUSE);
    }
}
