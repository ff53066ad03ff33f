//! Where a ray meets a triangle, exactly; and by it, whether the ray sees an item.

use super::super::certificate::View;
use super::line::{Exact, Three, cross, dot, exact, sign_of_difference};
use super::rough::{guess, roomy};
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces, WorldBox};

/// How far along a ray, as a fraction; below the line is above zero.
struct Depth {
    above: Exact,
    below: Exact,
}

impl Depth {
    fn is_less(&self, other: &Depth) -> bool {
        sign_of_difference(&self.above, &other.below, &other.above, &self.below) < 0
    }

    fn order(&self, depth: f64) -> i32 {
        sign_of_difference(&self.above, &1.0.into(), &depth.into(), &self.below)
    }
}

/// That the ray meets a triangle of the item from near to far, and none of what is
/// opaque before it.
pub fn sees(
    view: &View,
    origin: [f64; 3],
    direction: [f64; 3],
    item: ItemId,
    surfaces: &Surfaces,
) -> Result<(), &'static str> {
    let mut all = Vec::new();
    for other in 0..surfaces.items() {
        if surfaces.kinds[other] != SurfaceKind::Opaque && other != item as usize {
            continue;
        }
        let two_sided = surfaces.two_sided[other];
        let range = surfaces.of_item[other].clone();
        for corners in &surfaces.triangles[range.start as usize..range.end as usize] {
            if let Some(depth) = meet(view, origin, direction, surfaces, corners, two_sided) {
                all.push((other, depth));
            }
        }
    }
    let own = all.iter().filter(|(other, _)| *other == item as usize);
    let first = own.reduce(|a, b| if b.1.is_less(&a.1) { b } else { a });
    let (_, first) = first.ok_or("its ray does not meet the item")?;
    let before = |(other, depth): &(usize, Depth)| {
        surfaces.kinds[*other] == SurfaceKind::Opaque && depth.is_less(first)
    };
    match all.iter().any(before) {
        true => Err("another item is in front of it"),
        false => Ok(()),
    }
}

/// From near to far, and from its front if it has one side.
fn meet(
    view: &View,
    origin: [f64; 3],
    direction: [f64; 3],
    surfaces: &Surfaces,
    corners: &[u32; 3],
    two_sided: bool,
) -> Option<Depth> {
    let near = corners.map(|corner| surfaces.origin + surfaces.points[corner as usize].as_dvec3());
    // Sums are rounded: the next numbers are beyond them.
    let low = near[0].min(near[1]).min(near[2]).to_array();
    let high = near[0].max(near[1]).max(near[2]).to_array();
    let around = WorldBox::new(
        low.map(f64::next_down).into(),
        high.map(f64::next_up).into(),
    );
    if let Some([enters, leaves]) = guess(origin, direction, &around) {
        let far = view.far.unwrap_or(f64::INFINITY);
        let possible = enters <= leaves && leaves >= roomy(view.near, -1.0) && enters <= far;
        if !possible {
            return None;
        }
    }
    let (from, way) = (exact(origin), exact(direction));
    let about = |corner: u32| -> Three {
        let local = surfaces.points[corner as usize];
        [0, 1, 2].map(|k: usize| {
            let place = &Exact::from(surfaces.origin[k]) + &Exact::from(f64::from(local[k]));
            &place - &from[k]
        })
    };
    let [a, b, c] = corners.map(about);
    let less = |p: &Three, q: &Three| [0, 1, 2].map(|k: usize| &p[k] - &q[k]);
    let normal = cross(&less(&b, &a), &less(&c, &a));
    let towards = dot(&way, &normal);
    let sign = towards.sign();
    // Along its plane there is nothing of it to be seen.
    if sign == 0 || (sign > 0 && !two_sided) {
        return None;
    }
    // The ray passes each edge on the side of the triangle.
    let within = [(&a, &b), (&b, &c), (&c, &a)]
        .iter()
        .all(|(p, q)| dot(&way, &cross(p, q)).sign() * sign >= 0);
    if !within {
        return None;
    }
    let turned = |x: Exact| if sign < 0 { -&x } else { x };
    let depth = Depth {
        above: turned(dot(&a, &normal)),
        below: turned(towards),
    };
    let reached = depth.order(view.near) >= 0 && view.far.is_none_or(|far| depth.order(far) <= 0);
    reached.then_some(depth)
}
