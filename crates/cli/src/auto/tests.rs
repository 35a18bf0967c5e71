//! The choice among made-up backends.

use super::*;
use crate::adapters::named;
use DeviceKind::{Cpu, Gpu, Software};
use backend::BackendError;
use std::cell::RefCell;

/// What a made-up backend offers, and how opening it ends.
struct Fake {
    name: &'static str,
    offers: Result<Vec<(&'static str, DeviceKind)>, &'static str>,
    breaks: Option<fn() -> Stop>,
    lacks: Option<&'static str>,
    covered_by: Option<&'static str>,
    answers_rays: bool,
}

fn fake(name: &'static str, offers: &[(&'static str, DeviceKind)]) -> Fake {
    Fake {
        name,
        offers: Ok(offers.to_vec()),
        breaks: None,
        lacks: None,
        covered_by: None,
        answers_rays: false,
    }
}

fn host() -> Fake {
    fake("cpu", &[("host", Cpu)])
}

/// Backend and adapter.
type Value = (&'static str, String);

/// What the choice did, in order: `list NAME` or `open NAME ADAPTER`.
fn choose(fakes: &[Fake], asked: Option<&str>) -> (Result<(Value, String), Stop>, Vec<String>) {
    let log = RefCell::new(Vec::new());
    let rivals: Vec<Rival<'_, Value>> = fakes
        .iter()
        .map(|fake| Rival {
            name: fake.name,
            place: "it stands where it stands",
            kinds: if fake.name == "cpu" {
                &[Cpu]
            } else {
                &[Gpu, Software]
            },
            covered_by: fake.covered_by,
            lacks: fake.lacks.map(str::to_owned),
            answers_rays: Box::new(|_| fake.answers_rays),
            list: Box::new(|| {
                log.borrow_mut().push(format!("list {}", fake.name));
                let no = |e: &&str| BackendError::NoDevice((*e).to_owned());
                fake.offers.as_ref().map(|o| named(o)).map_err(no)
            }),
            open: Box::new(|adapter| {
                let line = format!("open {} {}", fake.name, adapter.name);
                log.borrow_mut().push(line);
                let value = (fake.name, adapter.name.clone());
                fake.breaks.map_or(Ok(value), |stop| Err(stop()))
            }),
        })
        .collect();
    let taken = take(&rivals, asked);
    drop(rivals);
    (taken, log.into_inner())
}

/// Backend and reason.
fn taken(fakes: &[Fake], asked: Option<&str>) -> (&'static str, String) {
    let ((backend, _), why) = choose(fakes, asked).0.unwrap();
    (backend, why)
}

fn refused(fakes: &[Fake], asked: Option<&str>) -> String {
    choose(fakes, asked).0.unwrap_err().text()
}

fn too_small() -> Stop {
    Stop::from(BackendError::Limit {
        what: "triangles".to_owned(),
        need: 4000,
        limit: 1000,
    })
}

#[test]
fn the_first_backend_with_a_gpu_is_taken_and_nothing_else_is_touched() {
    let fakes = [
        fake("a", &[("soft", Software), ("card", Gpu)]),
        fake("b", &[("card", Gpu)]),
        host(),
    ];
    let (taken, log) = choose(&fakes, None);
    let (value, why) = taken.unwrap();
    assert_eq!(value, ("a", "card".to_owned()));
    assert_eq!(why, "card is a GPU; it stands where it stands");
    assert_eq!(log, ["list a", "open a card"]);
}

#[test]
fn a_driver_that_traces_is_named_where_hardware_may_do_it_and_never_taken() {
    let able = |offers| Fake {
        answers_rays: true,
        ..fake("a", offers)
    };
    let rt = fake("vulkan-rt", &[("card", Gpu)]);
    let (backend, why) = taken(&[able(&[("card", Gpu)]), rt, host()], None);
    assert_eq!(backend, "a");
    assert!(
        why.contains("--backend vulkan-rt is the faster choice"),
        "{why}"
    );
    assert_eq!(why.matches("vulkan-rt").count(), 1, "{why}");
    // Where the card was meant by name, too; but no driver on the host's cores is hardware.
    let (_, why) = taken(&[able(&[("card", Gpu)]), host()], Some("card"));
    assert!(why.ends_with("the driver's affair"), "{why}");
    let (backend, why) = taken(&[able(&[("soft", Software)]), host()], Some("soft"));
    assert!(backend == "a" && !why.contains("vulkan-rt"), "{why}");
}

#[test]
fn a_software_driver_never_comes_before_the_host_and_is_not_opened() {
    let fakes = [fake("a", &[("soft", Software)]), host()];
    let (taken, log) = choose(&fakes, None);
    let ((backend, _), why) = taken.unwrap();
    assert_eq!(backend, "cpu");
    assert!(why.starts_with("a finds no GPU but only soft"), "{}", why);
    assert_eq!(log, ["list a", "list cpu", "open cpu host"]);
}

#[test]
fn a_backend_that_would_find_no_more_is_not_even_listed() {
    let covered = |offers| Fake {
        covered_by: Some("a"),
        ..fake("b", offers)
    };
    let log = |first| choose(&[first, covered(&[("card", Gpu)]), host()], None).1;
    assert!(!log(fake("a", &[("soft", Software)])).contains(&"list b".to_owned()));
    let absent = Fake {
        offers: Err("no loader"),
        ..fake("a", &[])
    };
    assert!(!log(absent).contains(&"list b".to_owned()));
    // But it is where the other was not asked, or has a GPU that it cannot use.
    for first in [
        Fake {
            lacks: Some("intersector 'x'"),
            ..fake("a", &[])
        },
        Fake {
            breaks: Some(too_small),
            ..fake("a", &[("card", Gpu)])
        },
    ] {
        assert!(log(first).contains(&"open b card".to_owned()));
    }
}

#[test]
fn a_gpu_that_fails_gives_way_to_the_next_and_both_numbers_are_told() {
    let small = |name| Fake {
        breaks: Some(too_small),
        ..fake(name, &[("card", Gpu)])
    };
    let (backend, why) = taken(&[small("a"), fake("b", &[("card", Gpu)]), host()], None);
    assert_eq!(backend, "b");
    assert!(
        why.contains("a on card: triangles needs 4000, the limit is 1000"),
        "{why}"
    );
    let (backend, why) = taken(&[small("a"), small("b"), host()], None);
    assert_eq!(backend, "cpu");
    assert!(
        why.contains("a on card") && why.contains("b on card"),
        "{why}"
    );
}

#[test]
fn a_second_gpu_is_tried_when_the_first_fails() {
    let broken = Fake {
        breaks: Some(|| Stop::failed("wrong bits")),
        ..fake("a", &[("one", Gpu), ("two", Gpu)])
    };
    let (_, log) = choose(&[broken, host()], None);
    assert_eq!(log[1..3], ["open a one", "open a two"]);
}

#[test]
fn a_method_that_no_gpu_knows_is_left_to_the_host_without_a_look_at_gpus() {
    let lacking = |name| Fake {
        lacks: Some("intersector 'woop'"),
        ..fake(name, &[("card", Gpu)])
    };
    let (taken, log) = choose(&[lacking("a"), lacking("b"), host()], None);
    let ((backend, _), why) = taken.unwrap();
    assert_eq!(backend, "cpu");
    assert_eq!(
        why,
        "a does not support intersector 'woop'; b does not support intersector 'woop'"
    );
    assert_eq!(log, ["list cpu", "open cpu host"]);
}

#[test]
fn an_absent_backend_is_passed_over_with_the_reason() {
    let absent = Fake {
        offers: Err("no loader"),
        ..fake("a", &[])
    };
    let (backend, why) = taken(&[absent, host()], None);
    assert_eq!(
        (backend, why.as_str()),
        ("cpu", "a cannot run: no device: no loader")
    );
}

#[test]
fn who_names_an_adapter_gets_it_even_if_it_is_software() {
    let fakes = || [fake("a", &[("soft", Software), ("card", Gpu)]), host()];
    assert_eq!(
        taken(&fakes(), Some("soft")),
        ("a", "'soft' is soft".to_owned())
    );
    assert_eq!(taken(&fakes(), Some("host")).0, "cpu");
    assert_eq!(taken(&fakes(), Some("1")).0, "a");
    // Both have a number 0, and the host comes before software.
    assert_eq!(taken(&fakes(), Some("0")).0, "cpu");
}

#[test]
fn an_adapter_that_fits_several_or_none_is_refused_with_those_there_are() {
    let fakes = || [fake("a", &[("card x", Gpu), ("card y", Gpu)]), host()];
    assert!(refused(&fakes(), Some("card")).ends_with("0: card x; 1: card y"));
    assert_eq!(
        refused(&fakes(), Some("voodoo")),
        "no backend has an adapter 'voodoo'; there is a 0: card x; 1: card y, cpu 0: host"
    );
}

#[test]
fn an_adapter_that_is_there_but_fails_is_not_called_absent() {
    let small = Fake {
        breaks: Some(too_small),
        ..fake("a", &[("card", Gpu)])
    };
    let text = refused(&[small, host()], Some("card"));
    assert_eq!(text, "triangles needs 4000, the limit is 1000");
    let absent = Fake {
        offers: Err("no loader"),
        ..fake("a", &[])
    };
    assert_eq!(
        refused(&[absent, host()], Some("card")),
        "a cannot run: no device: no loader; no other backend has an adapter 'card'; there is cpu 0: host"
    );
}

#[test]
fn where_nothing_works_every_reason_is_told() {
    let exact = |name, offers: &[_]| Fake {
        lacks: Some("intersector 'exact'"),
        ..fake(name, offers)
    };
    let fakes = [exact("a", &[("card", Gpu)]), exact("cpu", &[("host", Cpu)])];
    let stop = choose(&fakes, None).0.unwrap_err();
    assert!(matches!(stop, Stop::Bad(_)));
    let text = stop.text();
    assert!(
        text.contains("a does not") && text.contains("cpu does not"),
        "{text}"
    );
    let broken = || Fake {
        breaks: Some(|| Stop::failed("no threads")),
        ..host()
    };
    let alone = choose(&[broken()], None).0.unwrap_err();
    assert!(matches!(&alone, Stop::Failed(_)) && alone.text() == "no threads");
    let small = Fake {
        breaks: Some(too_small),
        ..fake("a", &[("card", Gpu)])
    };
    let both = choose(&[small, broken()], None).0.unwrap_err();
    assert!(matches!(both, Stop::Failed(_)), "the last failure decides");
    let text = both.text();
    assert!(
        text.contains("limit is 1000") && text.contains("no threads"),
        "{text}"
    );
}
