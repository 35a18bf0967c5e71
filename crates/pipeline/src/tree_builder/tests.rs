//! Trees over a row of triangles that changes its order.

use super::*;
use crate::sampling::samples;
use bvh_build::order_toward;
use bvh_layout::BlockTree;

/// So many triangles in a row, which in each key frame stand in these places.
pub(crate) fn row(count: u32, places: &[&dyn Fn(u32) -> f32]) -> Animation {
    let key = |place: &&dyn Fn(u32) -> f32| -> Vec<Point> {
        let corners = |x: f32| [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]];
        (0..count).flat_map(|i| corners(place(i))).collect()
    };
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Animation::new(places.iter().map(key).collect(), triangles.collect()).unwrap()
}

/// Triangles in a row: in order, and with every seventh beside the first.
fn shuffled() -> Animation {
    let in_order = |i| i as f32;
    row(64, &[&in_order, &|i| (i * 37 % 64) as f32, &in_order])
}

fn tree(made: Made) -> Option<Built> {
    match made {
        Made::Tree(built) => Some(built),
        Made::NoBetter => None,
    }
}

#[test]
fn only_a_tree_that_is_cheaper_where_it_will_be_used_is_handed_over() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let mut builder = TreeBuilder::new();
    builder.build(&a, (a.first(), None), &cancel).unwrap();
    let other = || Vertices::KeyFrames(a.pose(1.0));
    let mut made_for = |rival_at: Option<f64>| {
        let at = rival_at.map(|t| a.pose(t));
        tree(builder.rebuild(&a, (other(), None), at, &cancel).unwrap())
    };
    assert!(made_for(Some(0.0)).is_none() && made_for(Some(2.0)).is_none());
    // What was not handed over is no rival: this one still meets the first.
    assert!(made_for(Some(1.0)).is_some());
    // Its equal is taken, even where another would be better.
    assert!(made_for(Some(0.0)).is_some());
    assert!(made_for(None).is_some());
}

/// Clumps of four triangles that change places between key frames, each turned round in every other one.
fn clumps() -> Animation {
    let at = |odd: u32, i: u32| (i / 4 * odd % 64 * 16) as f32;
    let ahead = |i: u32| (i % 4) as f32 * 0.25;
    let turned = |i: u32| (3 - i % 4) as f32 * 0.25;
    row(
        256,
        &[
            &|i| at(1, i) + ahead(i),
            &|i| at(37, i) + turned(i),
            &|i| at(11, i) + ahead(i),
            &|i| at(53, i) + turned(i),
        ],
    )
}

/// Boxes of each triangle at both poses.
fn swept(a: &Animation, times: [f64; 2]) -> Vec<Aabb> {
    let [x, y] = times.map(|time| a.pose(time));
    let [x, y] = [x, y].map(|pose| a.moment(pose).unwrap());
    let both = |t| x.build_box(t).union(y.build_box(t));
    (0..a.triangle_count() as u32).map(both).collect()
}

fn from_scratch(boxes: &[Aabb]) -> BinaryTree {
    let mut tree = BinaryTree::default();
    let built = Builder::new().build(boxes, &Cancel::new(), &mut tree);
    built.map(|()| tree).unwrap()
}

fn of_groups(last: &BinaryTree, boxes: &[Aabb]) -> BinaryTree {
    let mut tree = BinaryTree::default();
    let built = SubtreeRebuilder::new().build(
        &mut Builder::new(),
        (last, boxes),
        &Cancel::new(),
        &mut tree,
    );
    built.map(|_| tree).unwrap()
}

/// A builder with a tree for the first key frame, and how the next ones come.
struct Course {
    animation: Animation,
    builder: TreeBuilder,
}

impl Course {
    fn new() -> Self {
        Self::with_forms(Forms::default())
    }

    fn with_forms(forms: Forms) -> Self {
        let (animation, mut builder) = (clumps(), TreeBuilder::with_forms(forms));
        let first = builder.build(&animation, (animation.first(), None), &Cancel::new());
        first.unwrap();
        Self { animation, builder }
    }

    /// The tree before and the tree for a moment, used from a third of a key frame before it.
    fn next(&mut self, time: f64) -> [BinaryTree; 2] {
        let (a, last) = (&self.animation, self.builder.in_use.clone());
        let [from, at] = [time - 0.375, time].map(|t| a.pose(t));
        let what = (Vertices::KeyFrames(at), Some([from, at]));
        let made = self.builder.rebuild(a, what, Some(at), &Cancel::new());
        made.unwrap();
        [last, self.builder.in_use.clone()]
    }

    fn boxes(&self, time: f64) -> Vec<Aabb> {
        swept(&self.animation, [time; 2])
    }
}

