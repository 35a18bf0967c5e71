//! A backend that only checks the contract, and vertices that block a builder.

use backend::{
    Arithmetic, Backend, BackendError, Capabilities, Device, DeviceKind, FrameReport, Generation,
    Hits, Intersector, Query, Result, Snapshot, StageTimes, Ticket, TreeFormat, TreeWriter,
};
use bvh_build::{BinaryTree, sah_cost};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Point, Pose};
use std::collections::{HashMap, VecDeque};
use std::ops::Deref;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Receives a message for each rendered frame.
pub(in crate::driver) type Rendered = Arc<Mutex<Receiver<()>>>;

/// Positions whose readers wait for 20 more frames, or until no renderer is left.
struct Vertices {
    positions: Vec<Point>,
    rendered: Option<Rendered>,
}

impl Deref for Vertices {
    type Target = [Point];
    fn deref(&self) -> &[Point] {
        if let Some(rendered) = &self.rendered {
            let rendered = rendered.lock().unwrap();
            rendered.try_iter().for_each(drop);
            for _ in 0..20 {
                let next = rendered.recv_timeout(Duration::from_secs(10));
                let waits = next == Err(RecvTimeoutError::Timeout);
                assert!(!waits, "no frame was rendered while the builder waited");
            }
        }
        &self.positions
    }
}

/// A call that fails once.
struct Failure {
    /// Name of the call: the argument of `check`.
    call: &'static str,
    /// Number of earlier calls of this name, which succeed.
    after: usize,
}

/// Calls that the fake received.
#[derive(Default)]
pub(in crate::driver) struct Log {
    pub(in crate::driver) interpolated: usize,
    pub(in crate::driver) refitted: usize,
    pub(in crate::driver) traced: Vec<(Generation, Pose)>,
    pub(in crate::driver) adopted: Vec<Generation>,
    /// The adopted trees.
    pub(in crate::driver) adopted_trees: Vec<Arc<BinaryTree>>,
    /// Generations of the trees that `rebuild` was called for.
    pub(in crate::driver) rebuilt: Vec<Generation>,
    pub(in crate::driver) position_requests: usize,
    /// Evaluated generations, and the costs of both trees at the positions of the frame, the candidate's first.
    pub(in crate::driver) evaluated: Vec<(Generation, [f64; 2])>,
}

/// Checks the order of calls. Positions requested before the first trace arrive at once. Later ones arrive after `polls`
/// polls, or never.
#[derive(Default)]
pub(in crate::driver) struct Fake {
    pub(in crate::driver) log: Log,
    animation: Option<Arc<Animation>>,
    pose: Option<Pose>,
    generation: Generation,
    /// True if the boxes are up to date: those of leaves, and those of inner nodes.
    fresh: (bool, bool),
    ticket: u64,
    /// Polls left, submission and pose, in the order of the requests.
    read_backs: VecDeque<(u32, Ticket, Pose)>,
    /// Whether the recording requests positions.
    requests_positions: bool,
    /// Whether any query was traced.
    traced: bool,
    polls: Option<u32>,
    /// Blocks readers of positions, except for those of the first tree.
    pub(in crate::driver) rendered: Option<Rendered>,
    /// Whether it evaluates candidates. Submissions without an evaluation report a constant cost.
    pub(in crate::driver) measures: bool,
    /// The current tree, if candidates are evaluated.
    tree: Option<Topology>,
    /// Costs of a candidate and of the current tree, in the recording and per submission.
    recorded: Option<[f64; 2]>,
    costs: HashMap<Ticket, [f64; 2]>,
    failure: Option<Failure>,
    /// Whether there is no memory to upload a tree in advance.
    pub(in crate::driver) lacks_memory: bool,
    /// Snapshots that were allocated in advance. With these, the fake allocates no memory, so it logs nothing.
    pub(in crate::driver) prepared: Option<Vec<Snapshot>>,
}

impl Fake {
    pub(in crate::driver) fn new(polls: Option<u32>) -> Self {
        Self {
            polls,
            ..Self::default()
        }
    }

    /// Makes a call fail once, after `after` calls of the same name.
    pub(in crate::driver) fn failing(self, call: &'static str, after: usize) -> Self {
        let failure = Some(Failure { call, after });
        Self { failure, ..self }
    }

    /// Returns an error if this call is to fail.
    fn check(&mut self, call: &str) -> Result<()> {
        match &mut self.failure {
            Some(failure) if failure.call == call && failure.after > 0 => failure.after -= 1,
            Some(failure) if failure.call == call => {
                self.failure = None;
                return Err(BackendError::unsupported("fake", "this call"));
            }
            _ => (),
        }
        Ok(())
    }

    /// The cost of a tree at the pose of the recording.
    fn cost_of(&self, tree: &Topology) -> f64 {
        let moment = self.animation.as_ref().unwrap().moment(self.pose.unwrap());
        let (moment, triangles) = (moment.unwrap(), 0..tree.triangle_count() as u32);
        let boxes: Vec<Aabb> = triangles.map(|t| moment.build_box(t)).collect();
        sah_cost(tree.binary(), &boxes[..])
    }

    fn note(&mut self, what: impl FnOnce(&mut Log)) {
        if self.prepared.is_none() {
            what(&mut self.log);
        }
    }
}

