//! glTF 2.0 and GLB: every node with a mesh is an item.
//!
//! Coordinates are the file's. Points and lines count for the boxes of their items and have no
//! triangles. Compressed meshes are replaced by the box of their accessor's bounds, which is
//! visible and hides nothing; in a file without other triangles, items are boxes. Vertices are
//! transformed by their node alone: skins and morph targets have no effect. Source: Khronos Group,
//! glTF 2.0 Specification, 2021.

mod animation;
mod file;
mod mesh;
mod notes;

use std::collections::HashSet;
use std::sync::Arc;

use glam::{DAffine3, DVec3, DVec4};
use gltf::json::{Index, Node, Value};
use serde_json::Map;

pub use self::animation::CameraAnimation;
use self::animation::{Parts, place_of, transform};
use self::file::File;
pub use self::file::{Beside, beside};
use self::mesh::{Mesh, positions};
use super::{
    CameraPlace, Labels, LoadOptions, Scene, Surfaces, UpAxis, WorldBox, choose_origin, memory,
};
use crate::input::Result;

/// Bytes of a mesh's number while it is read: in f64, and as a point or corner.
const BYTES_PER_NUMBER: u64 = 20;
/// Bytes of an instance while it is read: its transform and its item's.
const BYTES_PER_INSTANCE: u64 = (2 * size_of::<Placed>()) as u64;
/// Most items of a file: an instance takes few bytes of it.
const MOST_ITEMS: usize = 1 << 24;

/// Recognises glTF by the magic of a GLB, or by the opening brace of JSON.
pub fn is_gltf(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    bytes.starts_with(b"glTF") || text.trim_ascii_start().starts_with(b"{")
}

/// Reads a scene; `beside` reads the files that it refers to.
///
/// # Errors
/// The first value that glTF 2.0 does not allow, by its place in the file; a node that is reached
/// twice; a mesh without triangles and without bounds; a scene that does not fit into memory.
pub(super) fn read_beside(
    bytes: &[u8],
    [file, name]: [&str; 2],
    options: &LoadOptions,
    beside: Beside,
) -> Result<Scene> {
    let mut file = File::open(bytes, file, beside)?;
    let (placed, places, order) = file.placed()?;
    file.note_unread(&placed, &order, places.len());
    let animation = file.camera_animation(&order).transpose();
    let meshes = 0..file.root.meshes.len();
    let numbers = meshes.clone().map(|mesh| file.numbers(mesh));
    let numbers = numbers.fold(0, u64::saturating_add);
    let needed = numbers.saturating_mul(BYTES_PER_NUMBER);
    memory::check_fits(name, needed, options.structures, numbers)?;
    let meshes = meshes.map(|mesh| file.mesh(mesh));
    let meshes: Vec<Mesh> = meshes.collect::<Result<_>>()?;
    file.note_without_triangles(&placed, &meshes);
    let mut labels = Labels::new("name");
    let names = placed.iter().map(|item| &file.root.nodes[item.node].name);
    names.for_each(|name| labels.push(name.as_deref().unwrap_or_default()));
    // Freed early: nodes and buffers are larger than many scenes.
    (file.root, file.exact, file.buffers) = Default::default();
    Ok(Scene {
        up: UpAxis::Y,
        unit: Some("m"),
        labels: vec![labels],
        places,
        animation: animation.map(Arc::new),
        ..file.scene(&placed, &meshes, name, options)?
    })
}

/// Nodes with their parents, parents first.
type Order = Vec<(usize, Option<usize>)>;

/// A node with a mesh, or one of its instances.
struct Placed {
    node: usize,
    mesh: usize,
    world: DAffine3,
}

