//! The choice among made-up backends.

use super::*;
use crate::adapters::named;
use crate::args::BackendName;
use DeviceKind::{Cpu, Gpu, Software};
use backend::BackendError;
use std::cell::RefCell;

/// What a made-up backend offers, and how opening it ends.
#[derive(Clone)]
struct Fake {
    name: &'static str,
    offers: Result<Vec<(&'static str, DeviceKind)>, &'static str>,
    breaks: Option<fn() -> BackendError>,
    covered_by: Option<&'static str>,
}

fn fake(name: &'static str, offers: &[(&'static str, DeviceKind)]) -> Fake {
    Fake {
        name,
        offers: Ok(offers.to_vec()),
        breaks: None,
        covered_by: None,
    }
}

fn absent(name: &'static str) -> Fake {
    Fake {
        offers: Err("no loader"),
        ..fake(name, &[])
    }
}

/// One card, which cannot be opened.
fn broken(name: &'static str, breaks: fn() -> BackendError) -> Fake {
    Fake {
        breaks: Some(breaks),
        ..fake(name, &[("card", Gpu)])
    }
}

fn host() -> Fake {
    fake("cpu", &[("host", Cpu)])
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
    fn list(&self, log: &RefCell<Vec<String>>) -> backend::Result<Vec<Adapter>> {
        log.borrow_mut().push(format!("list {}", self.name));
        let no = |e: &&str| BackendError::NoDevice((*e).to_owned());
        self.offers.as_ref().map(|o| named(o)).map_err(no)
    }

    fn open(
        &self,
        adapter: Option<&Adapter>,
        log: &RefCell<Vec<String>>,
    ) -> backend::Result<Box<dyn Backend>> {
        let line = format!("open {} {}", self.name, adapter.unwrap().name);
        log.borrow_mut().push(line);
        match self.breaks {
            Some(breaks) => Err(breaks()),
            None => Ok(Box::new(cpu_simd::open(Some(1))?)),
        }
    }
}

/// The reason, and what the choice did, in order: `list NAME` or `open NAME ADAPTER`.
fn choose(
    fakes: &[Fake],
    asked: Option<&str>,
    traces: bool,
) -> (Result<String, Stop>, Vec<String>) {
    let log = RefCell::new(Vec::new());
    let each = |fake| {
        let log = &log;
        let list = move || Fake::list(fake, log);
        let open = move |adapter: Option<&Adapter>, _: usize| Fake::open(fake, adapter, log);
        (fake, list, open)
    };
    let all: Vec<_> = fakes.iter().map(each).collect();
    let known = all.iter().map(|(fake, list, open)| Known {
        name: BackendName::Auto,
        text: fake.name,
        place: "it stands where it stands",
        kinds: match fake.name {
            "cpu" => &[Cpu],
            _ => &[Gpu, Software],
        },
        covered_by: fake.covered_by,
        list,
        open,
    });
    let known: Vec<Known<'_>> = known.collect();
    let want = Want {
        backend: BackendName::Auto,
        adapter: asked,
        threads: 1,
    };
    let known: Vec<_> = known.iter().collect();
    let taken = take(&known, &want, &|_| traces, |_| Ok(()));
    (taken.map(|((), why)| why), log.take())
}

/// Backend and adapter that were opened last, and the reason.
fn taken(fakes: &[Fake], asked: Option<&str>) -> (String, String) {
    let (why, log) = choose(fakes, asked, false);
    let opened = log.last().unwrap().strip_prefix("open ").unwrap();
    (opened.to_owned(), why.unwrap())
}

fn refused(fakes: &[Fake], asked: Option<&str>) -> String {
    choose(fakes, asked, false).0.unwrap_err().text()
}

#[test]
fn the_first_backend_with_a_gpu_is_taken_and_nothing_else_is_touched() {
    let fakes = [
        fake("a", &[("soft", Software), ("card", Gpu)]),
        fake("b", &[("card", Gpu)]),
        host(),
    ];
    let (why, log) = choose(&fakes, None, false);
    assert_eq!(why.unwrap(), "card is a GPU; it stands where it stands");
    assert_eq!(log, ["list a", "open a card"]);
}

#[test]
fn a_driver_that_traces_is_named_where_hardware_may_do_it() {
    let why = |offers, asked| {
        let fakes = [fake("a", offers), host()];
        choose(&fakes, asked, true).0.unwrap()
    };
    let card: &[_] = &[("card", Gpu)];
    let named = why(card, None);
    let says = "--backend vulkan-rt is the faster choice";
    assert!(named.contains(says), "{named}");
    assert_eq!(named.matches("vulkan-rt").count(), 1, "{named}");
    // Where the card was meant by name, too; but no driver on the host's cores is hardware.
    assert!(why(card, Some("card")).ends_with("the driver's affair"));
    let soft: &[_] = &[("soft", Software)];
    assert!(!why(soft, Some("soft")).contains("vulkan-rt"));
}

