//! The part of a scene that a boxes file keeps: the boxes as they were written, and
//! labels. What is read back is the same; the format itself is `boxes_csv`'s.

use glam::DVec3;

use super::{Scene, WorldBox, bad_item};
use crate::input::InputError;

impl Scene {
    /// The items as they were written, world coordinates. Exact: where no
    /// original is kept, origin and stored box add up without rounding.
    pub fn written(&self) -> impl Iterator<Item = WorldBox> {
        let originals = self.originals.boxes();
        let items = self.items.iter().enumerate();
        items.map(move |(id, item)| match originals {
            Some(boxes) => boxes[id],
            None => WorldBox::of(item, self.origin),
        })
    }

    /// The scene as it is read back from a boxes file: the same boxes, as they
    /// were written, and labels; no triangles, regions, camera places or own tree.
    ///
    /// Almost always the stored items are the very same too. Where the reader
    /// chooses another origin (a map whose zero lies far away), they are rounded
    /// about that one.
    ///
    /// # Errors
    /// An item that lies beyond what the reader
    /// takes: the range of f32, in world coordinates.
    pub fn settled(self) -> Result<Scene, InputError> {
        let most = f64::from(f32::MAX);
        let within = |v: DVec3| v.abs().cmple(DVec3::splat(most)).all();
        let boxes: Vec<WorldBox> = self.written().collect();
        let outside = boxes.iter().position(|b| !within(b.min) || !within(b.max));
        if let Some(item) = outside {
            let found = format_args!("in world coordinates beyond +-{most:e}");
            return Err(bad_item(&self.name, item, found, "less in a file"));
        }
        Ok(Scene {
            labels: self.labels,
            skipped_items: self.skipped_items,
            up: self.up,
            unit: self.unit,
            ..Scene::from_boxes(self.name, &boxes)?
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LoadOptions, load, read_boxes_csv, write_boxes_csv};
    use super::*;
    use proptest::prelude::*;

    fn written(scene: &Scene) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_boxes_csv(scene, &mut bytes).unwrap();
        bytes
    }

    /// Writes, reads and writes again; what was read.
    fn there_and_back(scene: &Scene) -> Scene {
        let kept = scene.clone().settled().unwrap();
        let bytes = written(&kept);
        let read = read_boxes_csv(&bytes[..], "b.csv", false).unwrap();
        // Zero may lose its sign on the way, and nothing else may change.
        assert_eq!((kept.origin, &kept.items), (read.origin, &read.items));
        assert_eq!(kept.bounds, read.bounds);
        assert_eq!(kept.originals.boxes(), read.originals.boxes());
        assert!(scene.written().eq(read.written()), "{}", scene.name);
        assert!(written(&read.clone().settled().unwrap()) == bytes);
        read
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
            "mesh:terrain:n=5000",
            "mesh:forest:n=5000",
        ] {
            let scene = load(source, &LoadOptions::default()).unwrap();
            let read = there_and_back(&scene);
            let is_same = (scene.origin, &scene.items) == (read.origin, &read.items);
            // A map's own zero is not what a reader chooses.
            assert!(is_same || source.starts_with("freedm"), "{source}");
        }
    }

    #[test]
    fn another_origin_is_taken_once() {
        let b = |low: f64, high: f64| WorldBox::new(DVec3::splat(low), DVec3::splat(high));
        // A map's own zero, far away.
        let far = [b(1e7 + 0.1, 1e7 + 1.7), b(1e7 + 3.3, 1e7 + 3.3)];
        let map = Scene::about("map", &far, DVec3::ZERO).unwrap();
        let read = there_and_back(&map);
        // Stored about the map's zero they were a step of f32 larger.
        assert!(read.origin.x > 9e6 && read.world_bounds().min.x > map.world_bounds().min.x);
        // Rounded outward, these are a power of two wide.
        for shift in 0..64 {
            let low = 1e7 + 0.3 + 16.0 * f64::from(shift);
            let wide = [b(low, low + 1.0), b(low + 5.0, low + 1_023.999_99)];
            let scene = Scene::from_boxes("wide", &wide).unwrap();
            there_and_back(&scene);
        }
    }

    #[test]
    fn what_the_reader_does_not_take_is_refused() {
        let scene = load("uniform:n=3,offset=1e39", &LoadOptions::default()).unwrap();
        let error = scene.settled().unwrap_err().to_string();
        assert!(error.contains("item 0") && error.contains("3.4"), "{error}");
    }

    proptest! {
        /// Any boxes about any origin: what is read back are the very same, and
        /// they are written the same.
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
            for scene in [
                Scene::from_boxes("chosen", &boxes),
                Scene::about("given", &boxes, DVec3::splat(origin)),
            ] {
                let scene = scene.unwrap();
                prop_assert!(scene.written().eq(boxes.iter().copied()));
                there_and_back(&scene);
            }
        }
    }
}
