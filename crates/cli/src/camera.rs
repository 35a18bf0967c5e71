//! Options of the camera and the point light, and the view of a scene that they select.

use crate::error::CliError;
use crate::parsers;
use abvh::frames::LitView;
use backend::Query;
use clap::Args;
use geom::{Camera, Point};
use scene::{Scene, Viewpoint};
use serde::Serialize;

/// Number of pixels of a frame of the default [`size`](CameraSettings::size).
pub(crate) const DEFAULT_PIXELS: usize = 1280 * 720;

/// The camera and the point light. By default, the view shows the whole motion. Serialized under the options' names.
#[derive(Args, Clone, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) struct CameraSettings {
    /// Frame size in pixels
    #[arg(long, value_name = "WxH", value_parser = parsers::size, default_value = "1280x720")]
    pub(crate) size: [u32; 2],
    /// Position of the camera
    #[arg(long, value_name = "x,y,z", value_parser = parsers::point::<f64>, allow_hyphen_values = true)]
    pub(crate) eye: Option<[f64; 3]>,
    /// Point that the camera looks at
    #[arg(long, value_name = "x,y,z", value_parser = parsers::point::<f64>, allow_hyphen_values = true)]
    look_at: Option<[f64; 3]>,
    /// Up direction of the camera
    #[arg(long, value_name = "x,y,z", value_parser = parsers::point::<f32>, allow_hyphen_values = true)]
    up: Option<Point>,
    /// Vertical field of view, in degrees
    #[arg(long, value_name = "DEG", default_value = "40",
        value_parser = parsers::number(|d: f32| d > 0.0 && d < 180.0, "a field of view lies between 0 and 180 degrees"))]
    fov: f32,
    /// Position of the point light
    #[arg(long, value_name = "x,y,z", value_parser = parsers::point::<f64>, allow_hyphen_values = true)]
    pub(crate) light: Option<[f64; 3]>,
}

/// A camera for one scene, and the position of the point light.
pub(crate) struct LitCamera {
    pub(crate) camera: Camera,
    pub(crate) light: Point,
}

impl LitCamera {
    /// Returns the query for the camera's rays and their shadow rays.
    pub(crate) fn query(&self) -> Query<'_> {
        Query::picture(&self.camera, self.light)
    }

    /// Returns the view that the library renders.
    pub(crate) fn view(&self) -> LitView<'_> {
        LitView {
            camera: &self.camera,
            light: self.light,
        }
    }
}

impl CameraSettings {
    /// Returns the number of pixels of a frame.
    pub(crate) fn pixels(&self) -> usize {
        let [width, height] = self.size;
        width as usize * height as usize
    }

    /// Returns the default view of the whole motion, with the requested points and directions instead of the computed
    /// ones.
    pub(crate) fn view(&self, scene: &Scene) -> Result<Viewpoint, CliError> {
        let framed = Viewpoint::framing(&scene.animation, self.fov, self.size);
        let point = |option, requested: Option<[f64; 3]>, framed| match requested {
            Some(point) => in_scene(option, point, scene),
            None => Ok(framed),
        };
        Ok(Viewpoint {
            eye: point("--eye", self.eye, framed.eye)?,
            look_at: point("--look-at", self.look_at, framed.look_at)?,
            up: self.up.unwrap_or(framed.up),
            light: point("--light", self.light, framed.light)?,
            ..framed
        })
    }

    /// Returns the camera and the point light for a scene.
    pub(crate) fn aim(&self, scene: &Scene) -> Result<LitCamera, CliError> {
        let view = self.view(scene)?;
        let camera = view.camera(self.size);
        let camera = camera.ok_or_else(|| no_camera(&view, scene))?;
        let light = view.light;
        Ok(LitCamera { camera, light })
    }
}

/// Returns the error for a view that defines no camera.
fn no_camera(view: &Viewpoint, scene: &Scene) -> CliError {
    let Viewpoint {
        eye, look_at, up, ..
    } = view;
    // Points in the scene's original coordinates.
    let [from, to] = [eye, look_at].map(|point| match scene.facts.offset {
        Some(offset) => format!("{:?}", [0, 1, 2].map(|i| f64::from(point[i]) + offset[i])),
        None => format!("{point:?}"),
    });
    CliError::invalid(if eye == look_at {
        format!("--eye and --look-at are the same point, {from}: choose different points")
    } else if *up == [0.0; 3] {
        "--up must not be zero".to_owned()
    } else {
        format!("the up direction {up:?} must not be parallel to the view from {from} to {to}")
    })
}

/// Converts a point from the scene's original coordinates to those of its key frames, which may be recentred.
fn in_scene(option: &str, point: [f64; 3], scene: &Scene) -> Result<Point, CliError> {
    let offset = scene.facts.offset.unwrap_or_default();
    let moved: Point = std::array::from_fn(|i| (point[i] - offset[i]) as f32);
    if moved.iter().all(|x| x.is_finite()) {
        Ok(moved)
    } else {
        Err(CliError::invalid(format!(
            "{option} {point:?} is out of range"
        )))
    }
}
