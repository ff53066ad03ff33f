//! Drawings of scenes from above, as SVG.
//!
//! Items in the colours of their classes, cells of a structure, the view volume.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::sheet::{Cells, Class, Rect, SIDE, Sheet, centre, longest, union};
use super::text;
use crate::camera::Camera;
use crate::scene::{Regions, Scene, UpAxis};

/// A drawing; later classes of items are drawn over earlier ones of the same size.
pub struct Plan<'p> {
    pub caption: String,
    pub scene: &'p Scene,
    pub camera: Option<&'p Camera>,
    pub classes: &'p [Class],
    pub class_of: &'p dyn Fn(usize) -> usize,
    pub cells: Option<Cells<'p>>,
}

/// Most items that are drawn: those of key classes, then the nearest to the eye.
const MOST_DRAWN: usize = 10_000;
/// An item from above.
struct Drawn {
    rect: Rect,
    class: usize,
    /// True if it surrounds others and would cover them.
    is_outlined: bool,
}

impl Plan<'_> {
    /// The drawing as SVG.
    pub fn svg(&self) -> String {
        let (mut items, mut notes) = self.items();
        let (cells, up) = (self.cells.as_ref(), self.scene.up);
        let outlines = cells.map_or(Vec::new(), |cells| cells.outlines(self.scene));
        notes.extend(cells.iter().flat_map(|cells| cells.notes(up)));
        notes.retain(|note| !note.is_empty());
        let eye = self.camera.map(|camera| up.to_z_up(camera.frame.eye));
        let corners = outlines.iter().flat_map(|outline| &outline.corners);
        let corners = corners.map(|&corner| [corner; 2]);
        let eye = eye.map(DVec3::truncate);
        let sheet = Sheet::over(window(&items, corners, eye));
        outline_floors(&mut items, &sheet);
        let mut body = String::new();
        cells.inspect(|cells| cells.fill(&outlines, &sheet, &mut body));
        self.draw_items(&items, &sheet, &mut body);
        self.draw_walls(&sheet, &mut body);
        cells.inspect(|cells| cells.draw(&outlines, &sheet, &mut body));
        if let Some(camera) = self.camera {
            draw_camera(camera, up, &sheet, &mut body);
        }
        let unit = self.scene.unit.unwrap_or("units of the scene");
        let axes = match up {
            UpAxis::Y => ["z", "x", unit],
            UpAxis::Z => ["x", "y", unit],
        };
        sheet.finished(&self.caption, axes, &body, &self.legend(), &notes)
    }

    /// The items to draw, and notes about omitted ones; empty if there are none.
    fn items(&self) -> (Vec<Drawn>, Vec<String>) {
        let (origin, up) = (self.scene.origin, self.scene.up);
        let middle = self.scene.world_bounds();
        let middle = middle.min / 2.0 + middle.max / 2.0;
        let eye = self.camera.map_or(middle, |c| c.frame.eye);
        let eye = up.to_z_up(eye);
        // Lowest and highest z of the rooms at the height of the eye.
        let heights = self.rooms().map(|(min, max)| [min.z, max.z]);
        let storey = heights.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let (mut apart, mut all) = (0, Vec::new());
        for (item, b) in self.scene.items.iter().enumerate() {
            if b.is_empty() {
                continue;
            }
            let (min, max) = b.in_world(origin);
            let [min, max] = [min, max].map(|corner| up.to_z_up(corner));
            let class = (self.class_of)(item);
            let is_key = self.classes[class].is_key;
            if !is_key && storey.is_some_and(|[low, high]| max.z < low || high < min.z) {
                apart += 1;
                continue;
            }
            let distance = eye.clamp(min, max).distance(eye);
            let rect = [min.truncate(), max.truncate()];
            all.push(((!is_key, distance), rect, class));
        }
        all.sort_by(|(a, ..), (b, ..)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let far = all.len().saturating_sub(MOST_DRAWN);
        all.truncate(MOST_DRAWN);
        let farther = ["farther from the middle", "farther from the eye"];
        let farther = farther[usize::from(self.camera.is_some())];
        let notes = [(apart, "on other storeys"), (far, farther)].map(|(count, why)| {
            text::any(count, "item", |items| format!("not drawn: {items} {why}"))
        });
        let drawn = all.into_iter().map(|(_, rect, class)| Drawn {
            rect,
            class,
            is_outlined: false,
        });
        (drawn.collect(), notes.into())
    }

    /// Rooms at the height of the eye; none without a camera.
    fn rooms(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        let z = self.camera.map_or(f64::NAN, |camera| camera.frame.eye.z);
        let rooms = match &self.scene.regions {
            Regions::Tiling(tiling) => &tiling.boxes[..],
            _ => &[],
        };
        let rooms = rooms.iter().map(|room| room.in_world(self.scene.origin));
        rooms.filter(move |(min, max)| min.z <= z && z <= max.z)
    }

    /// Draws the items, larger ones first; within a factor of two in length, by class.
    fn draw_items(&self, items: &[Drawn], sheet: &Sheet, body: &mut String) {
        let mut order: Vec<_> = items.iter().collect();
        let size = |item: &Drawn| (longest(item.rect) * sheet.scale).max(1.0).log2() as i32;
        order.sort_by_key(|item| (!item.is_outlined, -size(item), item.class));
        for run in order.chunk_by(|a, b| (a.is_outlined, a.class) == (b.is_outlined, b.class)) {
            let colour = self.classes[run[0].class].colour;
            let _ = match run[0].is_outlined {
                true => write!(body, "<path fill=\"none\" stroke=\"{colour}\" d=\""),
                false => write!(body, "<path fill=\"{colour}\" d=\""),
            };
            run.iter().for_each(|item| sheet.push_rect(item.rect, body));
            body.push_str("\"/>\n");
        }
    }

    /// Draws the walls of a map and the rooms of a tiling.
    fn draw_walls(&self, sheet: &Sheet, body: &mut String) {
        let mut path = String::new();
        if let Regions::Bsp(map) = &self.scene.regions {
            for line in &map.lines {
                let [a, b] = line.ends.map(|end| sheet.at(end.map(f64::from).into()));
                let _ = write!(path, "M{} {}L{} {}", a[0], a[1], b[0], b[1]);
            }
        } else {
            for (min, max) in self.rooms() {
                sheet.push_rect([min.truncate(), max.truncate()], &mut path);
            }
        }
        if !path.is_empty() {
            let line = "stroke=\"#707070\" stroke-width=\".6\"";
            let _ = writeln!(body, "<path fill=\"none\" {line} d=\"{path}\"/>");
        }
    }

    /// Swatches and words: classes of items with their counts, then those of cells.
    fn legend(&self) -> Vec<(String, String)> {
        let total = text::count(self.scene.items.len());
        let items = counted(self.classes, self.scene.items.len(), self.class_of);
        let items = items.map(|(class, count)| {
            let words = format!("{}: {count} of {total}", class.words);
            (format!("fill=\"{}\"", class.colour), words)
        });
        let cells = self.cells.iter();
        let cells =
            cells.flat_map(|drawn| counted(drawn.classes, drawn.cells.len(), drawn.class_of));
        let cells = cells.map(|(class, count)| {
            let colour = class.colour;
            let fill = if class.is_key { colour } else { "#fff" };
            let swatch = format!("fill=\"{fill}\" fill-opacity=\".3\" stroke=\"{colour}\"");
            (swatch, format!("{}: {count}", class.words))
        });
        items.chain(cells).collect()
    }
}

