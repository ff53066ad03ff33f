//! The search for certificates: for an item a ray that sees it, or boxes that hide
//! it. Its image is parted along the edges of the boxes in front of it until each
//! part lies behind one of them. Everything that it claims is decided exactly.

use std::cmp::Ordering;

use glam::DVec3;

use super::certificate::{Cell, Certificates, Edge, Proof, View};
use super::entry::Probe;
use super::ray_index::RayIndex;
use super::sample::{NO_ITEM, SampleTruth};
use super::sight::{Polygon, Sight, Triple, sign};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::threads;
use crate::visibility::{Ray, Rays, Solids};

/// Most parts of an item's image that are looked at, and how often one is parted
/// again: items that are hidden need a few.
const MOST_CELLS: usize = 400;
const MOST_CUTS: usize = 48;

/// Items that a thread takes at a time.
const CHUNK: usize = 16;

named! {
    /// What is known of an item in a view.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
    #[non_exhaustive]
    pub enum Class {
        /// Some sample sees it.
        Visible = "visible",
        /// No sample sees it, but a ray between them does.
        SubSample = "sub-sample",
        /// No ray of the view sees it.
        Hidden = "hidden",
        /// It is the front item of no ray, but may tie with one of a lower number.
        Tied = "tied",
        /// No proof was found either way.
        Undecided = "undecided",
    }
}

impl Class {
    /// By the truth of a sample grid and by a proof.
    pub fn of(truth: &SampleTruth, item: ItemId, proof: &Proof) -> Class {
        match proof {
            _ if truth.sees(item) => Class::Visible,
            Proof::Witness { .. } => Class::SubSample,
            Proof::Cover { ties: true, .. } => Class::Tied,
            Proof::AroundEye | Proof::Cover { .. } => Class::Hidden,
            Proof::Undecided => Class::Undecided,
        }
    }
}

/// Looks for proofs in one view of a scene.
#[derive(Clone, Debug)]
pub struct Prover<'s> {
    solids: &'s Solids,
    index: &'s RayIndex,
    sight: Sight,
}

/// Why a search ended without a cover.
enum End {
    Seen(Ray),
    GaveUp,
}

/// The search for one item's cover.
struct Hunt<'p> {
    prover: &'p Prover<'p>,
    item: ItemId,
    /// What was met in front of it, the largest to the eye first.
    known: Vec<(f64, ItemId)>,
    cells: usize,
    /// Whether items of lower numbers may be as near.
    ties: bool,
}

