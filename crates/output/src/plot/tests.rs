//! Tests of whole charts with invented numbers.

use super::*;
use proptest::prelude::*;
use roxmltree::{Document, Node};

/// Names of backends, intersectors and updates with relative costs. Intersectors also have wrong answers per
/// million rays.
const BACKENDS: [(&str, f64); 3] = [("cpu", 60.0), ("vulkan", 1.1), ("wgpu", 1.5)];
const INTERSECTORS: [(&str, f64, u64); 4] = [
    ("moller-trumbore", 1.0, 820),
    ("woop", 0.93, 2600),
    ("watertight", 1.12, 11),
    ("exact", 1.31, 0),
];
const UPDATES: [(&str, f64); 3] = [("rebuild", 9.0), ("refit", 1.5), ("async", 1.0)];

/// Returns a chart of every method on every backend for `scenes` scenes. All numbers are invented.
fn invented(scenes: usize) -> Chart {
    let mut chart = of_points([]);
    chart.scenes.clear();
    for (scene, slower) in ["grove", "collide", "twist"].iter().zip(1..).take(scenes) {
        chart.scenes.push(ChartScene {
            name: scene.to_string(),
            triangles: 174_312,
            size: [1280, 800],
            frames: 32,
        });
        chart.points.extend((0..36).map(|method| {
            let (backend, slow) = BACKENDS[method / 12];
            let (intersector, cost, wrong) = INTERSECTORS[method / 3 % 4];
            let (update, waits) = UPDATES[method % 3];
            let ms = f64::from(slower) * slow * cost * waits;
            ChartPoint {
                backend: backend.to_owned(),
                update: update.to_owned(),
                intersector: intersector.to_owned(),
                scene: scene.to_string(),
                mixed_range: vec![FamilyCounts {
                    family: "outlier".to_owned(),
                    rays: 9000,
                    wrong,
                }],
                memory_bytes: Some(90 << 20),
                ..point(ms, wrong)
            }
        }));
    }
    chart
}

fn point(ms: f64, wrong: u64) -> ChartPoint {
    ChartPoint {
        backend: "cpu".to_owned(),
        intersector: "exact".to_owned(),
        ms_per_frame: TimeSpread {
            median: ms,
            p5: ms / 2.0,
            p95: ms * 2.0,
        },
        rays_tested: 1_000_000,
        wrong,
        ..ChartPoint::default()
    }
}

/// Returns a chart of the points of one unnamed scene.
fn of_points(points: impl IntoIterator<Item = ChartPoint>) -> Chart {
    let adapter = |backend: &str| Adapter {
        backend: backend.to_owned(),
        adapter: "Invented GPU X200".to_owned(),
        driver: String::new(),
    };
    Chart {
        machine: Machine {
            cpu: Some("Invented CPU 9000".to_owned()),
            version: "0.1.0".to_owned(),
            date: "2026-01-01".to_owned(),
            adapters: vec![adapter("vulkan"), adapter("wgpu")],
        },
        points: points.into_iter().collect(),
        scenes: vec![ChartScene::default()],
        failures: Vec::new(),
    }
}

/// Renders the picture, the page and the CSV. Checks that the picture is XML without NaN or infinity. Checks that the
/// page loads no other file, and that every point has a row. Returns the picture.
fn checked(chart: &Chart) -> String {
    let (picture, page) = (svg(chart).unwrap(), html(chart).unwrap());
    let document = Document::parse(&picture).unwrap();
    for a in document.descendants().flat_map(|n| n.attributes()) {
        let is_not_finite = a.value().contains("NaN") || a.value().contains("inf");
        assert!(!is_not_finite, "{a:?}");
    }
    assert!(page.contains(&picture));
    assert!(!page.contains("src=") && !page.contains("<link") && !page.contains("@import"));
    assert_eq!(page.matches("<tr><td>").count(), chart.points.len());
    let rows = chart.points.len() + chart.failures.len();
    assert_eq!(records(chart).1.len(), rows);
    picture
}

/// Returns the header and the rows of the CSV.
fn records(chart: &Chart) -> (csv::StringRecord, Vec<csv::StringRecord>) {
    let table = super::csv(chart).unwrap();
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let head = reader.headers().unwrap().clone();
    (head, reader.into_records().map(|r| r.unwrap()).collect())
}

fn cell(chart: &Chart, row: usize, name: &str) -> String {
    let (head, rows) = records(chart);
    rows[row][head.iter().position(|h| h == name).unwrap()].to_owned()
}

fn texts(picture: &str) -> Vec<String> {
    let document = Document::parse(picture).unwrap();
    let texts = document.descendants().filter(|n| n.has_tag_name("text"));
    let trimmed = texts.filter_map(|n| Some(n.text()?.trim().to_owned()));
    trimmed.collect()
}

fn number_of<T: std::str::FromStr>(node: Node<'_, '_>, name: &str) -> T {
    node.attribute(name).and_then(|a| a.parse().ok()).unwrap()
}

