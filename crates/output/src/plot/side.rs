//! Panels below the planes: hard rays, leaks and double hits by offset, key frames.

use super::axis::Axis;
use super::data::{Chart, KeyFrameStep, Leaks, Point, known};
use super::look::{GREY, Look, SCENES, Shape, find};
use super::page::{Looks, PER};
use super::panel::{Legend, Mark, Panel, Series};
use super::rate::Rate;
use super::table::{families, number, offsets};

/// How many of how many rays.
type Faults = (u64, u64);

/// What went wrong in each of several places: families of rays or offsets.
struct Places<'a> {
    title: &'static str,
    x: &'static str,
    y: &'static str,
    names: Vec<String>,
    /// By one point in one place.
    read: &'a dyn Fn(usize, &Point) -> Option<Faults>,
}

/// Panels with a place for each family of rays or offset, and marks for each backend and intersector.
pub(crate) fn side_panels(chart: &Chart, looks: &Looks) -> Vec<(Panel, Vec<Series>)> {
    let mut names = vec!["edges and vertices".to_owned()];
    names.extend(families(chart));
    let hard = |place: usize, p: &Point| {
        let of = p.mixed_range.iter().find(|f| f.family == names[place]);
        let aimed = (place == 0).then_some((p.aimed.wrong, p.aimed.rays));
        aimed.or(of.map(|f| (f.wrong, f.rays)))
    };
    let offsets = offsets(chart);
    let at = |place: usize, p: &Point| -> Option<Leaks> {
        let mut leaks = p.leaks.iter();
        leaks.find(|l| l.offset == Some(offsets[place])).copied()
    };
    let by_offset = Places {
        title: "Leaks: rays from inside closed meshes that met nothing",
        x: "offset of the mesh from the origin, in its own sizes",
        y: "leaks per million",
        names: offsets.iter().map(|&x| number(x)).collect(),
        read: &|place, p| at(place, p).map(|l| (l.leaks, l.rays)),
    };
    let hard_rays = Places {
        title: "Hard rays: at edges and vertices of the scene, and in scenes of mixed range",
        x: "family of rays",
        y: "wrong per million",
        names: names.clone(),
        read: &hard,
    };
    let doubles = Places {
        title: "Double hits: rays that crossed an edge of a closed mesh twice",
        y: "double hits per million",
        names: by_offset.names.clone(),
        read: &|place, p| at(place, p).map(|l| (l.double_hits, l.counted)),
        ..by_offset
    };
    let all = [hard_rays, by_offset, doubles];
    let panels = all.iter().map(|p| p.panel(&chart.points, looks));
    panels.flatten().collect()
}

impl Places<'_> {
    /// `None` if no point knows. Marks stand side by side, so that equal ones do not hide each other.
    fn panel(&self, points: &[Point], looks: &Looks) -> Option<(Panel, Vec<Series>)> {
        let count = looks.intersectors.len() * looks.backends.len();
        let mut series = Vec::new();
        for (intersector, shape) in &looks.intersectors {
            for (backend, colour) in &looks.backends {
                let beside = 0.8 * ((series.len() as f64 + 0.5) / count as f64 - 0.5);
                let of = |p: &&Point| p.backend == *backend && p.intersector == *intersector;
                let of: Vec<&Point> = points.iter().filter(of).collect();
                let mark = |place: usize| {
                    let rate = self.worst(place, &of)?.per(PER);
                    let x = place as f64 + beside;
                    Some(Mark {
                        bars: Some([[x; 2], [rate.low, rate.high]]),
                        ..Mark::new(x, rate.value)
                    })
                };
                series.push(Series {
                    marks: (0..self.names.len()).filter_map(mark).collect(),
                    look: Some(Look {
                        colour: *colour,
                        shape: *shape,
                        fill: 1.0,
                        radius: 6.0,
                    }),
                    ..Series::default()
                });
            }
        }
        let marks = || series.iter().flat_map(|s| &s.marks);
        marks().next()?;
        let rates = marks().flat_map(|m| [m.at[1], m.bars.unwrap_or_default()[1][1]]);
        let panel = Panel {
            title: self.title.to_owned(),
            x: Axis::named(self.x, self.names.iter().cloned()),
            y: Axis::log(self.y, rates),
            legend: Legend::None,
        };
        Some((panel, series))
    }

    /// The highest rate among all measurements in one place.
    fn worst(&self, place: usize, points: &[&Point]) -> Option<Rate> {
        let counts = points.iter().filter_map(|p| (self.read)(place, p));
        let rates = counts.filter_map(|(wrong, of)| Rate::of(wrong, of));
        rates.max_by(|a, b| a.value.total_cmp(&b.value))
    }
}

/// How far off key frames are that a tolerance keeps, and what they cost.
pub(crate) fn key_frames(chart: &Chart) -> Vec<(Panel, Vec<Series>)> {
    type Read = fn(&KeyFrameStep) -> Option<f64>;
    let quantities: [(&str, &'static str, Read); 2] = [
        (
            "Key frames kept, by number: error",
            "largest error / diagonal",
            |s| s.max_error,
        ),
        (
            "Key frames kept, by number: time",
            "milliseconds a frame",
            |s| s.ms,
        ),
    ];
    let scenes = &chart.companions.key_frames;
    let colours = SCENES.assign(scenes.iter().map(|k| &*k.scene));
    let panel = |(title, y, read): (&str, &'static str, Read)| {
        let series = scenes.iter().map(|k| {
            let mark = |step: &KeyFrameStep| {
                let tolerance = known(step.tolerance).filter(|&t| t > 0.0)?;
                let value = known(read(step)).filter(|&v| v >= 0.0)?;
                Some(Mark {
                    words: step.key_frames.to_string(),
                    ..Mark::new(tolerance, value)
                })
            };
            let mut marks: Vec<Mark> = k.steps.iter().filter_map(mark).collect();
            marks.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
            let colour = find(&colours, &k.scene).unwrap_or(GREY);
            Series {
                name: k.scene.clone(),
                look: Some(Look {
                    colour,
                    shape: Shape::CIRCLE,
                    fill: 1.0,
                    radius: 4.0,
                }),
                marks,
                line: Some((colour, 2)),
            }
        });
        let series: Vec<Series> = series.filter(|s| !s.marks.is_empty()).collect();
        let values = |axis: usize| {
            series
                .iter()
                .flat_map(|s| &s.marks)
                .map(move |m| m.at[axis])
        };
        let panel = Panel {
            title: title.to_owned(),
            x: Axis::log("tolerance / diagonal", values(0)),
            y: Axis::log(y, values(1)),
            legend: Legend::UpperLeft,
        };
        (!series.is_empty()).then_some((panel, series))
    };
    quantities.into_iter().filter_map(panel).collect()
}