impl<'s> Prover<'s> {
    /// For the view of these rays.
    pub fn new(solids: &'s Solids, index: &'s RayIndex, rays: &Rays) -> Prover<'s> {
        let sight = Sight::new(&View::of(rays));
        Prover {
            solids,
            index,
            sight,
        }
    }

    /// The view that the proofs are about.
    pub fn view(&self) -> &View {
        &self.sight.view
    }

    /// Whether the item is visible along any ray of the view, with the proof.
    pub fn prove(&self, item: ItemId) -> Proof {
        let b = &self.solids.boxes[item as usize];
        let view = self.view();
        let holds = |p: DVec3| p.cmpge(b.min).all() && p.cmple(b.max).all();
        if !view.parallel && holds(view.eye.into()) {
            return Proof::AroundEye;
        }
        let corners = corners_of(b).map(|corner| self.sight.through(corner));
        let Some(outline) = outline(&corners) else {
            return Proof::Undecided;
        };
        let image = Polygon::new(
            outline
                .iter()
                .map(|&k| corners[usize::from(k)].clone())
                .collect(),
        );
        let clipped = self
            .sight
            .sides
            .iter()
            .try_fold(image, |image, side| image.cut(side, false));
        let search = |ties: bool| {
            let (known, cells) = (Vec::new(), 0);
            let mut hunt = Hunt {
                prover: self,
                item,
                known,
                cells,
                ties,
            };
            let cell = clipped
                .as_ref()
                .map_or(Ok(Cell::Empty), |image| hunt.cell(image, 0))?;
            let outline = outline.clone();
            Ok(Proof::Cover {
                outline,
                ties,
                cell,
            })
        };
        match search(false) {
            Ok(proof) => proof,
            Err(End::Seen(ray)) => witness(&ray),
            Err(End::GaveUp) => search(true).unwrap_or(Proof::Undecided),
        }
    }

    /// A ray about the middle of a polygon.
    fn ray_through(&self, image: &Polygon) -> Ray {
        let view = self.view();
        let (forward, eye) = (DVec3::from(view.forward), DVec3::from(view.eye));
        let unit = |line: &Triple| match view.parallel {
            true => line.near[super::certificate::longest(view.forward)],
            false => forward.dot(line.near.into()),
        };
        let sum: DVec3 = image
            .corners
            .iter()
            .map(|c| DVec3::from(c.near) / unit(c))
            .sum();
        let mut middle = sum / image.corners.len() as f64;
        if !view.parallel {
            return view.ray(view.eye, middle.to_array());
        }
        middle[super::certificate::longest(view.forward)] = 0.0;
        let origin = middle + forward * forward.dot(eye - middle);
        view.ray(origin.to_array(), view.forward)
    }

    /// Whether the ray, as rounded, is one of the view.
    fn is_of_view(&self, ray: &Ray) -> bool {
        let line = self.line_of(ray);
        let sides = &self.sight.sides;
        sides.iter().all(|side| side.dot_sign(&line) >= 0)
    }

    /// A ray of the view as three numbers.
    fn line_of(&self, ray: &Ray) -> Triple {
        match self.view().parallel {
            false => ray.direction.to_array().map(Into::into).into(),
            true => self.sight.through(ray.origin.to_array()),
        }
    }

    /// Whether all rays through the polygon enter `front` from where boxes hide on,
    /// and before they enter `back`, if they do; with `ties` not after that.
    fn hides(&self, front: &WorldBox, back: &WorldBox, image: &Polygon, ties: bool) -> bool {
        let (sight, corners) = (&self.sight, &image.corners[..]);
        // Rays that pierce a convex box are a convex set: the corners are enough.
        if !corners.iter().all(|line| pierces(sight, line, front)) {
            return false;
        }
        // The way of all rays along each axis, 0 where they differ.
        let ways = [0, 1, 2].map(|axis: usize| {
            let way = sign(sight.slope(&corners[0], axis));
            let same = corners
                .iter()
                .all(|line| sign(sight.slope(line, axis)) == way);
            if same { way } else { 0 }
        });
        let entry = |b: &WorldBox, axis: usize, way: i32| {
            (axis, if way > 0 { b.min[axis] } else { b.max[axis] })
        };
        // Entered last through the plane of any one axis: not before that plane.
        let visible = |axis: usize| {
            let plane = entry(front, axis, ways[axis]);
            let reached = |line: &Triple| sight.hides_from(line, plane, ways[axis]);
            ways[axis] != 0 && corners.iter().all(reached)
        };
        if !(0..3).any(visible) {
            return false;
        }
        (0..3).any(|axis| {
            // `back` is not entered before its plane across this axis ..
            let way = match sight.view.parallel {
                true => ways[axis],
                false => side_of(sight.view.eye[axis], back, axis),
            };
            if way == 0 {
                return false;
            }
            let behind = entry(back, axis, way);
            // .. and `front` is entered before it, through whichever plane.
            (0..3).all(|k| {
                let free = match sight.view.parallel {
                    true => sight.view.forward[k] == 0.0,
                    false => side_of(sight.view.eye[k], front, k) == 0,
                };
                let before = |line: &Triple| {
                    sight.order(line, entry(front, k, ways[k]), behind) * ways[k] * way
                };
                let always = || match ties {
                    true => corners.iter().all(|line| before(line) <= 0),
                    false => image.below_zero(before),
                };
                free || ways[k] != 0 && always()
            })
        })
    }
}

