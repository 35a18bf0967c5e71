//! Data that nobody should hand in, but somebody will.

use super::{checked, invented, of_points, point, targets, texts};
use crate::{
    Chart, Companions, KeyFrameStep, KeyFrames, Leaks, Point, Scene, Spread, TError, csv, html,
    json,
};
use proptest::prelude::*;

#[test]
fn a_scene_told_of_twice_is_drawn_once() {
    let mut chart = invented::small();
    chart.scenes.push(chart.scenes[0].clone());
    assert_eq!(targets(&checked("twice", &chart)), 16);
}

#[test]
fn no_points_and_one_point_are_charts_too() {
    let picture = checked("empty", &Chart::default());
    assert!(texts(&picture).iter().any(|t| t == "no points"));
    for (name, p) in [("one-right", point(1.0, 0)), ("one-wrong", point(1.0, 5))] {
        assert_eq!(targets(&checked(name, &of_points(vec![p]))), 1);
    }
}

#[test]
fn what_cannot_be_drawn_is_counted() {
    let mut points = vec![
        point(1.0, 0),
        point(f64::NAN, 0),
        point(0.0, 0),
        point(-1.0, 0),
    ];
    points.push(point(f64::INFINITY, 3));
    points.push(Point {
        rays_tested: 0,
        ..point(1.0, 0)
    });
    points.push(Point {
        ms_per_frame: Spread::default(),
        ..point(1.0, 0)
    });
    let picture = checked("unknown", &of_points(points));
    assert_eq!(targets(&picture), 1);
    let note = "6 without a time or tested rays not drawn";
    assert!(
        texts(&picture).iter().any(|t| t == note),
        "{:?}",
        texts(&picture)
    );
}

#[test]
fn unknown_numbers_read_back_as_unknown() {
    let chart = of_points(vec![point(f64::NAN, 1)]);
    let back: Chart = serde_json::from_str(&json(&chart).unwrap()).unwrap();
    assert_eq!(back.points[0].ms_per_frame, Spread::default());
    let table = csv(&chart).unwrap();
    let mut reader = ::csv::Reader::from_reader(table.as_bytes());
    let headers = reader.headers().unwrap().clone();
    let row = reader.records().next().unwrap().unwrap();
    let cell = |name: &str| row[headers.iter().position(|h| h == name).unwrap()].to_owned();
    assert_eq!(
        (
            &*cell("ms_median"),
            &*cell("wrong"),
            &*cell("wrong_per_million")
        ),
        ("", "1", "1")
    );
}

#[test]
fn names_are_words_and_never_markup() {
    let name = "<script>alert(\"&amp;\")</script>'\u{1}\u{0}\n</title>]]>";
    let mut chart = invented::small();
    chart.title = name.to_owned();
    chart.machine.cpu = Some(name.to_owned());
    chart.machine.adapters[0].adapter = name.to_owned();
    chart.scenes[0].name = name.to_owned();
    chart.companions.key_frames[0].scene = name.to_owned();
    for p in &mut chart.points {
        p.scene = name.to_owned();
        p.command = format!("abvh render {name}");
        p.update = name.to_owned();
    }
    chart.points[0].backend = name.to_owned();
    chart.points[1].intersector = name.to_owned();
    chart.points[2].layout = name.to_owned();
    checked("markup", &chart);
    let page = html(&chart).unwrap();
    // The page's own script and nobody else's.
    assert_eq!(page.matches("<script").count(), 1);
    assert!(page.contains("&lt;script&gt;alert(&quot;&amp;amp;&quot;)"));
    let table = csv(&chart).unwrap();
    let row = ::csv::Reader::from_reader(table.as_bytes())
        .into_records()
        .next()
        .unwrap()
        .unwrap();
    assert_eq!(&row[0], name);
}

#[test]
fn two_hundred_crowded_points_keep_their_labels_apart() {
    let points = (0..200).map(|i| Point {
        backend: format!("backend{}", i % 9),
        layout: format!("layout{}", i % 5),
        intersector: format!("test{}", i % 8),
        update: format!("update{}", i % 7),
        ..point(1.0 + f64::from(i % 20) * 0.01, (i / 20) as u64)
    });
    let picture = checked("crowded", &of_points(points.collect()));
    assert_eq!(targets(&picture), 200);
    assert!(
        texts(&picture)
            .iter()
            .any(|t| t.starts_with("no room for the labels of"))
    );
}

