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
        let middle = ((r.x0 + r.x1) / 2, (r.y0 + r.y1) / 2);
        let font = Font::new(wish.size).colour(INK).anchor(HPos::Center);
        text(sheet, middle, &wish.text, font)?;
    }
    Ok(spots.iter().filter(|s| s.is_none()).count())
}