/// On which side of a point the box lies along an axis: 1 is above it, 0 at it.
fn side_of(at: f64, b: &WorldBox, axis: usize) -> i32 {
    i32::from(b.min[axis] > at) - i32::from(b.max[axis] < at)
}

/// Whether the whole line meets the closed box.
fn pierces(sight: &Sight, line: &Triple, b: &WorldBox) -> bool {
    let ways = [0, 1, 2].map(|axis: usize| sign(sight.slope(line, axis)));
    let ends = |axis: usize| {
        let (low, high) = ((axis, b.min[axis]), (axis, b.max[axis]));
        if ways[axis] < 0 {
            (high, low)
        } else {
            (low, high)
        }
    };
    (0..3).all(|axis| {
        let (from, to) = ends(axis);
        if ways[axis] == 0 {
            return sight.gap_sign(line, from) <= 0 && sight.gap_sign(line, to) >= 0;
        }
        (0..3).all(|other| {
            let leaves = ends(other).1;
            ways[other] == 0
                || other == axis
                || sight.order(line, from, leaves) * ways[axis] * ways[other] <= 0
        })
    })
}

fn corners_of(b: &WorldBox) -> [[f64; 3]; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|k: usize| {
        [0, 1, 2].map(|axis: usize| {
            if k >> axis & 1 == 1 {
                b.max[axis]
            } else {
                b.min[axis]
            }
        })
    })
}

/// The corners round the image of a box, anticlockwise; `None` if it has no area.
fn outline(corners: &[Triple; 8]) -> Option<Vec<u8>> {
    // From p to q: nothing is on the right, and what is on the line lies between.
    let follows = |p: usize, q: usize| {
        let mut area = false;
        let fits = (0..8).all(|c| {
            let turn = Triple::turn(&corners[p], &corners[q], &corners[c]);
            area |= turn > 0;
            turn > 0 || turn == 0 && between(&corners[p], &corners[c], &corners[q])
        });
        fits && area
    };
    // Corners in one place (flat boxes, one behind the other) count as the first.
    let same = |p: usize, q: usize| parallel(&corners[p], &corners[q]);
    let first: Vec<usize> = (0..8).filter(|&q| !(0..q).any(|p| same(p, q))).collect();
    let next = |p: usize| first.iter().copied().find(|&q| q != p && follows(p, q));
    let start = first.iter().copied().find(|&p| next(p).is_some())?;
    let mut round = vec![start as u8];
    let mut at = next(start)?;
    while at != start {
        round.push(at as u8);
        at = next(at).filter(|_| round.len() < 8)?;
    }
    (round.len() > 2).then_some(round)
}

/// Whether two lines of sight are the same one, near enough: only a guess is made
/// of it.
fn parallel(a: &Triple, b: &Triple) -> bool {
    let (a, b) = (DVec3::from(a.near), DVec3::from(b.near));
    a.cross(b).length() <= 1e-15 * a.length() * b.length() && a.dot(b) > 0.0
}

/// Whether c is between p and q, all three on a line of the image.
fn between(p: &Triple, c: &Triple, q: &Triple) -> bool {
    let [p, c, q] = [p, c, q].map(|line| DVec3::from(line.near).normalize());
    p.dot(c).min(c.dot(q)) >= p.dot(q) - 1e-12
}

fn witness(ray: &Ray) -> Proof {
    Proof::Witness {
        origin: ray.origin.to_array(),
        direction: ray.direction.to_array(),
    }
}