impl File<'_> {
    /// Nodes with a mesh, places of cameras, and all nodes, depth first.
    fn placed(&self) -> Result<(Vec<Placed>, Vec<CameraPlace>, Order)> {
        let nodes = &self.root.nodes;
        let first = (!self.root.scenes.is_empty()).then(|| Index::new(0));
        let roots: Vec<Index<Node>> = match self.root.scene.or(first) {
            Some(scene) => self.get(&self.root.scenes, scene, "scene")?.nodes.clone(),
            None => {
                let children = nodes.iter().flat_map(|node| node.children.iter().flatten());
                let inner: HashSet<u32> = children.map(|child| child.value() as u32).collect();
                let outer = (0..nodes.len() as u32).filter(|n| !inner.contains(n));
                outer.map(Index::new).collect()
            }
        };
        let (mut placed, mut places, mut order) = (Vec::new(), Vec::new(), Vec::new());
        let mut reached = vec![false; nodes.len()];
        let mut open = vec![(roots.iter(), None, DAffine3::IDENTITY)];
        while let Some((rest, above, parent)) = open.last_mut() {
            let Some(&next) = rest.next() else {
                open.pop();
                continue;
            };
            let (index, above, parent) = (next.value(), *above, *parent);
            let place = format!("nodes[{index}]");
            let node = self.get(nodes, next, &place)?;
            if std::mem::replace(&mut reached[index], true) {
                return Err(self.error(place, "a node that is reached twice", "a tree of nodes"));
            }
            order.push((index, above));
            let world = parent * self.local(index)?;
            if let Some(mesh) = node.mesh {
                let all = self.get(&self.root.meshes, mesh, &format!("{place}.mesh"))?;
                let mesh = mesh.value();
                let instances = match all.primitives.iter().any(|p| positions(p).is_some()) {
                    true => self.instances(index, placed.len())?,
                    false => Vec::new(),
                };
                placed.extend(instances.into_iter().map(|instance| Placed {
                    node: index,
                    mesh,
                    world: world * instance,
                }));
            }
            if node.camera.is_some() {
                places.extend(place_of(world, self.lens_of(index)?));
            }
            if let Some(children) = &node.children {
                open.push((children.iter(), Some(index), world));
            }
        }
        Ok((placed, places, order))
    }

    /// Transform of a node relative to its parent.
    fn local(&self, index: usize) -> Result<DAffine3> {
        let found = match &self.exact.nodes[index].matrix {
            Some(matrix) => {
                let last = matrix.row(3);
                if last.is_finite() && !last.abs_diff_eq(DVec4::W, 1e-6) {
                    let place = format!("nodes[{index}].matrix");
                    let found = format!("a last row of {last}");
                    return Err(self.error(place, found, "[0, 0, 0, 1]"));
                }
                DAffine3::from_mat4(**matrix)
            }
            None => transform(self.parts(index)),
        };
        self.finite(found, || format!("nodes[{index}]"))
    }

    fn finite(&self, transform: DAffine3, place: impl Fn() -> String) -> Result<DAffine3> {
        let expected = "finite numbers and a rotation that is not zero";
        let error = || self.error(place(), "a transform that is not finite", expected);
        transform.is_finite().then_some(transform).ok_or_else(error)
    }

    /// The stated parts of a node's transform.
    fn parts(&self, index: usize) -> Parts {
        let node = &self.exact.nodes[index];
        let [moved, scaled] = [node.translation, node.scale].map(|v| Some(v?.extend(0.0)));
        [moved, node.rotation, scaled]
    }

    /// Instances of a node by EXT_mesh_gpu_instancing; the node itself without them.
    ///
    /// `before` items are placed already. Each instance has at least a byte in a buffer.
    fn instances(&self, index: usize, before: usize) -> Result<Vec<DAffine3>> {
        let extensions = self.root.nodes[index].extensions.as_ref();
        let instancing = extensions.and_then(|e| e.others.get("EXT_mesh_gpu_instancing"));
        let Some(attributes) = instancing.map(|instancing| &instancing["attributes"]) else {
            return Ok(vec![DAffine3::IDENTITY]);
        };
        let place = format!("nodes[{index}].extensions.EXT_mesh_gpu_instancing");
        let index = |at: &Value| Some(Index::new(u32::try_from(at.as_u64()?).unwrap_or(u32::MAX)));
        let all = attributes.as_object().into_iter().flat_map(Map::values);
        let all = all.filter_map(index);
        let counts = all.map(|at| Ok(self.get(&self.root.accessors, at, &place)?.count.0));
        let counts: Vec<u64> = counts.collect::<Result<_>>()?;
        let [least, count] = [counts.iter().min(), counts.iter().max()].map(|c| *c.unwrap_or(&0));
        let most = MOST_ITEMS.saturating_sub(before).min(self.bytes) as u64;
        if least != count || !(1..=most).contains(&count) {
            let found = format!("attributes of {least} to {count} elements");
            let expected = format!("as many of each, 1 to {most}");
            return Err(self.error(place, found, &expected));
        }
        let (before, all) = (before as u64, before as u64 + count);
        // Querying the free memory takes half a millisecond.
        if all / memory::ANYWHERE > before / memory::ANYWHERE {
            memory::check_fits(self.name, all * BYTES_PER_INSTANCE, 0, all)?;
        }
        let column = |(name, width)| {
            let column = index(&attributes[name]).map(|at| self.vectors(at, width, &place));
            column.transpose()
        };
        let [moved, turned, scaled] =
            [("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3)].map(column);
        let columns = [moved?, turned?, scaled?];
        let of = |i: usize| columns.each_ref().map(|column| Some(column.as_ref()?[i]));
        let all = (0..count as usize)
            .map(|i| self.finite(transform(of(i)), || format!("{place}, instance {i}")));
        all.collect()
    }

    /// The scene of all boxes, and of triangles if any are read.
    fn scene(
        &self,
        placed: &[Placed],
        meshes: &[Mesh],
        name: &str,
        options: &LoadOptions,
    ) -> Result<Scene> {
        let of = |item: &Placed| &meshes[item.mesh];
        let parts = |mesh: &Mesh| mesh.corners.len().max(mesh.points.len() + mesh.loose.len());
        let parts: u64 = placed.iter().map(|item| parts(of(item)) as u64).sum();
        options.check_fits(name, None, parts)?;
        if parts > u64::from(u32::MAX) / 4 {
            let found = format!("{parts} triangles or points");
            return Err(self.error("meshes", found, "at most a billion"));
        }
        let bounds = |item: &Placed| -> Result<WorldBox> {
            let points = self.moved(&of(item).points, item)?;
            let corners = of(item).corners.iter().flatten();
            let corners = corners.map(|&corner| points[corner as usize]);
            let loose = self.moved(&of(item).loose, item)?;
            Ok(WorldBox::union_of(corners.chain(loose).map(WorldBox::at)))
        };
        let boxes: Vec<WorldBox> = placed.iter().map(bounds).collect::<Result<_>>()?;
        let origin = choose_origin(boxes.iter().copied());
        let scene = Scene::about(name, &boxes, origin)?;
        if !placed.iter().any(|item| of(item).has_own) {
            return Ok(scene);
        }
        drop(boxes);
        let mut surfaces = Surfaces::about(origin);
        for item in placed {
            let mesh = of(item);
            let mut corners = mesh.corners.clone();
            if item.world.matrix3.determinant() < 0.0 {
                corners.iter_mut().for_each(|corners| corners.swap(1, 2));
            }
            surfaces.push_written(&self.moved(&mesh.points, item)?, &corners);
            surfaces.set_last(&mesh.kinds, &mesh.two_sided);
        }
        Ok(Scene {
            surfaces: Some(Arc::new(surfaces)),
            ..scene
        })
    }

    /// Points of a mesh in world coordinates, for one of its items.
    fn moved(&self, points: &[DVec3], item: &Placed) -> Result<Vec<DVec3>> {
        let moved = |&point: &DVec3| {
            let point = item.world.transform_point3(point);
            let place = || format!("meshes[{}]", item.mesh);
            let found = || format!("a vertex that its transforms move to {point}");
            let error = || self.error(place(), found(), "finite numbers");
            point.is_finite().then_some(point).ok_or_else(error)
        };
        points.iter().map(moved).collect()
    }
}

#[cfg(test)]
mod tests;
