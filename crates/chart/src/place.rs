//! Labels beside their points, none upon another: greedy, the most wished-for first.

use crate::mark::{Place, Rect};
use crate::text::width;

/// A label looking for a place.
#[derive(Clone, Debug)]
pub(crate) struct Wish {
    /// The mark it belongs to.
    pub(crate) at: Place,
    pub(crate) text: String,
    /// Height of the letters, in pixels.
    pub(crate) size: i32,
    /// Whether it may stand away from its mark, with a line between.
    pub(crate) far: bool,
}

/// What is in the way.
#[derive(Clone, Debug)]
pub(crate) struct Ground {
    /// Labels stay within.
    pub(crate) bounds: Rect,
    /// No label covers any of these.
    pub(crate) solid: Vec<Rect>,
    /// Labels rather do not cover these.
    pub(crate) soft: Vec<Rect>,
}

/// Where a label ended up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spot {
    pub(crate) rect: Rect,
    /// A line from the mark to the label, if it stands away.
    pub(crate) leader: Option<[Place; 2]>,
}

/// Distances from the mark's edge that are tried, near ones first; the first needs no leader.
const REACH: [i32; 5] = [5, 18, 32, 48, 66];

/// Directions that are tried, the most readable first.
const WAYS: [(i32, i32); 12] = [
    (2, 0),
    (0, -2),
    (-2, 0),
    (0, 2),
    (2, -2),
    (-2, -2),
    (2, 2),
    (-2, 2),
    (1, -2),
    (-1, -2),
    (1, 2),
    (-1, 2),
];

/// A place for each wish, in order, or `None` where there is none left.
pub(crate) fn place(ground: &Ground, wishes: &[Wish], radius: i32) -> Vec<Option<Spot>> {
    let mut ground = ground.clone();
    let marks = ground.solid.clone();
    let mut leaders: Vec<[Place; 2]> = Vec::new();
    let mut spots = Vec::with_capacity(wishes.len());
    for wish in wishes {
        let best = candidates(wish, radius)
            .filter(|(spot, _)| fits(&ground, &marks, &leaders, wish.at, spot))
            .min_by_key(|(spot, cost)| cost + burden(&ground.soft, &marks, wish.at, spot))
            .map(|(spot, _)| spot);
        if let Some(spot) = &best {
            ground.solid.push(spot.rect);
            leaders.extend(spot.leader);
        }
        spots.push(best);
    }
    spots
}

fn candidates(wish: &Wish, radius: i32) -> impl Iterator<Item = (Spot, i32)> {
    let (wide, high) = (width(&wish.text, wish.size), wish.size + 2);
    let (x, y) = wish.at;
    let reaches = if wish.far { &REACH[..] } else { &REACH[..1] };
    reaches.iter().flat_map(move |&reach| {
        (0..).zip(WAYS).map(move |(rank, (dx, dy))| {
            let away = radius + reach;
            let left = match dx {
                2 => x + away,
                -2 => x - away - wide,
                1 => x + 4,
                -1 => x - 4 - wide,
                _ => x - wide / 2,
            };
            let top = match dy {
                2 => y + away - if dx.abs() == 2 { high / 2 } else { 0 },
                -2 => y - away - high + if dx.abs() == 2 { high / 2 } else { 0 },
                _ => y - high / 2,
            };
            let rect = Rect::new(left, top, left + wide, top + high);
            let end = (x.clamp(rect.x0, rect.x1), y.clamp(rect.y0, rect.y1));
            let leader = (reach > REACH[0]).then_some([wish.at, end]);
            (Spot { rect, leader }, 2 * reach + rank)
        })
    })
}

/// What speaks against a place: lines below it, and marks as near to it as its own.
fn burden(soft: &[Rect], marks: &[Rect], own: Place, spot: &Spot) -> i32 {
    let near = |m: &&Rect| {
        let grown = Rect::new(m.x0 - 7, m.y0 - 7, m.x1 + 7, m.y1 + 7);
        grown.meets(&spot.rect) && !m.meets(&Rect::around(own, 1))
    };
    let lines = soft.iter().filter(|s| s.meets(&spot.rect)).count();
    25 * (lines + marks.iter().filter(near).count()) as i32
}