/// Returns the pixel positions of the points in all scatter plots.
fn places(picture: &str) -> Vec<(i32, i32)> {
    let document = Document::parse(picture).unwrap();
    let nodes = document.descendants();
    let targets = nodes.filter(|n| n.has_attribute("pointer-events"));
    let places = targets.map(|n| (number_of(n, "cx"), number_of(n, "cy")));
    places.collect()
}

#[test]
fn rates_have_confidence_intervals() {
    // For 0 of a million, the rule of three applies. For 10 of 100, Wilson's formula gives 0.0552 to 0.1744.
    for (wrong, tested, expected) in [
        (0, 1_000_000, [0.0, 0.0, 3.0]),
        (0, 2, [0.0, 0.0, 1e6]),
        (10, 100, [1e5, 55_230.0, 174_370.0]),
        (u64::MAX, u64::MAX, [1e6, 1e6, 1e6]),
    ] {
        let r = Rate::of(wrong, tested).unwrap();
        let off = [r.value, r.low, r.high].into_iter().zip(expected);
        assert!(off.map(|(a, b)| (a - b).abs()).all(|d| d < 10.0), "{r:?}");
    }
    assert_eq!(Rate::of(0, 0), None);
    // If more answers are wrong than were tested, all count as wrong.
    let r = Rate::of(9, 3).unwrap();
    assert!(r.value == 1e6 && r.high == 1e6 && r.low > 2e5 && r.low < 1e6);
}

#[test]
fn draws_and_labels_every_point() {
    for scenes in [1, 3] {
        assert_eq!(places(&checked(&invented(scenes))).len(), 36 * scenes);
    }
    let texts = texts(&checked(&invented(1)));
    for words in [
        "Invented CPU 9000 · abvh 0.1.0 · 2026-01-01",
        "vulkan: Invented GPU X200",
        "grove: 174,312 triangles, 1280 x 800 pixels, 32 frames",
        "milliseconds a frame: median, 5 to 95 %",
        "wrong answers per million rays, 95 % interval",
        "none",
        "moller-trumbore",
        "1 vulkan woop async",
        "4 vulkan exact async",
        "Pareto front",
        "edges and vertices",
        "outlier",
    ] {
        assert!(texts.iter().any(|t| t == words), "{words}: {texts:?}");
    }
}

#[test]
fn better_points_are_lower_left() {
    let points = [(1.0, 100), (2.0, 10), (4.0, 1), (8.0, 0), (16.0, 0)];
    let picture = svg(&of_points(points.map(|(ms, wrong)| point(ms, wrong)))).unwrap();
    let places = places(&picture);
    for (a, b) in [(0, 1), (1, 2), (2, 3)] {
        assert!(places[a].0 < places[b].0 && places[a].1 < places[b].1);
    }
    // Equal ratios are equal distances, up to pixel rounding.
    let gap = |a: usize, b: usize| (places[b].0 - places[a].0, places[b].1 - places[a].1);
    assert!((gap(0, 1).0 - gap(2, 3).0).abs() <= 1 && (gap(0, 1).1 - gap(1, 2).1).abs() <= 1);
    assert_eq!(
        places[3].1, places[4].1,
        "points without wrong answers have one position"
    );
    let document = Document::parse(&picture).unwrap();
    let has_line = |a: (i32, i32), b: (i32, i32)| {
        let ends = |n| ["x1", "y1", "x2", "y2"].map(|name| number_of::<i32>(n, name));
        let mut lines = document.descendants().filter(|n| n.has_tag_name("line"));
        lines.any(|n| ends(n) == [a.0, a.1, b.0, b.1])
    };
    // The interval of 0 in a million ends at 3 per million, which is log10(3) decades above 1 per million.
    let (x, none) = places[3];
    let top = places[2].1 - (f64::from(gap(1, 2).1) * 3_f64.log10()).round() as i32;
    assert!((-1..=1).any(|d| has_line((x, none), (x, top + d))));
    // For a median of 4 ms, the 5 to 95 % interval is 2 to 8 ms, where the neighbouring points are.
    let y = places[2].1;
    assert!(has_line((places[1].0, y), (places[3].0, y)));
}

#[test]
fn front_agrees_across_output_formats() {
    let chart = invented(2);
    let starred = (0..chart.points.len()).filter(|&i| cell(&chart, i, "on_front") == "1");
    let names: Vec<_> = starred.map(|i| chart.points[i].name()).collect();
    // Each scene has its own front, even if it is slower than the others.
    let expected = ["moller-trumbore", "woop", "watertight", "exact"];
    let expected = expected.map(|i| format!("vulkan {i} async"));
    assert_eq!(names, [expected.clone(), expected].concat());
    let texts = texts(&svg(&chart).unwrap());
    let is_named = |name: &String| texts.iter().any(|t| t.ends_with(name));
    assert!(names.iter().all(is_named), "{texts:?}");
    assert_eq!(html(&chart).unwrap().matches("<td>★</td>").count(), 8);
}