impl Hunt<'_> {
    fn boxed(&self, item: ItemId) -> &WorldBox {
        &self.prover.solids.boxes[item as usize]
    }

    /// Whether an item may be entered together with the one that it hides.
    fn may_tie(&self, front: ItemId) -> bool {
        self.ties && front < self.item
    }

    /// The proof for a part of the image.
    fn cell(&mut self, image: &Polygon, cuts: usize) -> Result<Cell, End> {
        let hides = |hunt: &Self, front: ItemId| {
            let (b, back) = (hunt.boxed(front), hunt.boxed(hunt.item));
            hunt.prover.hides(b, back, image, hunt.may_tie(front))
        };
        if let Some((_, front)) = self.known.iter().find(|known| hides(self, known.1)) {
            return Ok(Cell::Behind(*front));
        }
        self.cells += 1;
        if self.cells > MOST_CELLS || cuts > MOST_CUTS {
            return Err(End::GaveUp);
        }
        let ray = self.prover.ray_through(image);
        let pierced = self.in_front(&ray)?;
        for &(size, front) in &pierced {
            if self.known.iter().any(|known| known.1 == front) {
                continue;
            }
            let at = self.known.partition_point(|known| known.0 >= size);
            self.known.insert(at, (size, front));
            if hides(self, front) {
                return Ok(Cell::Behind(front));
            }
        }
        let Some((edge, line)) = self.best_cut(&pierced, image, &ray) else {
            return Err(End::GaveUp);
        };
        // What hides the middle is most likely nearer along its own edge as well.
        let inner = line.dot_sign(&self.prover.line_of(&ray)) > 0;
        let mut parts = |line_in_first: bool| {
            let mut part = |line: &Triple, open: bool| match image.cut(line, open) {
                Some(part) => self.cell(&part, cuts + 1),
                None => Ok(Cell::Empty),
            };
            let cells = [
                part(&line, !line_in_first)?,
                part(&line.negated(), line_in_first)?,
            ];
            let cells = Box::new(cells);
            Ok(Cell::Parted {
                edge,
                line_in_first,
                cells,
            })
        };
        match parts(inner) {
            Err(End::GaveUp) => parts(!inner),
            found => found,
        }
    }

    /// The items that the ray enters before this one, the largest to the eye first.
    fn in_front(&self, ray: &Ray) -> Result<Vec<(f64, ItemId)>, End> {
        let probe = Probe::new(*ray);
        let own = probe.enter(self.boxed(self.item), f64::INFINITY);
        let limit = own.map_or(f64::INFINITY, |own| own.at_most());
        let mut pierced = self.prover.index.all_along(ray, limit);
        if let Some(own) = own {
            pierced.retain(|(item, entry)| match probe.compare(entry, &own) {
                Ordering::Equal => self.may_tie(*item),
                order => order.is_lt(),
            });
            if pierced.is_empty() && self.prover.is_of_view(ray) {
                return Err(End::Seen(*ray));
            }
        }
        let sized = pierced
            .iter()
            .filter(|(item, _)| *item != self.item)
            .map(|(item, entry)| {
                let size = self.boxed(*item).max - self.boxed(*item).min;
                let area = size.x * size.y + size.y * size.z + size.z * size.x;
                let reach = if self.prover.view().parallel {
                    1.0
                } else {
                    entry.depth * entry.depth
                };
                (area / reach, *item)
            });
        let mut sized: Vec<_> = sized.collect();
        sized.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        Ok(sized)
    }

    /// The edge to part the image by: of the box that hides most of it, that side
    /// beyond which most is left over.
    fn best_cut(
        &self,
        pierced: &[(f64, ItemId)],
        image: &Polygon,
        ray: &Ray,
    ) -> Option<(Edge, Triple)> {
        let sight = &self.prover.sight;
        let covered = |item: ItemId| {
            let b = self.boxed(item);
            image
                .corners
                .iter()
                .filter(|line| pierces(sight, line, b))
                .count()
        };
        let mut by_cover: Vec<_> = pierced
            .iter()
            .map(|&(_, item)| (covered(item), item))
            .collect();
        by_cover.sort_by_key(|&(count, _)| std::cmp::Reverse(count));
        let middle = self.prover.line_of(ray);
        let best = by_cover
            .iter()
            .find_map(|&(_, item)| self.cut_along(item, image, &middle, true));
        // It is covered already, but not by one face before one face.
        best.or_else(|| self.cut_along(self.item, image, &middle, false))
            .or_else(|| {
                by_cover
                    .iter()
                    .find_map(|&(_, item)| self.cut_along(item, image, &middle, false))
            })
    }

    /// The edge of a box that leaves most of the image beyond it; of its outline, or
    /// of all its edges.
    fn cut_along(
        &self,
        item: ItemId,
        image: &Polygon,
        middle: &Triple,
        outer: bool,
    ) -> Option<(Edge, Triple)> {
        let b = self.boxed(item);
        let sight = &self.prover.sight;
        let mut best: Option<(f64, Edge, Triple)> = None;
        for (axes, bits) in [[0u8, 1], [0, 2], [1, 2]]
            .into_iter()
            .flat_map(|axes| (0..4).map(move |bits| (axes, bits)))
        {
            let edge = Edge {
                item,
                axes,
                upper: [bits & 1 == 1, bits & 2 == 2],
            };
            let line = sight.edge(b, &edge);
            let side = line.dot_sign(middle);
            if side == 0 || outer && !holds_all(sight, b, &edge, side) {
                continue;
            }
            let length = DVec3::from(line.near).length();
            let beyond = image.corners.iter().map(|corner| {
                let corner = DVec3::from(corner.near);
                -f64::from(side) * corner.dot(line.near.into()) / (corner.length() * length)
            });
            let most = beyond.fold(f64::NEG_INFINITY, f64::max);
            let cuts = || {
                image.corners.iter().any(|c| c.dot_sign(&line) * side < 0)
                    && image.corners.iter().any(|c| c.dot_sign(&line) * side > 0)
            };
            if best.as_ref().is_none_or(|best| most > best.0) && cuts() {
                best = Some((most, edge, line));
            }
        }
        best.map(|(_, edge, line)| (edge, line))
    }
}

