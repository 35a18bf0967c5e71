//! What some drivers must not do at a time, in whichever interface it is asked of them.

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// One driver (NVIDIA 580) locks itself up when a thread makes or destroys a device while another compiles kernels.
static DOOR: RwLock<()> = RwLock::new(());

/// Held while kernels are compiled, which several threads may do at a time.
pub fn compile_door() -> RwLockReadGuard<'static, ()> {
    DOOR.read().unwrap_or_else(PoisonError::into_inner)
}

/// Held while a device is made or destroyed.
pub fn device_door() -> RwLockWriteGuard<'static, ()> {
    DOOR.write().unwrap_or_else(PoisonError::into_inner)
}
