//! Connections between ports that could not be made: iceoryx2 continues without them silently, and tries again when
//! another port of that kind comes or leaves.
//!
//! In: iceoryx2's degradation events. Out: a count.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use iceoryx2::port::{DegradationAction, DegradationCause, DegradationInfo};

/// A counter shared by all ports of one side.
#[derive(Clone, Debug, Default)]
pub(super) struct Unmet(Arc<AtomicU64>);

impl Unmet {
    /// Handler for a port: it counts the failure and continues, since one peer with broken files must not silence the
    /// others.
    pub(super) fn handler(
        &self,
    ) -> impl Fn(DegradationCause, &DegradationInfo) -> DegradationAction + Send + use<> {
        let count = Arc::clone(&self.0);
        move |cause, _: &DegradationInfo| {
            if matches!(cause, DegradationCause::FailedToEstablishConnection) {
                count.fetch_add(1, Ordering::Relaxed);
            }
            DegradationAction::Ignore
        }
    }

    /// Number of failures since the last call.
    pub(super) fn take(&self) -> u64 {
        self.0.swap(0, Ordering::Relaxed)
    }
}
