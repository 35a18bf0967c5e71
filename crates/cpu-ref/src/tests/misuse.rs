//! What a correct caller cannot foresee is an error; misuse panics.

use super::{moving, senseless_tree, still, trace};
use crate::CpuBackend;
use backend::{Backend, Generation, Intersector, QueryKind, Rays, Ticket};
use std::panic::{AssertUnwindSafe, catch_unwind};

#[test]
fn no_threads_are_refused() {
    assert!(CpuBackend::new(Some(0)).is_err());
}

#[test]
fn misuse_panics_and_says_what_comes_first() {
    type Misuse = fn(&mut CpuBackend);
    let nothing = |backend: &mut CpuBackend| {
        trace(backend, Rays::List(&[]), QueryKind::Closest);
    };
    let table: [(&str, Misuse, bool); 5] = [
        (
            "the tree is stale",
            |b| b.adopt(&senseless_tree(&moving()), Generation(2)).unwrap(),
            true,
        ),
        (
            "the tree is stale",
            |b| b.interpolate(moving().pose(1.0)).unwrap(),
            true,
        ),
        ("the tree is stale", |b| b.preprocess().unwrap(), true),
        (
            "generations rise",
            |b| drop(b.adopt(&senseless_tree(&moving()), Generation(1))),
            false,
        ),
        ("never given", |b| drop(b.wait(Ticket(77))), false),
    ];
    for (why, misuse, traced) in table {
        let mut backend = still(&moving(), Intersector::Watertight);
        let panic = catch_unwind(AssertUnwindSafe(|| {
            misuse(&mut backend);
            if traced {
                nothing(&mut backend);
            }
        }));
        let said = panic.expect_err(why);
        let text = said.downcast_ref::<String>().map(String::as_str);
        let text = text
            .or(said.downcast_ref::<&str>().copied())
            .unwrap_or_default();
        assert!(text.contains(why), "{text}");
    }
}