#[test]
fn a_software_driver_never_comes_before_the_host_and_is_not_opened() {
    let (why, log) = choose(&[fake("a", &[("soft", Software)]), host()], None, false);
    assert!(why.unwrap().starts_with("a finds no GPU but only soft"));
    assert_eq!(log, ["list a", "list cpu", "open cpu host"]);
}

#[test]
fn a_backend_that_would_find_no_more_is_not_even_listed() {
    let covered = Fake {
        covered_by: Some("a"),
        ..fake("b", &[("card", Gpu)])
    };
    let log = |first| choose(&[first, covered.clone(), host()], None, false).1;
    for first in [fake("a", &[("soft", Software)]), absent("a")] {
        assert!(!log(first).contains(&"list b".to_owned()));
    }
    // But it is where the other has a GPU that it cannot use.
    assert!(log(broken("a", too_small)).contains(&"open b card".to_owned()));
}

#[test]
fn a_gpu_that_fails_gives_way_to_the_next_and_both_numbers_are_told() {
    let small = |name| broken(name, too_small);
    let card = fake("b", &[("card", Gpu)]);
    let (opened, why) = taken(&[small("a"), card, host()], None);
    assert_eq!(opened, "b card");
    let limit = "a on card: triangles needs 4000, the limit is 1000";
    assert!(why.contains(limit), "{why}");
    let (opened, why) = taken(&[small("a"), small("b"), host()], None);
    assert_eq!(opened, "cpu host");
    let both = why.contains("a on card") && why.contains("b on card");
    assert!(both, "{why}");
    let two = Fake {
        offers: Ok(vec![("one", Gpu), ("two", Gpu)]),
        ..broken("a", lost)
    };
    let (_, log) = choose(&[two, host()], None, false);
    assert_eq!(log[1..3], ["open a one", "open a two"]);
}

#[test]
fn an_absent_backend_is_passed_over_with_the_reason() {
    let expected = ("cpu host", "a cannot run: no device: no loader");
    let (opened, why) = taken(&[absent("a"), host()], None);
    assert_eq!((&*opened, &*why), expected);
}

#[test]
fn who_names_an_adapter_gets_it_even_if_it_is_software() {
    let fakes = [fake("a", &[("soft", Software), ("card", Gpu)]), host()];
    let named = |asked| taken(&fakes, Some(asked));
    let soft = ("a soft".to_owned(), "'soft' is soft".to_owned());
    assert_eq!(named("soft"), soft);
    // Both have a number 0, and the host comes before software.
    for (asked, opened) in [("host", "cpu host"), ("1", "a card"), ("0", "cpu host")] {
        assert_eq!(named(asked).0, opened);
    }
}

#[test]
fn an_adapter_that_fits_several_or_none_is_refused_with_those_there_are() {
    let fakes = [fake("a", &[("card x", Gpu), ("card y", Gpu)]), host()];
    assert!(refused(&fakes, Some("card")).ends_with("0: card x; 1: card y"));
    assert_eq!(
        refused(&fakes, Some("voodoo")),
        "no backend has an adapter 'voodoo'; there is a 0: card x; 1: card y, cpu 0: host"
    );
    assert_eq!(
        refused(&[absent("a"), host()], Some("card")),
        "a cannot run: no device: no loader; no other backend has an adapter 'card'; there is cpu 0: host"
    );
}

#[test]
fn where_nothing_works_every_reason_is_told_and_the_last_failure_decides() {
    let host = |breaks| Fake {
        breaks: Some(breaks),
        ..host()
    };
    let small = broken("a", too_small);
    // An adapter that is there but fails is not called absent.
    let only = refused(&[small.clone(), host(lost)], Some("card"));
    assert_eq!(only, "triangles needs 4000, the limit is 1000");
    let alone = choose(&[host(lost)], None, false).0.unwrap_err();
    assert!(matches!(&alone, Stop::Failed(_)) && alone.text().contains("wrong bits"));
    let both = choose(&[small.clone(), host(lost)], None, false)
        .0
        .unwrap_err();
    assert!(matches!(both, Stop::Failed(_)));
    let text = both.text();
    let told = text.contains("limit is 1000") && text.contains("wrong bits");
    assert!(told, "{text}");
    let bad = choose(&[small, host(too_small)], None, false)
        .0
        .unwrap_err();
    assert!(matches!(bad, Stop::Bad(_)));
}
