//! Proofs of what is visible and what is hidden, for all rays of a view and not
//! only for those of a grid. It defines how they are written down; `cover` looks for
//! them and `check` verifies them.

use serde::{Deserialize, Serialize};

use crate::camera::Lens;
use crate::query::ItemId;
use crate::visibility::{Ray, Rays};

/// By how much the view of a certificate is larger than the camera's, as a share of
/// its width: rays are rounded, and the four sides are too (both some 2^-52). What
/// is proven for the larger view holds for every rounded ray of the camera.
const SLACK: f64 = 1.0 / (1u64 << 30) as f64;

/// The same as a share of the coordinates, where an orthographic ray begins.
const SLACK_OF_PLACE: f64 = 1.0 / (1u64 << 45) as f64;

/// All rays of a camera, in plain numbers that are taken as they are.
///
/// A line of sight is three numbers up to a factor above zero. From an eye, they are
/// its direction. Of parallel lines, let `m` be the axis along which their direction
/// is longest (the first of equals): the numbers are (x, y, z) = (X, Y, Z) * W where
/// the line crosses the plane of the other two axes, with W above zero in place m.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct View {
    /// Where depths are counted from; the origin of all rays of a lens with a centre.
    pub eye: [f64; 3],
    /// The direction in which depths are counted, of length 1 (to rounding).
    pub forward: [f64; 3],
    /// Whether all rays go `forward`, instead of through the eye.
    pub parallel: bool,
    /// A line of sight is in the view if its scalar product with none of these four
    /// is below zero.
    pub sides: [[f64; 3]; 4],
    /// Least depth, along the ray's own direction, at which items are visible.
    pub near: f64,
    /// Largest such depth; none without a far plane.
    pub far: Option<f64>,
    /// Least depth at which a box that a ray enters hides what is behind: near and a
    /// little more.
    pub hides_from: f64,
}

/// A line through the image that parts a cell: where the planes of two faces meet. Of
/// one box that is an edge; of two, beyond it the other one is nearer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// The boxes of which they are faces.
    pub items: [ItemId; 2],
    /// The axes across the faces, ascending.
    pub axes: [u8; 2],
    /// Whether each is at the upper bound.
    pub upper: [bool; 2],
}

/// A part of the image of an item, and why no ray through it sees the item.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Cell {
    /// There are no rays in it.
    Empty,
    /// Every ray through it enters this box that hides first, and not before the near
    /// plane: an item's, or one of [`Hiders::Within`].
    Behind(ItemId),
    /// Two parts. The line between them need be proven in one of them only: in the
    /// other, the box in front may be as far as the item along it.
    Parted {
        /// The edge that parts them.
        edge: Edge,
        /// Whether the first part has the line.
        line_in_first: bool,
        /// Where the form of `check` is above zero, and where it is below.
        cells: Box<[Cell; 2]>,
    },
}

/// Rays along which an item that is covered may be met as soon as what covers it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Except {
    /// None: no ray sees it.
    Nothing,
    /// Any, where the box in front has a lower number: it may tie, but is the front
    /// item of no ray.
    Ties,
    /// As before, and of any box those along lines of the image: it is the front item
    /// of no part of the image that has an area.
    Lines,
}

/// What is known of an item, and the proof of it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Proof {
    /// Visible: it is in front (or ties) along this ray. Where items have holes: it has
    /// none, and nothing at all is in front of it.
    Witness {
        /// Where the ray begins.
        origin: [f64; 3],
        /// Its direction per unit of depth.
        direction: [f64; 3],
    },
    /// Hidden: the eye is in the closed box, which is entered before any near plane.
    /// No proof of an item of triangles.
    AroundEye,
    /// Hidden: the image of the box is covered. The outline lists corners of the
    /// box (bit k: the upper bound on axis k), so that each side has the whole box on
    /// its left; none of them if the whole image is one line.
    Cover {
        /// Corners round its image.
        outline: Vec<u8>,
        /// What the cover does not rule out.
        except: Except,
        /// Why each part of it is hidden.
        cell: Cell,
    },
    /// Hidden in a map, by its plan: each of these walls stands before a part of what is
    /// seen of the item from above, the next one from where it begins or the last one
    /// ends; counter-clockwise about the eye.
    Walls(Vec<ItemId>),
    /// Neither was found.
    Undecided,
}

/// A wall of a map, from above.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlanWall {
    /// Whose wall it is.
    pub item: ItemId,
    /// Where it begins and ends.
    pub ends: [[f64; 2]; 2],
    /// Whether it lets nothing through at any height.
    pub is_solid: bool,
}

/// A box in the world as proofs name it: lower and upper corner.
pub type Corners = [[f64; 3]; 2];

/// Which boxes hide what is behind them.
#[derive(Clone, PartialEq, Default, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Hiders {
    /// Those of all items.
    #[default]
    Items,
    /// Those of the items without holes; which these are, as it is typed.
    Uncut(String),
    /// Boxes inside the triangles of an item, or below the ground, which is no item. They
    /// are numbered on behind the items, first those below the ground.
    Within(Vec<(Option<ItemId>, Corners)>),
}

impl Hiders {
    fn are_items(&self) -> bool {
        *self == Hiders::Items
    }
}