/// Classes that are not empty, with their counts.
fn counted<'c>(
    classes: &'c [Class],
    all: usize,
    class_of: &dyn Fn(usize) -> usize,
) -> impl Iterator<Item = (&'c Class, String)> {
    let mut counts = vec![0; classes.len()];
    (0..all).for_each(|one| counts[class_of(one)] += 1);
    let counted = classes.iter().zip(counts).filter(|(_, count)| *count > 0);
    counted.map(|(class, count)| (class, text::count(count)))
}

/// The part of the plane that is drawn.
///
/// All cells, the eye if it is near, and the items, except a few much larger than all others
/// together.
fn window(items: &[Drawn], cells: impl Iterator<Item = Rect>, eye: Option<DVec2>) -> Rect {
    let bounds = items.iter().map(|item| item.rect).reduce(union);
    let bounds = bounds.unwrap_or_default();
    let middles = items.iter().map(|item| [centre(item.rect); 2]);
    let middles = middles.reduce(union);
    let is_close = |m: &Rect| longest(*m) > 0.0 && longest(*m) < longest(bounds) / 3.0;
    let window = cells.fold(middles.filter(is_close).unwrap_or(bounds), union);
    let with = eye.map(|eye| union(window, [eye; 2]));
    let with = with.filter(|with| longest(*with) <= 2.0 * longest(window));
    with.unwrap_or(window)
}

/// Marks items that would cover two others or a fiftieth of the drawing.
fn outline_floors(items: &mut [Drawn], sheet: &Sheet) {
    let large = |rect: Rect| longest(rect) * sheet.scale > 8.0;
    let middle = |item: &Drawn| (centre(item.rect), longest(item.rect));
    let middles: Vec<_> = items.iter().map(middle).collect();
    for item in items.iter_mut().filter(|item| large(item.rect)) {
        let ([low, high], length) = (item.rect, longest(item.rect));
        let covers =
            |&&(p, own): &&(DVec2, f64)| own < length && low.cmplt(p).all() && p.cmplt(high).all();
        let area = (high - low).element_product() * sheet.scale * sheet.scale;
        item.is_outlined =
            area > SIDE * SIDE / 50.0 || middles.iter().filter(covers).nth(1).is_some();
    }
}

