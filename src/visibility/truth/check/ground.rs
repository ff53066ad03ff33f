//! Whether boxes lie below the ground of a mesh, and a view begins above it.
//!
//! Ground are the opaque items of which every triangle turns left as seen from above. If
//! each of their edges is gone along once each way, but for a rim that runs round a
//! rectangle, then their triangles have, seen from above, the rectangle's border as theirs:
//! each place in it is covered once, and the height has no step. What begins above that
//! height and comes to something below it, over the rectangle all the way, has met a
//! triangle from its front.

use super::super::certificate::View;
use super::line::{Exact, Line, Three, cross, dot, exact, sign_of_difference};
use crate::scene::{SurfaceKind, Surfaces, WorldBox};

type Triangle = [[f32; 3]; 3];

/// The ground of a scene.
pub struct Ground {
    origin: [f64; 3],
    triangles: Vec<Triangle>,
    /// Bounds along x and along y.
    low: [f32; 2],
    high: [f32; 2],
}

impl Ground {
    /// That of the first `items` items. O(t log t).
    pub fn of(surfaces: &Surfaces, items: usize) -> Result<Ground, &'static str> {
        let is_ground = |item: &usize| {
            surfaces.kinds[*item] == SurfaceKind::Opaque
                && surfaces
                    .of(*item)
                    .all(|t| turns_left(t.map(|p| p.to_array())))
        };
        let items = (0..items.min(surfaces.items())).filter(is_ground);
        // Zeros of either sign are one place.
        let triangles = items.flat_map(|item| surfaces.of(item));
        let triangles = triangles.map(|t| t.map(|p| p.to_array().map(|x| x + 0.0)));
        let triangles: Vec<Triangle> = triangles.collect();
        let along = |axis: usize| triangles.iter().flatten().map(move |p| p[axis]);
        let low = [0, 1].map(|axis| along(axis).fold(f32::INFINITY, f32::min));
        let high = [0, 1].map(|axis| along(axis).fold(f32::NEG_INFINITY, f32::max));
        let ground = Ground {
            origin: surfaces.origin.to_array(),
            triangles,
            low,
            high,
        };
        match ground.is_whole() {
            true => Ok(ground),
            false => Err("the scene has no ground"),
        }
    }

    /// Whether the triangles are one height over a rectangle.
    fn is_whole(&self) -> bool {
        let mut edges: Vec<([[u32; 3]; 2], bool)> = Vec::new();
        for t in &self.triangles {
            for (from, to) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let [from, to] = [from, to].map(|p| p.map(f32::to_bits));
                edges.push(([from.min(to), from.max(to)], from < to));
            }
        }
        edges.sort_unstable();
        let mut sides: [Vec<[f32; 2]>; 4] = Default::default();
        for same in edges.chunk_by(|a, b| a.0 == b.0) {
            match same {
                [(_, false), (_, true)] => {}
                [(ends, _)] => {
                    let [p, q] = ends.map(|p| p.map(f32::from_bits));
                    let bounds = [self.low[0], self.high[0], self.low[1], self.high[1]];
                    let on = |k: usize| p[k / 2] == bounds[k] && q[k / 2] == bounds[k];
                    let Some(side) = (0..4).find(|&k| on(k)) else {
                        return false;
                    };
                    let along = 1 - side / 2;
                    sides[side].push([p[along].min(q[along]), p[along].max(q[along])]);
                }
                _ => return false,
            }
        }
        sides.iter_mut().enumerate().all(|(side, parts)| {
            let along = 1 - side / 2;
            parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let ends = parts.windows(2).all(|two| two[0][1] == two[1][0]);
            let first = parts.first().is_some_and(|part| part[0] == self.low[along]);
            let last = parts.last().is_some_and(|part| part[1] == self.high[along]);
            ends && first && last
        })
    }

    /// Whether a box is over the rectangle and nowhere above the ground.
    pub fn holds(&self, b: &WorldBox) -> bool {
        let is_over = (0..2).all(|k| {
            self.compare(k, self.low[k], b.min[k]) <= 0
                && self.compare(k, self.high[k], b.max[k]) >= 0
        });
        is_over
            && self.triangles.iter().all(|t| {
                let is_aside = |k: usize| {
                    t.iter().all(|p| self.compare(k, p[k], b.max[k]) > 0)
                        || t.iter().all(|p| self.compare(k, p[k], b.min[k]) < 0)
                };
                is_aside(0) || is_aside(1) || t.iter().all(|p| self.compare(2, p[2], b.max[2]) >= 0)
            })
    }

    /// The sign of a coordinate less a bound. A sum that was rounded is beyond a bound only
    /// if the sum is.
    fn compare(&self, axis: usize, local: f32, bound: f64) -> i32 {
        let rounded = self.origin[axis] + f64::from(local);
        match rounded.partial_cmp(&bound) {
            Some(std::cmp::Ordering::Less) => -1,
            Some(std::cmp::Ordering::Greater) => 1,
            _ => (&self.place(axis, local) - &Exact::from(bound)).sign(),
        }
    }

    fn place(&self, axis: usize, local: f32) -> Exact {
        &Exact::from(self.origin[axis]) + &Exact::from(f64::from(local))
    }

    /// Whether all lines of a view are above the ground where boxes begin to hide: at the
    /// four corners of the image, and so, as a plane is flat, between them.
    pub fn is_below(&self, view: &View) -> bool {
        // A corner is a point times its weight, which is above zero.
        let Some(corners) = corners(view) else {
            return false;
        };
        let side = |(point, weight): &(Three, Exact), axis: usize, local: f32| {
            sign_of_difference(
                &point[axis],
                &Exact::from(1.0),
                &self.place(axis, local),
                weight,
            )
        };
        let beyond = |axis: usize, local: f32, sign: i32| {
            corners
                .iter()
                .all(|corner| side(corner, axis, local) == sign)
        };
        let is_over = (0..2).all(|k| beyond(k, self.low[k], 1) && beyond(k, self.high[k], -1));
        // Far ones need no exact numbers: these are true to 2^-40 of what they are made of.
        let near = |axis: usize| {
            let at = corners
                .iter()
                .map(|(p, w)| p[axis].estimate() / w.estimate());
            let (low, high) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                (l.min(x), h.max(x))
            });
            let size = low.abs().max(high.abs()).max(self.origin[axis].abs());
            let slack = size * 1e-6;
            (
                low - slack - self.origin[axis],
                high + slack - self.origin[axis],
            )
        };
        let ranges = [near(0), near(1)];
        is_over
            && self.triangles.iter().all(|t| {
                let is_far = |k: usize| {
                    t.iter().all(|p| f64::from(p[k]) > ranges[k].1)
                        || t.iter().all(|p| f64::from(p[k]) < ranges[k].0)
                };
                is_far(0) || is_far(1) || t.iter().all(|p| beyond(2, p[2], 1))
            })
    }
}

