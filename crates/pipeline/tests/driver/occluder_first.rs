//! Trees for shadow rays: made to face the light of the frame that asks for them.

use crate::ahead::{many_shuffled, positions};
use crate::fake::Fake;
use crate::{driver, query, read};
use backend::QueryKind;
use bvh_build::Cancel;
use geom::Point;
use pipeline::{Frame, Pace, TreeBuilder, Update};

/// Records of all trees adopted in frames at times 0 to 5, by what each seeks.
fn trees(update: Update, predict: bool, kind: impl Fn(u64) -> QueryKind) -> Vec<Vec<u32>> {
    let animation = many_shuffled(6, 256);
    let (fake, log) = Fake::new(Some(0), None);
    let mut driver = driver(fake, &animation, (update, predict)).unwrap();
    for index in 0..6 {
        let time = index as f64;
        let frame = Frame { index, time };
        driver.begin(frame, query(kind(index))).unwrap();
        driver.finish(None).unwrap();
    }
    drop(driver);
    read(log).trees
}

/// The record of a tree for one moment.
fn tree_at(time: f64, toward: Option<Point>) -> Vec<u32> {
    let animation = many_shuffled(6, 256);
    let mut builder = TreeBuilder::new();
    builder.order_toward(toward);
    let built = builder.build(
        &animation,
        (&positions(&animation, time), None),
        &Cancel::new(),
    );
    built.unwrap().topology.into_words()
}

#[test]
fn every_tree_faces_the_light_of_the_frame_that_asks() {
    // One light and, from frame 3 on, another, at either end of the row.
    let lights = [[300.0, 40.0, 10.0], [-40.0, 40.0, 10.0]];
    let light = |index: u64| lights[usize::from(index >= 3)];
    let ordered = |time: u64, of: u64| tree_at(time as f64, Some(light(of)));
    assert_ne!(ordered(0, 0), tree_at(0.0, None));
    assert_ne!(ordered(5, 5), ordered(5, 0));
    let kind = |index| QueryKind::ClosestAndShadow {
        light: light(index),
    };
    let rebuilt = trees(Update::Rebuild, false, kind);
    assert_eq!((&rebuilt[0], &rebuilt[5]), (&ordered(0, 0), &ordered(5, 5)));
    assert_eq!(trees(Update::Refit, false, kind), [ordered(0, 0)]);
    // Asked for in one frame, such a tree is in use from the next one on; foreseen, it is built for that one.
    for (predict, ahead) in [(false, 0), (true, 1)] {
        let found = trees(Update::Async(Pace::Lockstep(1)), predict, kind);
        for (tree, asked) in found[1..].iter().zip(1..) {
            assert_eq!(*tree, ordered(asked + ahead, asked), "{predict} {asked}");
        }
        assert!(found.len() > 4, "{}", found.len());
    }
}

#[test]
fn trees_for_other_rays_face_nothing() {
    for kind in [QueryKind::Closest, QueryKind::Any] {
        let found = trees(Update::Rebuild, false, |_| kind);
        assert_eq!(found[3], tree_at(3.0, None));
    }
}
