use super::*;

/// Returns two squares of two triangles each, at `z = 0` and `z = -1`, moved along all axes.
fn squares(by: f32) -> Verifier {
    let square = |z: f32| [[0.0, 0.0, z], [4.0, 0.0, z], [4.0, 4.0, z], [0.0, 4.0, z]];
    let corners = [square(0.0), square(-1.0)].concat();
    let key = corners.iter().map(|p| p.map(|x| x + by)).collect();
    let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    Verifier::new(&Animation::new(vec![key], triangles).unwrap(), 0.0)
}

fn down(x: f32, y: f32, by: f32) -> Ray {
    Ray::new([x + by, y + by, 2.0 + by], [0.0, 0.0, -1.0])
}

fn hit(triangle: u32, t: f32, u: f32, v: f32) -> Hit {
    Hit { t, u, v, triangle }
}

#[test]
fn what_is_hit_clearly_allows_one_answer_alone() {
    let judge = squares(0.0);
    let ray = down(3.0, 1.0, 0.0);
    let right = hit(0, 2.0, 0.5, 0.25);
    assert!(judge.admits(&ray));
    assert_eq!(judge.refutes(&ray, &right), None);
    let close = hit(0, 2.0 + 4e-6, 0.5, 0.25);
    assert_eq!(judge.refutes(&ray, &close), None);
    for wrong in [
        Hit::MISS,
        hit(0, 2.0001, 0.5, 0.25),
        hit(0, 2.0, 0.5, 0.2501),
        hit(0, 2.0, 0.25, 0.5),
        hit(1, 2.0, 0.5, 0.25),
        hit(2, 3.0, 0.5, 0.25),
        hit(9, 2.0, 0.5, 0.25),
    ] {
        assert!(judge.refutes(&ray, &wrong).is_some(), "{wrong:?}");
    }
    assert_eq!(judge.refutes(&down(5.0, 1.0, 0.0), &Hit::MISS), None);
    assert!(judge.refutes(&down(5.0, 1.0, 0.0), &right).is_some());
}

#[test]
fn beside_an_edge_either_neighbour_is_right_but_not_what_lies_behind() {
    let judge = squares(0.0);
    let ray = down(2.000_001, 2.0, 0.0);
    assert_eq!(judge.refutes(&ray, &hit(0, 2.0, 0.0, 0.5)), None);
    assert_eq!(judge.refutes(&ray, &hit(1, 2.0, 0.5, 0.0)), None);
    // Neither triangle is certainly hit there, and neither is the one behind.
    assert_eq!(judge.refutes(&ray, &Hit::MISS), None);
    let rim = down(4.000_001, 1.0, 0.0);
    assert_eq!(judge.refutes(&rim, &Hit::MISS), None);
    assert_eq!(judge.refutes(&rim, &hit(0, 2.0, 0.75, 0.25)), None);
}

#[test]
fn the_margin_grows_with_the_coordinates() {
    let near = |by: f32| {
        let ray = down(3.0, 1.0, by);
        squares(by).refutes(&ray, &hit(0, 2.01, 0.5, 0.25))
    };
    assert!(near(0.0).is_some() && near(100.0).is_some());
    assert_eq!(near(10_000.0), None);
}

#[test]
fn intervals_are_kept_and_shadows_follow_the_way_to_the_light() {
    let judge = squares(0.0);
    let until = |t_max| Ray {
        t_max,
        ..down(3.0, 1.0, 0.0)
    };
    assert_eq!(judge.refutes_any(&until(1.9), false), None);
    assert!(judge.refutes_any(&until(1.9), true).is_some());
    assert_eq!(judge.refutes_any(&until(2.1), true), None);
    assert!(judge.refutes_any(&until(2.1), false).is_some());
    let below = hit(2, 3.0, 0.5, 0.25);
    let (light, far) = ([3.0, 1.0, 5.0], [3.0, 1.0, -0.5]);
    let shadow =
        |hit, light, blocked| judge.refutes_shadow(&down(3.0, 1.0, 0.0), hit, light, blocked);
    assert_eq!(shadow(&below, light, true), None);
    assert!(shadow(&below, light, false).is_some());
    assert_eq!(shadow(&below, far, false), None);
    assert!(shadow(&below, far, true).is_some());
    assert!(shadow(&Hit::MISS, far, true).is_some());
    let somewhere = hit(2, 3.0, f32::NAN, f32::NAN);
    assert_eq!(shadow(&somewhere, light, false), None);
}

#[test]
fn nothing_is_asked_of_single_precision_where_it_overflows_or_vanishes() {
    let judge = squares(0.0);
    let ray = down(1.0, 1.0, 0.0);
    let short = Ray {
        direction: [0.0, 0.0, -1e-30],
        ..ray
    };
    let away = Ray {
        origin: [1e30, 0.0, 0.0],
        ..ray
    };
    assert!(judge.admits(&ray) && !judge.admits(&short) && !judge.admits(&away));
}

