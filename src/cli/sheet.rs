//! A part of the plane on paper, with axes in the scene's units and a legend below.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::figure::round_values;
use super::text::{self, html};
use crate::geometry::{Aabb, Plane};
use crate::index::TreeCell;
use crate::scene::{Scene, UpAxis, clipped};

/// Low and high corner.
pub type Rect = [DVec2; 2];

/// Longer side of the drawing in pixels.
pub const SIDE: f64 = 800.0;
/// Margins for the labels of the axes, and for the caption.
const LEFT: f64 = 84.0;
const TOP: f64 = 36.0;
const LINE: f64 = 20.0;

pub fn centre([low, high]: Rect) -> DVec2 {
    low + (high - low) / 2.0
}

pub fn union(a: Rect, b: Rect) -> Rect {
    [a[0].min(b[0]), a[1].max(b[1])]
}

pub fn longest([low, high]: Rect) -> f64 {
    (high - low).max_element()
}

/// A number of pixels with one decimal.
pub fn px(value: f64) -> f64 {
    (value * 10.0).round() / 10.0 + 0.0
}

/// The plane on paper.
pub struct Sheet {
    window: Rect,
    /// Pixels per unit.
    pub scale: f64,
    size: DVec2,
}

impl Sheet {
    /// A sheet for a window, with a margin.
    ///
    /// Never without extent, and at most three times as long as wide.
    pub fn over(window: Rect) -> Sheet {
        let (middle, length) = (centre(window), longest(window));
        let least = middle.abs().max_element() * 1e-9;
        let is_sound = length.is_finite() && length > least;
        let length = if is_sound { length } else { least.max(1.0) };
        let sides = (window[1] - window[0]).max(DVec2::splat(length / 3.0));
        let sides = 1.06 * sides.min(DVec2::splat(length));
        let scale = SIDE / sides.max_element();
        Sheet {
            window: [middle - sides / 2.0, middle + sides / 2.0],
            scale,
            size: sides * scale,
        }
    }

    /// Pixels of a point: y is up in the scene and down on the sheet.
    pub fn at(&self, p: DVec2) -> [f64; 2] {
        let [low, high] = self.window;
        [(p.x - low.x) * self.scale, (high.y - p.y) * self.scale].map(px)
    }

    /// Adds a rectangle to a path, at least one pixel in size, clipped to the sheet.
    pub fn push_rect(&self, [low, high]: Rect, path: &mut String) {
        let [first, last] = self.window;
        let sides = [
            (low.x - first.x, high.x - first.x, self.size.x),
            (last.y - high.y, last.y - low.y, self.size.y),
        ];
        let [(x, w), (y, h)] = sides.map(|(low, high, size)| {
            let [low, high] = [low, high].map(|v| (v * self.scale).clamp(-9.0, size + 9.0));
            let thin = (1.0 - (high - low)).max(0.0) / 2.0;
            (px(low - thin), px(high - low + 2.0 * thin))
        });
        let _ = write!(path, "M{x} {y}h{w}v{h}h-{w}z");
    }

    /// The whole picture.
    pub fn finished(
        &self,
        caption: &str,
        [across, along, unit]: [&str; 3],
        body: &str,
        legend: &[(String, String)],
        notes: &[String],
    ) -> String {
        let [w, h] = self.size.to_array().map(px);
        let width = LEFT + w.max(0.85 * SIDE) + 20.0;
        let rows = legend.len().div_ceil(2);
        let below = TOP + h + 56.0;
        let height = below + LINE * (rows + notes.len()) as f64 + 6.0;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" \
             width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"13\" \
             role=\"img\" aria-label=\"{0}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <text x=\"{LEFT}\" y=\"22\" font-size=\"16\">{0}</text>\n<svg x=\"{LEFT}\" y=\"{TOP}\" \
             width=\"{w}\" height=\"{h}\">\n{body}</svg>\n<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{w}\" \
             height=\"{h}\" fill=\"none\" stroke=\"#888\"/>\n",
            html(caption),
        );
        let bottom = TOP + h;
        for axis in [0, 1] {
            for (value, label) in ticks(self.window[0][axis], self.window[1][axis]) {
                let [x, y] = self.at(DVec2::splat(value));
                let [x, y] = [px(LEFT + x), px(TOP + y)];
                let (mark, x, y, anchor) = match axis {
                    0 => (format!("{x} {bottom}v5"), x, bottom + 19.0, "middle"),
                    _ => (format!("{LEFT} {y}h-5"), LEFT - 8.0, y + 4.0, "end"),
                };
                let _ = writeln!(
                    svg,
                    "<path stroke=\"#888\" d=\"M{mark}\"/><text x=\"{x}\" y=\"{y:.1}\" \
                     text-anchor=\"{anchor}\">{label}</text>"
                );
            }
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{across}, in {unit}</text>\n\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{along}</text>",
            LEFT + w / 2.0,
            bottom + 36.0,
            TOP + h / 2.0
        );
        for (place, (swatch, words)) in legend.iter().enumerate() {
            let x = LEFT + (place / rows) as f64 * (width - LEFT) / 2.0;
            let y = below + LINE * (place % rows) as f64;
            let _ = writeln!(
                svg,
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"14\" height=\"12\" {swatch}/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                x + 20.0,
                y + 11.0,
                html(words)
            );
        }
        for (row, note) in notes.iter().enumerate() {
            let (y, note) = (below + LINE * (rows + row) as f64 + 11.0, html(note));
            let _ = writeln!(
                svg,
                "<text x=\"{LEFT}\" y=\"{y:.1}\" fill=\"#555\">{note}</text>"
            );
        }
        svg + "</svg>\n"
    }
}