fn fits(ground: &Ground, marks: &[Rect], leaders: &[[Place; 2]], own: Place, spot: &Spot) -> bool {
    let free = ground.bounds.holds(&spot.rect)
        && !ground.solid.iter().any(|s| s.meets(&spot.rect))
        && !leaders.iter().any(|&l| crosses(l, &spot.rect));
    let leads_well = |leader: [Place; 2]| {
        let labels = &ground.solid[marks.len()..];
        let others = marks.iter().filter(|m| !m.meets(&Rect::around(own, 1)));
        !labels.iter().chain(others).any(|s| crosses(leader, s))
            && !leaders.iter().any(|&l| meet(l, leader))
    };
    free && spot.leader.is_none_or(leads_well)
}

/// Whether a line meets a rectangle, as far as points a few pixels apart tell.
fn crosses([a, b]: [Place; 2], r: &Rect) -> bool {
    let steps = ((a.0 - b.0).abs().max((a.1 - b.1).abs()) / 3).max(1);
    (0..=steps).any(|i| {
        let along = |a: i32, b: i32| a + (b - a) * i / steps;
        r.meets(&Rect::around((along(a.0, b.0), along(a.1, b.1)), 1))
    })
}

/// Whether two lines cross.
fn meet(a: [Place; 2], b: [Place; 2]) -> bool {
    let side = |[p, q]: [Place; 2], r: Place| {
        ((q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0)).signum()
    };
    side(a, b[0]) != side(a, b[1]) && side(b, a[0]) != side(b, a[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn wish(x: i32, y: i32, text: &str) -> Wish {
        Wish {
            at: (x, y),
            text: text.to_owned(),
            size: 16,
            far: true,
        }
    }

    fn ground(wishes: &[Wish]) -> Ground {
        Ground {
            bounds: Rect::new(0, 0, 500, 300),
            solid: wishes.iter().map(|w| Rect::around(w.at, 8)).collect(),
            soft: Vec::new(),
        }
    }

    #[test]
    fn a_lone_label_stands_to_the_right_of_its_mark() {
        let wishes = [wish(100, 100, "label")];
        let spots = place(&ground(&wishes), &wishes, 8);
        let spot = spots[0].unwrap();
        assert!(spot.rect.x0 > 108 && spot.rect.y0 < 100 && spot.rect.y1 > 100);
        assert_eq!(spot.leader, None);
    }

    #[test]
    fn a_label_keeps_away_from_the_mark_of_another() {
        let wishes = [wish(100, 100, "label"), wish(167, 100, "")];
        let spots = place(&ground(&wishes), &wishes, 8);
        assert!(
            !spots[0].unwrap().rect.meets(&Rect::around((167, 100), 15)),
            "{spots:?}"
        );
    }

    #[test]
    fn a_label_without_room_is_left_out() {
        let wishes = [wish(100, 100, &"far too wide ".repeat(9))];
        assert_eq!(place(&ground(&wishes), &wishes, 8), [None]);
    }

    #[test]
    fn lines_that_cross_meet_and_others_do_not() {
        let cross = [[(0, 0), (9, 9)], [(0, 9), (9, 0)]];
        assert!(meet(cross[0], cross[1]) && meet(cross[1], cross[0]));
        assert!(!meet(cross[0], [(0, 9), (3, 6)]));
        assert!(!meet(cross[0], [(20, 0), (20, 30)]));
    }

    proptest! {
        #[test]
        fn labels_cover_neither_marks_nor_each_other(
            at in prop::collection::vec((0i32..500, 0i32..300), 0..40)
        ) {
            let wishes: Vec<_> = at.iter().map(|&(x, y)| wish(x, y, "vulkan fast")).collect();
            let ground = ground(&wishes);
            let spots = place(&ground, &wishes, 8);
            let leaders: Vec<_> = spots.iter().flatten().filter_map(|s| s.leader).collect();
            for (i, &a) in leaders.iter().enumerate() {
                prop_assert!(!leaders[..i].iter().any(|&b| meet(a, b)));
            }
            let rects: Vec<_> =
                spots.into_iter().flatten().map(|s| s.rect).collect();
            for (i, a) in rects.iter().enumerate() {
                prop_assert!(ground.bounds.holds(a));
                prop_assert!(!ground.solid.iter().any(|m| m.meets(a)));
                prop_assert!(!rects[..i].iter().any(|b| b.meets(a)));
            }
        }
    }
}
