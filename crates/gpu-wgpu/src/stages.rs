//! Stages as work for the device: which kernels, over what, bound to which buffers.

use crate::WgpuBackend;
use crate::encode::{Groups, Work};
use crate::queries::Stage;
use crate::traces::Trace;
use backend::{Query, Rays, Result, Seek};
use geom::{Camera, Point};
use shaders::Params;

impl WgpuBackend {
    pub(crate) fn params(&self) -> Params {
        let tree = self.tree();
        let k = self.scene().scale_exponent;
        Params {
            alpha: self.alpha,
            scale: f32::from_bits(((127 - k) as u32) << 23),
            scale_exponent: k,
            leaf_bits_at: tree.parts.leaf_bits,
            leaf_ranks_at: tree.parts.leaf_ranks,
            leaf_triangles_at: tree.parts.leaf_triangles,
            node_count: tree.node_count,
            ..Params::default()
        }
    }

    /// Records a stage; buffers are found by their names in the kernels.
    pub(crate) fn run(&mut self, stage: Stage, work: &[Work], also: Also<'_>) -> Result<()> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let position = self.position;
        let trace = || also.trace.expect("a trace");
        let find = |name: &'static str| match name {
            "earlier" => scene.key(also.key),
            "later" => scene.key(also.key.saturating_add(1)),
            "positions" => &scene.positions[position],
            "triangles" => &scene.triangles,
            "topology" => tree.topology(),
            "leaf_nodes" => &tree.leaf_nodes,
            "inner_nodes" => &tree.inner_nodes,
            "records" => &tree.triangles,
            "nodes" => &tree.nodes,
            "hits" => &trace().hits,
            "blocked" => &trace().blocked,
            "rays" => trace().rays.as_ref().expect("given rays"),
            other => panic!("no buffer named {other}"),
        };
        let slot = self.frames.record(&self.gpu)?;
        slot.record(&self.gpu, &self.pipelines, stage, work, find)
    }

    fn primary(&mut self, query: &Query<'_>, trace: &Trace) -> Result<()> {
        let mut params = self.params();
        params.count = trace.count as u32;
        let (kernel, groups) = match (query.rays, query.seek) {
            (Rays::List(_), Seek::Any) => ("any_rays", Groups::Linear(params.count)),
            (Rays::List(_), _) => ("trace_rays", Groups::Linear(params.count)),
            (Rays::Camera(camera), _) => ("trace_camera", set_camera(&mut params, camera)),
        };
        let work = [Work {
            kernel,
            params,
            groups,
        }];
        self.run(Stage::TracePrimary, &work, Also::trace(trace))
    }

    fn shadow(&mut self, query: &Query<'_>, light: Point, trace: &Trace) -> Result<()> {
        let mut params = self.params();
        params.light = light;
        params.count = trace.count as u32;
        let (kernel, groups) = match query.rays {
            Rays::List(_) => ("shadow_rays", Groups::Linear(params.count)),
            Rays::Camera(camera) => ("shadow_camera", set_camera(&mut params, camera)),
        };
        let work = [Work {
            kernel,
            params,
            groups,
        }];
        self.run(Stage::TraceShadow, &work, Also::trace(trace))
    }

    pub(crate) fn trace_stages(&mut self, query: &Query<'_>, trace: &Trace) -> Result<()> {
        let light = match query.seek {
            Seek::ClosestAndShadow { light } => Some(light),
            Seek::Closest | Seek::Any => None,
        };
        if self.tree().leaf_count == 0 {
            trace.fill_misses(&self.gpu)?;
            let also = Also::default();
            self.run(Stage::TracePrimary, &[], also)?;
            return light.map_or(Ok(()), |_| self.run(Stage::TraceShadow, &[], also));
        }
        self.primary(query, trace)?;
        light.map_or(Ok(()), |light| self.shadow(query, light, trace))
    }
}

/// Buffers that belong to one dispatch.
#[derive(Clone, Copy, Default)]
pub(crate) struct Also<'a> {
    trace: Option<&'a Trace>,
    /// The earlier key frame.
    key: u32,
}

impl<'a> Also<'a> {
    pub(crate) fn key(key: u32) -> Self {
        Self { trace: None, key }
    }

    /// The output of a trace.
    fn trace(trace: &'a Trace) -> Self {
        Self {
            trace: Some(trace),
            key: 0,
        }
    }
}

fn set_camera(params: &mut Params, camera: &Camera) -> Groups {
    params.eye = camera.eye;
    params.corner = camera.corner;
    params.across = camera.across;
    params.down = camera.down;
    params.width = camera.width;
    params.height = camera.height;
    Groups::Pixels(camera.width, camera.height)
}
