use super::*;
use crate::data::Adapter;
use roxmltree::Document;

fn point(triangles: u64, update: &str, layout: &str, ms: f64) -> GrowthPoint {
    GrowthPoint {
        triangles,
        update: update.to_owned(),
        layout: layout.to_owned(),
        frame_ms: Some(ms),
        first_ms: Some(30.0 * ms),
        device_bytes: Some(90_u64.saturating_mul(triangles)),
    }
}

fn growth(points: Vec<GrowthPoint>) -> Growth {
    Growth {
        title: "Growth <of> demo:twist".to_owned(),
        machine: Machine {
            cpu: Some("a cpu".to_owned()),
            version: "1".to_owned(),
            date: "today".to_owned(),
            adapters: vec![Adapter {
                backend: "vulkan".to_owned(),
                adapter: "a card".to_owned(),
                driver: String::new(),
            }],
        },
        size: [1280, 720],
        points,
    }
}

/// Circles of a picture with the fill of a policy.
fn circles(picture: &str, colour: &str) -> Vec<(f64, f64)> {
    let document = Document::parse(picture).unwrap();
    let all = document.descendants();
    let of = all.filter(|n| {
        let fill = n
            .attribute("fill")
            .is_some_and(|f| f.eq_ignore_ascii_case(colour));
        n.has_tag_name("circle") && fill
    });
    let read = |n: roxmltree::Node<'_, '_>, name| n.attribute(name).unwrap().parse().unwrap();
    of.map(|n| (read(n, "cx"), read(n, "cy"))).collect()
}

#[test]
fn more_triangles_are_right_and_slower_is_higher() {
    let sizes = [10_000, 100_000, 1_000_000];
    // Given in disorder.
    let points = [2, 0, 1].map(|i| point(sizes[i], "async", "fast", [0.1, 0.4, 1.6][i]));
    let picture = growth_svg(&growth(points.into())).unwrap();
    let places = circles(&picture, "#0072B2");
    // A legend's, three of time, three of memory, three of start-up.
    assert_eq!(places.len(), 10, "{places:?}");
    let time = &places[1..4];
    assert!(time[0].0 < time[1].0 && time[1].0 < time[2].0, "{time:?}");
    assert!(time[0].1 > time[1].1 && time[1].1 > time[2].1, "{time:?}");
    let step = |i: usize| (time[i + 1].0 - time[i].0, time[i].1 - time[i + 1].1);
    let ((x0, y0), (x1, y1)) = (step(0), step(1));
    assert!(
        (x0 - x1).abs() <= 2.0 && (y0 - y1).abs() <= 2.0,
        "equal ratios are equal ways: {time:?}"
    );
    for name in [">20k<", ">100k<", ">1M<"] {
        let names = picture.split_whitespace().collect::<String>();
        assert!(names.contains(name), "{name}");
    }
    let memory = &places[4..7];
    assert!((memory[0].1 - memory[2].1).abs() < 1.0, "{memory:?}");
}

#[test]
fn whatever_is_missing_or_absurd_is_left_out() {
    let mut odd = point(0, "async", "fast", 1.0);
    odd.frame_ms = Some(f64::NAN);
    let nothing = GrowthPoint::default();
    let huge = point(u64::MAX, "new", "other", f64::INFINITY);
    for points in [
        vec![],
        vec![odd, nothing, huge],
        vec![point(5, "t-sah", "bvh2", 1e-300)],
    ] {
        let growth = growth(points);
        Document::parse(&growth_svg(&growth).unwrap()).unwrap();
    }
}

#[test]
fn equal_data_give_equal_bytes() {
    let growth = growth(vec![point(10_000, "refit", "bvh2", 0.25)]);
    assert_eq!(
        growth_svg(&growth).unwrap(),
        growth_svg(&growth.clone()).unwrap()
    );
}
