//! One vertex or face, filled by the parser as it goes.

use crate::Rgb;
use geom::Point;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

/// What is used of an element of any kind.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) point: Point,
    pub(super) colour: Rgb,
    /// One bit for each of red, green and blue that is there.
    pub(super) colour_parts: u8,
    /// The vertices of a face; nothing if one of them is negative.
    pub(super) corners: Option<Vec<u32>>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "x" => self.set_coordinate(0, &property),
            "y" => self.set_coordinate(1, &property),
            "z" => self.set_coordinate(2, &property),
            "red" | "r" | "diffuse_red" => self.set_colour(0, &property),
            "green" | "g" | "diffuse_green" => self.set_colour(1, &property),
            "blue" | "b" | "diffuse_blue" => self.set_colour(2, &property),
            "vertex_indices" | "vertex_index" => {
                self.corners = property.to_u32_list();
                PropertyAccessResult::Set
            }
            _ => PropertyAccessResult::Ignored,
        }
    }
}

impl Element {
    fn set_coordinate(&mut self, axis: usize, property: &Property) -> PropertyAccessResult {
        match property.to_f32_lossy() {
            Some(x) => self.point[axis] = x,
            None => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }

    fn set_colour(&mut self, part: usize, property: &Property) -> PropertyAccessResult {
        match property.to_u8_color_lossy() {
            Some(c) => self.colour[part] = c,
            None => return PropertyAccessResult::Ignored,
        }
        self.colour_parts |= 1 << part;
        PropertyAccessResult::Set
    }
}