/// Whether a triangle has an area, seen from above, and turns left.
fn turns_left([a, b, c]: Triangle) -> bool {
    let minus = |p: f32, q: f32| &Exact::from(f64::from(p)) - &Exact::from(f64::from(q));
    sign_of_difference(
        &minus(b[0], a[0]),
        &minus(c[1], a[1]),
        &minus(b[1], a[1]),
        &minus(c[0], a[0]),
    ) > 0
}

/// The corners of the image where boxes begin to hide: points times a weight above zero.
fn corners(view: &View) -> Option<Vec<(Three, Exact)>> {
    let (eye, forward) = (exact(view.eye), exact(view.forward));
    let sides = view.sides.map(exact);
    let from = Exact::from(view.hides_from);
    let corners = [[0, 2], [0, 3], [1, 2], [1, 3]].map(|[i, j]: [usize; 2]| {
        let line = Line::new(view, cross(&sides[i], &sides[j]));
        // Depth along a line is counted from the eye's plane: place + direction * t.
        let reach = dot(&line.direction, &forward);
        let gone = match view.parallel {
            false => Exact::ZERO,
            true => {
                let eye = [0, 1, 2].map(|k: usize| &(&eye[k] * &line.unit) - &line.place[k]);
                dot(&eye, &forward)
            }
        };
        (line, reach, gone)
    });
    let points = corners.into_iter().map(|(line, reach, gone)| {
        // At depth h of a line through place / unit: t = (h * unit + gone) / (unit * reach),
        // so the point is (place * reach + direction * (h * unit + gone)) / (unit * reach).
        let along = &(&from * &line.unit) + &gone;
        let point = [0, 1, 2].map(|k: usize| {
            (&(&line.place[k] * &reach) + &(&line.direction[k] * &along)).compressed()
        });
        let weight = (&line.unit * &reach).compressed();
        match weight.sign() {
            0 => None,
            1 => Some((point, weight)),
            _ => Some((point.map(|x| -&x), -&weight)),
        }
    });
    points.collect()
}