#[test]
fn a_tree_is_made_of_groups_of_the_last_one_until_trees_hold() {
    let mut course = Course::new();
    let [last, tree] = course.next(1.0);
    assert_eq!(tree, of_groups(&last, &course.boxes(1.0)));
    assert_ne!(tree, from_scratch(&course.boxes(1.0)));
    // Twice the same moment: the tree that it finds could have been kept.
    course.next(1.0);
    course.next(1.0);
    let [_, tree] = course.next(1.0);
    assert_eq!(tree, from_scratch(&course.boxes(1.0)));
    // That holds until one has faded.
    let [_, tree] = course.next(2.0);
    assert_eq!(tree, from_scratch(&course.boxes(2.0)));
    let [last, tree] = course.next(3.0);
    let boxes = swept(&course.animation, [2.625, 3.0]);
    assert_eq!(tree, of_groups(&last, &boxes));
    assert_ne!(tree, from_scratch(&boxes));
}

#[test]
fn a_warm_up_changes_no_tree_to_come_and_finds_its_memory() {
    let (a, cancel) = (clumps(), Cancel::new());
    let forms = Forms {
        treelets: true,
        blocks: false,
    };
    let next = |warms_up: bool| {
        let mut builder = TreeBuilder::with_forms(forms);
        builder.warm_up(&a, a.pose(0.0), &cancel).unwrap();
        assert!(builder.spare.is_empty(), "there is no tree to begin with");
        builder.build(&a, (a.first(), None), &cancel).unwrap();
        if warms_up {
            builder.warm_up(&a, a.pose(2.0), &cancel).unwrap();
            assert!(!builder.spare.is_empty());
        }
        let vertices = Vertices::KeyFrames(a.pose(1.0));
        let made = builder.rebuild(&a, (vertices, None), Some(a.pose(1.0)), &cancel);
        tree(made.unwrap()).unwrap()
    };
    let [plain, warmed] = [false, true].map(next);
    assert_eq!(plain.topology.words(), warmed.topology.words());
    assert_eq!(plain.strategy, BuildStrategy::Subtrees);
    assert_eq!(
        (plain.cost, plain.strategy, plain.next),
        (warmed.cost, warmed.strategy, warmed.next)
    );
}

#[test]
fn what_records_carry_changes_no_tree() {
    let forms = Forms {
        treelets: true,
        blocks: true,
    };
    let [mut plain, mut carrying] = [Forms::default(), forms].map(Course::with_forms);
    for time in [1.0, 2.0, 2.0, 3.0] {
        assert_eq!(plain.next(time), carrying.next(time));
        let boxes = &carrying.builder.boxes;
        assert_eq!(boxes[..], carrying.boxes(time)[..], "blocks are filled");
    }
}

#[test]
fn a_first_tree_for_more_than_a_moment_costs_what_it_does_at_that_moment() {
    let a = clumps();
    let (mut builder, halves) = (TreeBuilder::new(), [0.25, 0.75]);
    let from = (a.first(), Some(halves.map(|time| a.pose(time))));
    let built = builder.build(&a, from, &Cancel::new()).unwrap();
    assert_eq!(builder.in_use, from_scratch(&swept(&a, halves)));
    assert_eq!(
        built.cost,
        sah_cost(&builder.in_use, &swept(&a, [0.0; 2])[..])
    );
}

#[test]
fn what_a_tree_costs_is_said_of_the_middle_whatever_it_was_built_for() {
    let mut course = Course::new();
    let a = &course.animation;
    for time in [1.0, 2.0] {
        let [from, at] = [time - 0.375, time].map(|t| a.pose(t));
        let what = (Vertices::KeyFrames(at), Some([from, at]));
        let made = course.builder.rebuild(a, what, Some(at), &Cancel::new());
        let cost = tree(made.unwrap()).unwrap().cost;
        let found = sah_cost(&course.builder.in_use, &swept(a, [time; 2])[..]);
        assert!((cost / found - 1.0).abs() < 1e-9, "{cost} {found}");
    }
}

#[test]
fn a_tree_that_nobody_weighs_does_not_count_as_faded() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let mut builder = TreeBuilder::new();
    builder.build(&a, (a.first(), None), &cancel).unwrap();
    let halves = [0.625, 1.0].map(|t| a.pose(t));
    for _ in 0..3 {
        let from = Vertices::KeyFrames(a.pose(1.0));
        let made = builder.rebuild(&a, (from, Some(halves)), None, &cancel);
        let own = TreeBuilder::new()
            .build(&a, (&a.key(1).unwrap(), None), &cancel)
            .unwrap();
        let found = tree(made.unwrap()).unwrap();
        assert_eq!(found.topology.words(), own.topology.words());
    }
}

#[test]
fn key_frames_make_the_same_tree_as_the_vertices_read_back() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let pose = a.pose(0.3);
    let moment = a.moment(pose).unwrap();
    let positions: Vec<Point> = (0..192).map(|v| moment.vertex(v)).collect();
    let read_back = Vertices::ReadBack(Box::new(positions));
    let [x, y] = [Vertices::KeyFrames(pose), read_back].map(|vertices| {
        let made = TreeBuilder::new().rebuild(&a, (vertices, None), None, &cancel);
        tree(made.unwrap()).unwrap()
    });
    assert_eq!((x.topology.words(), x.cost), (y.topology.words(), y.cost));
}

