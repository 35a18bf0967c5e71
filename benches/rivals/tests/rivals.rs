//! Tests every rival: its hits, its times, its rows in `abvh bench` and its points in `abvh chart`. Also tests what is
//! reported if a rival is absent.
//!
//! A rival that this machine lacks shows as ignored, with the reason. `ABVH_REQUIRE_RIVALS=vulkan-rt,embree` turns its
//! absence into a failure. The Vulkan driver runs under the validation layers where they are installed, and any message
//! is a failure.

use backend::{FrameReport, Hits, Intersector, Query, QueryKind, Rays};
use conformance::stage::open;
use geom::{Animation, Camera, CameraPose, Point, Pose, Ray};
use gpu_common::{Options, Validation};
use integration::{program, stage};
use rivals::vulkan_rt::VulkanRt;
use rivals::{Rival, RivalName, TreeUpdate};
use std::ffi::OsStr;
use std::process::ExitCode;
use std::sync::Arc;

/// The largest share of rays whose triangle or shadow may differ from ours.
const SHARE: f64 = 0.002;
const SIZE: [u32; 2] = [160, 100];

type Test = (&'static str, fn(RivalName));

const TESTS: &[Test] = &[
    ("hits_match_ours_almost_everywhere", hits),
    ("non_finite_triangles_are_not_hit", not_finite),
    ("far_triangle_changes_no_shadow", far_triangle),
    ("query_kinds_agree", queries),
    ("unchanged_pose_skips_tree_update", times),
    ("bench_reports_rows_and_difference", rows),
    ("chart_includes_the_rival", points),
];

fn main() -> ExitCode {
    let arguments = integration::arguments();
    let required = std::env::var("ABVH_REQUIRE_RIVALS").unwrap_or_default();
    let mut trials = vec![
        integration::trial("unknown_adapter_is_reported", unknown_adapter),
        integration::trial("absent_rival_reports_its_reason", absent),
    ];
    for rival in RivalName::ALL {
        let family = rival.name().split(':').next();
        let is_required = required.split(',').any(|name| Some(name) == family);
        let absent = rival.adapters().err().map(|e| e.to_string());
        for &(name, test) in TESTS {
            let trial = integration::trial(format!("{rival}::{name}"), move || test(rival));
            trials.push(match &absent {
                Some(why) if !is_required => trial.with_kind(why).with_ignored_flag(true),
                _ => trial,
            });
        }
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}

/// A rival with a scene.
struct Subject(Box<dyn Rival>);

impl Subject {
    fn load(rival: RivalName, animation: &Arc<Animation>, tree_update: TreeUpdate) -> Self {
        let options = Options {
            validation: Validation::IfInstalled,
            ..Options::default()
        };
        let mut opened: Box<dyn Rival> = match rival {
            RivalName::Embree => rival.open(None, 2).unwrap(),
            _ => Box::new(VulkanRt::new(&options, rival).unwrap()),
        };
        opened.load(Arc::clone(animation), tree_update).unwrap();
        Self(opened)
    }

    fn trace(&mut self, pose: Pose, query: Query<'_>) -> (Hits, FrameReport) {
        let (rays, light) = (query.rays, query.kind.light());
        let report = self.0.frame(pose, rays, light).unwrap();
        let hits = self.0.hits().unwrap().clone();
        assert_eq!(self.0.complaints(), [""; 0]);
        (hits, report)
    }
}

/// A scene with a camera and a light.
struct Shot {
    animation: Arc<Animation>,
    camera: Camera,
    light: Point,
}

impl Shot {
    fn of(animation: Arc<Animation>) -> Self {
        Self {
            camera: stage::camera(&animation, SIZE),
            light: stage::light(&animation),
            animation,
        }
    }

    fn demo() -> Self {
        let scene = scene::open("demo:collide:3000", &scene::SceneOptions::default()).unwrap();
        Self::of(scene.animation)
    }

    fn query(&self) -> Query<'_> {
        Query::picture(&self.camera, self.light)
    }

    /// Returns our hits, those of `watertight` on the host.
    fn ours(&self, time: f64) -> Hits {
        let mut host = stage::host();
        open(&mut host, &self.animation, time, Intersector::Watertight).unwrap();
        stage::trace(&mut host, &self.animation, time, self.query())
    }
}

/// Returns the share of rays whose triangle or shadow differs.
fn differing(a: &Hits, b: &Hits) -> f64 {
    let both = |of: &Hits| {
        let triangles = of.closest.iter().map(|hit| hit.triangle);
        triangles.zip(of.blocked.clone()).collect::<Vec<_>>()
    };
    let (a, b) = (both(a), both(b));
    assert_eq!(a.len(), b.len());
    let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
    differ as f64 / a.len() as f64
}

fn count(hits: &Hits) -> (u64, u64) {
    let found = hits.closest.iter().filter(|hit| hit.is_hit()).count();
    let blocked = hits.blocked.iter().filter(|&&mark| mark == 1).count();
    (found as u64, blocked as u64)
}

fn hits(rival: RivalName) {
    let shot = Shot::demo();
    let times = [0.0, 1.5, 3.25];
    let ours = times.map(|time| shot.ours(time));
    assert!(
        ours.iter()
            .all(|hits| count(hits).0 > 1000 && count(hits).1 > 100)
    );
    for tree_update in TreeUpdate::ALL {
        let mut subject = Subject::load(rival, &shot.animation, tree_update);
        for (&time, ours) in times.iter().zip(&ours) {
            let (hits, report) = subject.trace(shot.animation.pose(time), shot.query());
            let share = differing(&hits, ours);
            assert!(share <= SHARE, "{tree_update} at {time}: {share}");
            assert_eq!((report.hits, report.blocked), count(&hits));
        }
        // Hits of another time are recognised as wrong.
        let (hits, _) = subject.trace(shot.animation.pose(1.5), shot.query());
        assert!(differing(&hits, &ours[2]) > SHARE);
    }
}

fn not_finite(rival: RivalName) {
    let shot = Shot::demo();
    let keys = shot.animation.all_keys().unwrap();
    let mut keys: Vec<Vec<Point>> = keys.iter().map(|key| key.to_vec()).collect();
    let hits = shot.ours(0.0).closest;
    let hit = hits.iter().find(|hit| hit.is_hit()).unwrap();
    let broken = shot.animation.triangles()[hit.triangle as usize];
    keys[0][broken[0] as usize] = [f32::NAN; 3];
    let triangles = shot.animation.triangles().to_vec();
    let animation = Animation::new(keys, triangles).unwrap();
    let damaged = Shot {
        animation: Arc::new(animation),
        ..shot
    };
    let mut subject = Subject::load(rival, &damaged.animation, TreeUpdate::Rebuild);
    for time in [0.0, 1.0] {
        let (hits, _) = subject.trace(damaged.animation.pose(time), damaged.query());
        let share = differing(&hits, &damaged.ours(time));
        assert!(share <= SHARE, "at {time}: {share}");
    }
}

/// Traces a square above a larger one, with a triangle so far away that an offset of shadow rays in proportion to the
/// scene's size would exceed the distance between the squares.
fn far_triangle(rival: RivalName) {
    let square = |y: f32, size: f32| {
        [[-size, -size], [size, -size], [size, size], [-size, size]].map(|[x, z]| [x, y, z])
    };
    let far = [[1e6, 0.0, 0.0], [1e6, 1.0, 0.0], [1e6, 0.0, 1.0]];
    let vertices = [&square(0.0, 4.0)[..], &square(1.0, 1.0), &far].concat();
    let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10]];
    let shot = Shot {
        animation: Arc::new(Animation::new(vec![vertices], triangles).unwrap()),
        camera: Camera::look_at(CameraPose::new([1.0, 6.0, 8.0], [0.0; 3]), SIZE).unwrap(),
        light: [0.5, 5.0, 0.25],
    };
    let ours = shot.ours(0.0);
    assert!(count(&ours).1 > 100);
    let mut subject = Subject::load(rival, &shot.animation, TreeUpdate::Rebuild);
    let (hits, _) = subject.trace(shot.animation.pose(0.0), shot.query());
    let share = differing(&hits, &ours);
    assert!(share <= SHARE, "{share}");
}

