//! The triangle stage must keep every triangle that some ray meets first.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::case::{RAYS, StageCase, along, looking};
use crate::camera::{Camera, Lens};
use crate::kernel::Kernel;
use crate::scene::{MESHES, Scene, SeededRng, Surfaces};
use crate::visibility::Guarantee;
use crate::visibility::rays::tests::in_image;
use crate::visibility::triangle::{
    Clusters, Eye, MOST_TRIANGLES, Selection, TRIANGLE_ROWS, TriangleRow,
};
use crate::visibility::truth::SurfaceIndex;
use crate::visibility::{Ray, Rays};

/// Number of triangles per mesh.
const OF_MESH: usize = 1_500;

/// Input of the back ends under test.
pub struct TriangleCase {
    surfaces: Surfaces,
    camera: Camera,
    /// Targets of rays in addition to the random ones.
    aims: Vec<DVec3>,
}

/// Triangles that a back end removed although a ray meets them first.
pub struct Lost {
    /// The back end.
    pub row: &'static TriangleRow,
    /// Indices of the triangles.
    pub triangles: Vec<u32>,
}

/// The twelve triangles of each box.
impl From<StageCase> for TriangleCase {
    fn from(case: StageCase) -> TriangleCase {
        let scene = Scene::from_boxes("triangles", &case.boxes).expect("boxes of a scene");
        TriangleCase {
            surfaces: Surfaces::from_boxes(&scene),
            camera: case.camera,
            aims: case.aims,
        }
    }
}

/// A random mesh, seen from a random point in or near its bounds.
pub fn mesh(rng: &mut SeededRng) -> TriangleCase {
    let mesh = &MESHES[rng.below(MESHES.len())];
    let surfaces = mesh.mesh(OF_MESH, rng.below(1000) as u64);
    let scene = surfaces.clone().into_scene("mesh").expect("a mesh");
    let bounds = scene.world_bounds();
    let (centre, size) = ((bounds.min + bounds.max) / 2.0, bounds.max - bounds.min);
    let mut point =
        |scale| centre + (rng.point() - 0.5) * (size + size.max_element() * 0.1) * scale;
    let (eye, look) = (point(1.4), point(0.8));
    let near = size.max_element() * 1e-3;
    let lens = Lens::perspective(60.0, 16.0 / 9.0, near, None).expect("a lens");
    TriangleCase {
        surfaces,
        camera: looking(eye, look - eye, lens),
        aims: Vec::new(),
    }
}

impl TriangleCase {
    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.surfaces.triangles.len()
    }

    /// Triangles that each back end with a guarantee loses.
    ///
    /// At least half of the rays aim at triangles, the others at random points of the image.
    pub fn lost(self, rng: &mut SeededRng, kernel: Kernel) -> Vec<Lost> {
        let rays = Rays::of(&self.camera).expect("a camera with a lens");
        let aimed: Vec<DVec3> = (0..RAYS).map(|_| self.point(rng)).collect();
        let aims = aimed.iter().chain(&self.aims);
        let aims = aims.filter_map(|&point| in_image(&rays, point));
        let random = (0..RAYS).map(|_| [rng.unit(), rng.unit()]);
        let anywhere: Vec<[f64; 2]> = aims.chain(random).collect();
        let anywhere = anywhere.iter().map(|&[x, y]| rays.through(x, y));

        let clusters = Arc::new(Clusters::of(Arc::new(self.surfaces), MOST_TRIANGLES));
        let origin = clusters.surfaces.origin;
        let eye = Eye::of(&self.camera, origin);
        let met = Met::new(&clusters).first(anywhere);
        let all = Selection::all(&clusters);
        let promising = TRIANGLE_ROWS
            .iter()
            .filter(|row| row.guarantee <= Guarantee::Conservative);
        let lost = promising.map(|row| {
            let mut kept = all.clone();
            (row.build)(&clusters).cull(&eye, kernel, &mut kept);
            let lost = met.iter().map(|&(c, bits)| (c, bits & !kept.words()[c]));
            let lost = lost.flat_map(|(c, bits)| {
                let own = clusters.triangles_of(c).iter().enumerate();
                own.filter_map(move |(i, &t)| (bits >> i & 1 == 1).then_some(t))
            });
            let mut triangles: Vec<u32> = lost.collect();
            triangles.sort_unstable();
            triangles.dedup();
            Lost { row, triangles }
        });
        lost.collect()
    }

    /// A point of a random triangle, mostly next to an edge or a corner.
    fn point(&self, rng: &mut SeededRng) -> DVec3 {
        let triangle = rng.below(self.triangles()) as u32;
        let [a, b, c] = self.surfaces.corners(triangle).map(Vec3::as_dvec3);
        let (s, t) = (along(rng), along(rng));
        self.surfaces.origin + a + ((b - a) + (c - b) * t) * s
    }
}

/// Map from corners to the triangles that have them.
struct Met {
    index: SurfaceIndex,
    /// Clusters and bits of the triangles with these corners.
    places: HashMap<[[u32; 3]; 3], Vec<(usize, u64)>>,
}

/// Bits of a triangle's corners, as a map key.
fn key(corners: [Vec3; 3]) -> [[u32; 3]; 3] {
    corners.map(|corner| corner.to_array().map(f32::to_bits))
}

impl Met {
    fn new(clusters: &Clusters) -> Met {
        let mut places: HashMap<_, Vec<_>> = HashMap::new();
        for cluster in 0..clusters.len() {
            for (i, corners) in clusters.corners_of(cluster).enumerate() {
                let place = (cluster, 1 << i);
                places.entry(key(corners)).or_default().push(place);
            }
        }
        Met {
            index: SurfaceIndex::build(&clusters.surfaces),
            places,
        }
    }

    /// Clusters and bits of the triangles that some ray meets first.
    fn first(&self, rays: impl Iterator<Item = Ray>) -> Vec<(usize, u64)> {
        let hits = rays.filter_map(|ray| self.index.front_of(&ray).hit);
        let places = hits.flat_map(|hit| &self.places[&key(hit.corners)]);
        places.copied().collect()
    }
}
