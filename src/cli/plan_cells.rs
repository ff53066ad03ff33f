//! Cells of a structure in a drawing from above.

use std::fmt::Write;

use glam::DVec3;

use super::sheet::{Rect, Sheet};
use super::text;
use crate::geometry::{Aabb, Plane};
use crate::index::TreeCell;
use crate::scene::{Scene, UpAxis};

/// Look of a group of cells.
pub struct CellClass {
    pub colour: &'static str,
    pub words: &'static str,
    /// Filled below the items.
    pub is_filled: bool,
}

/// Cells with a class each.
pub struct Cells<'p> {
    pub cells: &'p [TreeCell<'p>],
    pub classes: &'p [CellClass],
    pub class_of: &'p dyn Fn(usize) -> usize,
    /// Deepest level that is drawn.
    pub depth: u32,
}

/// The outline of a cell.
pub struct Outline {
    cell: usize,
    /// Bounds of its items.
    rect: Rect,
    /// Its corners: those of its bounds, or cut by planes.
    pub corners: Vec<[f64; 2]>,
}

impl Cells<'_> {
    /// Outlines of the cells down to the deepest level.
    pub fn outlines(&self, scene: &Scene) -> Vec<Outline> {
        let up = scene.up;
        let origin = up.to_z_up(scene.origin);
        let mut around: Vec<Vec<[f64; 2]>> = Vec::new();
        let mut outlines = Vec::new();
        for (cell, drawn) in self.cells.iter().enumerate() {
            if drawn.level > self.depth {
                continue;
            }
            let bounds = &drawn.bounds;
            let [min, max] = [bounds.min, bounds.max].map(|corner| up.to_z_up(corner));
            let rect = flat(&Aabb::new(min, max), origin);
            around.truncate(drawn.level as usize);
            let corners = match (drawn.half_space, around.last()) {
                (Some(side), Some(parent)) => cut(parent, &turned(&side, up), origin),
                _ => corners_of(rect).into(),
            };
            around.push(corners.clone());
            outlines.push(Outline {
                cell,
                rect,
                corners,
            });
        }
        outlines
    }

    /// Fills bounds of cells below the items.
    pub fn fill(&self, outlines: &[Outline], sheet: &Sheet, body: &mut String) {
        for (class, look) in self
            .classes
            .iter()
            .enumerate()
            .filter(|(_, look)| look.is_filled)
        {
            let _ = write!(
                body,
                "<path fill=\"{}\" fill-opacity=\".15\" d=\"",
                look.colour
            );
            let of_class = outlines.iter().filter(|o| (self.class_of)(o.cell) == class);
            of_class.for_each(|outline| sheet.push_rect(outline.rect, body));
            body.push_str("\"/>\n");
        }
    }

    /// Draws outlines, deep levels first and thinner.
    pub fn draw(&self, outlines: &[Outline], sheet: &Sheet, body: &mut String) {
        let deepest = outlines.iter().map(|o| self.cells[o.cell].level).max();
        for level in (0..=deepest.unwrap_or(0)).rev() {
            let width = [3.5, 2.5, 1.7, 1.1].get(level as usize).unwrap_or(&0.7);
            for (class, look) in self.classes.iter().enumerate() {
                let of_class = outlines.iter().filter(|outline| {
                    self.cells[outline.cell].level == level
                        && (self.class_of)(outline.cell) == class
                });
                let mut path = String::new();
                for outline in of_class {
                    for (corner, &place) in outline.corners.iter().enumerate() {
                        let [x, y] = sheet.at(place);
                        let command = if corner == 0 { "M" } else { "L" };
                        let _ = write!(path, "{command}{x} {y}");
                    }
                    path.push('Z');
                }
                if !path.is_empty() {
                    let _ = writeln!(
                        body,
                        "<path fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" d=\"{path}\"/>",
                        look.colour
                    );
                }
            }
        }
    }

    /// Cells and planes that are not drawn.
    pub fn notes(&self, up: UpAxis) -> Vec<String> {
        let below = self
            .cells
            .iter()
            .filter(|cell| cell.level > self.depth)
            .count();
        let planes = self.cells.iter().filter(|cell| cell.level <= self.depth);
        let level = planes.filter(|cell| {
            cell.half_space
                .is_some_and(|side| !is_upright(&turned(&side, up)))
        });
        let level = level.count();
        let mut notes = vec!["thicker outlines: upper levels".to_owned()];
        if below > 0 {
            notes.push(format!(
                "not drawn: {} below level {}",
                text::counted(below, "cell"),
                self.depth
            ));
        }
        if level > 0 {
            notes.push(format!(
                "{} bounded by a plane that is not upright: as the cell around",
                text::counted(level, "cell")
            ));
        }
        notes
    }
}

/// The plane in axes with z up.
fn turned(plane: &Plane, up: UpAxis) -> Plane {
    Plane::new(up.to_z_up(plane.normal), plane.d)
}

pub fn is_upright(plane: &Plane) -> bool {
    plane.normal.z.abs() <= 1e-6 * plane.normal.length()
}

pub fn flat(b: &Aabb, origin: DVec3) -> Rect {
    let (min, max) = b.in_world(origin);
    [min.x, min.y, max.x, max.y]
}

pub fn corners_of([x0, y0, x1, y1]: Rect) -> [[f64; 2]; 4] {
    [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

/// The part of a polygon in a half-space about an origin.
///
/// All of it if the plane is not upright. By Sutherland and Hodgman 1974, "Reentrant
/// polygon clipping".
pub fn cut(polygon: &[[f64; 2]], side: &Plane, origin: DVec3) -> Vec<[f64; 2]> {
    if !is_upright(side) {
        return polygon.to_vec();
    }
    let normal = side.normal.as_dvec3();
    let value = |p: [f64; 2]| {
        normal.x * (p[0] - origin.x) + normal.y * (p[1] - origin.y) + f64::from(side.d)
    };
    let mut part = Vec::new();
    for (i, &to) in polygon.iter().enumerate() {
        let from = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (before, here) = (value(from), value(to));
        if (before < 0.0) != (here < 0.0) {
            let share = before / (before - here);
            part.push([0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * share));
        }
        if here >= 0.0 {
            part.push(to);
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_upright_plane_cuts_a_cell_and_a_level_one_does_not() {
        let square = corners_of([10.0, 10.0, 12.0, 12.0]);
        let origin = DVec3::splat(10.0);
        let half = Plane::new(glam::Vec3::X, -0.5);
        let part = cut(&square, &half, origin);
        let (low, high) = ([10.5, 10.0], [10.5, 12.0]);
        assert!(
            part.len() == 4 && part.contains(&low) && part.contains(&high),
            "{part:?}"
        );
        assert_eq!(
            cut(&square, &Plane::new(glam::Vec3::Z, -0.5), origin),
            square
        );
        assert!(cut(&[], &half, origin).is_empty());
        for (up, axis) in [(UpAxis::Y, glam::Vec3::Y), (UpAxis::Z, glam::Vec3::Z)] {
            assert!(!is_upright(&turned(&Plane::new(axis, 1.0), up)));
            assert!(is_upright(&turned(&half, up)));
        }
    }
}