fn queries(rival: RivalName) {
    let shot = Shot::demo();
    let pose = shot.animation.pose(1.5);
    let mut subject = Subject::load(rival, &shot.animation, TreeUpdate::Refit);
    let (both, _) = subject.trace(pose, shot.query());
    let mut list: Vec<Ray> = shot.camera.rays().collect();
    // A ray that is not valid hits nothing.
    list[0].direction = [0.0; 3];
    let mut trace = |kind| {
        let rays = Rays::List(&list);
        subject.trace(pose, Query { rays, kind }).0
    };
    let light = shot.light;
    let given = trace(QueryKind::ClosestAndShadow { light });
    // At most one ray differs: the one that is not valid. The half is for rounding.
    assert!(differing(&given, &both) <= 1.5 / list.len() as f64);
    assert!(!given.closest[0].is_hit());
    let closest = trace(QueryKind::Closest);
    assert!(closest.closest == given.closest && closest.blocked.is_empty());
}

fn times(rival: RivalName) {
    let shot = Shot::demo();
    let mut subject = Subject::load(rival, &shot.animation, TreeUpdate::Rebuild);
    let (_, moved) = subject.trace(shot.animation.pose(0.5), shot.query());
    let (_, stayed) = subject.trace(shot.animation.pose(0.5), shot.query());
    for (times, is_moved) in [(moved.times, true), (stayed.times, false)] {
        let tree = [times.interpolate_ms, times.refit_ms];
        assert_eq!(tree.map(|ms| ms.is_some()), [is_moved; 2]);
        let stages = tree
            .into_iter()
            .chain([times.preprocess_ms, times.trace_primary_ms]);
        let sum: f64 = stages.flatten().sum();
        assert!(
            sum > 0.0 && (sum - times.device_ms).abs() < 1e-6,
            "{times:?}"
        );
        assert_eq!(times.trace_shadow_ms, None);
    }
}

