//! A wgpu device of the program's own, and its buffers.

use crate::wgpu_lent::device_on;
use abvh::own_device::{OwnDevice, required_features};
use std::sync::mpsc;
use wgpu::util::{DeviceExt, DownloadBuffer};
use wgpu::{Adapter, Buffer, BufferUsages, Limits};

pub(crate) fn own_device(adapter: &Adapter, limits: Limits) -> OwnDevice {
    let (device, queue, info) = device_on(adapter, required_features(), limits);
    OwnDevice {
        device,
        queue,
        info,
    }
}

pub(crate) fn filled(own: &OwnDevice, contents: &[u8], usage: BufferUsages) -> Buffer {
    own.device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents,
            usage,
        })
}

pub(crate) fn bytes_of(device: &OwnDevice, buffer: &Buffer) -> Vec<u8> {
    let (said, heard) = mpsc::channel();
    let OwnDevice { device, queue, .. } = device;
    DownloadBuffer::read_buffer(device, queue, &buffer.slice(..), move |bytes| {
        said.send(bytes.unwrap().to_vec()).unwrap();
    });
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    heard.recv().unwrap()
}
