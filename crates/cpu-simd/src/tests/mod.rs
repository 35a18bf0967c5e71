//! Every instruction set that the machine has against the reference.

mod answers;
mod boxes;
mod simd;

use crate::open_at;
use crate::simd::Level;
use conformance::{LAWS, Reference, hold};
use cpu_ref::CpuBackend;

/// Cases of each law and instruction set.
const CASES: u32 = 4;

#[test]
fn every_instruction_set_keeps_every_law() {
    let mut reference = Reference::new(Box::new(CpuBackend::new(Some(1)).unwrap()));
    for level in Level::all() {
        let mut subject = open_at(level, Some(2)).unwrap();
        for law in LAWS {
            let held = hold(law, &mut subject, &mut reference, 7, 0..CASES);
            held.unwrap_or_else(|e| panic!("{level:?}: {e}"));
        }
    }
}
