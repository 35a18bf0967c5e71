//! After the first frames, the frame loop takes no memory from the heap, whatever the policy.
//!
//! Builders do, on threads of their own; only the thread that renders is counted.

#![expect(unsafe_code, reason = "an allocator that counts")]

use backend::{
    Arithmetic, Backend, Device, DeviceKind, FrameReport, Generation, Hits, Inspect, Method, Query,
    QueryKind, Rays, Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Aabb, Animation, Camera, Point, Pose};
use pipeline::{Driver, DriverOptions, Frame, Pace, PipelineError, Update};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::time::Duration;

thread_local! {
    static TAKEN: Cell<u64> = const { Cell::new(0) };
}

/// Counts how often each thread takes memory.
struct Counting;

// SAFETY: every call is passed on to the system's allocator; counting takes no memory itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        TAKEN.with(|n| n.set(n.get() + 1));
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        TAKEN.with(|n| n.set(n.get() + 1));
        // SAFETY: as above.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// A backend that does nothing and takes no memory. Vertices wait in boxes made beforehand.
struct Idle {
    device: Device,
    snapshots: Vec<Snapshot>,
    ticket: u64,
    requested: Option<Ticket>,
}

impl Idle {
    fn new(animation: &Animation, snapshots: usize) -> Self {
        let device = Device {
            backend: "idle",
            adapter: String::new(),
            driver: String::new(),
            kind: DeviceKind::Cpu,
            threads: 1,
            arithmetic: Arithmetic::IEEE,
        };
        let snapshot = |_| Box::new(animation.keys()[0].clone()) as Snapshot;
        Self {
            device,
            snapshots: (0..snapshots).map(snapshot).collect(),
            ticket: 0,
            requested: None,
        }
    }
}

impl Backend for Idle {
    fn device(&self) -> &Device {
        &self.device
    }
    fn load(&mut self, _: Arc<Animation>, _: Method) -> Result<()> {
        Ok(())
    }
    fn adopt(&mut self, _: &Topology, _: Generation) -> Result<()> {
        Ok(())
    }
    fn interpolate(&mut self, _: Pose) -> Result<()> {
        Ok(())
    }
    fn preprocess(&mut self) -> Result<()> {
        Ok(())
    }
    fn refit(&mut self) -> Result<()> {
        Ok(())
    }
    fn trace(&mut self, _: Query<'_>) -> Result<()> {
        Ok(())
    }
    fn request_positions(&mut self) -> Result<()> {
        self.requested = Some(Ticket(self.ticket + 1));
        Ok(())
    }
    fn submit(&mut self) -> Result<Ticket> {
        self.ticket += 1;
        Ok(Ticket(self.ticket))
    }
    fn wait(&mut self, _: Ticket) -> Result<FrameReport> {
        Ok(FrameReport::default())
    }
    fn hits(&mut self, _: Ticket, _: &mut Hits) -> Result<()> {
        Ok(())
    }
    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        let Some(ticket) = self.requested.take() else {
            return Ok(None);
        };
        let snapshot = self.snapshots.pop().expect("enough were made");
        Ok(Some((ticket, snapshot)))
    }
    fn inspect(&mut self) -> &mut dyn Inspect {
        self
    }
}

impl Inspect for Idle {
    fn positions(&mut self) -> Result<Vec<Point>> {
        Ok(Vec::new())
    }
    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        Ok(Vec::new())
    }
}

/// A sheet of triangles that bulges.
fn bulging() -> Arc<Animation> {
    let place = |i: u32| [(i % 32) as f32, (i / 32) as f32];
    let key = |far: f32| {
        let corners = |i: u32| {
            let [x, y] = place(i);
            let z = far * (x * y * 0.02).sin();
            [[x, y, z], [x + 1.0, y, z], [x, y + 1.0, z]]
        };
        (0..512).flat_map(corners).collect()
    };
    let triangles = (0..512).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Arc::new(Animation::new(vec![key(0.0), key(9.0)], triangles).unwrap())
}

/// How often each frame after the first took memory, and how many trees came meanwhile.
fn takings(update: Update, predict: bool) -> (Vec<u64>, usize) {
    const FRAMES: u64 = 400;
    let animation = bulging();
    let options = DriverOptions {
        method: Method::default(),
        update,
        builder_threads: 1,
        time_range: [0.0, 1.0],
        predict,
    };
    let backend = Idle::new(&animation, FRAMES as usize + 1);
    let mut driver = Driver::new(Box::new(backend), animation, options).unwrap();
    let camera = Camera::look_at([0.0, 0.0, 9.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, [2, 2]).unwrap();
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::Closest,
    };
    let (mut all, mut trees) = (Vec::with_capacity(FRAMES as usize), 0);
    let mut last = TAKEN.get();
    let frames = (0..FRAMES).map(|index| Frame {
        index,
        time: index as f64 / FRAMES as f64,
    });
    let run = driver.run::<PipelineError>(frames, query, false, |record, _| {
        trees += usize::from(record.adopted.is_some());
        std::thread::sleep(Duration::from_micros(100));
        let now = TAKEN.get();
        all.push(now - last);
        last = now;
        Ok(())
    });
    run.unwrap();
    (all, trees)
}

#[test]
fn frames_take_no_memory_once_the_loop_runs() {
    let before = TAKEN.get();
    drop(std::hint::black_box(vec![0_u8; 9]));
    assert_eq!(TAKEN.get(), before + 1, "nobody counts");
    let free = Update::Async(Pace::Free);
    // A thread that waits at a channel is entered there, which takes memory the first time.
    for (update, predict, least, allowed) in [
        (Update::Refit, true, 1, 0),
        (Update::TSah, true, 1, 0),
        (free, true, 4, 0),
        (free, false, 4, 0),
        (Update::Async(Pace::Lockstep(3)), true, 100, 4),
    ] {
        let (all, trees) = takings(update, predict);
        assert!(trees >= least, "{update:?} {predict}: {trees} trees");
        // The builder's thread is started with its first job.
        let late: u64 = all[20..].iter().sum();
        assert!(late <= allowed, "{update:?} {predict}: {late} times");
    }
}
