//! Whole charts: invented numbers in, files out.

mod invented;

use crate::{
    Chart, Companions, KeyFrameStep, KeyFrames, Leaks, Point, Scene, Spread, TError, csv, html,
    json, svg,
};
use proptest::prelude::*;
use roxmltree::Document;

/// Everything in one: that it is made at all, that the picture is XML, and that nothing reaches beyond it.
fn checked(name: &str, chart: &Chart) -> String {
    let picture = svg(chart).unwrap();
    let page = html(chart).unwrap();
    keep(name, &picture, &page);
    let document = Document::parse(&picture).unwrap_or_else(|e| panic!("{name}: {e}"));
    let inside = page
        .split_once("<svg")
        .unwrap()
        .1
        .split_once("</svg>")
        .unwrap()
        .0;
    Document::parse(&format!("<svg{inside}</svg>")).unwrap_or_else(|e| panic!("{name}: {e}"));
    for node in document.descendants() {
        for a in node.attributes() {
            assert!(
                !a.value().contains("NaN") && !a.value().contains("inf"),
                "{name}: {a:?}"
            );
        }
    }
    assert!(!page.contains("src=") && !page.contains("<link") && !page.contains("@import"));
    let rows = ::csv::Reader::from_reader(csv(chart).unwrap().as_bytes())
        .into_records()
        .map(Result::unwrap)
        .count();
    assert_eq!(rows, chart.points.len());
    picture
}

/// `ABVH_KEEP_CHARTS=DIR` keeps the pictures, to be looked at.
fn keep(name: &str, picture: &str, page: &str) {
    if let Some(dir) = std::env::var_os("ABVH_KEEP_CHARTS") {
        let dir = std::path::PathBuf::from(dir);
        std::fs::write(dir.join(format!("{name}.svg")), picture).unwrap();
        std::fs::write(dir.join(format!("{name}.html")), page).unwrap();
    }
}

/// Every text of a picture, in order.
fn texts(picture: &str) -> Vec<String> {
    let document = Document::parse(picture).unwrap();
    let texts = document.descendants().filter(|n| n.has_tag_name("text"));
    texts
        .filter_map(|n| n.text())
        .map(|t| t.trim().to_owned())
        .collect()
}

fn targets(picture: &str) -> usize {
    let document = Document::parse(picture).unwrap();
    document
        .descendants()
        .filter(|n| n.attribute("pointer-events").is_some())
        .count()
}

fn of_points(points: Vec<Point>) -> Chart {
    Chart {
        title: "t".to_owned(),
        points,
        ..Chart::default()
    }
}

fn point(ms: f64, wrong: u64) -> Point {
    Point {
        backend: "cpu".to_owned(),
        intersector: "exact".to_owned(),
        ms_per_frame: Spread {
            median: Some(ms),
            p5: Some(ms / 2.0),
            p95: Some(ms * 2.0),
        },
        rays_tested: 1_000_000,
        wrong,
        ..Point::default()
    }
}

#[test]
fn full_and_small_sets_are_drawn_whole() {
    let small = checked("small", &invented::small());
    assert_eq!(targets(&small), 16);
    assert_eq!(targets(&checked("full", &invented::chart(1))), 72);
    assert_eq!(targets(&checked("three", &invented::chart(3))), 216);
    let texts = texts(&small);
    for words in [
        "milliseconds a frame (median)",
        "wrong answers per million rays",
        "none in",
        "2.30\u{a0}M",
        "vulkan fast exact async",
        "Pareto front: nothing is faster and as right",
        "leaks per 10⁹ edge-aimed rays",
        "double hits per 10⁹ edge-aimed rays",
        "units in the last place (f32)",
        "wrong shadows per million rays",
        "MiB",
        "largest error / scene's diagonal",
    ] {
        assert!(
            texts.iter().any(|t| t == words),
            "{words} is missing from {texts:?}"
        );
    }
}

#[test]
fn every_text_stays_within_the_picture() {
    for chart in [invented::small(), invented::chart(1), invented::chart(4)] {
        let picture = svg(&chart).unwrap();
        let document = Document::parse(&picture).unwrap();
        for node in document.descendants().filter(|n| n.has_tag_name("text")) {
            let read = |name: &str| node.attribute(name).unwrap().parse::<f64>().unwrap();
            let words = node.text().unwrap_or("").trim();
            if node.attribute("transform").is_some() {
                continue;
            }
            let wide = f64::from(crate::text::width(words, read("font-size").round() as i32));
            let left = match node.attribute("text-anchor").unwrap() {
                "start" => read("x"),
                "middle" => read("x") - wide / 2.0,
                _ => read("x") - wide,
            };
            assert!(
                left >= 0.0 && left + wide <= 1000.0,
                "{words:?} from {left}, {wide} wide"
            );
        }
    }
}

#[test]
fn equal_charts_give_equal_bytes_and_json_reads_back() {
    let chart = invented::chart(2);
    assert_eq!(svg(&chart).unwrap(), svg(&chart.clone()).unwrap());
    assert_eq!(html(&chart).unwrap(), html(&chart.clone()).unwrap());
    assert_eq!(csv(&chart).unwrap(), csv(&chart.clone()).unwrap());
    let text = json(&chart).unwrap();
    assert_eq!(serde_json::from_str::<Chart>(&text).unwrap(), chart);
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["schema"],
        1
    );
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
            .any(|t| t.ends_with("without a label for want of room"))
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
            double_hits: 0,
        },
        Leaks {
            offset: Some(-1e300),
            rays: u64::MAX,
            leaks: 1,
            double_hits: u64::MAX,
        },
        Leaks {
            offset: Some(0.1),
            rays: 0,
            leaks: 9,
            double_hits: 9,
        },
        Leaks {
            offset: None,
            rays: 9,
            leaks: 9,
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
    let leaks = (any::<Option<f64>>(), any::<[u64; 3]>());
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
            .map(|(offset, [rays, leaks, double_hits])| Leaks {
                offset,
                rays,
                leaks,
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