/// Draws the edges of the view volume and the eye.
///
/// Without a far plane the edges extend beyond the sheet.
fn draw_camera(camera: &Camera, up: UpAxis, sheet: &Sheet, body: &mut String) {
    let camera = camera.unprojected().unwrap_or(*camera);
    let Camera { frame, lens } = &camera;
    let beyond = || lens.with_far(Some(2.0 * (lens.near() + SIDE / sheet.scale)));
    let corners = match lens.far() {
        None => beyond().ok().and_then(|lens| lens.corners(frame)),
        Some(_) => lens.corners(frame),
    };
    let mut path = String::new();
    if let Some(corners) = corners {
        let corners = corners.map(|corner| up.to_z_up(corner));
        let corners = corners.map(|corner| sheet.at(corner.truncate()));
        // Bit 0 is right, bit 1 top, bit 2 far.
        for (from, to) in (0..8).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))) {
            let ([x0, y0], [x1, y1]) = (corners[from], corners[to]);
            let is_edge = from != to && (from & 4 == 0 || lens.far().is_some());
            if is_edge && [x0, y0, x1, y1].iter().all(|v| v.is_finite()) {
                let _ = write!(path, "M{x0} {y0}L{x1} {y1}");
            }
        }
    }
    let _ = writeln!(body, "<path fill=\"none\" stroke=\"#000\" d=\"{path}\"/>");
    let eye = up.to_z_up(frame.eye);
    let [x, y] = sheet.at(eye.truncate());
    let _ = writeln!(body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"4\"/>");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path;
    use crate::scene::WorldBox;

    #[test]
    fn of_many_items_the_nearest_are_drawn() {
        let at = |i: usize| WorldBox::at(DVec3::new(0.0, (12_000 - i) as f64, 0.0));
        let boxes: Vec<WorldBox> = (0..12_000).map(at).collect();
        let scene = Scene::from_boxes("a", &boxes).expect("boxes");
        let camera = path::load("orbit:frames=1", &scene, &Default::default());
        let mut camera = camera.expect("a path").cameras[0];
        camera.frame.eye = DVec3::ZERO;
        for is_key in [true, false] {
            let classes = [Class {
                colour: "#111",
                words: "of it",
                is_key,
            }];
            let plan = Plan {
                caption: scene.name.clone(),
                scene: &scene,
                camera: Some(&camera),
                classes: &classes,
                class_of: &|_| 0,
                cells: None,
            };
            let (drawn, _) = plan.items();
            let farthest = drawn.iter().map(|item| item.rect[1].y);
            assert_eq!(farthest.fold(0.0, f64::max), 10_000.0);
        }
    }

    #[test]
    fn a_floor_is_an_outline_and_small_items_lie_over_large_ones() {
        let flat =
            |x, y, side| WorldBox::around(DVec3::new(x, y, 0.0), DVec3::new(side, side, 1.0));
        let boxes = [
            flat(2.0, 2.0, 0.1),
            flat(2.0, 2.0, 4.0),
            flat(25.0, 25.0, 100.0),
            flat(49.0, 49.0, 0.0),
        ];
        let scene = Scene::from_boxes("a<b", &boxes).expect("boxes");
        let class = |colour| Class {
            colour,
            words: "of it",
            is_key: false,
        };
        let plan = Plan {
            caption: scene.name.clone(),
            scene: &scene,
            camera: None,
            classes: &["#111", "#222"].map(class),
            class_of: &|item| usize::from(item == 1 || item == 3),
            cells: None,
        };
        let svg = plan.svg();
        assert!(
            svg.contains("a&lt;b") && svg.contains(">of it: 2 of 4<"),
            "{svg}"
        );
        let [floor, large, small] = [
            "fill=\"none\" stroke=\"#111\"",
            "fill=\"#222\"",
            "fill=\"#111\"",
        ]
        .map(|look| svg.find(&format!("<path {look}")).expect("a path"));
        assert!(floor < large && large < small, "{svg}");
        // A point is one pixel.
        assert!(svg.contains("h1v1h-1z"), "{svg}");
    }

    #[test]
    fn a_few_items_beyond_all_others_do_not_shrink_them() {
        let item = |[x0, y0, x1, y1]: [f64; 4]| Drawn {
            rect: [DVec2::new(x0, y0), DVec2::new(x1, y1)],
            class: 0,
            is_outlined: false,
        };
        let sky = item([-1e6, -1e6, 1e6, 1e6]);
        let items = [sky, item([0.0, 0.0, 1.0, 1.0]), item([5.0, 3.0, 6.0, 4.0])];
        assert_eq!(
            window(&items, std::iter::empty(), None),
            [DVec2::ZERO, DVec2::new(5.5, 3.5)]
        );
        let eye = |x| Some(DVec2::new(x, 0.0));
        assert_eq!(window(&items[1..2], std::iter::empty(), eye(1.5))[1].x, 1.5);
        assert_eq!(
            window(&items[1..2], std::iter::empty(), eye(90.0))[1].x,
            1.0
        );
    }
}