/// What is known of some items in a view.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Certificates {
    /// The scene's name, for people.
    pub scene: String,
    /// Number of its boxes.
    pub boxes: usize,
    /// The camera that it is the view of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraOf>,
    /// The view.
    pub view: View,
    /// What hides in it.
    #[serde(default, skip_serializing_if = "Hiders::are_items")]
    pub hiders: Hiders,
    /// How many items are in question: those in view that any back end removed, and those
    /// seen at a sample. Each has a proof or is undecided.
    pub items: usize,
    /// Items with their proofs.
    pub proofs: Vec<(ItemId, Proof)>,
}

/// A camera of a path.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraOf {
    /// The path, as it is typed.
    pub path: String,
    /// Place of the camera in it.
    pub index: usize,
}

impl Cell {
    /// Every number of a box in it.
    fn each_number(&mut self, of: &mut dyn FnMut(&mut ItemId)) {
        match self {
            Cell::Empty => {}
            Cell::Behind(front) => of(front),
            Cell::Parted { edge, cells, .. } => {
                edge.items.iter_mut().for_each(&mut *of);
                cells.iter_mut().for_each(|cell| cell.each_number(of));
            }
        }
    }
}

impl Proof {
    /// That this ray sees the item.
    pub(super) fn witness(ray: &Ray) -> Proof {
        Proof::Witness {
            origin: ray.origin.to_array(),
            direction: ray.direction.to_array(),
        }
    }
}

impl Certificates {
    /// Proofs of a scene's items in a view.
    pub fn new(
        scene: impl Into<String>,
        boxes: usize,
        view: View,
        proofs: Vec<(ItemId, Proof)>,
    ) -> Certificates {
        let scene = scene.into();
        Certificates {
            scene,
            boxes,
            camera: None,
            view,
            hiders: Hiders::Items,
            items: proofs.len(),
            proofs,
        }
    }

    /// Boxes within items that no proof names are left out, the others numbered anew.
    pub(super) fn without_unused(mut self) -> Certificates {
        let Hiders::Within(within) = &self.hiders else {
            return self;
        };
        let items = self.boxes;
        let place = |number: ItemId| (number as usize).checked_sub(items);
        let cells = self.proofs.iter_mut().filter_map(|(_, proof)| match proof {
            Proof::Cover { cell, .. } => Some(cell),
            _ => None,
        });
        let mut cells: Vec<&mut Cell> = cells.collect();
        let mut is_named = vec![false; within.len()];
        for cell in &mut cells {
            cell.each_number(&mut |number| {
                if let Some(place) = place(*number) {
                    is_named[place] = true;
                }
            });
        }
        let mut left = Vec::new();
        let anew = within.iter().zip(&is_named).map(|(b, is_named)| {
            let number = (items + left.len()) as ItemId;
            if *is_named {
                left.push(*b);
            }
            number
        });
        let anew: Vec<ItemId> = anew.collect();
        for cell in &mut cells {
            cell.each_number(&mut |number| {
                if let Some(place) = place(*number) {
                    *number = anew[place];
                }
            });
        }
        self.hiders = Hiders::Within(left);
        self
    }

    /// Of a camera, of which the view is to be.
    pub fn of_camera(mut self, path: &str, index: usize) -> Certificates {
        let path = path.to_owned();
        self.camera = Some(CameraOf { path, index });
        self
    }
}

impl View {
    /// The rays of a camera, and a 2^-30 more on each side.
    pub fn of(rays: &Rays) -> View {
        let camera = rays.camera();
        let frame = &camera.frame;
        let (u, v, forward, eye) = (frame.u(), frame.v(), frame.forward(), frame.eye);
        let parallel = matches!(camera.lens, Lens::Orthographic { .. });
        let [left, right, bottom, top] = rays.window();
        let place = match parallel {
            true => SLACK_OF_PLACE * eye.abs().max_element(),
            false => 0.0,
        };
        let (wide, high) = (
            SLACK * (right - left) + place,
            SLACK * (top - bottom) + place,
        );
        let bounds = [left - wide, right + wide, bottom - high, top + high];
        // Of a line at (a, b) of the window, times -1 on the upper sides: a - left.
        let side = |axis: glam::DVec3, bound: f64| match parallel {
            false => axis - forward * bound,
            true => {
                let mut line = axis;
                line[longest(forward.to_array())] = -axis.dot(eye) - bound;
                line
            }
        };
        let near = camera.lens.near();
        View {
            eye: eye.to_array(),
            forward: forward.to_array(),
            parallel,
            sides: [
                side(u, bounds[0]).to_array(),
                (-side(u, bounds[1])).to_array(),
                side(v, bounds[2]).to_array(),
                (-side(v, bounds[3])).to_array(),
            ],
            near,
            far: camera.lens.far(),
            hides_from: near + SLACK * near.abs() + place,
        }
    }

    /// A ray of this view.
    pub(super) fn ray(&self, origin: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray {
            origin: origin.into(),
            direction: direction.into(),
            near: self.near,
            far: self.far.unwrap_or(f64::INFINITY),
        }
    }
}

/// The axis along which a direction is longest, the first of equals.
pub(super) fn longest(direction: [f64; 3]) -> usize {
    let size = direction.map(f64::abs);
    let first = if size[1] > size[0] { 1 } else { 0 };
    if size[2] > size[first] { 2 } else { first }
}