/// Runs the program in an empty folder; returns the exit code, standard output and a file.
fn run(words: &str, file: &str, variables: &[(&str, &OsStr)]) -> (Option<i32>, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let output = program::run_where(folder.path(), words.split_whitespace(), variables);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let file = std::fs::read_to_string(folder.path().join(file)).unwrap_or_default();
    (output.status.code(), text, file)
}

fn rows(rival: RivalName) {
    let words = format!(
        "bench demo:collide:600 --backend cpu --rival {} --update refit,rebuild --rays camera,random --frames 3 --size 64x40 --quiet --json b.json",
        rival.name()
    );
    let (code, text, json) = run(&words, "b.json", &[]);
    assert_eq!(code, Some(0), "{text}");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let rows = json["rows"].as_array().unwrap();
    let own: Vec<_> = rows
        .iter()
        .filter(|row| row["backend"] == rival.name())
        .collect();
    let names: Vec<_> = own
        .iter()
        .filter_map(|row| row["update"].as_str())
        .collect();
    assert_eq!(names, ["refit", "rebuild", "refit", "rebuild"], "{json:#}");
    for row in own {
        let numbers = ["device_ms", "wall_ms", "mrays_per_s", "differing"];
        assert!(numbers.iter().all(|name| row[name].is_number()), "{row:#}");
        assert!(row["differing"].as_f64().unwrap() < 0.02, "{row:#}");
        assert_eq!(row["per_frame"].as_array().unwrap().len(), 3);
    }
    assert!(
        rows.iter()
            .any(|row| row["backend"] == "cpu" && row.get("differing").is_none())
    );
    assert!(text.contains("of rays differ from backend cpu"), "{text}");
}

fn points(rival: RivalName) {
    let words = format!(
        "chart demo:collide:300 --backend cpu --intersector watertight --rival {} --update refit --frames 3 --size 64x40 --rays 2000 --out c --quiet",
        rival.name()
    );
    let (code, text, json) = run(&words, "c/points.json", &[]);
    assert_eq!(code, Some(0), "{text}");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let points = json["points"].as_array().unwrap();
    let own: Vec<_> = points
        .iter()
        .filter(|p| p["backend"] == rival.name())
        .collect();
    assert_eq!(own.len(), 1, "{json:#}");
    let [tested, wrong] = ["rays_tested", "wrong"].map(|name| own[0][name].as_u64().unwrap());
    assert!(tested == 2000 && wrong <= 20, "{:#}", own[0]);
    assert!(own[0]["ms_per_frame"]["median"].is_number(), "{:#}", own[0]);
}

fn unknown_adapter() {
    let opened = RivalName::VulkanRt.open(Some(999), 1);
    let why = opened.err().unwrap().to_string();
    assert!(why.starts_with("no device: "), "{why}");
}

/// Hides the driver from the loader. The table must still contain the row of the backend.
fn absent() {
    let nothing = OsStr::new("/nonexistent");
    let hidden = [("VK_DRIVER_FILES", nothing), ("VK_ICD_FILENAMES", nothing)];
    let words = "bench demo:collide:300 --backend cpu --rival vulkan-rt --update refit --frames 2 --size 16x12 --quiet --json b.json";
    let (code, text, json) = run(words, "b.json", &hidden);
    assert_eq!(code, Some(1), "{text}");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 2, "{json:#}");
    assert!(rows[0]["backend"] == "cpu" && rows[0]["wall_ms"].is_number());
    let why = rows[1]["error"].as_str().unwrap();
    assert!(why.starts_with("rival vulkan-rt cannot run: "), "{why}");
    assert!(text.contains(why), "{text}");
}
