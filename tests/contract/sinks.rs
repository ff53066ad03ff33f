//! Lists, counts, callbacks and slices of a query have the same ids.

use std::ops::ControlFlow;

use cullbench::geometry::{Aabb, ConvexVolume};
use cullbench::index::{Bvh, FrustumQuery, Input, Linear, Query, RegionIndex, Wide};
use cullbench::kernel::Kernel;
use cullbench::query::{Count, ItemId, NoRecorder, Sink};
use glam::Vec3;

/// Answers a query with an instruction set.
fn ask<S: Sink>(
    kernel: Kernel,
    index: &impl RegionIndex,
    volume: &ConvexVolume,
    sink: &mut S,
) -> ControlFlow<()> {
    let recorder = &mut NoRecorder;
    kernel.run(Query {
        index,
        volume,
        sink,
        recorder,
    })
}

fn every_form_has_the_same_ids<T: RegionIndex>(items: &[Aabb], volume: &ConvexVolume) {
    let index = &T::build(&Input::new(items), &T::Params::default()).unwrap();
    let list = index.visible(volume);
    assert!(list.len() > 3 * 256, "{}", list.len());
    let mut one_by_one = Vec::new();
    index.each_visible(volume, |id| one_by_one.push(id));
    assert_eq!(one_by_one, list);
    for kernel in Kernel::available() {
        let (mut list, mut count) = (Vec::new(), Count::default());
        assert!(ask(kernel, index, volume, &mut list).is_continue());
        assert!(ask(kernel, index, volume, &mut count).is_continue());
        assert_eq!(count.0, list.len() as u64, "{kernel}");
        // The third call ends the query, or none.
        for most in [usize::MAX, 3] {
            let mut slices: Vec<Vec<ItemId>> = Vec::new();
            let mut sink = |ids: &[ItemId]| {
                slices.push(ids.to_vec());
                match slices.len() < most {
                    true => ControlFlow::Continue(()),
                    false => ControlFlow::Break(()),
                }
            };
            let flow = ask(kernel, index, volume, &mut sink);
            assert!(slices.iter().all(|ids| !ids.is_empty()), "{kernel}");
            assert!(list.starts_with(&slices.concat()), "{kernel}");
            match most {
                3 => assert!(flow.is_break() && slices.len() == 3, "{kernel}"),
                _ => assert_eq!(slices.concat(), list, "{kernel}"),
            }
        }
    }
}

#[test]
fn lists_counts_and_slices_have_the_same_ids() {
    // Two of three are in view, so that blocks are partly full.
    let at = |i: u16| Vec3::new(f32::from(i % 70), f32::from(i / 70), f32::from(i % 3) * 9.0);
    let items: Vec<Aabb> = (0..5000).map(|i| Aabb::around(at(i), Vec3::ONE)).collect();
    let region = Aabb::new(Vec3::splat(3.5), Vec3::new(60.0, 60.0, 20.0));
    let volume = ConvexVolume::of_box(&region);
    every_form_has_the_same_ids::<Linear>(&items, &volume);
    every_form_has_the_same_ids::<Wide>(&items, &volume);
    every_form_has_the_same_ids::<Bvh>(&items, &volume);
}
