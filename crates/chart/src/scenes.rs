//! One main panel a scene: what it is, its points, and what they do not show.

use crate::axes::heading;
use crate::data::{Chart, Scene};
use crate::error::Result;
use crate::look::Looks;
use crate::mark::{Font, GREY, Place, Rect, Sheet, text};
use crate::plane::{self, Dot, Target};
use crate::scale::Scale;
use crate::text::{clean, count, fit, width};
use plotters::style::text_anchor::HPos;

/// The scenes that were told of, each once, then those that only points name; one without a name if there is none.
pub(crate) fn of(chart: &Chart) -> Vec<Scene> {
    let mut scenes: Vec<Scene> = Vec::new();
    for scene in &chart.scenes {
        if !scenes.iter().any(|s| s.name == scene.name) {
            scenes.push(scene.clone());
        }
    }
    for point in &chart.points {
        if !scenes.iter().any(|s| s.name == point.scene) {
            scenes.push(Scene {
                name: point.scene.clone(),
                ..Scene::default()
            });
        }
    }
    if scenes.is_empty() {
        scenes.push(Scene::default());
    }
    scenes
}

/// A scene and its points.
pub(crate) struct Panel<'a> {
    pub(crate) scene: &'a Scene,
    /// How many points there are, those that cannot be drawn included.
    pub(crate) all: usize,
    pub(crate) dots: Vec<Dot<'a>>,
}

impl Panel<'_> {
    /// Draws it into `frame`; says where the points are.
    pub(crate) fn draw(
        &self,
        sheet: &Sheet<'_>,
        frame: Rect,
        scales: &(Scale, Scale),
        looks: &Looks,
    ) -> Result<Vec<Target>> {
        let facts = facts(self.scene);
        let named = Rect {
            x1: frame.x1 - width(&facts, 16) - 16,
            ..frame
        };
        heading(sheet, named, &clean(&self.scene.name))?;
        let plot = Rect {
            y0: frame.y0 + 30,
            y1: frame.y1 - 22,
            ..frame
        };
        let (targets, unlabelled) = plane::draw(sheet, plot, &self.dots, scales, looks)?;
        let remarks = remarks(self.all, self.dots.len(), unlabelled);
        draw_notes(sheet, frame, &facts, &remarks)?;
        Ok(targets)
    }
}

fn facts(scene: &Scene) -> String {
    if scene.triangles == 0 && scene.frames == 0 {
        return String::new();
    }
    let [width, height] = scene.size;
    let [triangles, frames] = [scene.triangles, scene.frames].map(count);
    format!("{triangles} triangles, {width} × {height} pixels, {frames} frames")
}

/// What the panel does not show.
fn remarks(all: usize, drawn: usize, unlabelled: usize) -> String {
    let mut remarks = Vec::new();
    if all == 0 {
        remarks.push("no points".to_owned());
    }
    if all > drawn {
        remarks.push(format!(
            "{} without a time or tested rays not drawn",
            all - drawn
        ));
    }
    if unlabelled > 0 {
        remarks.push(format!(
            "no room for the labels of {unlabelled} of {drawn} points: see points.csv"
        ));
    }
    remarks.join("; ")
}

/// Facts to the right of the heading, remarks in the lower right corner.
fn draw_notes(sheet: &Sheet<'_>, frame: Rect, facts: &str, remarks: &str) -> Result<()> {
    let font = Font::new(16).colour(GREY).anchor(HPos::Right);
    let at: Place = (frame.x1, frame.y0 + 12);
    text(sheet, at, &fit(facts, 16, 640), font)?;
    text(
        sheet,
        (frame.x1, frame.y1 - 10),
        remarks,
        Font { size: 14, ..font },
    )
}
