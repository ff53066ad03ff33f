//! The search for the cover of one item: its image is parted along the edges of the
//! boxes in front of it until each part lies behind one of them.

use std::cmp::{Ordering, Reverse};

use glam::DVec3;

use super::super::certificate::{Cell, Edge, Except};
use super::super::entry::Probe;
use super::super::sight::{Polygon, Sight, Triple, sign};
use super::hides::{Nearer, hides, pierces, side_of};
use super::outline::corners_of;
use super::outlook::Outlook;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::Ray;

/// Most parts of an item's image that are looked at, and how often one is parted
/// again: items that are hidden need a few.
const MOST_CELLS: usize = 400;
const MOST_CUTS: usize = 48;

/// Why a search ended without a cover.
pub enum End {
    Seen(Ray),
    GaveUp,
}

/// The search for one item's cover.
pub struct Hunt<'p> {
    look: &'p Outlook<'p>,
    item: ItemId,
    /// What was met in front of it, the largest to the eye first.
    known: Vec<(f64, ItemId)>,
    cells: usize,
    except: Except,
}

impl<'p> Hunt<'p> {
    /// For this item of a polygon.
    pub fn new(look: &'p Outlook<'p>, item: ItemId, except: Except) -> Hunt<'p> {
        Hunt {
            look,
            item,
            known: Vec::new(),
            cells: 0,
            except,
        }
    }

    /// How much nearer than the item a box in front of it must be.
    fn nearer(&self, front: ItemId) -> Nearer {
        match self.except {
            Except::Nothing => Nearer::Everywhere,
            _ if front < self.item => Nearer::OrTied,
            Except::Ties => Nearer::Everywhere,
            Except::Lines => Nearer::ButAlongLines,
        }
    }

    /// The proof for a part of the image.
    pub fn cell(&mut self, image: &Polygon, cuts: usize) -> Result<Cell, End> {
        let hides = |hunt: &Self, front: ItemId| {
            let (b, back) = (hunt.look.boxed(front), hunt.look.boxed(hunt.item));
            hides(&hunt.look.sight, b, back, image, hunt.nearer(front))
        };
        if let Some((_, front)) = self.known.iter().find(|known| hides(self, known.1)) {
            return Ok(Cell::Behind(*front));
        }
        self.cells += 1;
        if self.cells > MOST_CELLS || cuts > MOST_CUTS {
            return Err(End::GaveUp);
        }
        let ray = self.look.ray_through(image);
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
        let Some((edge, line, inner)) = self.best_cut(&pierced, image, &ray) else {
            return Err(End::GaveUp);
        };
        let matters = self.except != Except::Lines;
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
            Err(End::GaveUp) if matters => parts(!inner),
            found => found,
        }
    }

    /// The items that the ray enters before this one, the largest to the eye first.
    fn in_front(&self, ray: &Ray) -> Result<Vec<(f64, ItemId)>, End> {
        let probe = Probe::new(*ray);
        let own = probe.enter(self.look.boxed(self.item), f64::INFINITY);
        let limit = own.map_or(f64::INFINITY, |own| own.at_most());
        let mut pierced = self.look.index.all_along(ray, limit);
        if let Some(own) = own {
            pierced.retain(|(item, entry)| match probe.compare(entry, &own) {
                Ordering::Equal => self.nearer(*item) == Nearer::OrTied,
                order => order.is_lt(),
            });
            if pierced.is_empty() && self.look.is_of_view(ray) {
                return Err(End::Seen(*ray));
            }
        }
        let sized = pierced
            .iter()
            .filter(|(item, _)| *item != self.item)
            .map(|(item, entry)| {
                let size = self.look.boxed(*item).max - self.look.boxed(*item).min;
                let area = size.x * size.y + size.y * size.z + size.z * size.x;
                let reach = if self.look.sight.view.parallel {
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

    /// The edge to part the image by, and whether the first part should have the line:
    /// of the box that hides most of it, that side beyond which most is left over.
    fn best_cut(
        &self,
        pierced: &[(f64, ItemId)],
        image: &Polygon,
        ray: &Ray,
    ) -> Option<(Edge, Triple, bool)> {
        let sight = &self.look.sight;
        let covered = |item: ItemId| {
            let b = self.look.boxed(item);
            let covers = |line: &&Triple| pierces(sight, line, b);
            image.corners.iter().filter(covers).count()
        };
        let mut by_cover: Vec<_> = pierced
            .iter()
            .map(|&(_, item)| (covered(item), item))
            .collect();
        by_cover.sort_by_key(|&(count, _)| Reverse(count));
        let fronts = || by_cover.iter().map(|&(_, item)| item);
        let middle = self.look.line_of(ray);
        let along = |item: ItemId, outer: bool| self.cut_along(item, image, &middle, outer);
        // What hides the middle is most likely nearer along its own edge as well.
        let outlined = fronts().find_map(|item| along(item, true));
        // It is covered already, but not by one face before one face; or the box in
        // front goes through the item.
        let found = outlined.or_else(|| along(self.item, false));
        let found = found.or_else(|| fronts().find_map(|item| along(item, false)));
        let inner = |line: &Triple| line.dot_sign(&middle) > 0;
        let found = found.map(|(edge, line)| (edge, inner(&line), line));
        let through = || {
            let (edge, line) = fronts().find_map(|item| self.cut_through(item, image))?;
            Some((edge, !inner(&line), line))
        };
        let (edge, first, line) = found.or_else(through)?;
        Some((edge, line, first))
    }

    /// Where a face of a box in front goes through a face of the item.
    fn cut_through(&self, front: ItemId, image: &Polygon) -> Option<(Edge, Triple)> {
        let sight = &self.look.sight;
        let way = |item: ItemId, axis: usize| match sight.view.parallel {
            true => sign(sight.view.forward[axis]),
            false => side_of(sight.view.eye[axis], self.look.boxed(item), axis),
        };
        let pairs = [[0, 1], [0, 2], [1, 2]]
            .into_iter()
            .flat_map(|axes: [usize; 2]| {
                [[front, self.item], [self.item, front]].map(|items| (axes, items))
            });
        pairs.into_iter().find_map(|(axes, items)| {
            let ways = [0, 1].map(|k: usize| way(items[k], axes[k]));
            let edge = Edge {
                items,
                axes: axes.map(|axis| axis as u8),
                upper: ways.map(|way| way < 0),
            };
            let line = sight.edge(items.map(|item| self.look.boxed(item)), &edge);
            let cuts = |sign: i32| image.corners.iter().any(|c| c.dot_sign(&line) == sign);
            (!ways.contains(&0) && cuts(1) && cuts(-1)).then_some((edge, line))
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
        let b = self.look.boxed(item);
        let sight = &self.look.sight;
        let mut best: Option<(f64, Edge, Triple)> = None;
        for (axes, bits) in [[0u8, 1], [0, 2], [1, 2]]
            .into_iter()
            .flat_map(|axes| (0..4).map(move |bits| (axes, bits)))
        {
            let edge = Edge {
                items: [item, item],
                axes,
                upper: [bits & 1 == 1, bits & 2 == 2],
            };
            let line = sight.edge([b, b], &edge);
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
    let line = sight.edge([b, b], edge);
    corners_of(b).iter().enumerate().all(|(k, corner)| {
        let own = |place: usize| (k >> edge.axes[place] & 1 == 1) == edge.upper[place];
        own(0) && own(1) || line.dot_sign(&sight.through(*corner)) * side >= 0
    })
}
