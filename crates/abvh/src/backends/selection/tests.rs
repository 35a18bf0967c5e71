//! Tests of the selection with fake backends.

use super::*;
use crate::backends::adapters::named;
use DeviceKind::{Cpu, Gpu, Software};
use backend::BackendName;
use std::cell::RefCell;

/// A fake backend: its adapters, and the error of opening it, if any.
#[derive(Clone)]
struct Fake {
    name: BackendName,
    offers: Result<Vec<(&'static str, DeviceKind)>, &'static str>,
    breaks: Option<fn() -> BackendError>,
}

fn fake(name: BackendName, offers: &[(&'static str, DeviceKind)]) -> Fake {
    Fake {
        name,
        offers: Ok(offers.to_vec()),
        breaks: None,
    }
}

fn absent(name: BackendName) -> Fake {
    Fake {
        offers: Err("no loader"),
        ..fake(name, &[])
    }
}

/// A backend with one GPU that cannot be opened.
fn broken(name: BackendName, breaks: fn() -> BackendError) -> Fake {
    Fake {
        breaks: Some(breaks),
        ..fake(name, &[CARD])
    }
}

const CARD: (&str, DeviceKind) = ("card", Gpu);
const SOFT: (&str, DeviceKind) = ("soft", Software);

fn host() -> Fake {
    fake(BackendName::Cpu, &[("host", Cpu)])
}

fn too_small() -> BackendError {
    BackendError::Limit {
        what: "triangles".to_owned(),
        need: 4000,
        limit: 1000,
    }
}

fn lost() -> BackendError {
    BackendError::DeviceLost("wrong bits".to_owned())
}

impl Fake {
    fn list(&self, log: &RefCell<Vec<String>>) -> backend::Result<Vec<AdapterInfo>> {
        log.borrow_mut().push(format!("list {}", self.name));
        let no = |e: &&str| BackendError::NoDevice((*e).to_owned());
        self.offers.as_ref().map(|o| named(o)).map_err(no)
    }

    fn open(
        &self,
        adapter: Option<usize>,
        log: &RefCell<Vec<String>>,
    ) -> backend::Result<Box<dyn Backend>> {
        let (name, _) = self.offers.as_ref().unwrap()[adapter.unwrap()];
        let line = format!("open {} {name}", self.name);
        log.borrow_mut().push(line);
        match self.breaks {
            Some(breaks) => Err(breaks()),
            None => Ok(Box::new(cpu_simd::open(Some(1))?)),
        }
    }
}

/// Returns the reason, and the log of the selection: `list NAME` or `open NAME ADAPTER`.
fn choose(
    fakes: &[Fake],
    asked: Option<&str>,
) -> (Result<String, NoBackend<BackendError>>, Vec<String>) {
    let log = RefCell::new(Vec::new());
    let each = |fake| {
        let log = &log;
        let list = move || Fake::list(fake, log);
        let open = move |adapter: Option<usize>, _: usize| Fake::open(fake, adapter, log);
        (fake, list, open)
    };
    let all: Vec<_> = fakes.iter().map(each).collect();
    let entries = all.iter().map(|(fake, list, open)| BackendEntry {
        name: fake.name,
        rank_reason: "it has this rank",
        kinds: match fake.name {
            BackendName::Cpu => &[Cpu],
            BackendName::CpuRef => &[],
            _ => &[Gpu, Software],
        },
        list,
        open,
    });
    let entries: Vec<BackendEntry<'_>> = entries.collect();
    let selected = open_first(&entries, asked, 1, |_| Ok(()));
    (selected.map(|((), reason)| reason), log.take())
}

/// Checks that the reason or the error contains each of `says`, and that the selection's log is `log` unless that is
/// empty.
fn check(fakes: &[Fake], asked: Option<&str>, log: &str, says: &[&str]) {
    let (found, did) = choose(fakes, asked);
    let text = found.unwrap_or_else(|none| format!("refused: {}", none.reason));
    let missing = says.iter().find(|part| !text.contains(**part));
    assert_eq!(missing, None, "{text}");
    assert!(log.is_empty() || did.join(", ") == log, "{did:?}");
}

#[test]
fn opens_devices_in_preference_order() {
    let small = |name| broken(name, too_small);
    let two = Fake {
        offers: Ok(vec![("one", Gpu), ("two", Gpu)]),
        ..broken(BackendName::Vulkan, lost)
    };
    let limit = "vulkan on card: triangles needs 4000, the limit is 1000";
    let (both, soft) = (
        fake(BackendName::Vulkan, &[SOFT, CARD]),
        fake(BackendName::Vulkan, &[SOFT]),
    );
    let next = || fake(BackendName::Wgpu, &[CARD]);
    let first = "list vulkan, open vulkan card";
    let on_host = "list vulkan, list cpu, open cpu host";
    let after_two = "list vulkan, open vulkan one, open vulkan two, list cpu, open cpu host";
    let after_small = "list vulkan, open vulkan card, list wgpu, open wgpu card";
    let is_gpu = "card is a GPU; it has this rank";
    let cases: [(&[Fake], &str, &[&str]); 7] = [
        (&[both, next(), host()], first, &[is_gpu]),
        (
            &[soft, host()],
            on_host,
            &["vulkan finds no GPU but only soft"],
        ),
        // If a GPU fails, the next is tried.
        (
            &[small(BackendName::Vulkan), next(), host()],
            after_small,
            &[limit],
        ),
        (
            &[small(BackendName::Vulkan), small(BackendName::Wgpu), host()],
            "",
            &[limit, "wgpu on card"],
        ),
        (&[two, host()], after_two, &[]),
        (
            &[absent(BackendName::Vulkan), host()],
            on_host,
            &["vulkan cannot run: no device: no loader"],
        ),
        (
            &[absent(BackendName::Vulkan)],
            "list vulkan",
            &["refused: ", "no loader"],
        ),
    ];
    for (fakes, log, says) in cases {
        check(fakes, None, log, says);
    }
}

#[test]
fn the_reference_is_never_selected() {
    let reference = fake(BackendName::CpuRef, &[("host", Cpu)]);
    check(
        &[reference.clone(), host()],
        None,
        "list cpu, open cpu host",
        &[],
    );
    let (found, log) = choose(&[reference], None);
    assert!(found.is_err() && log.is_empty(), "{log:?}");
    let entry = crate::backends::find_backend(BackendName::CpuRef).unwrap();
    assert!(entry.kinds.is_empty());
}

#[test]
fn named_adapter_is_opened_or_refused() {
    let fakes = [fake(BackendName::Vulkan, &[SOFT, CARD]), host()];
    // Both backends have an adapter 0, and the host is preferred to software.
    for (asked, opened, says) in [
        ("soft", "open vulkan soft", "'soft' is soft"),
        ("host", "open cpu host", "host"),
        ("1", "open vulkan card", "card"),
        ("0", "open cpu host", "host"),
    ] {
        let (why, log) = choose(&fakes, Some(asked));
        assert_eq!(log.last().unwrap(), opened);
        assert!(why.unwrap().contains(says));
    }
    let fakes = [
        fake(BackendName::Vulkan, &[("card x", Gpu), ("card y", Gpu)]),
        host(),
    ];
    let cards = "0: card x; 1: card y";
    check(&fakes, Some("card"), "", &["refused: ", cards]);
    let none = "refused: no backend has an adapter 'voodoo'; there is vulkan 0: card x; 1: card y, cpu 0: host";
    check(&fakes, Some("voodoo"), "", &[none]);
    let other = "no loader; no other backend has an adapter 'card'; there is cpu 0: host";
    check(
        &[absent(BackendName::Vulkan), host()],
        Some("card"),
        "",
        &[other],
    );
}

#[test]
fn total_failure_reports_every_reason() {
    let host = |breaks| Fake {
        breaks: Some(breaks),
        ..host()
    };
    let small = broken(BackendName::Vulkan, too_small);
    // An adapter that exists but fails is not reported as missing.
    let only = "refused: triangles needs 4000, the limit is 1000";
    check(&[small.clone(), host(lost)], Some("card"), "", &[only]);
    check(&[host(lost)], None, "", &["refused: ", "wrong bits"]);
    let both = ["limit is 1000", "wrong bits"];
    check(&[small.clone(), host(lost)], None, "", &both);
    for second in [lost, too_small] {
        let (found, _) = choose(&[small.clone(), host(second)], None);
        assert_eq!(found.unwrap_err().last_error, Some(second()));
    }
}