/// The only triangle of a case whose light was at a corner. The shadow ray starts on an edge and ends exactly at the
/// corner, and no other triangle is near.
#[test]
fn a_way_that_ends_on_the_triangle_it_began_on_may_be_blocked_by_it_and_by_nothing_else() {
    let corners = [
        [11.84, 9.324, 9.539],
        [11.6004, 9.56, 9.8362],
        [11.8096, 9.2804, 9.2642],
    ];
    let judge = one_of(corners, [8.0; 3]);
    let found = hit(0, 0.999_999_64, 0.256_004_63, 3.488_469e-6);
    let ray = Ray::new([20.0, 0.0, 3.0], [1.0; 3]);
    let shadow = |light, blocked| judge.refutes_shadow(&ray, &found, light, blocked);
    for on_it in [corners[0], corners[2], [11.7202, 9.442, 9.6876]] {
        assert_eq!(shadow(on_it, true), None, "{on_it:?}");
        assert_eq!(shadow(on_it, false), None, "{on_it:?}");
    }
    let beyond = [12.0796, 9.088, 9.2418];
    let above = [11.84, 9.324, 9.5391];
    for beside in [beyond, above, [20.0, 0.0, 3.0]] {
        assert!(shadow(beside, true).is_some(), "{beside:?}");
        assert_eq!(shadow(beside, false), None, "{beside:?}");
    }
}

#[test]
fn a_light_where_the_hit_is_may_be_seen_from_there_or_not() {
    let judge = squares(0.0);
    let (ray, found) = (down(3.0, 1.0, 0.0), hit(0, 2.0, 0.5, 0.25));
    let shadow = |light, blocked| judge.refutes_shadow(&ray, &found, light, blocked);
    for blocked in [false, true] {
        assert_eq!(shadow([3.0, 1.0, 0.0], blocked), None);
    }
    assert!(shadow([3.0, 1.0, 0.01], true).is_some());
}

/// Seed 5, case 233: eye and light are in the triangle's plane, so the start does not move. The light is below the
/// plane by less than a rounding error.
#[test]
fn a_triangle_may_block_its_plane_but_nothing_that_surely_leaves_it() {
    let corners = [
        [0.143_396_85, -0.146_364_03, -0.210_177_81],
        [-0.229_941_31, 0.212_297_2, -0.014_971_614],
        [0.478_527_13, 0.083_719_015, -0.455_925_05],
    ];
    let judge = one_of(corners, [2.0; 3]);
    let found = hit(0, 0.956_547_5, 0.425_609, 0.311_431_62);
    let shadow = |eye, light, blocked| {
        let ray = Ray::new(eye, [1.0; 3]);
        judge.refutes_shadow(&ray, &found, light, blocked)
    };
    let eye = [0.312_263_04, -0.045_061_707, -0.332_136_3];
    let light = [-0.976_617_6, 0.929_619_7, 0.375_440_8];
    assert_eq!(shadow(eye, light, true), None);
    assert_eq!(shadow(eye, light, false), None);
    let ([x, y, z], [a, b, c]) = (eye, light);
    // The eye has a certain side. So the start is off the plane, and the shadow ray crosses the plane outside the
    // triangle.
    assert!(shadow([x, y, z + 1e-4], light, true).is_some());
    // The light has a certain side too.
    assert!(shadow(eye, [a, b, c + 1e-4], true).is_some());
}

#[test]
fn a_triangle_may_block_what_leaves_it_if_it_is_too_thin_for_a_normal() {
    let blocks = |height: f32| {
        let judge = one_of([[0.0; 3], [4.0, 0.0, 0.0], [2.0, height, 0.0]], [4.0; 3]);
        let (ray, found) = (down(2.0, 0.0, 0.0), hit(0, 2.0, 0.25, 0.5));
        judge
            .refutes_shadow(&ray, &found, [2.0, 1.0, 3.0], true)
            .is_none()
    };
    assert!(blocks(1e-5) && !blocks(2.0));
}

/// Returns a triangle in a scene whose extent is determined by a vertex of no triangle.
fn one_of(corners: [Point; 3], far: Point) -> Verifier {
    let [a, b, c] = corners;
    let animation = Animation::new(vec![vec![a, b, c, far]], vec![[0, 1, 2]]);
    Verifier::new(&animation.unwrap(), 0.0)
}

#[test]
fn a_triangle_is_as_far_away_as_its_nearest_point() {
    let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    for (p, far) in [
        ([1.0, 1.0, -3.0], 3.0),
        ([1.0, 1.0, 0.0], 0.0),
        ([-3.0, -4.0, 0.0], 5.0),
        ([3.0, 3.0, 0.0], 2.0_f64.sqrt()),
        ([2.0, -3.0, 4.0], 5.0),
    ] {
        let found = distance_to_triangle(p.into(), &corners.map(DVec3::from));
        assert!((found - far).abs() < 1e-12, "{p:?}: {found}");
    }
}