#[test]
fn a_tree_for_all_times_is_never_worse_over_them_than_the_first_frames() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let samples = samples(&a, [0.0, 2.0]).unwrap();
    let mut builder = TreeBuilder::new();
    let first = a.pose(0.0);
    let for_all = builder.build_for_all(&a, &samples, first, &cancel).unwrap();
    let own = builder.build(&a, (a.first(), None), &cancel).unwrap();
    assert_eq!(for_all.cost, own.cost);
    assert_ne!(for_all.topology.words(), own.topology.words());
    // Where hardly anything but the first frame counts, its own tree is taken.
    let mut rarely = samples;
    rarely[1..].iter_mut().for_each(|s| s.weight *= 1e-9);
    let for_first = builder.build_for_all(&a, &rarely, first, &cancel).unwrap();
    assert_eq!(for_first.topology.words(), own.topology.words());
}

#[test]
fn a_tree_that_was_never_used_is_taken_back() {
    let (a, cancel) = (shuffled(), Cancel::new());
    let at = |time| a.pose(time);
    let from = |builder: &mut TreeBuilder, time| {
        let what = (Vertices::KeyFrames(at(time)), None);
        tree(builder.rebuild(&a, what, Some(at(time)), &cancel).unwrap())
    };
    let mut builder = TreeBuilder::new();
    builder.build(&a, (a.first(), None), &cancel).unwrap();
    let used = builder.in_use.clone();
    from(&mut builder, 1.0).expect("another order, another tree");
    assert_ne!(builder.in_use, used);
    builder.revert();
    assert_eq!(builder.in_use, used);
    // The next one is set against the one in use.
    let mut other = TreeBuilder::new();
    other.build(&a, (a.first(), None), &cancel).unwrap();
    let [one, other] = [&mut builder, &mut other].map(|b| from(b, 0.7).map(|t| t.topology));
    assert_eq!(one, other);
}

#[test]
fn an_old_records_memory_is_used_again() {
    let (a, cancel) = (shuffled(), Cancel::new());
    for treelets in [false, true] {
        let mut builder = TreeBuilder::with_forms(Forms {
            treelets,
            blocks: false,
        });
        let memory = |tree: &Topology| {
            let treelets = tree.treelets().map(|t| t.words().as_ptr());
            (tree.words().as_ptr(), treelets)
        };
        let first = builder
            .build(&a, (a.first(), None), &cancel)
            .unwrap()
            .topology;
        let before = memory(&first);
        builder.reuse(first.into_spare());
        builder.reuse(Spare::default());
        let again = builder
            .build(&a, (&a.key(1).unwrap(), None), &cancel)
            .unwrap()
            .topology;
        assert_eq!(memory(&again), before);
        assert_eq!(before.1.is_some(), treelets);
    }
}

#[test]
fn a_tree_for_all_times_faces_the_light_too() {
    let (a, light) = (clumps(), [900.0, 5.0, 1.0]);
    let tree = |toward| {
        let mut builder = TreeBuilder::new();
        builder.order_toward(toward);
        let all = samples(&a, [0.0, 3.0]).unwrap();
        let built = builder.build_for_all(&a, &all, a.pose(0.0), &Cancel::new());
        built.map(|_| builder.in_use).unwrap()
    };
    let plain = tree(None);
    let mut turned = plain.clone();
    order_toward(&mut turned, &a.at(0.0).unwrap(), light);
    assert_ne!(turned, plain);
    assert_eq!(tree(Some(light)), turned);
}

#[test]
fn blocks_of_a_tree_that_faces_the_light_are_asked_in_its_order() {
    // The larger, the farther from the light.
    let corner = |i: u32| {
        let (x, size) = ((4 * i) as f32, 1.0 + i as f32 / 99.0);
        [[x, 0.0, 0.0], [x + size, 0.0, 0.0], [x, size, size]]
    };
    let vertices = (0..256).flat_map(corner).collect();
    let triangles = (0..256).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let a = Animation::new(vec![vertices], triangles).unwrap();
    let cancel = Cancel::new();
    let forms = Forms {
        treelets: false,
        blocks: true,
    };
    for (toward, first) in [(None, First::Larger), (Some([-9.0, 5.0, 1.0]), First::Left)] {
        let mut builder = TreeBuilder::with_forms(forms);
        builder.order_toward(toward);
        let tree = builder
            .build(&a, (a.first(), None), &cancel)
            .unwrap()
            .topology;
        let of = |first| BlockTree::of(&tree, a.triangles(), (&builder.boxes[..], first));
        assert!(of(First::Larger) != of(First::Left));
        assert!(**tree.blocks().unwrap() == of(first), "{first:?}");
    }
}
