//! The geodesic sphere: an icosahedron whose faces are cut into f² triangles,
//! pushed out to the sphere. Neighbouring faces share the points of their edge.

use std::collections::HashMap;

use glam::DVec3;

/// Golden ratio.
const PHI: f64 = 1.618_033_988_749_895;

const CORNERS: [[f64; 3]; 12] = [
    [-1.0, PHI, 0.0],
    [1.0, PHI, 0.0],
    [-1.0, -PHI, 0.0],
    [1.0, -PHI, 0.0],
    [0.0, -1.0, PHI],
    [0.0, 1.0, PHI],
    [0.0, -1.0, -PHI],
    [0.0, 1.0, -PHI],
    [PHI, 0.0, -1.0],
    [PHI, 0.0, 1.0],
    [-PHI, 0.0, -1.0],
    [-PHI, 0.0, 1.0],
];

/// Counter-clockwise from outside.
const FACES: [[usize; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// Unit directions and the triangles between them: 20 f² triangles and 10 f² + 2
/// points for a frequency f >= 1.
pub fn icosphere(frequency: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let f = frequency.max(1);
    let mut sphere = Sphere {
        frequency: f,
        ids: HashMap::new(),
        points: Vec::new(),
    };
    let mut triangles = Vec::new();
    for face in FACES {
        for j in 0..f {
            for i in 0..f - j {
                let mut at = |i: u32, j: u32| sphere.point(face, [f - i - j, i, j]);
                let (a, b, c) = (at(i, j), at(i + 1, j), at(i, j + 1));
                triangles.push([a, b, c]);
                if i + j + 1 < f {
                    triangles.push([b, at(i + 1, j + 1), c]);
                }
            }
        }
    }
    (sphere.points, triangles)
}

struct Sphere {
    frequency: u32,
    /// Point of each set of corners with their weights, without those of weight zero.
    ids: HashMap<[(usize, u32); 3], u32>,
    points: Vec<DVec3>,
}

impl Sphere {
    fn point(&mut self, face: [usize; 3], weights: [u32; 3]) -> u32 {
        let mut key = [0, 1, 2].map(|k| match weights[k] {
            0 => (usize::MAX, 0),
            weight => (face[k], weight),
        });
        // The same sum in the same order, whichever face asks.
        key.sort_unstable();
        let (next, frequency) = (self.points.len() as u32, f64::from(self.frequency));
        *self.ids.entry(key).or_insert_with(|| {
            let parts = key.iter().filter(|(_, weight)| *weight > 0);
            let sum = parts.fold(DVec3::ZERO, |sum, &(corner, weight)| {
                sum + DVec3::from(CORNERS[corner]) * (f64::from(weight) / frequency)
            });
            self.points.push(sum.normalize());
            next
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn euler_counts_and_outward_faces() {
        for f in [1, 2, 7] {
            let (points, triangles) = icosphere(f);
            assert_eq!(triangles.len(), 20 * (f * f) as usize);
            assert_eq!(points.len(), 10 * (f * f) as usize + 2);
            for [a, b, c] in &triangles {
                let [a, b, c] = [a, b, c].map(|&p| points[p as usize]);
                assert!(a.dot(b.cross(c)) > 0.0);
            }
        }
    }
}
