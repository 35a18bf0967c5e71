//! Every scene, motion and ray that laws are tried on.

use geom::{Animation, Camera, Point, Ray};
use proptest::prelude::*;
use std::sync::Arc;

/// A scene in motion with rays to ask it.
#[derive(Clone, Debug)]
pub struct Case {
    /// What it is made of, for messages.
    pub kind: Kind,
    /// The scene.
    pub animation: Arc<Animation>,
    /// Moments to visit, in key frames; the first is where the first tree is built.
    pub times: Vec<f64>,
    /// Rays given one by one.
    pub rays: Vec<Ray>,
    /// A camera that sees the scene.
    pub camera: Camera,
    /// A point light.
    pub light: Point,
}

/// What scenes are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Free triangles.
    Soup,
    /// A sheet whose triangles share vertices.
    Sheet,
    /// A closed body.
    Body,
    /// Needles and flakes.
    Slivers,
    /// Equal triangles, and coplanar ones that overlap.
    Stack,
    /// Triangles that are inactive or degenerate, always or at times.
    Broken,
    /// Nothing, one triangle, two triangles.
    Few,
}

impl Kind {
    /// All there are.
    pub const ALL: [Self; 7] = [
        Self::Soup,
        Self::Sheet,
        Self::Body,
        Self::Slivers,
        Self::Stack,
        Self::Broken,
        Self::Few,
    ];
}

type Mesh = (Vec<Vec<Point>>, Vec<[u32; 3]>);

/// A case of one kind.
pub fn case(kind: Kind) -> impl Strategy<Value = Case> {
    let place = (scale(), offset());
    let extra = (
        prop::collection::vec(unit(), 96),
        prop::collection::vec(any::<u32>(), 96),
    );
    let times = prop::collection::vec(0.0..2.0, 3);
    (mesh(kind), place, extra, times).prop_map(
        move |(mesh, (scale, offset), (units, picks), times)| {
            let (keys, triangles) = moved(mesh, scale, offset);
            let animation = Animation::new(keys, triangles).expect("strategies make sound scenes");
            let around = Around::of(&animation, scale, offset);
            let mut times = times;
            times.push(1.0);
            Case {
                kind,
                rays: rays(&animation, &around, &units, &picks),
                camera: around.camera(units[0]),
                light: around.at(units[1], 3.0),
                animation: Arc::new(animation),
                times,
            }
        },
    )
}

/// Numbers in `-1..=1`, three at a time, none of them subnormal.
fn unit() -> impl Strategy<Value = Point> {
    let grid = -1000_i32..=1000;
    [grid.clone(), grid.clone(), grid].prop_map(|p| p.map(|x| x as f32 / 1000.0))
}

fn scale() -> impl Strategy<Value = f32> {
    prop_oneof![6 => Just(1.0_f32), 1 => Just(1e-3), 1 => Just(1e6), 1 => Just(1e-12), 1 => Just(1e15)]
}

fn offset() -> impl Strategy<Value = f32> {
    prop_oneof![5 => Just(0.0_f32), 1 => Just(10.0), 1 => Just(1e3), 1 => Just(1e5)]
}

/// Three key frames of a mesh of about unit size.
fn mesh(kind: Kind) -> BoxedStrategy<Mesh> {
    match kind {
        Kind::Soup => soup(1.0, 1..80).boxed(),
        Kind::Sheet => (2_usize..9, drift())
            .prop_map(|(n, d)| animate(sheet(n), &d))
            .boxed(),
        Kind::Body => (1_u32..3, drift())
            .prop_map(|(n, d)| animate(body(n), &d))
            .boxed(),
        Kind::Slivers => soup(1e-4, 1..60).boxed(),
        Kind::Stack => soup(1.0, 1..8).prop_map(stacked).boxed(),
        Kind::Broken => (soup(1.0, 2..40), prop::collection::vec(any::<u32>(), 12))
            .prop_map(|(m, picks)| broken(m, &picks))
            .boxed(),
        Kind::Few => (0_usize..3, soup(1.0, 2..3))
            .prop_map(|(n, (keys, mut triangles))| {
                triangles.truncate(n);
                (keys, triangles)
            })
            .boxed(),
    }
}