#[test]
fn csv_columns_are_stable() {
    let (head, _) = records(&Chart::default());
    let expected = "scene triangles backend adapter driver intersector update samples ms_median ms_p5 ms_p95 \
        mrays_per_s rays_tested wrong wrong_per_million wrong_per_million_low wrong_per_million_high on_front \
        wrong_shadow aimed_rays aimed_wrong memory_bytes cpu version date schema error";
    assert_eq!(head.iter().collect::<Vec<_>>().join(" "), expected);
    let chart = invented(1);
    let mut points = chart.points.iter();
    let woop = points.position(|p| p.intersector == "woop").unwrap();
    for (name, expected) in [
        ("rays_of_outlier", "9000"),
        ("wrong_of_outlier", "2600"),
        ("wrong", "2600"),
    ] {
        assert_eq!(cell(&chart, woop, name), expected);
    }
    assert_eq!(row(&chart.points[woop])[10].1, "2,600 of 9,000");
}

#[test]
fn failures_appear_in_every_table() {
    let mut chart = invented(1);
    chart.failures.push(Failure {
        scene: "grove".to_owned(),
        backend: "wgpu".to_owned(),
        intersector: "woop".to_owned(),
        update: "refit".to_owned(),
        rays: None,
        error: "device <lost>".to_owned(),
    });
    checked(&chart);
    let last = chart.points.len();
    for (name, expected) in [
        ("backend", "wgpu"),
        ("update", "refit"),
        ("error", "device <lost>"),
        ("ms_median", ""),
        ("wrong_of_outlier", ""),
    ] {
        assert_eq!(cell(&chart, last, name), expected);
    }
    assert_eq!(cell(&chart, 0, "error"), "");
    let page = html(&chart).unwrap();
    let item = "<li>grove wgpu woop refit failed: device &lt;lost&gt;</li>";
    assert!(page.contains(item), "{page}");
    let json: serde_json::Value = serde_json::from_str(&json(&chart).unwrap()).unwrap();
    assert_eq!(json["failures"][0]["error"], "device <lost>");
}

#[test]
fn counts_points_that_are_not_drawn() {
    let chart = of_points([point(1.0, 3), point(0.0, 3)]);
    let picture = checked(&chart);
    assert_eq!(places(&picture).len(), 1);
    let note = "(1 not drawn: no time or no tested rays)";
    let drawn = texts(&picture);
    assert!(drawn.iter().any(|t| t.ends_with(note)), "{drawn:?}");
    checked(&Chart::default());
}

#[test]
fn names_are_escaped_and_truncated() {
    let markup = "<script>alert(\"&amp;\")</script>'\u{1}\u{0}\n</title>]]>";
    for name in [markup.to_owned(), "name-that-never-ends ".repeat(30)] {
        let mut chart = invented(1);
        chart.machine.cpu = Some(name.clone());
        chart.scenes[0].name.clone_from(&name);
        let points = chart.points.iter_mut();
        points.for_each(|p| p.scene.clone_from(&name));
        chart.points[0].backend.clone_from(&name);
        chart.points[1].intersector.clone_from(&name);
        chart.points[2].update.clone_from(&name);
        assert_eq!(places(&checked(&chart)).len(), 36);
        assert_eq!(cell(&chart, 0, "scene"), name);
        assert!(!html(&chart).unwrap().contains("<script"));
    }
}

#[test]
fn texts_fit_within_the_picture() {
    let picture = svg(&invented(2)).unwrap();
    let document = Document::parse(&picture).unwrap();
    let texts = document.descendants().filter(|n| n.has_tag_name("text"));
    for node in texts.filter(|n| !n.has_attribute("transform")) {
        let words = node.text().unwrap_or("").trim();
        // Approximate width of sans-serif letters.
        let wide = 0.56 * number_of::<f64>(node, "font-size") * words.chars().count() as f64;
        let left = number_of::<f64>(node, "x")
            - match node.attribute("text-anchor") {
                Some("start") => 0.0,
                Some("middle") => wide / 2.0,
                _ => wide,
            };
        let fits = left >= 0.0 && left + wide <= 1000.0;
        assert!(fits, "{words:?} from {left}, {wide} wide");
    }
}

#[test]
fn draws_extreme_values() {
    let most = u64::MAX;
    let mut points: Vec<_> = [(5e-324, 1), (f64::MAX, 1), (1e-9, most)]
        .map(|(ms, wrong)| point(ms, wrong))
        .into();
    points[0].rays_tested = most;
    points[0].memory_bytes = Some(most);
    points[1].aimed = Aimed {
        rays: most,
        wrong: most,
    };
    assert_eq!(places(&checked(&of_points(points))).len(), 3);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn front_excludes_only_dominated_points(
        pairs in prop::collection::vec((1_u8..9, 0_u8..9), 0..40)
    ) {
        let points = pairs.iter().map(|&(ms, wrong)| point(f64::from(ms), u64::from(wrong)));
        let chart = of_points(points);
        let found: Vec<usize> = chart.front("").iter().map(|d| d.index).collect();
        for (i, p) in pairs.iter().enumerate() {
            let is_beaten = pairs.iter().enumerate().any(|(j, q)| {
                q.0 <= p.0 && q.1 <= p.1 && (q != p || j < i)
            });
            prop_assert_eq!(found.contains(&i), !is_beaten);
        }
    }
}
