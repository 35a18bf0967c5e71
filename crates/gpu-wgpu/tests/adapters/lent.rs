//! Devices that somebody else opened, with less than one would like, or lost on the way.

use crate::scenes::{SHADOWED, answers, camera, go, open, rays, stand, swarm};
use backend::{Backend, BackendError, Method, Rays, Seek};
use gpu_wgpu::{Options, WgpuBackend, required_features, required_limits};
use libtest_mimic::Failed;
use wgpu::{Device, Limits, Queue};

/// A device with no features at all, and such limits.
fn device(limits: Limits) -> Result<(Device, Queue, wgpu::AdapterInfo), Failed> {
    let mut desc = wgpu::InstanceDescriptor::new_without_display_handle();
    desc.flags = wgpu::InstanceFlags::empty();
    let instance = wgpu::Instance::new(desc);
    let all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let adapter = all.first().ok_or("no adapter")?;
    let desc = wgpu::DeviceDescriptor {
        required_features: required_features(),
        required_limits: limits,
        ..Default::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&desc))?;
    Ok((device, queue, adapter.get_info()))
}

pub(crate) fn a_lent_device_without_features_gives_the_same_hits() -> Result<(), Failed> {
    let (animation, camera) = (swarm(300), camera());
    let (device, queue, info) = device(required_limits(&animation, camera.pixels()))?;
    let mut lent = WgpuBackend::from_device(device, queue, info)?;
    let mut own = WgpuBackend::new(&Options::default())?;
    let ask = |backend: &mut WgpuBackend| {
        open(backend, &animation)?;
        answers(backend, &animation, 0.6, Rays::Camera(&camera), SHADOWED)
    };
    assert!(ask(&mut lent)? == ask(&mut own)?);
    stand(&mut lent, &animation, 0.7)?;
    let ticket = lent.submit()?;
    let times = lent.wait(ticket)?.times;
    assert!(
        times.refit_ms.is_none() && times.device_ms > 0.0,
        "{times:?}"
    );
    Ok(())
}

pub(crate) fn a_scene_too_large_is_refused_by_its_limit() -> Result<(), Failed> {
    let (device, queue, info) = device(required_limits(&swarm(10), 10))?;
    let mut backend = WgpuBackend::from_device(device, queue, info)?;
    let refused = backend.load(swarm(20_000), Method::default()).unwrap_err();
    let said = refused.to_string();
    assert!(
        said.starts_with("the tree's nodes (bytes of one buffer) needs "),
        "{said}"
    );
    assert!(
        matches!(
            refused,
            BackendError::Limit {
                limit: 0x10_0000,
                ..
            }
        ),
        "{refused:?}"
    );
    // A scene that fits still does, and so for its rays.
    let animation = swarm(10);
    open(&mut backend, &animation)?;
    stand(&mut backend, &animation, 0.0)?;
    let many = rays(40_000);
    let refused = go(&mut backend, Rays::List(&many), Seek::Closest).unwrap_err();
    assert!(
        matches!(
            refused,
            BackendError::Limit {
                need: 1_280_000,
                ..
            }
        ),
        "{refused:?}"
    );
    go(&mut backend, Rays::List(&many[..100]), Seek::Closest)?;
    Ok(())
}

pub(crate) fn a_device_with_too_few_buffers_is_refused() -> Result<(), Failed> {
    let (device, queue, info) = device(Limits::downlevel_defaults())?;
    let refused = WgpuBackend::from_device(device, queue, info).err();
    let said = refused.map(|e| e.to_string()).unwrap_or_default();
    assert!(
        said.contains("max_storage_buffers_per_shader_stage needs 8, the limit is 4"),
        "{said}"
    );
    Ok(())
}

pub(crate) fn a_lost_device_is_an_error_and_no_panic() -> Result<(), Failed> {
    let animation = swarm(100);
    let (device, queue, info) = device(required_limits(&animation, 100))?;
    let mut backend = WgpuBackend::from_device(device.clone(), queue, info)?;
    open(&mut backend, &animation)?;
    stand(&mut backend, &animation, 0.5)?;
    backend.request_positions()?;
    let ticket = go(&mut backend, Rays::List(&rays(100)), Seek::Closest)?;
    device.destroy();
    // What was under way may still end well; what comes next may not.
    let _ = backend.wait(ticket);
    let next = stand(&mut backend, &animation, 0.6)
        .and_then(|()| backend.submit())
        .and_then(|ticket| backend.wait(ticket));
    assert!(matches!(next, Err(BackendError::DeviceLost(_))), "{next:?}");
    assert!(matches!(
        backend.submit().and_then(|t| backend.wait(t)),
        Err(BackendError::DeviceLost(_))
    ));
    assert!(matches!(
        backend.take_positions(),
        Err(BackendError::DeviceLost(_)) | Ok(Some(_))
    ));
    Ok(())
}