/// Free triangles whose second edge is `thin` times as long as the first.
fn soup(thin: f32, count: std::ops::Range<usize>) -> impl Strategy<Value = Mesh> {
    prop::collection::vec((unit(), unit(), unit(), drift()), count).prop_map(move |all| {
        let mut keys = vec![Vec::new(); 3];
        for (corner, e, f, drift) in &all {
            let tip = |d: &Point, by: f32| std::array::from_fn(|i| corner[i] + by * d[i]);
            let corners = [*corner, tip(e, 0.4), tip(f, 0.4 * thin)];
            for (key, move_by) in keys.iter_mut().zip(drift) {
                key.extend(
                    corners.map(|p| std::array::from_fn::<f32, 3, _>(|i| p[i] + move_by[i])),
                );
            }
        }
        let triangles = (0..all.len() as u32)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect();
        (keys, triangles)
    })
}

/// Where something stands in each of three key frames.
fn drift() -> impl Strategy<Value = [Point; 3]> {
    [Just([0.0; 3]).boxed(), unit().boxed(), unit().boxed()]
}

/// A body whose vertices drift, each by its own share.
fn animate((points, triangles): (Vec<Point>, Vec<[u32; 3]>), drift: &[Point; 3]) -> Mesh {
    let share = |v: usize| ((v * 2_654_435_761) % 97) as f32 / 97.0;
    let at = |d: &Point| {
        let place = |(v, p): (usize, &Point)| std::array::from_fn(|i| p[i] + d[i] * share(v));
        points.iter().enumerate().map(place).collect()
    };
    (drift.iter().map(at).collect(), triangles)
}

fn sheet(n: usize) -> (Vec<Point>, Vec<[u32; 3]>) {
    let at = |i: usize| i as f32 / n as f32 * 2.0 - 1.0;
    let height = |i: usize, j: usize| ((i * 7 + j * 13) % 5) as f32 * 0.05;
    let points = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| [at(i), height(i, j), at(j)]))
        .collect();
    let quad = |i: u32, j: u32| {
        let w = n as u32 + 1;
        let a = j * w + i;
        [[a, a + 1, a + w + 1], [a, a + w + 1, a + w]]
    };
    let triangles = (0..n as u32)
        .flat_map(|j| (0..n as u32).flat_map(move |i| quad(i, j)))
        .collect();
    (points, triangles)
}

/// An octahedron, its faces split `n` times.
fn body(n: u32) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut points: Vec<Point> = vec![
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let mut triangles = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    for _ in 0..n {
        let mut middles = std::collections::BTreeMap::new();
        let mut split = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |p: u32, q: u32| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    let (x, y) = (points[p as usize], points[q as usize]);
                    points.push(std::array::from_fn(|i| (x[i] + y[i]) * 0.53));
                    points.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            split.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = split;
    }
    (points, triangles)
}

/// Each triangle thrice, and once more turned round.
fn stacked((keys, triangles): Mesh) -> Mesh {
    let again = |t: &[u32; 3]| [*t, *t, [t[1], t[2], t[0]], [t[0], t[2], t[1]]];
    let triangles = triangles.iter().flat_map(again).collect();
    (keys, triangles)
}

/// Some vertices not finite in some keys, some triangles of no area.
fn broken((mut keys, mut triangles): Mesh, picks: &[u32]) -> Mesh {
    let vertices = keys[0].len();
    for (n, &pick) in picks.iter().enumerate() {
        let vertex = pick as usize % vertices;
        match n % 4 {
            0 => keys[pick as usize / 7 % 3][vertex][n % 3] = f32::NAN,
            1 => keys.iter_mut().for_each(|k| k[vertex] = [f32::INFINITY; 3]),
            2 => triangles.push([vertex as u32; 3]),
            _ => {
                let other = (vertex as u32 + 1) % vertices as u32;
                triangles.push([vertex as u32, other, vertex as u32]);
            }
        }
    }
    (keys, triangles)
}

