//! Embree 3 (Wald et al. 2014, "Embree: a kernel framework for efficient CPU ray
//! tracing", ACM Transactions on Graphics 33, 4) through the crate embree-rs, boxes as
//! six quads each, triangles as they are.
//!
//! Links the system's library `embree3`, so it is a feature of its own.

use std::thread;

use ::embree_rs::{
    CommittedScene, Device, Geometry, IntersectContext, QuadMesh, RayHit, Scene, TriangleMesh, sys,
};
use glam::DVec3;

use super::contract::{BackEnd, Hit, NotBuilt, Pick, keep_nearest, keep_nearest_items};
use super::facets::Facets;
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "embree",
    summary: "Embree 3 by crate embree-rs, quads or triangles, its rtcIntersect1",
    // Rays and quads are in f32, and rays may slip through between two quads.
    guarantee: Guarantee::Unproven,
    build,
    build_triangles: Some(|facets, _| Ok(Box::new(EmbreeTriangles::of(facets)?))),
};

/// Corners of a box in the order of its faces; a bit of a corner is an axis, set for
/// the upper bound.
const QUADS: [[u32; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];

/// Its tree, asked face by face.
struct Faces(CommittedScene<'static>);

impl Faces {
    /// Over what `geometry` makes of at most so many things.
    fn of(
        count: usize,
        most: usize,
        geometry: impl FnOnce(&'static Device) -> Geometry<'static> + Send,
    ) -> Result<Faces, NotBuilt> {
        if count > most {
            return Err(NotBuilt::TooMany { count, most });
        }
        // A scene that lives as long as the process, as its device does: the crate's types
        // borrow one from the other, which no type of ours can hold both of.
        let committed = move || {
            let device: &'static Device = Box::leak(Box::new(Device::new()));
            let mut geometry = geometry(device);
            geometry.commit();
            let mut scene = Scene::new(device);
            scene.attach_geometry(geometry);
            let scene: &'static Scene = Box::leak(Box::new(scene));
            scene.commit()
        };
        // The crate's scene makes the processor flush what is tiny to zero from then on, on
        // the thread that makes it. So that is another one.
        let scene = thread::scope(|scope| {
            let made = scope.spawn(committed);
            made.join().unwrap_or_else(|e| std::panic::resume_unwind(e))
        });
        Ok(Faces(scene))
    }

    /// The first face at `from` or beyond, and how deep it is.
    #[inline(always)]
    fn next(&self, rounded: &RoundedRay, from: f32) -> Option<(usize, f32)> {
        let ray = sys::RTCRay {
            org_x: rounded.origin.x,
            org_y: rounded.origin.y,
            org_z: rounded.origin.z,
            tnear: from,
            dir_x: rounded.direction.x,
            dir_y: rounded.direction.y,
            dir_z: rounded.direction.z,
            time: 0.0,
            tfar: rounded.far.next_up(),
            mask: u32::MAX,
            id: 0,
            flags: 0,
        };
        let mut found = RayHit::new(ray);
        let mut context = IntersectContext::incoherent();
        self.0.intersect(&mut context, &mut found);
        let is_hit = found.hit.hit();
        is_hit.then_some((found.hit.primID as usize, found.ray.tfar))
    }
}

/// Its tree of quads.
pub struct Embree {
    faces: Faces,
    boxes: Vec<Aabb>,
    zero: DVec3,
}

/// Builds it for the table of back ends.
fn build(solids: &Solids, _: Kernel) -> Result<Box<dyn Pick>, NotBuilt> {
    let boxes = &solids.outer;
    let faces = Faces::of(boxes.len(), u32::MAX as usize / 8, |device| {
        let mut mesh = QuadMesh::unanimated(device, boxes.len() * 6, boxes.len() * 8);
        {
            let mut vertices = mesh.vertex_buffer.map();
            let mut indices = mesh.index_buffer.map();
            for (item, b) in boxes.iter().enumerate() {
                for corner in 0..8 {
                    let side = |axis: usize| match corner >> axis & 1 {
                        0 => b.min[axis],
                        _ => b.max[axis],
                    };
                    let vertex = &mut vertices[item * 8 + corner];
                    (vertex.x, vertex.y, vertex.z) = (side(0), side(1), side(2));
                }
                for (face, corners) in QUADS.iter().enumerate() {
                    let at = corners.map(|corner| item as u32 * 8 + corner);
                    let quad = &mut indices[item * 6 + face];
                    [quad.x, quad.y, quad.z, quad.w] = at;
                }
            }
        }
        Geometry::Quad(mesh)
    });
    Ok(Box::new(Embree {
        faces: faces?,
        boxes: boxes.clone(),
        zero: solids.origin,
    }))
}

impl Embree {
    /// The first face at `from` or beyond: its item, how deep it is, and how deep that
    /// item is entered, infinite where the ray leaves it only.
    #[inline(always)]
    fn next(&self, rounded: &RoundedRay, from: f32) -> Option<(ItemId, f32, f32)> {
        let (face, at) = self.faces.next(rounded, from)?;
        let item = face / 6;
        Some((item as ItemId, at, rounded.entry(&self.boxes[item])))
    }
}

impl Pick for Embree {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let mut from = rounded.near.max(0.0);
        // Faces by which the ray leaves what it began in are passed by.
        while let Some((item, at, enters)) = self.next(&rounded, from) {
            if enters.is_finite() {
                let depth = f64::from(enters);
                return Some(Hit { item, depth });
            }
            from = at.next_up();
        }
        None
    }

    /// From face to face; of faces at the very same depth one is found.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.zero);
        hits.clear();
        let mut from = rounded.near.max(0.0);
        while hits.len() < count
            && let Some((item, at, enters)) = self.next(&rounded, from)
        {
            let depth = f64::from(enters);
            if enters.is_finite() && !hits.iter().any(|hit| hit.item == item) {
                hits.push(Hit { item, depth });
            }
            from = at.next_up();
        }
        keep_nearest(hits, count);
    }
}

/// Its tree of triangles.
struct EmbreeTriangles {
    faces: Faces,
    facets: Facets,
}

impl EmbreeTriangles {
    fn of(facets: &Facets) -> Result<EmbreeTriangles, NotBuilt> {
        let all = &facets.all;
        let faces = Faces::of(all.len(), u32::MAX as usize / 3, |device| {
            let mut mesh = TriangleMesh::unanimated(device, all.len(), all.len() * 3);
            {
                let mut vertices = mesh.vertex_buffer.map();
                let mut indices = mesh.index_buffer.map();
                for (place, facet) in all.iter().enumerate() {
                    for (corner, at) in facet.corners.iter().enumerate() {
                        let vertex = &mut vertices[place * 3 + corner];
                        (vertex.x, vertex.y, vertex.z) = (at.x, at.y, at.z);
                    }
                    let first = place as u32 * 3;
                    let triangle = &mut indices[place];
                    [triangle.x, triangle.y, triangle.z] = [first, first + 1, first + 2];
                }
            }
            Geometry::Triangle(mesh)
        });
        Ok(EmbreeTriangles {
            faces: faces?,
            facets: facets.clone(),
        })
    }

    /// The first triangle at `from` or beyond that is met from its front or has two sides.
    #[inline(always)]
    fn next(&self, rounded: &RoundedRay, mut from: f32) -> Option<(usize, f32)> {
        loop {
            let (place, at) = self.faces.next(rounded, from)?;
            let facet = &self.facets.all[place];
            let [a, b, c] = facet.corners;
            if facet.two_sided || (b - a).cross(c - a).dot(rounded.direction) < 0.0 {
                return Some((place, at));
            }
            from = at.next_up();
        }
    }
}

impl Pick for EmbreeTriangles {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.facets.origin);
        let (place, at) = self.next(&rounded, rounded.near.max(0.0))?;
        self.facets.hit(place, f64::from(at))
    }

    /// From triangle to triangle; of those at the very same depth one is found.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.facets.origin);
        hits.clear();
        let mut from = rounded.near.max(0.0);
        while hits.len() < count
            && let Some((place, at)) = self.next(&rounded, from)
        {
            if let Some(hit) = self.facets.hit(place, f64::from(at))
                && !hits.iter().any(|other| other.item == hit.item)
            {
                hits.push(hit);
            }
            from = at.next_up();
        }
        keep_nearest_items(hits, count);
    }
}
