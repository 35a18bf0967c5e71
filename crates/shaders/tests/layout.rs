//! The host's structures lie in memory as the kernels' do.

use shaders::{KERNELS, Params};
use std::mem::{offset_of, size_of};

#[test]
fn params_lie_as_the_kernels_read_them() {
    for kernel in KERNELS {
        let module = naga::front::wgsl::parse_str(kernel.code.wgsl).unwrap();
        let (_, ty) = module
            .types
            .iter()
            .find(|(_, t)| t.name.as_deref() == Some("Params"))
            .unwrap();
        let naga::TypeInner::Struct { members, span } = &ty.inner else {
            panic!("a struct")
        };
        let offset = |name: &str| {
            members
                .iter()
                .find(|m| m.name.as_deref() == Some(name))
                .unwrap()
                .offset as usize
        };
        macro_rules! same { ($($field:ident)*) => { $(
            assert_eq!(offset(stringify!($field)), offset_of!(Params, $field), "{}", stringify!($field));
        )* } }
        same!(eye width corner height across first_group down alpha light fast_layout scale_exponent
              count first leaf_bits_at leaf_ranks_at leaf_triangles_at node_count zero listed
              destination shift goal rounds places notes rule scaled_eye
              depth_exponent column wide_at row wide_lanes depth wide_root pixel_margin clearance extreme
              tiny);
        assert_eq!(members.len(), 38);
        assert_eq!(*span as usize, size_of::<Params>(), "{}", kernel.name);
    }
}
