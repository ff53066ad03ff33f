//! Rules about triangles and fragments of the items in view: cones, and sorting.

use std::rc::Rc;
use std::sync::Arc;

use super::super::case::{Case, some_of};
use super::super::rule::{Draft, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials, mean};
use super::removal::{PROBED, PROBES, Removal, weighed};
use crate::camera::Camera;
use crate::funnel::{RaysEnd, World};
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::{ItemShape, Surfaces};
use crate::visibility::fragment::order::front_to_back;
use crate::visibility::fragment::{Canvas, DepthOrder, Piece, Tests, draw, draw_orders};
use crate::visibility::triangle::{
    Clusters, Cone, Eye, MOST_TRIANGLES, SafeCones, Selection, TriangleCull,
};
use crate::visibility::truth::SolidBox;
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

/// Items of a camera whose triangles are looked at, evenly spread.
const MOST_ITEMS: usize = 1_024;
/// Clusters of a camera whose cones a prediction looks at.
const MOST_CONES: usize = 64;
/// Triangles of a cluster: a face of a box, a wall.
const OF_A_FACE: usize = 2;

/// Items in view of a camera as clusters, with their cones.
struct Seen {
    items: Vec<ItemId>,
    clusters: Arc<Clusters>,
    /// Item of each cluster.
    owners: Vec<ItemId>,
    cones: SafeCones,
    eye: Eye,
}

/// Normal cones of clusters: one test removes a cluster that faces away.
///
/// They pay unless the cones are so wide that there is hardly such an eye, or triangles
/// cost next to nothing. Predicted from the width of the cones. A few cameras stand for
/// those that follow them; an answer has the item of each cluster with a triangle left.
pub(super) fn cones(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let world = case.world.as_ref().map_err(not_applicable)?;
    let cameras = case.cameras();
    let few: Rc<[Seen]> = some_of(cameras, PROBED)
        .map(|camera| Seen::of(case, world, camera))
        .collect();
    let sum = |of: fn(&Seen) -> usize| few.iter().map(of).sum::<usize>() as f64;
    let of_item = sum(|seen| seen.clusters.triangles.len()) / sum(|seen| seen.items.len());
    let kernel = case.spec.execution.kernel;
    let left = |cones| mean(few.iter().map(|seen| seen.left(cones).triangles() as f64));
    let removal = Removal {
        unit: ["triangle", "triangles"],
        with: left(Some(kernel)),
        without: left(None),
        cost_ns: case.options.draw_ns / of_item,
        predicted: turned_away(&few),
    };
    let on = match case.scene().item_shape() {
        ItemShape::Mesh => format!("clusters of up to {MOST_TRIANGLES} triangles"),
        _ => format!("{OF_A_FACE} triangles per cluster"),
    };
    let [kept, left_out] = [Some(kernel), None].map(|cones| {
        let few = few.clone();
        trials.unjudged(move |n, out| {
            let seen = &few[n * few.len() / cameras];
            let selection = seen.left(cones);
            let clusters = selection.words().iter().zip(&seen.owners);
            out.extend(clusters.filter(|(word, _)| **word != 0).map(|(_, &id)| id));
        })
    });
    let sides = Sides::new(format!("cone-f32-safe, {on}"), kept, left_out);
    Ok(weighed(sides, move || removal))
}

impl Seen {
    fn of(case: &Case, world: &World, camera: usize) -> Seen {
        let scene = case.scene();
        let met = case.found(camera);
        let items: Vec<ItemId> = some_of(met.len(), MOST_ITEMS).map(|n| met[n]).collect();
        let surfaces = Arc::new(match world.shape.triangles() {
            Some(all) => all.some(&items),
            None => {
                let boxes = items.iter().map(|&id| scene.items[id as usize]);
                Surfaces::of_boxes(scene.origin, boxes)
            }
        });
        let clusters = Arc::new(match scene.item_shape() {
            ItemShape::Mesh => Clusters::of(surfaces, MOST_TRIANGLES),
            _ => Clusters::as_listed(surfaces, OF_A_FACE),
        });
        let owners = clusters.of_item.iter().zip(&items);
        let owners = owners.flat_map(|(own, &id)| own.clone().map(move |_| id));
        Seen {
            owners: owners.collect(),
            cones: SafeCones::of(&clusters),
            clusters,
            items,
            eye: Eye::of(&case.workload.cameras[camera], scene.origin),
        }
    }

