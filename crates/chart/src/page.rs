//! The whole picture: heading, legend, one panel a scene, companions in two columns.

use crate::axes::heading;
use crate::data::{Chart, Scene};
use crate::error::Result;
use crate::keys::{Keys, Quantity};
use crate::legend::Legend;
use crate::look::Looks;
use crate::mark::{Font, GREY, INK, Place, Rect, Sheet, text};
use crate::offsets::{Fault, Offsets};
use crate::plane::{self, Dot, Target};
use crate::rows::{self, Rows};
use crate::text::{clean, count, fit};
use plotters::prelude::{IntoDrawingArea, SVGBackend};
use plotters::style::WHITE;
use plotters::style::text_anchor::HPos;

/// Pixels across the picture.
pub(crate) const WIDTH: i32 = 1000;
const LEFT: i32 = 16;
const RIGHT: i32 = WIDTH - 16;
/// Between panels.
const GAP: i32 = 22;
/// Height of a main panel: alone on the page, and one of several.
const PLANE: [i32; 2] = [600, 500];
const LINE: i32 = 24;

/// A picture as `plotters` wrote it, and where its points are.
pub(crate) struct Drawn {
    pub(crate) svg: String,
    pub(crate) size: (i32, i32),
    pub(crate) targets: Vec<Target>,
}

/// A panel among the companions.
enum Companion {
    Rows(Rows),
    Offsets(Offsets),
    Keys(Keys),
}

impl Companion {
    fn height(&self) -> i32 {
        match self {
            Self::Rows(p) => p.height(),
            Self::Offsets(p) => p.height(),
            Self::Keys(p) => p.height(),
        }
    }

    fn draw(&self, sheet: &Sheet<'_>, frame: Rect) -> Result<()> {
        match self {
            Self::Rows(p) => p.draw(sheet, frame),
            Self::Offsets(p) => p.draw(sheet, frame),
            Self::Keys(p) => p.draw(sheet, frame),
        }
    }
}

/// Draws everything.
pub(crate) fn draw(chart: &Chart) -> Result<Drawn> {
    let looks = Looks::of(&chart.points);
    let head = head(chart);
    let legend = Legend::new(&looks, LEFT, RIGHT);
    let scenes = scenes(chart);
    let plane = PLANE[usize::from(scenes.len() > 1)];
    let legend_top = 20 + 34 + LINE * head.len() as i32;
    let planes_top = legend_top + legend.height + GAP;
    let companions_top = planes_top + (plane + GAP) * scenes.len() as i32;
    let (companions, bottom) = columns(companions(chart, &looks), companions_top);
    let mut svg = String::new();
    let mut targets = Vec::new();
    {
        let sheet =
            SVGBackend::with_string(&mut svg, (WIDTH as u32, bottom as u32)).into_drawing_area();
        sheet.fill(&WHITE)?;
        draw_head(&sheet, &chart.title, &head)?;
        legend.draw(&sheet, legend_top)?;
        let dots: Vec<Dot<'_>> = dots(chart);
        let scales = plane::scales(&dots);
        for (i, scene) in (0..).zip(&scenes) {
            let top = planes_top + (plane + GAP) * i;
            let frame = Rect::new(LEFT, top, RIGHT, top + plane);
            let of_scene = |d: &&Dot<'_>| d.point.scene == scene.name;
            let here: Vec<Dot<'_>> = dots.iter().filter(of_scene).copied().collect();
            let all = chart
                .points
                .iter()
                .filter(|p| p.scene == scene.name)
                .count();
            heading(&sheet, frame, &clean(&scene.name))?;
            let plot = Rect {
                y0: top + 30,
                ..frame
            };
            let (found, unlabelled) = plane::draw(&sheet, plot, &here, &scales, &looks)?;
            draw_notes(
                &sheet,
                frame,
                &facts(scene),
                &remarks(all, here.len(), unlabelled),
            )?;
            targets.extend(found);
        }
        for (companion, frame) in &companions {
            companion.draw(&sheet, *frame)?;
        }
        sheet.present()?;
    }
    Ok(Drawn {
        svg,
        size: (WIDTH, bottom),
        targets,
    })
}

/// The points that can be drawn.
pub(crate) fn dots(chart: &Chart) -> Vec<Dot<'_>> {
    let dots = chart.points.iter().enumerate();
    dots.filter_map(|(i, p)| Dot::of(i, p)).collect()
}

/// The scenes that were told of, then those that only points name; one without a name if there is none.
fn scenes(chart: &Chart) -> Vec<Scene> {
    let mut scenes = chart.scenes.clone();
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

/// Lines under the title: what did the work.
fn head(chart: &Chart) -> Vec<String> {
    let machine = &chart.machine;
    let first = [
        machine.cpu.clone().unwrap_or_default(),
        if machine.version.is_empty() {
            String::new()
        } else {
            format!("abvh {}", machine.version)
        },
        machine.date.clone(),
    ];
    let mut lines = vec![join(&first, " · ")];
    for a in &machine.adapters {
        let device = join(&[a.adapter.clone(), a.driver.clone()], ", ");
        lines.push(format!("{}: {device}", a.backend));
    }
    lines.retain(|l| !l.is_empty());
    lines
}

fn join(parts: &[String], between: &str) -> String {
    let parts: Vec<&str> = parts
        .iter()
        .map(|p| &**p)
        .filter(|p| !p.is_empty())
        .collect();
    parts.join(between)
}

fn draw_head(sheet: &Sheet<'_>, title: &str, lines: &[String]) -> Result<()> {
    let title = fit(title, 28, RIGHT - LEFT);
    text(sheet, (LEFT, 32), &title, Font::new(26).bold().colour(INK))?;
    for (i, words) in (0..).zip(lines) {
        let at = (LEFT, 20 + 34 + LINE * i + LINE / 2);
        text(
            sheet,
            at,
            &fit(words, 16, RIGHT - LEFT),
            Font::new(16).colour(GREY),
        )?;
    }
    Ok(())
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
            "{unlabelled} of {drawn} points without a label for want of room"
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

fn companions(chart: &Chart, looks: &Looks) -> Vec<Companion> {
    let points = &chart.points;
    let keys = &chart.companions.key_frames;
    let rows = |r: Option<Rows>| r.map(Companion::Rows);
    let offsets = |f| Offsets::of(points, looks, f).map(Companion::Offsets);
    let curves = |q| Keys::of(keys, q).map(Companion::Keys);
    [
        offsets(Fault::Leak),
        offsets(Fault::DoubleHit),
        rows(rows::t_errors(points, looks)),
        rows(rows::shadows(points, looks)),
        curves(Quantity::Error),
        curves(Quantity::Time),
        rows(rows::memory(points, looks)),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Puts each panel into the shorter of two columns; returns the lower end of the longer one, too.
fn columns(panels: Vec<Companion>, top: i32) -> (Vec<(Companion, Rect)>, i32) {
    let half = (RIGHT - LEFT - GAP) / 2;
    let mut ends = [top, top];
    let mut placed = Vec::new();
    for panel in panels {
        let side = usize::from(ends[1] < ends[0]);
        let x = LEFT + side as i32 * (half + GAP);
        let bottom = ends[side] + panel.height();
        placed.push((panel, Rect::new(x, ends[side], x + half, bottom)));
        ends[side] = bottom + GAP;
    }
    (placed, ends[0].max(ends[1]))
}
