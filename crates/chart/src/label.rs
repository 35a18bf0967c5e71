//! Draws labels where there is room for them.

use crate::error::Result;
use crate::mark::{Font, GREY, INK, Sheet, line, rect, text};
use crate::place::{Ground, Wish, place};
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, WHITE};

/// Draws labels beside marks of this radius; says how many found no room.
pub(crate) fn write(
    sheet: &Sheet<'_>,
    ground: &Ground,
    wishes: &[Wish],
    radius: i32,
) -> Result<usize> {
    let spots = place(ground, wishes, radius);
    for (wish, spot) in wishes.iter().zip(&spots) {
        let Some(spot) = spot else { continue };
        if let Some(leader) = spot.leader {
            line(sheet, &leader, GREY, 1)?;
        }
        let r = spot.rect;
        rect(sheet, r, WHITE.mix(0.75).filled())?;
        let font = Font::new(wish.size).colour(INK);
        let (x, anchor) = match wish.at.0 {
            at if at <= r.x0 => (r.x0 + 1, HPos::Left),
            at if at >= r.x1 => (r.x1 - 1, HPos::Right),
            _ => ((r.x0 + r.x1) / 2, HPos::Center),
        };
        text(
            sheet,
            (x, (r.y0 + r.y1) / 2),
            &wish.text,
            font.anchor(anchor),
        )?;
    }
    Ok(spots.iter().filter(|s| s.is_none()).count())
}