#[test]
fn absurd_ranges_are_drawn() {
    let mut points = vec![point(5e-324, 1), point(f64::MAX, 1), point(1.0, 0)];
    points.push(Point {
        rays_tested: u64::MAX,
        wrong: u64::MAX,
        ..point(1e-9, 0)
    });
    points.push(Point {
        rays_tested: 1,
        wrong: u64::MAX,
        memory_bytes: Some(u64::MAX),
        ..point(1.0, 0)
    });
    points.push(Point {
        rays_tested: u64::MAX,
        wrong: 1,
        memory_bytes: Some(0),
        ..point(1.0, 0)
    });
    points[0].t_error_ulp = Some(TError {
        median: Some(f64::NAN),
        p999: Some(0.0),
        worst: Some(f64::MAX),
    });
    points[0].leaks = vec![
        Leaks {
            offset: Some(f64::INFINITY),
            rays: 1,
            leaks: 1,
            counted: 1,
            double_hits: 0,
        },
        Leaks {
            offset: Some(-1e300),
            rays: u64::MAX,
            leaks: 1,
            counted: 3,
            double_hits: u64::MAX,
        },
        Leaks {
            offset: Some(0.1),
            rays: 0,
            leaks: 9,
            counted: 9,
            double_hits: 9,
        },
        Leaks {
            offset: None,
            rays: 9,
            leaks: 9,
            counted: 9,
            double_hits: 9,
        },
    ];
    let mut chart = of_points(points);
    let step = |tolerance, max_error, ms| KeyFrameStep {
        tolerance,
        max_error,
        ms,
        key_frames: u64::MAX,
    };
    chart.companions.key_frames = vec![KeyFrames {
        scene: "s".to_owned(),
        steps: vec![
            step(Some(1e-300), Some(0.0), Some(1e300)),
            step(Some(1e300), Some(1e-300), Some(f64::NAN)),
            step(Some(0.0), Some(1.0), Some(1.0)),
            step(None, None, None),
        ],
    }];
    assert_eq!(targets(&checked("absurd", &chart)), 6);
}

#[test]
fn long_names_do_not_push_others_away() {
    let long = "name-that-never-ends ".repeat(30);
    let mut chart = invented::small();
    chart.title = long.clone();
    chart.machine.cpu = Some(long.clone());
    chart.scenes[0].name = long.clone();
    for p in &mut chart.points {
        p.scene = long.clone();
    }
    chart.points[3].backend = long.clone();
    chart.points[5].update = long;
    assert_eq!(targets(&checked("long", &chart)), 16);
}

fn any_point() -> impl Strategy<Value = Point> {
    let name = prop::sample::select(vec!["cpu", "vulkan", "", "a<b", "é"]);
    let names = (name.clone(), name.clone(), name.clone(), name);
    let numbers = (
        any::<[Option<f64>; 3]>(),
        any::<[u64; 3]>(),
        any::<[Option<f64>; 3]>(),
    );
    let leaks = (any::<Option<f64>>(), any::<[u64; 4]>());
    (names, numbers, prop::collection::vec(leaks, 0..3)).prop_map(|(names, numbers, leaks)| Point {
        backend: names.0.to_owned(),
        layout: names.1.to_owned(),
        intersector: names.2.to_owned(),
        update: names.3.to_owned(),
        scene: names.0.to_owned(),
        ms_per_frame: Spread {
            median: numbers.0[0],
            p5: numbers.0[1],
            p95: numbers.0[2],
        },
        rays_tested: numbers.1[0],
        wrong: numbers.1[1],
        wrong_shadow: numbers.1[2],
        t_error_ulp: Some(TError {
            median: numbers.2[0],
            p999: numbers.2[1],
            worst: numbers.2[2],
        }),
        leaks: leaks
            .into_iter()
            .map(|(offset, [rays, leaks, counted, double_hits])| Leaks {
                offset,
                rays,
                leaks,
                counted,
                double_hits,
            })
            .collect(),
        memory_bytes: Some(numbers.1[0]),
        ..Point::default()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_points_at_all_make_a_chart(points in prop::collection::vec(any_point(), 0..12)) {
        let mut chart = of_points(points);
        chart.scenes = vec![Scene::default()];
        chart.companions = Companions::default();
        checked("any", &chart);
    }
}