/// Whether the edge is one of the box's outline, with the box on the side `side`.
fn holds_all(sight: &Sight, b: &WorldBox, edge: &Edge, side: i32) -> bool {
    let line = sight.edge(b, edge);
    corners_of(b).iter().enumerate().all(|(k, corner)| {
        let own = |place: usize| (k >> edge.axes[place] & 1 == 1) == edge.upper[place];
        own(0) && own(1) || line.dot_sign(&sight.through(*corner)) * side >= 0
    })
}

/// Proofs for the items in question, in their order: witnesses of the samples for
/// those that the truth sees, the search for the others. The same on any number of
/// threads.
pub fn certify(
    scene: &str,
    prover: &Prover,
    rays: &Rays,
    truth: &SampleTruth,
    items: &[ItemId],
    threads: usize,
) -> Certificates {
    let seen = first_samples(prover, rays, truth);
    let of = |item: ItemId| match truth.visible.binary_search(&item) {
        Ok(place) => witness(&sample(rays, truth, seen[place])),
        Err(_) => prover.prove(item),
    };
    let mut proofs = vec![Vec::new(); items.len().div_ceil(CHUNK)];
    threads::share(
        threads,
        proofs.iter_mut().zip(items.chunks(CHUNK)),
        |(proofs, items)| {
            proofs.extend(items.iter().map(|&item| (item, of(item))));
        },
    );
    let boxes = prover.solids.boxes.len();
    Certificates::new(scene, boxes, prover.view().clone(), proofs.concat())
}

fn sample(rays: &Rays, truth: &SampleTruth, place: usize) -> Ray {
    let width = truth.grid.width as usize;
    rays.sample(truth.grid, (place % width) as u32, (place / width) as u32)
}

