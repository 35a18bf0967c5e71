//! What to trace, and what comes back.

use geom::{Camera, Hit, Point, Ray};

/// The rays of a query.
#[derive(Clone, Copy, Debug)]
pub enum Rays<'a> {
    /// One by one. Rays that are not [valid](Ray::is_valid) miss.
    List(&'a [Ray]),
    /// One through the middle of each pixel, made on the device: [`Camera::ray`], row by row.
    Camera(&'a Camera),
}

impl Rays<'_> {
    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::List(rays) => rays.len(),
            Self::Camera(camera) => camera.pixels(),
        }
    }
}

/// What to look for along each ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum QueryKind {
    /// The closest hit.
    Closest,
    /// Whether there is any hit.
    Any,
    /// The closest hit, then whether the way from it to a point light is blocked.
    ClosestAndShadow {
        /// Where the light is.
        light: Point,
    },
}

impl QueryKind {
    /// The light that ways are asked for, if any are.
    #[must_use]
    pub fn light(self) -> Option<Point> {
        match self {
            Self::ClosestAndShadow { light } => Some(light),
            Self::Closest | Self::Any => None,
        }
    }
}

/// What to trace.
#[derive(Clone, Copy, Debug)]
pub struct Query<'a> {
    /// The rays.
    pub rays: Rays<'a>,
    /// What to look for.
    pub kind: QueryKind,
}

/// What [`Backend::shade`](crate::Backend::shade) paints by.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Palette {
    /// sRGB of each triangle: red in the lowest byte, then green and blue.
    pub colours: Vec<u32>,
    /// Linear light of each 8-bit sRGB level, as the bits of an f32; then the sRGB level of each step of linear light, of
    /// which 4096 make 1.
    pub tones: Vec<u32>,
}

/// What a trace found, one entry a ray, in the rays' order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hits {
    /// Closest hits; empty with [`QueryKind::Any`].
    pub closest: Vec<Hit>,
    /// With [`QueryKind::Any`]: 1 if the ray met anything. With
    /// [`QueryKind::ClosestAndShadow`]: 1 if the hit is in shadow, 0 if lit or miss. Else empty.
    pub blocked: Vec<u8>,
}