impl Backend for Fake {
    fn device(&self) -> &Device {
        static DEVICE: Device = Device {
            backend: "fake",
            adapter: String::new(),
            driver: String::new(),
            kind: DeviceKind::Cpu,
            threads: 1,
            arithmetic: Arithmetic::IEEE,
            capabilities: Capabilities {
                tree_format: TreeFormat::Binary,
                batches: false,
                device_rebuild: Ok(()),
            },
        };
        &DEVICE
    }
    fn load(&mut self, animation: Arc<Animation>, _: Intersector) -> Result<()> {
        self.animation = Some(animation);
        Ok(())
    }
    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        assert!(
            generation > self.generation,
            "generation is not greater than the current one"
        );
        assert!(!self.requests_positions, "a submission comes first");
        let live = self.animation.as_ref().unwrap().live_count();
        assert_eq!(tree.binary().leaf_count(), live);
        self.check("adopt")?;
        self.generation = generation;
        self.fresh = (false, false);
        if self.measures {
            self.tree = Some(tree.clone());
        }
        self.note(|log| {
            log.adopted.push(generation);
            log.adopted_trees.push(Arc::clone(tree.binary()));
        });
        Ok(())
    }
    fn tree_writer(&mut self, _: Generation) -> Result<Option<TreeWriter>> {
        self.check("tree_writer").map(|()| None)
    }
    fn upload_tree(&mut self, _: &Topology, _: Generation) -> Result<bool> {
        if self.lacks_memory {
            let what = "a tree".to_owned();
            return Err(BackendError::OutOfMemory { what, bytes: 0 });
        }
        Ok(true)
    }
    fn evaluate(&mut self, tree: &Topology, generation: Generation) -> Result<bool> {
        assert!(generation > self.generation, "a candidate is newer");
        let Some(current) = &self.tree else {
            return Ok(false);
        };
        let costs = [tree, current].map(|tree| self.cost_of(tree));
        self.recorded = Some(costs);
        self.note(|log| log.evaluated.push((generation, costs)));
        Ok(true)
    }
    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        self.pose = Some(pose);
        self.fresh = (false, false);
        self.note(|log| log.interpolated += 1);
        Ok(())
    }
    fn preprocess(&mut self) -> Result<()> {
        assert!(self.pose.is_some() && self.generation > Generation(0));
        self.check("preprocess")?;
        self.fresh.0 = true;
        Ok(())
    }
    fn refit(&mut self) -> Result<()> {
        assert!(self.fresh.0, "boxes of leaves come first");
        self.fresh.1 = true;
        self.note(|log| log.refitted += 1);
        Ok(())
    }
    fn rebuild(&mut self, generation: Generation) -> Result<()> {
        assert!(
            generation > self.generation,
            "generation is not greater than the current one"
        );
        assert!(self.pose.is_some(), "positions come first");
        self.generation = generation;
        self.fresh = (false, false);
        self.note(|log| log.rebuilt.push(generation));
        Ok(())
    }
    fn trace(&mut self, _: &[Query<'_>]) -> Result<()> {
        assert_eq!(self.fresh, (true, true), "a stale tree was traced");
        let traced = (self.generation, self.pose.unwrap());
        self.note(|log| log.traced.push(traced));
        self.traced = true;
        Ok(())
    }
    fn request_positions(&mut self) -> Result<()> {
        assert!(!self.requests_positions, "one request a submission");
        self.check("request_positions")?;
        self.requests_positions = true;
        self.note(|log| log.position_requests += 1);
        Ok(())
    }
    fn submit(&mut self) -> Result<Ticket> {
        self.ticket += 1;
        if std::mem::take(&mut self.requests_positions) {
            let polls = self.polls.unwrap_or(u32::MAX);
            let polls = if self.traced { polls } else { 0 };
            let request = (polls, Ticket(self.ticket), self.pose.unwrap());
            self.read_backs.push_back(request);
        }
        let costs = self.recorded.take();
        self.costs
            .extend(costs.map(|costs| (Ticket(self.ticket), costs)));
        Ok(Ticket(self.ticket))
    }
    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        assert!(ticket.0 <= self.ticket, "this ticket was not issued");
        if self.costs.contains_key(&ticket) {
            self.check("wait for an evaluation")?;
        }
        let costs = self.costs.remove(&ticket);
        Ok(FrameReport {
            sah_cost: costs.map_or(Some(3.0), |[_, current]| Some(current)),
            candidate_cost: costs.map(|[candidate, _]| candidate),
            times: StageTimes {
                device_ms: 1.0,
                ..StageTimes::default()
            },
            ..FrameReport::default()
        })
    }
    fn take_hits(&mut self, _: Ticket, _: usize, _: &mut Hits) -> Result<()> {
        Ok(())
    }
    fn retain_traces(&mut self, _: &[Ticket]) {}
    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        match self.read_backs.front_mut() {
            Some((0, ticket, pose)) => {
                let (ticket, pose) = (*ticket, *pose);
                self.read_backs.pop_front();
                if let Some(prepared) = &mut self.prepared {
                    let snapshot = prepared.pop().expect("enough were made");
                    return Ok(Some((ticket, snapshot)));
                }
                let a = self.animation.as_ref().unwrap();
                let moment = a.moment(pose).unwrap();
                let at = |v| moment.vertex(v as u32);
                let positions: Vec<Point> = (0..a.vertex_count()).map(at).collect();
                let rendered = self.rendered.clone().filter(|_| self.traced);
                let vertices = Vertices {
                    positions,
                    rendered,
                };
                Ok(Some((ticket, Box::new(vertices))))
            }
            Some((polls, ..)) => {
                *polls -= 1;
                Ok(None)
            }
            None => Ok(None),
        }
    }
}
