//! Whole charts: invented numbers in, files out.

mod invented;
mod odd;

use crate::{Chart, Point, Spread, csv, html, json, svg};
use roxmltree::Document;

/// Everything in one: that it is made at all, that the picture is XML, and that nothing reaches beyond it.
fn checked(name: &str, chart: &Chart) -> String {
    let picture = svg(chart).unwrap();
    let page = html(chart).unwrap();
    keep(name, &picture, &page);
    let document = Document::parse(&picture).unwrap_or_else(|e| panic!("{name}: {e}"));
    // Every stretch of SVG within the page.
    for inside in page.split("<svg").skip(1) {
        let inside = inside.split_once("</svg>").unwrap().0;
        Document::parse(&format!("<svg{inside}</svg>")).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    assert_eq!(
        page.matches("class=\"target\"").count(),
        targets(&picture),
        "{name}"
    );
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
        "Pareto front",
        "leaks per 10⁹ rays",
        "double hits per 10⁹ rays",
        "units in the last place (f32)",
        "wrong shadows per million rays",
        "MiB",
        "largest error / diagonal",
    ] {
        assert!(
            texts.iter().any(|t| t == words),
            "{words} is missing from {texts:?}"
        );
    }
}

/// Where the points are, in pixels.
fn places(picture: &str) -> Vec<(i32, i32)> {
    let document = Document::parse(picture).unwrap();
    let targets = document
        .descendants()
        .filter(|n| n.attribute("pointer-events").is_some());
    let read = |n: roxmltree::Node<'_, '_>, name| n.attribute(name).unwrap().parse().unwrap();
    targets.map(|n| (read(n, "cx"), read(n, "cy"))).collect()
}

#[test]
fn faster_is_left_and_fewer_wrong_is_lower() {
    let points = [(1.0, 100), (2.0, 10), (4.0, 1), (8.0, 0), (16.0, 0)];
    let picture = svg(&of_points(
        points.map(|(ms, wrong)| point(ms, wrong)).into(),
    ))
    .unwrap();
    let places = places(&picture);
    for (a, b) in [(0, 1), (1, 2), (2, 3)] {
        assert!(places[a].0 < places[b].0 && places[a].1 < places[b].1);
    }
    // Equal ratios are equal distances, but for the rounding of pixels.
    let gap = |a: usize, b: usize| (places[b].0 - places[a].0, places[b].1 - places[a].1);
    assert!((gap(0, 1).0 - gap(2, 3).0).abs() <= 1 && (gap(0, 1).1 - gap(1, 2).1).abs() <= 1);
    assert_eq!(places[3].1, places[4].1, "none wrong is one place");
    // The whisker of none in a million ends at 3 per million: as far above 1 as log 3 is of a decade.
    let top = places[2].1 - (f64::from(gap(1, 2).1) * 3f64.log10()).round() as i32;
    let drawn = (-1..=1).any(|d| {
        let words = format!(
            "points=\"{0},{1} {0},{2} \"",
            places[3].0,
            places[3].1,
            top + d
        );
        picture.contains(&words)
    });
    assert!(drawn);
    // Of 4 ms, 5 to 95 % are 2 to 8 ms, where the neighbours stand.
    let y = places[2].1;
    let time = format!("points=\"{},{y} {},{y} \"", places[1].0, places[3].0);
    assert!(picture.contains(&time), "{time}");
}

#[test]
fn the_front_is_the_same_in_every_file() {
    let chart = invented::small();
    let table = csv(&chart).unwrap();
    let mut reader = ::csv::Reader::from_reader(table.as_bytes());
    let column = reader
        .headers()
        .unwrap()
        .iter()
        .position(|h| h == "on_front")
        .unwrap();
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    let front: Vec<String> = rows
        .iter()
        .zip(&chart.points)
        .filter(|(row, _)| &row[column] == "1")
        .map(|(_, p)| p.name())
        .collect();
    let expected = ["moller-trumbore", "woop", "watertight", "exact"];
    assert_eq!(front, expected.map(|i| format!("vulkan fast {i} async")));
    let texts = texts(&svg(&chart).unwrap());
    assert!(front.iter().all(|name| texts.contains(name)), "{texts:?}");
    assert_eq!(html(&chart).unwrap().matches("<td>★</td>").count(), 4);
    // Each scene has a front of its own, however slow it is beside the others.
    let two = html(&invented::chart(2)).unwrap();
    assert_eq!(two.matches("<td>★</td>").count(), 8);
}

#[test]
fn every_text_stays_within_the_picture() {
    let mut crowd = invented::chart(1);
    for (i, point) in crowd.points.iter_mut().enumerate() {
        point.backend = format!("backend number {}", i % 14);
    }
    for chart in [
        invented::small(),
        invented::chart(1),
        invented::chart(4),
        crowd,
    ] {
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
