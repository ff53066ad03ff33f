//! What a boxes file keeps of a scene: items and labels, about the origin that
//! its reader will choose. It owns the promise that writing, reading and
//! writing again gives the same bytes; the format itself is `boxes_csv`'s.

use glam::DVec3;

use super::{Originals, Regions, Scene, origin_between};
use crate::geometry::Aabb;
use crate::input::InputError;

/// A pass that changes anything makes a box larger or moves the origin, and
/// one of them is the rule: enough for a bound to cross a power of two.
const MOST_PASSES: usize = 8;

impl Scene {
    /// The scene as it is read back from a boxes file: the same items and
    /// labels, without regions, camera places and a partition of its own.
    ///
    /// Almost always the items are the very same. Where the reader would choose
    /// another origin (a map whose zero lies far away), they are rounded
    /// outward about that one here, so that it happens once and no more.
    ///
    /// # Errors
    /// [`InputError::BadItem`] for an item that lies beyond what the reader
    /// takes: the range of f32, in world coordinates.
    pub fn settled(self) -> Result<Scene, InputError> {
        let mut kept = Scene {
            regions: Regions::Items,
            places: Vec::new(),
            own_tree: None,
            // What is written are the boxes as they are stored.
            originals: Originals::default(),
            ..self
        };
        for _ in 0..MOST_PASSES {
            let read_back = kept.origin_of_reader();
            let mut changed = read_back != kept.origin;
            for item in &mut kept.items {
                let (min, max) = item.in_world(kept.origin);
                let read = Aabb::rounded_outward(min, max, read_back);
                changed |= read != *item;
                *item = read;
            }
            kept.origin = read_back;
            if !changed {
                break;
            }
        }
        kept.bounds = Aabb::union_of(&kept.items);
        kept.check_range()?;
        Ok(kept)
    }

    fn origin_of_reader(&self) -> DVec3 {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = self.items.iter().fold(none, |(low, high), item| {
            let (min, max) = item.in_world(self.origin);
            (low.min(min), high.max(max))
        });
        origin_between(low, high)
    }

    fn check_range(&self) -> Result<(), InputError> {
        let most = f64::from(f32::MAX);
        let within = |v: DVec3| v.abs().cmple(DVec3::splat(most)).all();
        let outside = self.items.iter().position(|item| {
            let (min, max) = item.in_world(self.origin);
            !within(min) || !within(max)
        });
        match outside {
            None => Ok(()),
            Some(item) => Err(InputError::BadItem {
                scene: self.name.clone(),
                item,
                reason: format!("in world coordinates beyond +-{most:e}; expected less in a file"),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LoadOptions, WorldBox, load, read_boxes_csv, write_boxes_csv};
    use super::*;
    use proptest::prelude::*;

    fn written(scene: &Scene) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_boxes_csv(scene, &mut bytes).unwrap();
        bytes
    }

    /// Writes, reads and writes again; what was read.
    fn there_and_back(scene: Scene) -> Scene {
        let kept = scene.settled().unwrap();
        let bytes = written(&kept);
        let read = read_boxes_csv(&bytes[..], "b.csv", false).unwrap();
        // Zero may lose its sign on the way, and nothing else may change.
        assert_eq!((kept.origin, &kept.items), (read.origin, &read.items));
        assert_eq!(kept.bounds, read.bounds);
        assert!(written(&read.clone().settled().unwrap()) == bytes);
        read
    }

    fn holds(outer: &Scene, inner: &Scene) -> bool {
        let world = |scene: &Scene, item: usize| scene.items[item].in_world(scene.origin);
        (0..inner.items.len()).all(|item| {
            let (outer, inner) = (world(outer, item), world(inner, item));
            outer.0.cmple(inner.0).all() && outer.1.cmpge(inner.1).all()
        })
    }

    #[test]
    fn every_kind_of_scene_is_read_back_with_the_same_items() {
        for source in [
            "uniform:n=0",
            "uniform:n=200",
            "uniform:n=200,offset=1e7",
            "city:n=200,offset=-123456.789",
            "forest:n=200,offset=1e9",
            "rooms:n=200,seed=3",
            "clustered:n=200,offset=3e15",
            "freedm-map12",
            "helsinki",
            "us-counties",
        ] {
            let scene = load(source, &LoadOptions::default()).unwrap();
            let read = there_and_back(scene.clone());
            let is_same = (scene.origin, &scene.items) == (read.origin, &read.items);
            // A map's own zero is not what a reader chooses.
            assert!(is_same || source.starts_with("freedm"), "{source}");
            assert!(holds(&read, &scene), "{source}");
        }
    }

    #[test]
    fn another_origin_is_taken_once() {
        let b = |low: f64, high: f64| WorldBox::new(DVec3::splat(low), DVec3::splat(high));
        // A map's own zero, far away.
        let far = [b(1e7 + 0.1, 1e7 + 1.7), b(1e7 + 3.3, 1e7 + 3.3)];
        let map = Scene::about("map", &far, DVec3::ZERO).unwrap();
        let read = there_and_back(map.clone());
        assert!(read.origin.x > 9e6 && holds(&read, &map));
        // Rounded outward, these are a power of two wide.
        for shift in 0..64 {
            let low = 1e7 + 0.3 + 16.0 * f64::from(shift);
            let wide = [b(low, low + 1.0), b(low + 5.0, low + 1_023.999_99)];
            let scene = Scene::from_boxes("wide", &wide).unwrap();
            assert!(holds(&there_and_back(scene.clone()), &scene), "{shift}");
        }
    }

    #[test]
    fn what_the_reader_does_not_take_is_refused() {
        let scene = load("uniform:n=3,offset=1e39", &LoadOptions::default()).unwrap();
        let error = scene.settled().unwrap_err().to_string();
        assert!(error.contains("item 0") && error.contains("3.4"), "{error}");
    }

    proptest! {
        /// Any boxes about any origin: what is read back holds them all, and
        /// is written the same.
        #[test]
        fn nothing_is_lost_and_the_second_time_is_the_first(
            centre in prop::num::f64::NORMAL.prop_map(|v| v % 1e12),
            edges in prop::collection::vec((-1e3f64..1e3, 0.0f64..50.0), 1..12),
            origin in prop_oneof![Just(0.0), -1e9f64..1e9],
        ) {
            let boxes: Vec<WorldBox> = edges
                .iter()
                .map(|(at, edge)| {
                    let min = DVec3::new(centre + at, *at, centre - at);
                    WorldBox::new(min, min + *edge)
                })
                .collect();
            there_and_back(Scene::from_boxes("chosen", &boxes).unwrap());
            let scene = Scene::about("given", &boxes, DVec3::splat(origin)).unwrap();
            prop_assert!(holds(&there_and_back(scene.clone()), &scene));
        }
    }
}
