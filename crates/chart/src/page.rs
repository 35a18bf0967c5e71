//! The whole picture: heading, legend, one panel a scene, side panels in two columns.

use crate::data::{Chart, Machine, Scene};
use crate::error::Result;
use crate::keys::{Keys, Quantity};
use crate::legend::Legend;
use crate::look::Looks;
use crate::mark::{Font, GREY, INK, Rect, Sheet, text};
use crate::offsets::{Fault, Offsets};
use crate::plane::{self, Dot, Target};
use crate::rows::{self, Rows};
use crate::scenes::{self, Panel};
use crate::text::fit;
use plotters::prelude::{IntoDrawingArea, SVGBackend};
use plotters::style::WHITE;
use std::collections::BTreeSet;

/// Pixels across the picture.
pub(crate) const WIDTH: i32 = 1000;
pub(crate) const LEFT: i32 = 16;
pub(crate) const RIGHT: i32 = WIDTH - 16;
/// Between panels.
pub(crate) const GAP: i32 = 22;
/// Height of a main panel: alone on the page, and one of several.
const PLANE: [i32; 2] = [604, 524];
pub(crate) const LINE: i32 = 24;

/// A picture as `plotters` wrote it, and where its points are.
pub(crate) struct Drawn {
    pub(crate) svg: String,
    pub(crate) size: (i32, i32),
    pub(crate) targets: Vec<Target>,
    /// Upper and lower ends of stretches that a page break should not part.
    pub(crate) bands: Vec<(i32, i32)>,
}

/// A panel beside the plots of scenes.
enum SidePanel {
    Rows(Rows),
    Offsets(Offsets),
    Keys(Keys),
}

impl SidePanel {
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

/// Where everything goes.
struct Plan {
    head: Vec<String>,
    legend: Legend,
    legend_top: i32,
    scenes: Vec<(Scene, Rect)>,
    side_panels: Vec<(SidePanel, Rect)>,
    bottom: i32,
}

impl Plan {
    fn new(chart: &Chart, looks: &Looks) -> Self {
        let head = head(&chart.machine);
        let legend = Legend::new(looks, LEFT, RIGHT);
        let legend_top = 64 + LINE * head.len() as i32;
        let mut top = legend_top + legend.height + GAP;
        let all = scenes::of(chart);
        let height = PLANE[usize::from(all.len() > 1)];
        let mut scenes = Vec::new();
        for scene in all {
            scenes.push((scene, Rect::new(LEFT, top, RIGHT, top + height)));
            top += height + GAP;
        }
        let side_panels = pairs(side_panels(chart, looks), top);
        let bottom = side_panels.iter().map(|c| c.1.y1 + GAP).fold(top, i32::max);
        Self {
            head,
            legend,
            legend_top,
            scenes,
            side_panels,
            bottom,
        }
    }

    /// Upper and lower ends of stretches of the picture that belong together.
    fn bands(&self) -> Vec<(i32, i32)> {
        // The first scene stays with the legend.
        let scenes = self.scenes.iter().skip(1).map(|s| s.1.y0);
        let side_panels = self.side_panels.iter().map(|c| c.1.y0);
        let starts: BTreeSet<i32> = scenes.chain(side_panels).chain([0, self.bottom]).collect();
        let starts: Vec<i32> = starts.into_iter().collect();
        starts.windows(2).map(|w| (w[0], w[1])).collect()
    }
}

/// Draws everything.
pub(crate) fn draw(chart: &Chart) -> Result<Drawn> {
    let looks = Looks::of(&chart.points);
    let plan = Plan::new(chart, &looks);
    let size = (WIDTH, plan.bottom);
    let mut svg = String::new();
    let mut targets = Vec::new();
    {
        let backend = SVGBackend::with_string(&mut svg, (size.0 as u32, size.1 as u32));
        let sheet = backend.into_drawing_area();
        sheet.fill(&WHITE)?;
        draw_head(&sheet, &chart.title, &plan.head)?;
        plan.legend.draw(&sheet, plan.legend_top)?;
        let dots = dots(chart);
        let scales = plane::scales(&dots);
        for (scene, frame) in &plan.scenes {
            let all = chart
                .points
                .iter()
                .filter(|p| p.scene == scene.name)
                .count();
            let here = dots.iter().filter(|d| d.point.scene == scene.name);
            let panel = Panel {
                scene,
                all,
                dots: here.copied().collect(),
            };
            targets.extend(panel.draw(&sheet, *frame, &scales, &looks)?);
        }
        for (companion, frame) in &plan.side_panels {
            companion.draw(&sheet, *frame)?;
        }
        sheet.present()?;
    }
    Ok(Drawn {
        svg,
        size,
        targets,
        bands: plan.bands(),
    })
}

/// The points that can be drawn.
pub(crate) fn dots(chart: &Chart) -> Vec<Dot<'_>> {
    let dots = chart.points.iter().enumerate();
    dots.filter_map(|(i, p)| Dot::of(i, p)).collect()
}

/// Lines under the title: what did the work.
pub(crate) fn head(machine: &Machine) -> Vec<String> {
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

/// The title, and words under it.
pub(crate) fn draw_head(sheet: &Sheet<'_>, title: &str, lines: &[String]) -> Result<()> {
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

fn side_panels(chart: &Chart, looks: &Looks) -> Vec<SidePanel> {
    let points = &chart.points;
    let keys = &chart.companions.key_frames;
    let rows = |r: Option<Rows>| r.map(SidePanel::Rows);
    let offsets = |f| Offsets::of(points, looks, f).map(SidePanel::Offsets);
    let curves = |q| Keys::of(keys, q).map(SidePanel::Keys);
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

/// Panels in rows of two, each with its frame.
fn pairs(panels: Vec<SidePanel>, mut top: i32) -> Vec<(SidePanel, Rect)> {
    let half = (RIGHT - LEFT - GAP) / 2;
    let mut placed = Vec::new();
    let mut panels = panels.into_iter().peekable();
    while panels.peek().is_some() {
        let row: Vec<SidePanel> = panels.by_ref().take(2).collect();
        let height = row.iter().map(SidePanel::height).max().unwrap_or(0);
        for (x, panel) in [LEFT, LEFT + half + GAP].into_iter().zip(row) {
            let frame = Rect::new(x, top, x + half, top + panel.height());
            placed.push((panel, frame));
        }
        top += height + GAP;
    }
    placed
}
