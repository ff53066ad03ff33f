//! Sorting the remaining items from front to back.
//!
//! With an early z-test a hidden fragment that comes late is not shaded. Sorting pays where
//! many layers lie behind each other and shading is expensive. Predicted from the layers
//! along a few rays.

use std::rc::Rc;

use glam::DVec3;

use super::super::case::some_of;
use super::super::rule::{Draft, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials, mean};
use super::removal::{PROBED, PROBES, Removal, weighed};
use crate::camera::Camera;
use crate::query::ItemId;
use crate::visibility::fragment::order::front_to_back;
use crate::visibility::fragment::{Canvas, DepthOrder, Piece, Tests, draw, draw_surfaces};
use crate::visibility::truth::{RayIndex, SurfaceIndex};
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

/// Samples of the counted images, and of the image for which they stand.
const COUNTED: SampleGrid = SampleGrid::new(160, 90);
const SHADED: SampleGrid = SampleGrid::new(1920, 1080);

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let scene = case.scene();
    let world = case.world.as_ref().map_err(not_applicable)?;
    let drawn = Rc::new(Drawn {
        solids: Solids::of(scene),
        origin: scene.origin,
        items: scene.items.len(),
        index: match world.shape.triangles() {
            None => Index::Boxes(RayIndex::build(&Solids::of(scene))),
            Some(surfaces) => Index::Triangles(SurfaceIndex::build(surfaces)),
        },
    });
    let few = some_of(case.cameras(), PROBED).map(|n| (*world.rays(n), case.found(n)));
    let few: Vec<(Rays, Vec<ItemId>)> = few.collect();
    let on = format!(
        "box-distance against {}, {}x{}",
        case.spec.label, SHADED.width, SHADED.height
    );
    let shared = drawn.clone();
    let kept = trials.judged(move |n, out| {
        case.query(n, out);
        front_to_back(&shared.solids, world.rays(n).camera(), out);
    });
    let shade_ns = case.options.shade_ns;
    Ok(weighed(Sides::same(on, kept, BASE), move || {
        let shaded = |sorted| mean(few.iter().map(|view| drawn.shaded(view, sorted)));
        Removal {
            unit: ["shaded fragment", "shaded fragments"],
            with: shaded(true),
            without: shaded(false),
            cost_ns: shade_ns,
            predicted: drawn.predicted(&few),
        }
    }))
}

/// The items of a scene, to be drawn and to be met by rays.
struct Drawn {
    /// Solid boxes, or the boxes about the items.
    solids: Solids,
    index: Index,
    origin: DVec3,
    items: usize,
}

/// Trees over solid boxes, or over triangles with floors behind the items.
enum Index {
    Boxes(RayIndex),
    Triangles(SurfaceIndex),
}

impl Drawn {
    /// Fragments of a view that pass an early z-test when they come.
    fn shaded(&self, (rays, found): &(Rays, Vec<ItemId>), sorted: bool) -> f64 {
        let mut items = found.clone();
        if sorted {
            front_to_back(&self.solids, rays.camera(), &mut items);
        }
        let passed = match &self.index {
            Index::Boxes(_) => {
                let pieces: Vec<Piece> = items.into_iter().map(Piece::whole).collect();
                let canvas = Canvas::of(rays, COUNTED);
                let drawn = draw(&canvas, &self.solids, &pieces, &Tests::default());
                drawn.tally.passed
            }
            Index::Triangles(index) => {
                let mut left = items.clone();
                left.sort_unstable();
                let place = |item| left.binary_search(item).unwrap_or_default() as ItemId;
                let pieces = items.iter().map(place).map(Piece::whole).collect();
                let no_parts = |_: &Solids, _: &Camera, _: &mut Vec<Piece>| ();
                let orders: [(&dyn DepthOrder, _); 1] = [(&no_parts, pieces)];
                let drawn = draw_surfaces(rays, COUNTED, index, self.origin, &left, &orders);
                drawn[0].0.passed
            }
        };
        passed as f64 * (SHADED.samples() as f64 / COUNTED.samples() as f64)
    }

    /// Number of items along a ray.
    fn layers(&self, ray: &Ray) -> usize {
        let mut met: Vec<ItemId> = match &self.index {
            Index::Boxes(index) => {
                let all = index.all_along(ray).into_iter();
                all.map(|(item, _)| item).collect()
            }
            Index::Triangles(index) => {
                let all = index.all_along(ray).into_iter();
                let ids = all.map(|(item, _)| item);
                ids.filter(|&item| (item as usize) < self.items).collect()
            }
        };
        met.sort_unstable();
        met.dedup();
        met.len()
    }

    /// Predicted share that sorting saves.
    ///
    /// In random order 1 + 1/2 + ... + 1/n of n layers are nearer than all before them
    /// (Knuth, The Art of Computer Programming, 1.2.10) and shaded, in order only one.
    fn predicted(&self, few: &[(Rays, Vec<ItemId>)]) -> f64 {
        let (mut shaded, mut covered) = (0.0, 0.0);
        for (rays, _) in few {
            for row in 0..PROBES.height {
                for column in 0..PROBES.width {
                    let layers = self.layers(&rays.sample(PROBES, column, row));
                    shaded += (1..=layers).map(|n| 1.0 / n as f64).sum::<f64>();
                    covered += f64::from(u8::from(layers > 0));
                }
            }
        }
        match covered > 0.0 {
            true => 1.0 - covered / shaded,
            false => 0.0,
        }
    }
}
