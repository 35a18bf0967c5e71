//! What a backend says of itself and of its work.

use geom::Point;
use std::fmt;
use std::ops::Deref;

/// A point in one backend's order of submissions. Tickets finish in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub u64);

/// Which build a tree came from. Strictly rises with each adoption.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Generation(pub u64);

/// Positions on their way to a builder: read-only, sendable, given back when dropped.
pub type Snapshot = Box<dyn Deref<Target = [Point]> + Send + Sync>;

/// What kind of machine does the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// A graphics processor.
    Gpu,
    /// The host's own cores, by this program's code.
    Cpu,
    /// A driver that runs graphics code on the host's cores.
    Software,
}

impl DeviceKind {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Cpu => "cpu",
            Self::Software => "software",
        }
    }
}

/// How a device computes where nobody tells it how to round, as the textbook intersectors do not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arithmetic {
    /// Whether a quotient is the nearest number to the exact one.
    pub rounds_division: bool,
    /// Whether products are added up without being rounded first, anywhere.
    pub fuses: bool,
}

impl Arithmetic {
    /// Every operation rounded once, as IEEE 754 has it: the host's.
    pub const IEEE: Self = Self {
        rounds_division: true,
        fuses: false,
    };
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.rounds_division, self.fuses) {
            (true, false) => "every operation rounded once",
            (true, true) => "quotients rounded once, products fused",
            (false, false) => "quotients approximate, products rounded once",
            (false, true) => "quotients approximate, products fused",
        })
    }
}

/// Who is at work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// The backend's name on the command line, such as `cpu`.
    pub backend: &'static str,
    /// The device's own name.
    pub adapter: String,
    /// Driver and version; empty where there is none.
    pub driver: String,
    /// What kind of machine it is.
    pub kind: DeviceKind,
    /// Host threads the backend computes on; 0 if its device does.
    pub threads: usize,
    /// How it computes where nobody tells it how to round.
    pub arithmetic: Arithmetic,
}

/// Bytes of device memory by what they hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceBytes {
    /// The tree and the triangles' records: all that is there to be traced or refitted. Where a tree is handed over while
    /// frames read another, both.
    pub tree: u64,
    /// Room in which trees are made, or wait to be sent.
    pub scratch: u64,
    /// The scene itself: key frames, positions, which vertices are a triangle's.
    pub scene: u64,
    /// What frames need and leave: rays, hits, shadows, what is seen of a picture, counts, parameters.
    pub frames: u64,
}

impl DeviceBytes {
    /// All of it.
    pub fn total(self) -> u64 {
        self.tree + self.scratch + self.scene + self.frames
    }
}

/// Milliseconds of each stage; `None` for a stage that the submission left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Key frames to positions; `None` also where they ran beside `preprocess`, whose time then holds both.
    pub interpolate_ms: Option<f64>,
    /// Positions to records and boxes of leaves, or key frames to these and to positions.
    pub preprocess_ms: Option<f64>,
    /// Positions to a tree made on the device, but for records and boxes of leaves.
    pub rebuild_ms: Option<f64>,
    /// Boxes of leaves to boxes of inner nodes.
    pub refit_ms: Option<f64>,
    /// Primary or given rays; their shadow rays too, where one kernel traces both.
    pub trace_primary_ms: Option<f64>,
    /// Shadow rays; `None` also where the primary rays' time holds theirs.
    pub trace_shadow_ms: Option<f64>,
    /// From the first stage's start to the last one's end, by the device's clock.
    pub device_ms: f64,
    /// When the first stage began, by the device's clock, whose zero is
    /// arbitrary but the same for all submissions; `None` where there is no such clock.
    pub begun_ms: Option<f64>,
}

/// What one submission did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameReport {
    /// How long it took.
    pub times: StageTimes,
    /// Rays that hit; with [`crate::QueryKind::Any`], rays that met anything.
    pub hits: u64,
    /// Hits in shadow.
    pub blocked: u64,
    /// Rays, shadow rays included, that error bounds left open and exact
    /// arithmetic settled; 0 unless the intersector is `exact`.
    pub settled: u64,
    /// Triangles inactive at the positions traced.
    pub inactive: u64,
    /// Triangles active but of zero area at the positions traced.
    pub degenerate: u64,
    /// Cost of the refitted tree by the surface area heuristic (traversal 1,
    /// intersection 1), where the backend measures it.
    pub sah_cost: Option<f64>,
    /// Bytes that went back to the host for a builder.
    pub readback_bytes: u64,
}

/// A tree's cost by the surface area heuristic (traversal 1, intersection 1; MacDonald, Booth 1990): all nodes' areas over the
/// root's. `None` if the root has no area, or areas were too large to be added up.
#[must_use]
pub fn sah_cost(areas: f64, root: f64) -> Option<f64> {
    let cost = areas / root;
    (root > 0.0 && cost.is_finite()).then_some(cost)
}