/// About six round values within a range, with their labels.
pub fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let (step, values) = round_values([low, high], 6.0);
    let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    let label = |value: f64| match value.abs().max(step) < 1e7 && step > 1e-7 {
        true => format!("{value:.decimals$}"),
        false => format!("{value:e}"),
    };
    values.into_iter().map(|v| (v, label(v))).collect()
}

/// Colour and words of a group of items or cells.
#[derive(Clone, Copy)]
pub struct Class {
    pub colour: &'static str,
    pub words: &'static str,
    /// True for items drawn at any distance from the eye, and for filled cells.
    pub is_key: bool,
}

/// Cells with a class each.
pub struct Cells<'p> {
    pub cells: &'p [TreeCell<'p>],
    pub classes: &'p [Class],
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
    pub corners: Vec<DVec2>,
}

impl Cells<'_> {
    /// Outlines of the cells down to the deepest level.
    pub fn outlines(&self, scene: &Scene) -> Vec<Outline> {
        let up = scene.up;
        let origin = up.to_z_up(scene.origin);
        let mut around: Vec<Vec<DVec2>> = Vec::new();
        let mut outlines = Vec::new();
        for (cell, drawn) in self.cells.iter().enumerate() {
            if drawn.level > self.depth {
                continue;
            }
            let [min, max] = [drawn.bounds.min, drawn.bounds.max].map(|p| up.to_z_up(p));
            let (min, max) = Aabb::new(min, max).in_world(origin);
            let rect = [min.truncate(), max.truncate()];
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
        let looks = self.classes.iter().enumerate();
        for (class, look) in looks.filter(|(_, look)| look.is_key) {
            let colour = look.colour;
            let _ = write!(body, "<path fill=\"{colour}\" fill-opacity=\".15\" d=\"");
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
                let is_of =
                    |cell: usize| self.cells[cell].level == level && (self.class_of)(cell) == class;
                let mut path = String::new();
                for outline in outlines.iter().filter(|outline| is_of(outline.cell)) {
                    let corners = outline.corners.iter().map(|&corner| sheet.at(corner));
                    let corners: Vec<String> = corners.map(|[x, y]| format!("{x} {y}")).collect();
                    path += &format!("M{}Z", corners.join("L"));
                }
                if !path.is_empty() {
                    let line = format!("stroke=\"{}\" stroke-width=\"{width}\"", look.colour);
                    let _ = writeln!(body, "<path fill=\"none\" {line} d=\"{path}\"/>");
                }
            }
        }
    }

    /// Notes about cells and planes that are not drawn; empty without any.
    pub fn notes(&self, up: UpAxis) -> [String; 3] {
        let (drawn, below): (Vec<&TreeCell<'_>>, Vec<_>) =
            (self.cells.iter()).partition(|cell| cell.level <= self.depth);
        let is_level = |side: &Plane| !is_upright(&turned(side, up));
        let sides = drawn.iter().filter_map(|cell| cell.half_space.as_ref());
        let level = sides.filter(|side| is_level(side)).count();
        let below = text::any(below.len(), "cell", |cells| {
            format!("not drawn: {cells} below level {}", self.depth)
        });
        let level = text::any(level, "cell", |cells| {
            format!("{cells} bounded by a plane that is not upright: as the cell around")
        });
        ["thicker outlines: upper levels".to_owned(), below, level]
    }
}

/// The plane in axes with z up.
fn turned(plane: &Plane, up: UpAxis) -> Plane {
    Plane::new(up.to_z_up(plane.normal), plane.d)
}

pub fn is_upright(plane: &Plane) -> bool {
    plane.normal.z.abs() <= 1e-6 * plane.normal.length()
}

pub fn corners_of([a, b]: Rect) -> [DVec2; 4] {
    [a, DVec2::new(b.x, a.y), b, DVec2::new(a.x, b.y)]
}

/// The part of a polygon in a half-space about an origin.
///
/// The whole polygon if the plane is not upright.
pub fn cut(polygon: &[DVec2], side: &Plane, origin: DVec3) -> Vec<DVec2> {
    if !is_upright(side) {
        return polygon.to_vec();
    }
    let (normal, origin) = (side.normal.as_dvec3().truncate(), origin.truncate());
    clipped(polygon, |p| normal.dot(p - origin) + f64::from(side.d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let labels = |low, high| ticks(low, high).into_iter().map(|(_, label)| label);
        assert!(labels(-3.0, 101.0).eq(["0", "20", "40", "60", "80", "100"]));
        assert!(labels(-0.011, 0.012).eq(["-0.010", "-0.005", "0.000", "0.005", "0.010"]));
        for (low, high) in [(0.0, f64::MAX), (1e300, 1e300 * 1.1), (0.0, 5e-324)] {
            assert!(ticks(low, high).len() <= 12, "{low} {high}");
        }
    }

    #[test]
    fn an_upright_plane_cuts_a_cell_and_a_level_one_does_not() {
        let square = corners_of([10.0, 12.0].map(DVec2::splat));
        let origin = DVec3::splat(10.0);
        let half = Plane::new(glam::Vec3::X, -0.5);
        let part = cut(&square, &half, origin);
        let [low, high] = [10.0, 12.0].map(|y| DVec2::new(10.5, y));
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
