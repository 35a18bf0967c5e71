//! Queries and results.

use geom::{Camera, Hit, Point, Ray};

/// The rays of a query.
#[derive(Clone, Copy, Debug)]
pub enum Rays<'a> {
    /// A list of rays. Rays that are not [valid](Ray::is_valid) miss.
    List(&'a [Ray]),
    /// One ray through the centre of each pixel, row by row: [`Camera::ray`]. GPUs generate these rays, except for
    /// [`QueryKind::Any`].
    Camera(&'a Camera),
    /// This number of rays in device memory. The GPU backend received their buffer by its own method, not through
    /// [`Backend`](crate::Backend). The host does not read the rays. Rays that are not valid miss.
    OnDevice(usize),
}

impl Rays<'_> {
    /// Returns the number of rays.
    pub fn count(&self) -> usize {
        match self {
            Self::List(rays) => rays.len(),
            Self::Camera(camera) => camera.pixels(),
            Self::OnDevice(count) => *count,
        }
    }
}

impl<'a> From<&'a [Ray]> for Rays<'a> {
    fn from(list: &'a [Ray]) -> Self {
        Self::List(list)
    }
}

impl<'a> From<&'a Vec<Ray>> for Rays<'a> {
    fn from(list: &'a Vec<Ray>) -> Self {
        Self::List(list)
    }
}

impl<'a, const N: usize> From<&'a [Ray; N]> for Rays<'a> {
    fn from(list: &'a [Ray; N]) -> Self {
        Self::List(list)
    }
}

impl<'a> From<&'a Camera> for Rays<'a> {
    fn from(camera: &'a Camera) -> Self {
        Self::Camera(camera)
    }
}

/// The result to compute for each ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum QueryKind {
    /// The closest hit.
    Closest,
    /// Whether there is any hit.
    Any,
    /// The closest hit, and whether the segment from it to a point light is blocked.
    ClosestAndShadow {
        /// Position of the light.
        light: Point,
    },
}

impl QueryKind {
    /// Returns the light to which shadow rays are traced, or `None` without shadow rays.
    pub fn light(self) -> Option<Point> {
        match self {
            Self::ClosestAndShadow { light } => Some(light),
            Self::Closest | Self::Any => None,
        }
    }
}

/// Rays and the result to compute for each.
#[derive(Clone, Copy, Debug)]
pub struct Query<'a> {
    /// The rays.
    pub rays: Rays<'a>,
    /// The result to compute for each ray.
    pub kind: QueryKind,
}

impl<'a> Query<'a> {
    /// Returns the query of a picture: the closest hit of each pixel's ray, and whether the light illuminates the hit.
    pub fn picture(camera: &'a Camera, light: Point) -> Self {
        Self {
            rays: Rays::Camera(camera),
            kind: QueryKind::ClosestAndShadow { light },
        }
    }
}

/// Colour tables for pictures, see [`Backend::load_palette`](crate::Backend::load_palette).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Palette {
    /// sRGB of each triangle: red in the lowest byte, then green and blue.
    pub colours: Vec<u32>,
    /// Two lookup tables, one after the other. The first maps each of the 256 sRGB levels to linear light, as the bits
    /// of an `f32`. The second maps linear light to an sRGB level. Its index is linear light times 4096, rounded.
    pub tones: Vec<u32>,
}

/// Results of a trace, one entry per ray, in the order of the rays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hits {
    /// Closest hits; empty with [`QueryKind::Any`].
    pub closest: Vec<Hit>,
    /// With [`QueryKind::Any`]: 1 if the ray hit a triangle. With [`QueryKind::ClosestAndShadow`]: 1 if the hit is in
    /// shadow, 0 if lit or a miss. Otherwise empty.
    pub blocked: Vec<u8>,
}

/// Memory of earlier hits, reused so that the operating system need not allocate and clear pages for each query.
#[derive(Debug, Default)]
pub struct HitsPool {
    spares: Vec<Hits>,
    capacity: usize,
}

impl HitsPool {
    /// Sets the maximum number of buffers in the pool. Frees those in excess.
    pub fn set_capacity(&mut self, buffers: usize) {
        self.capacity = buffers;
        self.spares.truncate(buffers);
    }

    /// Frees all buffers.
    pub fn clear(&mut self) {
        self.spares.clear();
    }

    /// Adds a buffer to the pool, or frees it if the pool is full.
    pub fn put(&mut self, hits: Hits) {
        let has_memory = hits.closest.capacity() + hits.blocked.capacity() > 0;
        if has_memory && self.spares.len() < self.capacity {
            self.spares.push(hits);
        }
    }

    /// Takes the buffer whose capacity fits `rays` results best. It is empty, or contains older hits.
    #[must_use]
    pub fn take(&mut self, rays: usize, kind: QueryKind) -> Hits {
        let misfit = |hits: &Hits| {
            let capacity = match kind {
                QueryKind::Any => hits.blocked.capacity(),
                QueryKind::Closest | QueryKind::ClosestAndShadow { .. } => hits.closest.capacity(),
            };
            (capacity < rays, capacity.abs_diff(rays))
        };
        let spares = self.spares.iter().enumerate();
        let best = spares.min_by_key(|(_, hits)| misfit(hits));
        best.map(|(i, _)| i)
            .map_or_else(Hits::default, |i| self.spares.swap_remove(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pool_returns_best_fit_within_limit() {
        let hits = |capacity: usize| Hits {
            closest: Vec::with_capacity(capacity),
            blocked: Vec::new(),
        };
        let mut pool = HitsPool::default();
        pool.set_capacity(3);
        for capacity in [50, 0, 10, 100, 70] {
            pool.put(hits(capacity));
        }
        let mut take = |rays| pool.take(rays, QueryKind::Closest).closest.capacity();
        assert_eq!([20, 60, 60, 60].map(&mut take), [50, 100, 10, 0]);
        [1, 2, 3].into_iter().for_each(|n| pool.put(hits(n)));
        pool.set_capacity(1);
        let left = [(); 2].map(|()| pool.take(1, QueryKind::Closest).closest.capacity());
        assert_eq!(left, [1, 0]);
    }
}