/// For each visible item a sample that sees it.
fn first_samples(prover: &Prover, rays: &Rays, truth: &SampleTruth) -> Vec<usize> {
    let mut seen = vec![usize::MAX; truth.visible.len()];
    let mut left = seen.len();
    let mut note = |item: ItemId, place: usize| {
        if let Ok(at) = truth.visible.binary_search(&item)
            && seen[at] == usize::MAX
        {
            seen[at] = place;
            left -= 1;
        }
        left
    };
    let mut fronts = truth
        .front
        .iter()
        .enumerate()
        .filter(|(_, item)| **item != NO_ITEM);
    if fronts.all(|(place, &item)| note(item, place) > 0) {
        // The rest is only ever the second of a tie.
        for (place, _) in truth
            .front
            .iter()
            .enumerate()
            .filter(|(_, item)| **item != NO_ITEM)
        {
            let front = prover.index.front_of(&sample(rays, truth, place));
            if front.is_some_and(|front| front.items.iter().any(|&item| note(item, place) == 0)) {
                break;
            }
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;
    use crate::visibility::SampleGrid;
    use crate::visibility::truth::{check, judge, visible_by_random_rays};

    /// No ray sees what is proven hidden, all witnesses see their items, and `check`
    /// agrees with all of it.
    #[test]
    fn proofs_hold_in_worlds_full_of_ties() {
        let mut rng = SeededRng::new(21);
        let mut classes = [0; 5];
        for world in 0..150 {
            let count = 2 + rng.below(10);
            let boxes = judge::ties(&mut rng, count);
            let solids = judge::solids(&boxes);
            let index = RayIndex::build(&solids);
            let rays = Rays::of(&judge::camera(&mut rng)).unwrap();
            let truth = SampleTruth::of(&solids, &index, &rays, SampleGrid::new(8, 8), 1);
            let prover = Prover::new(&solids, &index, &rays);
            let items: Vec<ItemId> = (0..boxes.len() as ItemId).collect();
            let certificates = certify("ties", &prover, &rays, &truth, &items, 1);
            let checked = check(&certificates, &boxes);
            assert!(
                checked.is_ok(),
                "{world}: {checked:?} {certificates:?} {boxes:?}"
            );
            let seen = visible_by_random_rays(&index, &rays, 500, world, 1);
            for (item, proof) in &certificates.proofs {
                let class = Class::of(&truth, *item, proof);
                classes[class as usize] += 1;
                if truth.sees(*item) {
                    assert!(
                        matches!(proof, Proof::Witness { .. }),
                        "{world} {item} {proof:?}"
                    );
                }
                let seen = seen.contains(item);
                assert!(class != Class::Hidden || !seen, "{world} {item}");
                // And where it does tie, the front item is another.
                assert!(class != Class::Tied || !truth.front.contains(item));
                if let Proof::Witness { origin, direction } = proof {
                    let ray = prover.view().ray(*origin, *direction);
                    assert!(judge::front(&ray, &boxes).contains(item));
                }
            }
        }
        let [visible, _, hidden, tied, undecided] = classes;
        println!("{classes:?}");
        assert!(
            visible > 150 && hidden > 150 && tied > 0 && undecided < hidden / 2,
            "{classes:?}"
        );
    }

    #[test]
    fn items_of_a_street_are_all_decided() {
        let scene = crate::scene::load("city:n=2000", &Default::default()).unwrap();
        let solids = Solids::of(&scene);
        let index = RayIndex::build(&solids);
        let eye = DVec3::new(-8.0, 20.0, 1.7);
        let frame = crate::camera::look_at(eye, DVec3::new(-8.0, 300.0, 1.7), DVec3::Z).unwrap();
        let lens = crate::camera::Lens::perspective(60.0, 1.5, 0.1, None).unwrap();
        let rays = Rays::of(&crate::camera::Camera { frame, lens }).unwrap();
        let truth = SampleTruth::of(&solids, &index, &rays, SampleGrid::new(90, 60), 1);
        let prover = Prover::new(&solids, &index, &rays);
        let items: Vec<ItemId> = (0..2000).collect();
        let certificates =
            [1, 3].map(|threads| certify("street", &prover, &rays, &truth, &items, threads));
        assert_eq!(certificates[0], certificates[1]);
        let counts = check(&certificates[0], &solids.boxes).unwrap();
        assert_eq!(
            (counts.visible + counts.hidden, counts.undecided),
            (2000, 0)
        );
        assert!(counts.visible >= truth.visible.len() && truth.visible.len() > 10);
    }
}