fn moved((mut keys, triangles): Mesh, scale: f32, offset: f32) -> Mesh {
    for p in keys.iter_mut().flatten() {
        *p = p.map(|x| (x + offset) * scale);
    }
    (keys, triangles)
}

/// Where a scene is and how large.
struct Around {
    scale: f32,
    centre: f32,
}

impl Around {
    fn of(_: &Animation, scale: f32, offset: f32) -> Self {
        Self {
            scale,
            centre: offset * scale,
        }
    }

    /// A point in the scene's neighbourhood, `reach` times its size.
    fn at(&self, unit: Point, reach: f32) -> Point {
        unit.map(|x| self.centre + x * reach * self.scale)
    }

    fn camera(&self, unit: Point) -> Camera {
        let away = [2.5 + unit[0], 1.5 + unit[1], 3.0 + unit[2]];
        let eye = self.at(away, 1.0);
        let target = self.at([0.0; 3], 1.0);
        let up = [0.0, 1.0, 0.0];
        Camera::look_at(eye, target, up, 50.0, [24, 17]).expect("the camera sees the scene")
    }
}

/// Rays of every sort, some aimed with care.
fn rays(animation: &Animation, around: &Around, units: &[Point], picks: &[u32]) -> Vec<Ray> {
    let mut rays = Vec::new();
    for (n, (&unit, &pick)) in units.iter().zip(picks).enumerate() {
        let from = around.at(unit, 3.0);
        let at = target(animation, around, n, pick, unit);
        let to: Point = std::array::from_fn(|i| at[i] - from[i]);
        let s = around.scale;
        let ray = match n % 8 {
            0 => Ray::new(at, unit.map(|x| x * s)),
            1 => Ray::new([at[0], at[1], around.centre - 4.0 * s], [0.0, 0.0, 1.0]),
            2 => Ray::new([around.centre + 4.0 * s, at[1], at[2]], [-1e-3, 0.0, 0.0]),
            3 => Ray::new(from, [to[0], to[1], 0.0]),
            4 => Ray {
                t_min: 0.5,
                t_max: 1.5,
                ..Ray::new(from, to)
            },
            5 => Ray {
                t_max: 1.0,
                ..Ray::new(from, to)
            },
            _ => Ray::new(from, to),
        };
        rays.push(ray);
    }
    rays.extend(void_rays(around));
    rays
}

/// A vertex, a point on an edge, a point in a triangle, or just a point.
fn target(animation: &Animation, around: &Around, n: usize, pick: u32, unit: Point) -> Point {
    let count = animation.triangle_count() as u32;
    if count == 0 || n % 5 == 4 {
        return around.at(unit, 1.0);
    }
    let [a, b, c] = animation.corners(animation.pose(1.0), pick % count);
    let [s, t] = [0.5 * (1.0 + unit[0]), 0.5 * (1.0 + unit[1])];
    let p: Point = match n % 5 {
        0 => a,
        1 => std::array::from_fn(|i| a[i] + s * (b[i] - a[i])),
        _ => std::array::from_fn(|i| a[i] + 0.5 * s * (b[i] - a[i]) + 0.5 * t * (c[i] - a[i])),
    };
    if p.iter().all(|x| x.is_finite()) {
        p
    } else {
        around.at(unit, 1.0)
    }
}

/// Rays that can hit nothing.
fn void_rays(around: &Around) -> [Ray; 5] {
    let o = around.at([0.0, 0.0, 3.0], 1.0);
    let d = [0.0, 0.0, -1.0];
    [
        Ray::new(o, [0.0; 3]),
        Ray::new(o, [f32::NAN, 0.0, 1.0]),
        Ray::new([f32::INFINITY, 0.0, 0.0], d),
        Ray {
            t_min: 2.0,
            t_max: 2.0,
            ..Ray::new(o, d)
        },
        Ray {
            t_min: f32::NAN,
            ..Ray::new(o, d)
        },
    ]
}
