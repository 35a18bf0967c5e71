//! Limits of rays.

use backend::{Intersector, QueryKind, Rays};
use conformance::{Target, aimed};
use geom::{Animation, Hit, Ray};
use integration::scenes::Source;
use integration::stage::{Stage, camera};
use std::sync::Arc;

/// By every intersector that rounds.
pub(crate) fn cut_where_hits_are(source: Source) {
    use Intersector::{MollerTrumbore, Watertight, Woop};
    let animation = source.animation();
    for by in [Watertight, Woop, MollerTrumbore] {
        cut(&animation, by);
    }
}

/// Cutting a ray just before its hit makes it miss; just behind it changes
/// nothing, and neither does starting just before; and any-hit agrees.
fn cut(animation: &Arc<Animation>, by: Intersector) {
    let time = 0.5 * animation.end();
    let mut stage = Stage::new(animation, by, 2);
    stage.plant(time);
    let mut rays = camera(animation, [64, 48]).rays().collect::<Vec<_>>();
    for target in Target::ALL {
        rays.extend(aimed(animation, time, target, 1.5, 333));
        rays.extend(aimed(animation, time, target, 30.0, 333));
    }
    let hits = stage.closest(time, &rays).closest;
    let met: Vec<u8> = hits.iter().map(|h| u8::from(h.is_hit())).collect();
    let count = met.iter().filter(|&&m| m == 1).count();
    assert!(count * 50 >= rays.len(), "{by}: only {count} rays hit");
    let any = stage.trace(time, Rays::List(&rays), QueryKind::Any).blocked;
    assert!(any == met, "{by}: any-hit disagrees with closest-hit");
    let mut changed = |change: fn(&mut Ray, f32)| {
        let mut cut = rays.clone();
        let hit = cut.iter_mut().zip(&hits).filter(|(_, h)| h.is_hit());
        hit.for_each(|(ray, hit)| change(ray, hit.t));
        stage.closest(time, &cut).closest
    };
    let before = changed(|ray, t| ray.t_max = t);
    let none = !before.iter().any(Hit::is_hit);
    assert!(none, "{by}: a ray that ends at its closest hit still hits");
    let around = changed(|ray, t| (ray.t_min, ray.t_max) = (t.next_down(), t.next_up()));
    let bits = |h: &Hit| (h.triangle, [h.t, h.u, h.v].map(f32::to_bits));
    let mut pairs = hits.iter().zip(&around).enumerate();
    let other = pairs.find(|(_, (a, b))| bits(a) != bits(b));
    assert!(other.is_none(), "{by}: limits round the hit: {other:?}");
}
