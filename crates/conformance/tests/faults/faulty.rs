//! The reference backend with one planted fault.

use backend::{
    Backend, Device, FrameReport, Generation, Hits, Inspect, Intersector, Query, QueryKind, Rays,
    Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use conformance::stage::tree_over;
use cpu_ref::CpuBackend;
use geom::{Aabb, Animation, Camera, Hit, Point, Pose, Ray};
use std::sync::Arc;

/// The reference backend with one planted fault.
pub(crate) struct Faulty {
    inner: CpuBackend,
    /// Name of the fault. An unknown name has no effect.
    fault: &'static str,
    device: Device,
    seen: Seen,
}

/// State observed so far.
#[derive(Default)]
struct Seen {
    animation: Option<Arc<Animation>>,
    first_leaf: Option<u32>,
    /// Hits by ticket, as they were when submitted.
    kept: Vec<(Ticket, Hits)>,
    rays: Vec<Ray>,
    kind: Option<QueryKind>,
    traces_since_refit: u32,
    loads: u32,
    /// Positions that were taken last. The fault `copies come twice` returns them again.
    taken_last: Option<Vec<Point>>,
    /// Positions that are returned even after another scene is loaded.
    stale_positions: Option<Vec<Point>>,
    pose: Option<Pose>,
    /// True if the host has not computed the range of the key frames.
    is_unknown: bool,
    /// True if the coordinates of the moment are known to differ greatly in size.
    is_spread: bool,
    /// Pose interpolated before `pose`, in the same scene.
    pose_before: Option<Pose>,
    /// Tree that `rebuild` built last.
    made: Option<Topology>,
    /// First tree that was uploaded in advance.
    uploaded: Option<Topology>,
    /// Hits of several queries traced together, and their total number.
    together: (Vec<Hits>, u64),
}

impl Faulty {
    pub(crate) fn new(fault: &'static str) -> Self {
        let inner = CpuBackend::new(Some(1)).unwrap();
        let mut device = inner.device().clone();
        device.capabilities.batches = true;
        device.capabilities.device_rebuild = Ok(());
        Self {
            inner,
            fault,
            device,
            seen: Seen::default(),
        }
    }

    fn is(&self, fault: &str) -> bool {
        self.fault == fault
    }

    fn trace_one(&mut self, query: Query<'_>) -> Result<()> {
        self.seen.together = (Vec::new(), 0);
        self.seen.traces_since_refit += 1;
        self.seen.kind = Some(query.kind);
        self.seen.rays = match query.rays {
            Rays::List(rays) => rays.to_vec(),
            Rays::Camera(_) | Rays::OnDevice(_) => Vec::new(),
        };
        match query.rays {
            Rays::Camera(camera) if self.is("pixels sampled at corners") => {
                let half = |i: usize| 0.5 * (camera.across[i] + camera.down[i]);
                let corner = std::array::from_fn(|i| camera.corner[i] - half(i));
                let rays = Rays::Camera(&Camera { corner, ..*camera });
                self.inner.trace(&[Query { rays, ..query }])
            }
            _ => self.inner.trace(&[query]),
        }
    }

    /// Applies the fault to hits.
    fn spoil(&self, hits: &mut Hits) {
        let seen = &self.seen;
        let miss = |h: &mut Hit| *h = Hit::MISS;
        let found = hits.closest.iter_mut().filter(|h| h.is_hit());
        match self.fault {
            "streamed vertices are not measured" if seen.is_unknown => {
                found.for_each(|h| h.u = h.u.next_up());
            }
            "far vertices change other hits" if seen.is_spread => {
                found.for_each(|h| h.t = h.t.next_down());
            }
            "far triangles are lost" if seen.is_spread => {
                let last = seen
                    .animation
                    .as_ref()
                    .map(|a| a.triangle_count() as u32 - 1);
                found.filter(|h| Some(h.triangle) == last).for_each(miss);
            }
            "distances one ulp off" => found.for_each(|h| h.t = h.t.next_up()),
            "weights swapped" => found.for_each(|h| std::mem::swap(&mut h.u, &mut h.v)),
            "edges leak" => {
                let near = |h: &&mut Hit| h.u.min(h.v).min(1.0 - h.u - h.v) < 1e-5;
                found.filter(near).for_each(miss);
            }
            "edges hit twice" => {
                let near = |h: &&mut Hit| h.u.min(h.v) == 0.0;
                found.filter(near).for_each(|h| h.t = h.t.next_down());
            }
            "made tree misses sometimes" if seen.made.is_some() => found.skip(1).for_each(miss),
            "first leaf is never hit" | "new tree answers for old frames" => {
                let first = seen.first_leaf;
                found.filter(|h| Some(h.triangle) == first).for_each(miss);
            }
            "hits of similar indices go to the first leaf" => {
                let first = seen.first_leaf.unwrap_or_default();
                // Triangles whose indices are in the same group of four.
                let similar = found.filter(|h| h.triangle / 4 == first / 4);
                similar.for_each(|h| h.triangle = first);
            }
            "every third scene is empty" if seen.loads.is_multiple_of(3) => found.for_each(miss),
            "second trace misses" if seen.traces_since_refit > 1 => found.for_each(miss),
            "hit again where the ray begins" => {
                for (hit, ray) in hits.closest.iter_mut().zip(&seen.rays) {
                    if !hit.is_hit() && ray.t_min > 0.0 {
                        (hit.t, hit.triangle) = (ray.t_min.next_up(), 0);
                    }
                }
            }
            "interval is closed" => {
                let ends = seen.rays.iter().map(|r| r.t_max);
                for (hit, end) in hits.closest.iter_mut().zip(ends) {
                    if !hit.is_hit() && end == 1.0 {
                        (hit.t, hit.triangle) = (1.0, 0);
                    }
                }
            }
            _ => {}
        }
        match (self.fault, seen.kind) {
            ("any hit forgets the last ray", Some(QueryKind::Any)) => {
                let last = hits.blocked.iter_mut().rev().find(|b| **b == 1);
                last.into_iter().for_each(|b| *b = 0);
            }
            ("shadows inverted", Some(QueryKind::ClosestAndShadow { .. })) => {
                let pairs = hits.blocked.iter_mut().zip(&hits.closest);
                let of_hits = pairs.filter(|(_, h)| h.is_hit());
                of_hits.for_each(|(b, _)| *b = 1 - *b);
            }
            _ => {}
        }
    }
}

impl Backend for Faulty {
    fn device(&self) -> &Device {
        &self.device
    }

    fn load(&mut self, animation: Arc<Animation>, intersector: Intersector) -> Result<()> {
        self.seen = Seen {
            animation: Some(Arc::clone(&animation)),
            loads: self.seen.loads + 1,
            stale_positions: self.seen.stale_positions.take(),
            ..Seen::default()
        };
        self.inner.load(animation, intersector)
    }

    fn upload_tree(&mut self, tree: &Topology, _: Generation) -> Result<bool> {
        self.seen.uploaded.get_or_insert_with(|| tree.clone());
        Ok(true)
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        let uploaded = self.seen.uploaded.take();
        let abandoned = uploaded.filter(|_| self.is("an abandoned upload is adopted"));
        let tree = abandoned.as_ref().unwrap_or(tree);
        self.seen.made = None;
        let adopted = self.inner.adopt(tree, generation);
        match (self.fault, &adopted) {
            ("any tree is taken", Err(_)) => return Ok(()),
            (_, Ok(())) => self.seen.first_leaf = tree.binary().order().first().copied(),
            _ => {}
        }
        adopted
    }

    fn evaluate(&mut self, tree: &Topology, generation: Generation) -> Result<bool> {
        self.inner.evaluate(tree, generation)
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        assert!(!self.is("panics"), "this backend panics");
        (self.seen.pose_before, self.seen.pose) = (self.seen.pose, Some(pose));
        let animation = self.seen.animation.as_ref();
        let late = animation.is_some_and(|a| match self.fault {
            "paged key frames come late" => a.window().is_some() && !a.is_streamed(),
            "streamed key frames come late" => a.is_streamed(),
            _ => false,
        });
        let range = animation.and_then(|a| a.known_range(pose));
        let is_unknown = animation.is_some() && range.is_none();
        self.seen.is_spread = range.is_some_and(|range| range.spread);
        self.seen.is_unknown = is_unknown;
        let key = pose.key.saturating_sub(u32::from(late));
        self.inner.interpolate(Pose { key, ..pose })
    }

    fn preprocess(&mut self) -> Result<()> {
        if self.is("boxes of the moment before")
            && let Some(before) = self.seen.pose_before
        {
            self.inner.interpolate(before)?;
        }
        self.inner.preprocess()
    }

    fn refit(&mut self) -> Result<()> {
        self.seen.traces_since_refit = 0;
        self.inner.refit()
    }

    /// Builds the tree on the host, between submissions.
    fn rebuild(&mut self, generation: Generation) -> Result<()> {
        self.inner.submit()?;
        let animation = self.seen.animation.clone().expect("a scene");
        let pose = self.seen.pose.expect("positions");
        let all = 0..animation.vertex_count() as u32;
        let moment = animation.moment(pose)?;
        let mut positions: Vec<_> = all.map(|v| moment.vertex(v)).collect();
        self.adopt(&tree_over(&animation, &positions), generation)?;
        if self.is("made tree is not the one in use") {
            positions.reverse();
        }
        self.seen.made = Some(tree_over(&animation, &positions));
        self.inner.preprocess()?;
        self.refit()
    }

    /// Traces a batch one after the other.
    fn trace(&mut self, queries: &[Query<'_>]) -> Result<()> {
        if let &[query] = queries {
            return self.trace_one(query);
        }
        self.seen.together = (Vec::new(), 0);
        for (index, &query) in queries.iter().enumerate() {
            self.inner.trace(&[query])?;
            let ticket = self.inner.submit()?;
            self.seen.together.1 += self.inner.wait(ticket)?.hits;
            let mut hits = Hits::default();
            self.inner.take_hits(ticket, 0, &mut hits)?;
            if index > 0 && self.is("all queries except the first miss") {
                hits.closest.fill(Hit::MISS);
                hits.blocked.fill(0);
            }
            self.seen.together.0.push(hits);
        }
        Ok(())
    }

    fn request_positions(&mut self) -> Result<()> {
        if self.is("positions outlive their scene") {
            self.seen.stale_positions = Some(vec![[0.0; 3]]);
        }
        self.inner.request_positions()
    }

    fn submit(&mut self) -> Result<Ticket> {
        let ticket = self.inner.submit()?;
        if self.seen.kind.is_some() {
            let mut hits = Hits::default();
            self.inner.take_hits(ticket, 0, &mut hits)?;
            if !self.is("new tree answers for old frames") {
                self.spoil(&mut hits);
            }
            self.seen.kept.push((ticket, hits));
        } else if self.is("submissions without rays discard results") {
            self.seen.kept.clear();
        }
        self.seen.kind = None;
        if self.is("tickets repeat") {
            return Ok(Ticket(ticket.0 / 2));
        }
        Ok(ticket)
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        if self.is("tickets repeat") {
            return Ok(FrameReport::default());
        }
        let mut report = self.inner.wait(ticket)?;
        report.hits += std::mem::take(&mut self.seen.together.1);
        match self.fault {
            "inactive miscounted" if report.inactive > 1 => report.inactive -= 1,
            "cost is that of the current tree" if report.candidate_cost.is_some() => {
                report.candidate_cost = report.sah_cost;
            }
            "evaluation counts inactive triangles twice" if report.candidate_cost.is_some() => {
                report.inactive *= 2;
            }
            "hits miscounted" if report.hits > 3 => report.hits -= 1,
            "a refit time without a refit" => report.times.refit_ms = Some(0.0),
            _ => {}
        }
        Ok(report)
    }

    fn is_done(&mut self, ticket: Ticket) -> Result<bool> {
        self.inner.is_done(ticket)
    }

    fn retain_traces(&mut self, tickets: &[Ticket]) {
        self.inner.retain_traces(tickets);
    }

    fn take_hits(&mut self, ticket: Ticket, index: usize, hits: &mut Hits) -> Result<()> {
        if let Some(of_batch) = self.seen.together.0.get(index) {
            hits.clone_from(of_batch);
            return Ok(());
        }
        let newest = self.is("answers of the newest frame") || self.is("tickets repeat");
        let mut newest_first = self.seen.kept.iter().rev();
        let found = newest_first.find(|k| newest || k.0 == ticket);
        *hits = found.map(|k| k.1.clone()).unwrap_or_default();
        if self.is("new tree answers for old frames") {
            self.spoil(hits);
        }
        Ok(())
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        let taken = self.inner.take_positions()?;
        let Some((ticket, snapshot)) = taken else {
            if self.is("copies come twice")
                && let Some(again) = self.seen.taken_last.take()
            {
                return Ok(Some((Ticket(0), Box::new(again))));
            }
            let old = self.seen.stale_positions.take();
            return Ok(old.map(|old| (Ticket(0), Box::new(old) as Snapshot)));
        };
        self.seen.taken_last = Some(snapshot.to_vec());
        self.seen.stale_positions = None;
        if self.is("copies are of the newest frame") {
            let newest = self.inner.positions()?;
            return Ok(Some((ticket, Box::new(newest))));
        }
        Ok(Some((ticket, snapshot)))
    }
}

impl Inspect for Faulty {
    fn rebuilt(&mut self) -> Result<Topology> {
        Ok(self.seen.made.clone().expect("a tree was made"))
    }

    fn positions(&mut self) -> Result<Vec<Point>> {
        let mut all = self.inner.positions()?;
        if self.is("positions one ulp off")
            && let Some(last) = all.last_mut()
        {
            last[2] = last[2].next_up();
        }
        Ok(all)
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        let mut all = self.inner.boxes()?;
        if self.is("last box too large")
            && let Some(last) = all.last_mut()
        {
            last.max[1] = last.max[1].next_up();
        }
        Ok(all)
    }
}
