//! Tests with a row of triangles whose order changes.

use super::*;
use bvh_layout::BlockTree;

/// Returns `count` triangles in a row, each at `place(key, triangle)` in each of `keys` key frames.
pub(crate) fn row(count: u32, keys: usize, place: impl Fn(usize, u32) -> f32) -> Animation {
    let corners = |x: f32| [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.5]];
    let key = |key| (0..count).flat_map(|i| corners(place(key, i))).collect();
    Animation::new((0..keys).map(key).collect(), apart(count)).unwrap()
}

/// Returns the indices of `count` triangles that share no vertices.
pub(crate) fn apart(count: u32) -> Vec<[u32; 3]> {
    (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()
}

/// Returns all positions at a time.
pub(crate) fn positions(animation: &Animation, time: f64) -> Vec<Point> {
    let moment = animation.at(time).unwrap();
    let vertices = 0..animation.vertex_count() as u32;
    vertices.map(|v| moment.vertex(v)).collect()
}

/// Returns the tree of a key frame.
pub(crate) fn at_key(animation: &Animation, key: usize) -> Built {
    let input = BuildInput::of(Vertices::AtPose(animation.pose(key as f64)));
    let built = TreeBuilder::default().build(animation, input, &Cancel::new());
    built.unwrap()
}

/// Returns a row of triangles that is permuted in the second of three key frames.
fn shuffled() -> Animation {
    row(64, 3, |key, i| (i * [1, 37, 1][key] % 64) as f32)
}

/// Returns groups of four triangles that change places between key frames. Each is reversed in every other key frame.
fn clumps() -> Animation {
    row(256, 4, |key, i| {
        let clump = i / 4 * [1, 37, 11, 53][key] % 64;
        let place = [i % 4, 3 - i % 4][key % 2];
        (clump * 16) as f32 + place as f32 * 0.25
    })
}

/// Returns boxes that contain each triangle at both times.
fn swept(a: &Animation, times: [f64; 2]) -> Vec<Aabb> {
    let [x, y] = times.map(|time| a.at(time).unwrap());
    let both = |t| x.build_box(t).union(y.build_box(t));
    (0..a.triangle_count() as u32).map(both).collect()
}

/// Returns a tree over `boxes`, built from subtrees of `last`.
fn rebuilt_from_subtrees(last: &BinaryTree, boxes: &[Aabb]) -> BinaryTree {
    let mut tree = BinaryTree::default();
    let (mut builder, cancel) = (SahBuilder::default(), Cancel::new());
    let built = SubtreeRebuilder::default().build(&mut builder, last, boxes, &cancel, &mut tree);
    built.map(|_| tree).unwrap()
}

/// A builder and its scene.
struct Course {
    animation: Animation,
    builder: TreeBuilder,
}

impl Course {
    /// Creates a builder with a tree for the first key frame.
    fn over(animation: Animation, format: TreeFormat) -> Self {
        let mut course = Self {
            animation,
            builder: TreeBuilder::with_format(format),
        };
        course.build(0.0, None, false);
        course
    }

    /// Builds a tree for one time or over two times.
    fn build(&mut self, time: f64, swept_times: Option<[f64; 2]>, is_compared: bool) -> Built {
        let pose = |time| self.animation.pose(time);
        let input = BuildInput {
            swept_poses: swept_times.map(|times| times.map(pose)),
            is_compared,
            ..BuildInput::of(Vertices::AtPose(pose(time)))
        };
        let (builder, cancel) = (&mut self.builder, Cancel::new());
        builder.build(&self.animation, input, &cancel).unwrap()
    }

    /// Returns the last tree and a new one for `time`, with swept poses at `time - 0.375` and at `time`.
    fn next(&mut self, time: f64) -> [BinaryTree; 2] {
        let last = self.last();
        self.build(time, Some([time - 0.375, time]), true);
        [last, self.last()]
    }

    /// Returns a copy of the last tree.
    fn last(&self) -> BinaryTree {
        BinaryTree::clone(&self.builder.last)
    }

    fn boxes(&self, time: f64) -> Vec<Aabb> {
        swept(&self.animation, [time; 2])
    }
}

#[test]
fn reuses_subtrees_until_trees_are_stable() {
    let mut course = Course::over(clumps(), TreeFormat::Binary);
    let [last, tree] = course.next(1.0);
    assert_eq!(tree, rebuilt_from_subtrees(&last, &course.boxes(1.0)));
    assert_ne!(tree, BinaryTree::over(&course.boxes(1.0)[..]));
    // If the time does not change, the last tree costs as little as the new one, so `is_slow` becomes true.
    course.next(1.0);
    course.next(1.0);
    let [_, tree] = course.next(1.0);
    assert_eq!(tree, BinaryTree::over(&course.boxes(1.0)[..]));
    // It stays true until a tree has degraded.
    let [_, tree] = course.next(2.0);
    assert_eq!(tree, BinaryTree::over(&course.boxes(2.0)[..]));
    let [last, tree] = course.next(3.0);
    let boxes = swept(&course.animation, [2.625, 3.0]);
    assert_eq!(tree, rebuilt_from_subtrees(&last, &boxes));
    assert_ne!(tree, BinaryTree::over(&boxes[..]));
}

#[test]
fn warm_up_does_not_change_trees() {
    let next = |warms_up: bool| {
        let mut course = Course {
            animation: clumps(),
            builder: TreeBuilder::with_format(TreeFormat::Treelets),
        };
        let warm_up = |course: &mut Course, time| {
            let (a, builder) = (&course.animation, &mut course.builder);
            builder.warm_up(a, a.pose(time), &Cancel::new()).unwrap();
            builder.spare.capacity() > 0
        };
        assert!(!warm_up(&mut course, 0.0), "there is no tree to begin with");
        course.build(0.0, None, false);
        assert!(!warms_up || warm_up(&mut course, 2.0));
        course.build(1.0, None, true)
    };
    let [plain, warmed] = [false, true].map(next);
    assert_eq!(plain.strategy, BuildStrategy::Subtrees);
    let made = |built: Built| (built.topology, built.cost, built.strategy, built.next);
    assert_eq!(made(plain), made(warmed));
}

/// With [`TreeFormat::WideBlocks`], trees are built for blocks of eight triangles. This may change a tree, but does not
/// change the trees of this scene.
#[test]
fn formats_build_the_same_trees_of_clumps() {
    let over = |format| Course::over(clumps(), format);
    let mut plain = over(TreeFormat::Binary);
    let [mut treelets, mut blocks] = [TreeFormat::Treelets, TreeFormat::WideBlocks].map(over);
    for time in [1.0, 2.0, 2.0, 3.0] {
        let expected = plain.next(time);
        assert_eq!(treelets.next(time), expected);
        assert_eq!(blocks.next(time), expected);
        let boxes = &blocks.builder.boxes;
        assert_eq!(boxes[..], blocks.boxes(time)[..], "boxes are updated");
    }
}

#[test]
fn cost_is_measured_at_the_pose() {
    let mut course = Course::over(clumps(), TreeFormat::Binary);
    let swept_times = [0.25, 0.75];
    let built = course.build(0.0, Some(swept_times), false);
    let last = &course.builder.last;
    let boxes = swept(&course.animation, swept_times);
    assert_eq!(**last, BinaryTree::over(&boxes[..]));
    assert_eq!(built.cost, sah_cost(last, &course.boxes(0.0)[..]));
    for time in [1.0, 2.0] {
        let swept_times = Some([time - 0.375, time]);
        let cost = course.build(time, swept_times, true).cost;
        let found = sah_cost(&course.builder.last, &course.boxes(time)[..]);
        assert!((cost / found - 1.0).abs() < 1e-9, "{cost} {found}");
    }
}

#[test]
fn key_frames_match_read_back_vertices() {
    let a = shuffled();
    let read_back = Vertices::ReadBack(Box::new(positions(&a, 0.3)));
    let [x, y] = [Vertices::AtPose(a.pose(0.3)), read_back].map(|vertices| {
        let input = BuildInput::of(vertices);
        let built = TreeBuilder::default().build(&a, input, &Cancel::new());
        built.map(|built| (built.topology, built.cost)).unwrap()
    });
    assert_eq!(x, y);
}

/// Samples the positions of the animation at `sampled_times`, passes them to the builder as observed at `times`, and
/// builds a tree for the time `target`.
fn observed(course: &mut Course, sampled_times: [f64; 2], times: [f64; 2], target: f64) -> Built {
    let sample = |time| Box::new(positions(&course.animation, time)) as Snapshot;
    let seen = sampled_times.map(sample);
    let pose = pose_between(times, target);
    let input = BuildInput {
        swept_poses: Some([pose; 2]),
        observed: Some(Observed {
            frames: seen,
            times,
        }),
        is_compared: true,
        ..BuildInput::of(Vertices::AtPose(pose))
    };
    let Course { builder, animation } = course;
    let built = builder.build(animation, input, &Cancel::new());
    built.unwrap()
}

/// Returns the last of several trees, each built for a known time.
fn known(times: &[f64]) -> Topology {
    let mut course = Course::over(shuffled(), TreeFormat::Binary);
    let made = times.iter().map(|&t| course.build(t, Some([t; 2]), true));
    made.last().unwrap().topology
}

#[test]
fn extrapolates_observed_motion() {
    let observed = |times, target| {
        let mut course = Course::over(shuffled(), TreeFormat::Binary);
        observed(&mut course, times, times, target).topology
    };
    // All these positions are exact in floating point.
    let ahead = observed([0.125, 0.25], 0.5);
    assert!(ahead == known(&[0.5]) && ahead != known(&[0.25]));
    // Observed twice at one time, the scene is at rest.
    assert_eq!(observed([0.25; 2], 9.0), known(&[0.25]));
}

#[test]
fn reversed_motion_uses_last_positions() {
    let mut course = Course::over(shuffled(), TreeFormat::Binary);
    // The motion reverses at time 1, so positions at 1.75 and 2 equal those at 0.25 and 0.
    let first = observed(&mut course, [0.25, 0.5], [0.25, 0.5], 0.75);
    assert!(!first.gave_up_extrapolation);
    let built = observed(&mut course, [0.25, 0.0], [1.75, 2.0], 2.5);
    assert!(built.gave_up_extrapolation);
    assert_eq!(built.topology, known(&[0.75, 0.0]));
}

#[test]
fn revert_restores_the_used_tree() {
    let courses = [(); 2].map(|()| Course::over(shuffled(), TreeFormat::Binary));
    let [mut course, mut other] = courses;
    let used = course.last();
    course.build(1.0, None, true);
    assert_ne!(course.last(), used);
    course.builder.revert();
    assert_eq!(course.last(), used);
    // The next tree is compared with the current one.
    let [one, other] = [&mut course, &mut other].map(|c| c.build(0.7, None, true));
    assert_eq!(one.topology, other.topology);
}

#[test]
fn reuses_memory_of_old_treelets() {
    let mut course = Course::over(shuffled(), TreeFormat::Treelets);
    let memory = |tree: &Topology| tree.treelets().unwrap().words().as_ptr();
    let first = course.build(0.0, None, false).topology;
    let before = memory(&first);
    course.builder.reuse(first.into_spare());
    assert_eq!(memory(&course.build(1.0, None, false).topology), before);
}

#[test]
fn only_shared_trees_are_replaced() {
    let mut tree = Arc::new(BinaryTree::new(vec![0], vec![]));
    assert_eq!(writable(&mut tree).leaf_count(), 1);
    let shared = Arc::clone(&tree);
    assert_eq!(writable(&mut tree).leaf_count(), 0);
    assert_eq!(shared.leaf_count(), 1);
}

#[test]
fn light_ordered_blocks_keep_tree_order() {
    // Triangles are larger the farther they are from the light.
    let corner = |i: u32| {
        let (x, size) = ((4 * i) as f32, 1.0 + i as f32 / 99.0);
        [[x, 0.0, 0.0], [x + size, 0.0, 0.0], [x, size, size]]
    };
    let vertices = (0..256).flat_map(corner).collect();
    let a = Animation::new(vec![vertices], apart(256)).unwrap();
    for (toward, first_visited) in [
        (None, FirstVisited::Larger),
        (Some([-9.0, 5.0, 1.0]), FirstVisited::Left),
    ] {
        let mut builder = TreeBuilder::with_format(TreeFormat::WideBlocks);
        let input = BuildInput {
            toward,
            ..BuildInput::of(Vertices::AtPose(a.pose(0.0)))
        };
        let tree = builder.build(&a, input, &Cancel::new()).unwrap().topology;
        let boxes = &builder.boxes;
        let of = |first_visited| {
            let options = CollapseOptions {
                boxes,
                first_visited,
            };
            BlockTree::of(tree.binary(), a.triangles(), options)
        };
        assert!(of(FirstVisited::Larger) != of(FirstVisited::Left));
        assert!(
            **tree.blocks().unwrap() == of(first_visited),
            "{first_visited:?}"
        );
    }
}

#[test]
fn trees_built_for_blocks_fill_them_better() {
    let corner = |i: u32| {
        let [x, y, z] = [7919, 6007, 4001].map(|step| (i * step % 1009) as f32);
        [[x, y, z], [x + 3.0, y, z], [x, y + 3.0, z]]
    };
    let vertices = (0..3000).flat_map(corner).collect();
    let a = Animation::new(vec![vertices], apart(3000)).unwrap();
    let blocks = |format| {
        let TreeBuilder { boxes, last, .. } = &Course::over(a.clone(), format).builder;
        let options = CollapseOptions {
            boxes,
            first_visited: FirstVisited::Larger,
        };
        BlockTree::of(last, a.triangles(), options).blocks.len()
    };
    let [full, others] = [TreeFormat::WideBlocks, TreeFormat::Binary].map(blocks);
    assert!(20 * full < 19 * others, "{full} {others}");
}
