//! How to write a structure: the whole contract, on the simplest one that beats
//! a scan. Items sorted along x stand in about sqrt(n) slabs, each with bounds.
//! `cargo test --example write_a_backend` puts it through the conformance suite.

use std::ops::{ControlFlow, Range};

use cullbench::camera::PlaneOptions;
use cullbench::geometry::{Aabb, ConvexVolume, PlaneTree};
use cullbench::index::{BuildError, FrustumQuery, LinearScalar, MemoryUsage};
use cullbench::index::{RegionIndex, indexable};
use cullbench::query::{Containment, ItemId, QueryCost, Recorder, Region, Sink};
use cullbench::{path, scene};
use glam::Vec3;

struct Slabs {
    /// Items in slab order, so that a slab is one slice of ids.
    ids: Vec<ItemId>,
    boxes: Vec<Aabb>,
    slabs: Vec<(Aabb, Range<usize>)>,
}

impl Slabs {
    /// One walk for every kind of region: a frustum, a point, a box.
    fn query<G: Region, S: Sink, R: Recorder>(
        &self,
        region: &G,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        for (bounds, items) in &self.slabs {
            recorder.node_tested();
            // The memo knows which planes are decided for all of the slab.
            let (verdict, memo) = region.classify(bounds, region.start(), recorder);
            match verdict {
                Containment::Outside => recorder.subtree_rejected(),
                Containment::Inside => {
                    recorder.subtree_accepted(items.len());
                    // `?`: a sink may break off, and is then left alone.
                    sink.accept(&self.ids[items.clone()])?;
                }
                Containment::Straddles => {
                    for (id, b) in self.ids[items.clone()]
                        .iter()
                        .zip(&self.boxes[items.clone()])
                    {
                        recorder.items_tested(1);
                        if region.admits(b, memo, recorder) {
                            sink.accept(std::slice::from_ref(id))?;
                        }
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }
}

impl RegionIndex for Slabs {
    const NAME: &'static str = "slabs";
    const SUMMARY: &'static str = "sqrt(n) slabs along x";
    type Params = (); // or a serde struct: `slabs:key=value`

    fn build(items: &[Aabb], _: Option<&PlaneTree>, _: &()) -> Result<Self, BuildError> {
        let mut ids = indexable(items)?; // refuses NaN, leaves empty boxes out
        let x = |id: &ItemId| items[*id as usize].centre().x;
        ids.sort_by(|a, b| x(a).total_cmp(&x(b)));
        let boxes: Vec<Aabb> = ids.iter().map(|&id| items[id as usize]).collect();
        let size = ids.len().isqrt().max(1);
        // Exact unions: a slab outside a plane then has no item inside it.
        let slabs = boxes.chunks(size).enumerate();
        let slabs = slabs
            .map(|(i, part)| (Aabb::union_of(part), i * size..i * size + part.len()))
            .collect();
        Ok(Slabs { ids, boxes, slabs })
    }

    fn memory(&self) -> MemoryUsage {
        let item_bytes = size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]);
        MemoryUsage {
            node_bytes: size_of_val(&self.slabs[..]),
            item_bytes,
        }
    }

    fn locate<S: Sink, R: Recorder>(&self, p: Vec3, sink: &mut S, r: &mut R) -> ControlFlow<()> {
        self.query(&p, sink, r)
    }
}

impl FrustumQuery for Slabs {
    fn visible<S: Sink, R: Recorder>(
        &self,
        volume: &ConvexVolume,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        self.query(volume, sink, recorder)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let city = scene::load("city:n=50000,seed=7", &Default::default())?;
    let orbit = path::load("orbit:frames=32", &city, &Default::default())?;
    let slabs = Slabs::build(&city.items, None, &())?;
    let scan = LinearScalar::build(&city.items, None, &Default::default())?;
    let (mut cheap, mut dear) = (QueryCost::default(), QueryCost::default());
    for camera in &orbit.cameras {
        let volume = camera.volume(&PlaneOptions::default(), &city.surroundings())?;
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        let _ = slabs.visible(&volume, &mut ours, &mut cheap);
        let _ = scan.visible(&volume, &mut theirs, &mut dear);
        ours.sort_unstable();
        assert_eq!(ours, theirs, "every structure returns the very same set");
    }
    for (name, cost) in [(Slabs::NAME, cheap), (LinearScalar::NAME, dear)] {
        let (boxes, planes) = (cost.comparisons() / 32, cost.planes_tested / 32);
        println!("{name}: {boxes} boxes and {planes} planes tested per frame");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    cullbench::conformance!(super::Slabs);
}
