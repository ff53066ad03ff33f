//! Structures of other crates, one file per crate, checked like ours.
//!
//! Each is given a test of one box at a time (`box_test`). docs/PEERS.md lists the calls.
//!
//! A peer's code is compiled for the portable instruction set, unless the compiler inlines it into
//! the kernel that calls it.

mod bevy_style;
mod bvh;
mod obvhs;
mod parry3d;
mod rstar;

pub use bevy_style::PeerBevyStyle;
pub use bvh::PeerBvh;
pub use obvhs::{ObvhsParams, ObvhsUpdate, PeerObvhs};
pub use parry3d::{Parry3dParams, Parry3dUpdate, PeerParry3d};
pub use rstar::PeerRstar;

#[cfg(test)]
mod tests {
    use crate::geometry::{Aabb, ConvexVolume, Plane};
    use crate::index::{DynIndex, StructureSpec};
    use crate::query::ItemId;
    use glam::Vec3;

    fn sorted(index: &dyn DynIndex, volume: &ConvexVolume) -> Vec<ItemId> {
        let mut ids = Vec::new();
        index.visible(volume, &mut ids);
        ids.sort_unstable();
        ids
    }

    /// A row of denormal points overflows the stack of parry3d's builder.
    ///
    /// Rows and stacks of points take quadratic time in obvhs's own clustering.
    #[test]
    fn rows_of_points_are_refused_or_built_soon() {
        let row = |step: f32, n: u16| -> Vec<Aabb> {
            let at = |i: u16| Aabb::around(Vec3::X * (f32::from(i) * step), Vec3::ZERO);
            (0..n).map(at).collect()
        };
        let tiny = f32::from_bits(1);
        let built = |name: &str, items: &[Aabb]| {
            let spec = StructureSpec::parse(name).expect("a structure");
            spec.build(items).map(|_| ()).map_err(|e| e.to_string())
        };
        let refused = built("peer-parry3d", &row(tiny, 20_000)).expect_err("too narrow");
        assert!(refused.contains("more than 2048 items"), "{refused}");
        for (step, n) in [
            (tiny, 2048),
            (tiny * 1e8, 20_000),
            (1.0, 20_000),
            (0.0, 20_000),
        ] {
            assert_eq!(built("peer-parry3d", &row(step, n)), Ok(()), "{step:e}");
        }
        for step in [tiny, 0.0, 1.0] {
            assert_eq!(built("peer-obvhs", &row(step, 60_000)), Ok(()), "{step:e}");
        }
    }

    /// Few and many items step, jump, grow and shrink, frame after frame.
    #[test]
    fn every_update_call_gives_the_sets_of_a_scan() {
        let halves = [Vec3::X, -Vec3::Y, Vec3::new(0.5, 0.7, -0.3)];
        let volumes = halves.map(|n| {
            let slab = [Plane::new(n, 3.0), Plane::new(-n, 9.0)];
            ConvexVolume::from_planes(&slab).expect("two planes")
        });
        for text in [
            "peer-obvhs",
            "peer-obvhs:update=move",
            "peer-parry3d",
            "peer-parry3d:update=optimize",
            "peer-parry3d:update=reinsert",
            "peer-rstar",
            "peer-bvh",
            "peer-bevy-style",
        ] {
            let spec = StructureSpec::parse(text).expect("a structure");
            assert!(spec.info().refits, "{text}");
            let at = |i: u32| Vec3::new((i % 11) as f32, (i / 11 % 9) as f32, (i / 99) as f32);
            let items = (0..900).map(|i| Aabb::around(at(i) * 2.0 - 9.0, Vec3::splat(0.4)));
            let mut items: Vec<Aabb> = items.collect();
            items[7] = Aabb::new(Vec3::ONE, Vec3::ZERO);
            let mut index = spec.build(&items).expect("sound items");
            for frame in 0..40_u32 {
                let step = [300, 29, 4, 1][frame as usize % 4];
                let moved: Vec<u32> = (frame % 5..900).step_by(step).filter(|i| *i != 7).collect();
                for &id in &moved {
                    let turn = (id * 7 + frame * 13) as f32;
                    let by = Vec3::new(turn.sin(), (turn * 1.7).cos(), (turn * 0.3).sin());
                    let far = if id % 10 == 0 { 6.0 } else { 0.3 };
                    let half = Vec3::splat(0.1 + (turn * 0.9).cos().abs());
                    let b = &mut items[id as usize];
                    *b = Aabb::around(b.centre() + by * far, half);
                }
                assert!(index.refit(&items, &moved), "{text} frame {frame}");
                for volume in &volumes {
                    let seen = items.iter().zip(0..).filter(|(b, _)| volume.sees(b));
                    let wanted: Vec<ItemId> = seen.map(|(_, id)| id).collect();
                    assert_eq!(sorted(&*index, volume), wanted, "{text} frame {frame}");
                }
            }
            let empty = Aabb::new(Vec3::ONE, Vec3::ZERO);
            let all = ConvexVolume::from_planes(&[]).expect("no planes");
            for frame in 0..60_u32 {
                // In the last frames all come or go.
                let step = [61, 17, 1][frame as usize / 20];
                let moved: Vec<u32> = (frame % 7..900).step_by(step).collect();
                for &id in &moved {
                    let b = &mut items[id as usize];
                    *b = match b.is_empty() {
                        true => Aabb::around(at((id * 31 + frame) % 900) * 2.0, Vec3::ONE),
                        false if id % 3 == frame % 3 => Aabb::around(at(id), Vec3::ONE),
                        false => empty,
                    };
                }
                assert!(index.refit(&items, &moved), "{text} frame {frame}");
                for volume in volumes.iter().chain([&all]) {
                    let held = items.iter().zip(0..).filter(|(b, _)| !b.is_empty());
                    let seen = held.filter(|(b, _)| volume.sees(b));
                    let wanted: Vec<ItemId> = seen.map(|(_, id)| id).collect();
                    assert_eq!(sorted(&*index, volume), wanted, "{text} frame {frame}");
                }
            }
            let ids: Vec<u32> = (0..900).collect();
            for held in [empty, Aabb::around(Vec3::ONE, Vec3::ONE)] {
                items.fill(held);
                assert!(index.refit(&items, &ids), "{text}: all at once");
                assert_eq!(
                    sorted(&*index, &all).len(),
                    [900, 0][usize::from(held.is_empty())]
                );
            }
        }
    }
}