    /// All triangles, or those that the cones leave.
    fn left(&self, cones: Option<Kernel>) -> Selection {
        let mut selection = Selection::all(&self.clusters);
        if let Some(kernel) = cones {
            self.cones.cull(&self.eye, kernel, &mut selection);
        }
        selection
    }
}

/// Share of all directions from which a triangle's whole cluster faces away.
///
/// The mean over the triangles of some clusters.
fn turned_away(few: &[Seen]) -> f64 {
    let (mut triangles, mut away) = (0.0, 0.0);
    for seen in few {
        for cluster in some_of(seen.clusters.len(), MOST_CONES) {
            let corners: Vec<_> = seen.clusters.corners_of(cluster).collect();
            let count = corners.len() as f64;
            triangles += count;
            away += Cone::fit(&corners).map_or(0.0, |cone| count * cone.turned_away());
        }
    }
    away / triangles
}

/// Samples of the counted images, and of the image for which they stand.
const COUNTED: SampleGrid = SampleGrid::new(160, 90);
const SHADED: SampleGrid = SampleGrid::new(1920, 1080);

/// Sorting the remaining items from front to back.
///
/// With an early z-test a hidden fragment that comes late is not shaded. Sorting pays where
/// many layers lie behind each other and shading is expensive. Predicted from the layers
/// along a few rays.
pub(super) fn sorting(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let scene = case.scene();
    let world = case.world.as_ref().map_err(not_applicable)?;
    let drawn = Rc::new(Drawn {
        solids: Solids::of(scene),
        items: scene.items.len(),
        surfaces: RaysEnd::at(&world.shape, None),
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
    surfaces: RaysEnd<'static>,
    items: usize,
}

impl Drawn {
    /// Fragments of a view that pass an early z-test when they come.
    fn shaded(&self, (rays, found): &(Rays, Vec<ItemId>), sorted: bool) -> f64 {
        let mut items = found.clone();
        if sorted {
            front_to_back(&self.solids, rays.camera(), &mut items);
        }
        let passed = match &self.surfaces {
            RaysEnd::Boxes(..) => {
                let bodies = items.iter().map(|&item| SolidBox {
                    b: self.solids.boxes[item as usize],
                    item,
                });
                let drawn = draw(&Canvas::of(rays, COUNTED), bodies, &Tests::default());
                drawn.tally.passed
            }
            RaysEnd::Triangles(index) => {
                let mut left = items.clone();
                left.sort_unstable();
                let place = |item| left.binary_search(item).unwrap_or_default() as ItemId;
                let pieces = items.iter().map(place).map(Piece::whole).collect();
                let no_parts = |_: &Solids, _: &Camera, _: &mut Vec<Piece>| ();
                let orders: [(&dyn DepthOrder, _); 1] = [(&no_parts, pieces)];
                let is_opaque = |_, _: &_, _: &_| true;
                let drawn = draw_orders(rays, COUNTED, index, &left, &is_opaque, &orders);
                drawn[0].0.passed
            }
        };
        passed as f64 * (SHADED.samples() as f64 / COUNTED.samples() as f64)
    }

    /// Number of items along a ray.
    fn layers(&self, ray: &Ray) -> usize {
        let mut met = self.surfaces.all_along(ray);
        // Floors and ceilings of a map come behind its items.
        met.retain(|&item| (item as usize) < self.items);
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
