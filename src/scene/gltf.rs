//! glTF 2.0 and GLB: every node with a mesh is an item, in the file's own coordinates.
//!
//! Triangles are read where all meshes have plain ones. Compressed meshes, points and
//! lines have the boxes of their accessors' bounds instead, and then no item of the file
//! has triangles. Skins and morph targets stay in their rest pose. Source: Khronos
//! Group, glTF 2.0 Specification, 2021.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::material::AlphaMode;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root, Value};

use super::{
    CameraPlace, Labels, LoadOptions, Scene, SurfaceKind, Surfaces, UpAxis, WorldBox,
    choose_origin, memory,
};
use crate::input::{InputError, note, read_file};
use crate::shown::shortened;

/// Tells glTF by the magic of a GLB, or by the brace that JSON begins with.
pub fn is_gltf(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    bytes.starts_with(b"glTF") || text.trim_ascii_start().starts_with(b"{")
}

/// Reads a scene; `file` is the path that other files are named relative to.
///
/// # Errors
/// The first value that is none of glTF 2.0, by its place in the file; a node that is
/// reached twice; a mesh without triangles and without bounds; a scene that does not fit
/// into memory.
pub fn read_gltf(
    bytes: &[u8],
    file: &str,
    name: &str,
    options: &LoadOptions,
) -> Result<Scene, InputError> {
    let file = File::open(bytes, file)?;
    let (placed, places) = file.placed()?;
    let meshes: Vec<Mesh> = (0..file.root.meshes.len())
        .map(|mesh| file.mesh(mesh))
        .collect::<Result<_, _>>()?;
    let mut labels = Labels::new("name".to_owned());
    for item in &placed {
        let node = file.root.nodes[item.node].name.as_deref();
        labels.push(node.unwrap_or_default().into());
    }
    let unplain = placed.iter().find_map(|item| match &meshes[item.mesh] {
        Mesh { plain: Ok(_), .. } => None,
        Mesh { plain: Err(reason), .. } => Some((item.mesh, reason)),
    });
    let scene = match unplain {
        None => file.triangles(&placed, &meshes, name, options)?,
        Some((mesh, reason)) => {
            note(&format!(
                "{}: items are boxes without triangles: meshes[{mesh}] {reason}",
                file.name
            ));
            let boxes: Result<Vec<_>, _> = placed.iter().map(|i| file.bounds(i)).collect();
            Scene::from_boxes(name, &boxes?)?
        }
    };
    Ok(Scene {
        up: UpAxis::Y,
        unit: Some("m"),
        labels: vec![labels],
        places,
        ..scene
    })
}

/// A node with a mesh, or one of its instances.
struct Placed {
    node: usize,
    mesh: usize,
    world: DAffine3,
}

/// The triangles of a mesh, or why it has none that can be read.
struct Mesh {
    plain: Result<Triangles, String>,
    kind: SurfaceKind,
    two_sided: bool,
}

#[derive(Default)]
struct Triangles {
    points: Vec<DVec3>,
    corners: Vec<[u32; 3]>,
}

/// A file with all of its buffers.
struct File<'f> {
    name: &'f str,
    root: Root,
    buffers: Vec<Cow<'f, [u8]>>,
}

impl<'f> File<'f> {
    fn open(bytes: &'f [u8], name: &'f str) -> Result<File<'f>, InputError> {
        let error = |found: String| value_error(name, "JSON", found, "glTF 2.0");
        let (json, mut bin) = match bytes.starts_with(b"glTF") {
            true => {
                let glb = gltf::Glb::from_slice(bytes).map_err(|e| InputError::Byte {
                    file: name.to_owned(),
                    offset: 0,
                    found: e.to_string(),
                    expected: "a GLB of version 2".to_owned(),
                })?;
                (glb.json, glb.bin)
            }
            false => (Cow::Borrowed(bytes), None),
        };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&json);
        let root: Root = serde_json::from_slice(json).map_err(|e| error(e.to_string()))?;
        if !root.asset.version.starts_with("2.") {
            let version = shortened(&root.asset.version, 20);
            return Err(error(format!("glTF of version '{version}'")));
        }
        let mut file = File {
            name,
            root,
            buffers: Vec::new(),
        };
        for index in 0..file.root.buffers.len() {
            let buffer = &file.root.buffers[index];
            let bytes = match &buffer.uri {
                None => bin.take().unwrap_or_default(),
                Some(uri) => Cow::Owned(file.linked(index, uri)?),
            };
            file.buffers.push(bytes);
        }
        Ok(file)
    }

    fn linked(&self, buffer: usize, uri: &str) -> Result<Vec<u8>, InputError> {
        let error = |found: String, expected| {
            Err(self.error(format!("buffers[{buffer}].uri"), found, expected))
        };
        match uri.strip_prefix("data:") {
            Some(data) => match data.split_once(";base64,").map(|(_, d)| STANDARD.decode(d)) {
                Some(Ok(bytes)) => Ok(bytes),
                _ => error("bytes that are no base64".to_owned(), "base64 data"),
            },
            None if uri.contains("://") => error(
                format!("'{}'", shortened(uri, 60)),
                "a file beside this one",
            ),
            None => {
                let beside = Path::new(self.name).parent().unwrap_or(Path::new(""));
                read_file(&beside.join(uri.replace("%20", " ")))
            }
        }
    }

    fn error(&self, place: String, found: impl Into<String>, expected: &str) -> InputError {
        value_error(self.name, &place, found, expected)
    }

    fn get<'s, T>(&self, all: &'s [T], index: Index<T>, place: &str) -> Result<&'s T, InputError> {
        let index = index.value();
        all.get(index).ok_or_else(|| {
            let expected = format!("an index below {}", all.len());
            self.error(place.to_owned(), format!("index {index}"), &expected)
        })
    }

    /// Nodes with a mesh and places of cameras, depth first.
    fn placed(&self) -> Result<(Vec<Placed>, Vec<CameraPlace>), InputError> {
        let nodes = &self.root.nodes;
        let roots: Vec<usize> = match self.root.scene.or(match self.root.scenes.is_empty() {
            true => None,
            false => Some(Index::new(0)),
        }) {
            Some(scene) => {
                let scene = self.get(&self.root.scenes, scene, "scene")?;
                scene.nodes.iter().map(|node| node.value()).collect()
            }
            None => {
                let children = nodes.iter().flat_map(|node| node.children.iter().flatten());
                let mut is_root = vec![true; nodes.len()];
                for child in children.map(|child| child.value()) {
                    if let Some(is_root) = is_root.get_mut(child) {
                        *is_root = false;
                    }
                }
                (0..nodes.len()).filter(|&node| is_root[node]).collect()
            }
        };
        let (mut placed, mut places) = (Vec::new(), Vec::new());
        let mut reached = vec![false; nodes.len()];
        let mut open: Vec<(usize, DAffine3)> =
            roots.iter().rev().map(|&root| (root, DAffine3::IDENTITY)).collect();
        while let Some((index, parent)) = open.pop() {
            let place = format!("nodes[{index}]");
            let node = self.get(nodes, Index::new(index as u32), &place)?;
            if std::mem::replace(&mut reached[index], true) {
                return Err(self.error(place, "a node that is reached twice", "a tree of nodes"));
            }
            let world = parent * self.local(index)?;
            if let Some(mesh) = node.mesh {
                self.get(&self.root.meshes, mesh, &format!("{place}.mesh"))?;
                let mesh = mesh.value();
                for instance in self.instances(index)? {
                    let world = world * instance;
                    placed.push(Placed { node: index, mesh, world });
                }
            }
            if node.camera.is_some() {
                let forward = world.transform_vector3(DVec3::NEG_Z).normalize_or_zero();
                let eye = world.translation;
                if forward != DVec3::ZERO {
                    places.push(CameraPlace { eye, forward });
                }
            }
            let children = node.children.iter().flatten().rev();
            open.extend(children.map(|child| (child.value(), world)));
        }
        Ok((placed, places))
    }

    /// Transform of a node relative to its parent.
    fn local(&self, index: usize) -> Result<DAffine3, InputError> {
        let node = &self.root.nodes[index];
        let found = match node.matrix {
            Some(matrix) => DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from))),
            None => transform(
                node.translation.map(|t| t.map(f64::from)),
                node.rotation.as_ref().map(|r| r.0.map(f64::from)),
                node.scale.map(|s| s.map(f64::from)),
            ),
        };
        match found.is_finite() {
            true => Ok(found),
            false => Err(self.error(
                format!("nodes[{index}]"),
                "a transform that is not finite",
                "finite numbers and a rotation that is not zero",
            )),
        }
    }

    /// Instances of a node by EXT_mesh_gpu_instancing; the node itself without them.
    fn instances(&self, index: usize) -> Result<Vec<DAffine3>, InputError> {
        let extensions = self.root.nodes[index].extensions.as_ref();
        let instancing = extensions.and_then(|e| e.others.get("EXT_mesh_gpu_instancing"));
        let Some(attributes) = instancing.map(|instancing| &instancing["attributes"]) else {
            return Ok(vec![DAffine3::IDENTITY]);
        };
        let place = format!("nodes[{index}].extensions.EXT_mesh_gpu_instancing");
        let column = |name: &str, width: usize| -> Result<Option<Vec<f64>>, InputError> {
            let Some(accessor) = attributes[name].as_u64() else {
                return Ok(None);
            };
            let accessor = Index::new(u32::try_from(accessor).unwrap_or(u32::MAX));
            match self.values(accessor, width, &place)? {
                Ok(values) => Ok(Some(values)),
                Err(reason) => Err(self.error(place.clone(), reason, "plain accessors")),
            }
        };
        let [moved, turned, scaled] = [("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3)]
            .map(|(name, width)| column(name, width));
        let (moved, turned, scaled) = (moved?, turned?, scaled?);
        let counts = [(&moved, 3), (&turned, 4), (&scaled, 3)];
        let count = counts.iter().filter_map(|(all, width)| Some(all.as_ref()?.len() / width));
        let of = |all: &Option<Vec<f64>>, i: usize| {
            Some(<[f64; 3]>::try_from(&all.as_ref()?[3 * i..3 * i + 3]).expect("three"))
        };
        let all = (0..count.min().unwrap_or(0)).map(|i| {
            let rotation = turned.as_ref().map(|all| &all[4 * i..4 * i + 4]);
            let rotation = rotation.map(|r| r.try_into().expect("four"));
            transform(of(&moved, i), rotation, of(&scaled, i))
        });
        Ok(all.collect())
    }

    /// Numbers of an accessor, `width` for each element, normalised where it says so;
    /// the reason where its bytes are not plain.
    fn values(
        &self,
        index: Index<Accessor>,
        width: usize,
        place: &str,
    ) -> Result<Result<Vec<f64>, String>, InputError> {
        let accessor = self.get(&self.root.accessors, index, place)?;
        let place = format!("accessors[{}]", index.value());
        let (Some(kind), Checked::Valid(dimensions)) = (component(accessor), accessor.type_) else {
            return Err(self.error(place, "no known type", "a type of glTF 2.0"));
        };
        if dimensions.multiplicity() != width {
            let found = format!("elements of {} numbers", dimensions.multiplicity());
            return Err(self.error(place, found, &format!("{width} numbers")));
        }
        let Some(view) = accessor.buffer_view.filter(|_| accessor.sparse.is_none()) else {
            return Ok(Err("has sparse accessors or none with bytes".to_owned()));
        };
        let view = self.get(&self.root.buffer_views, view, &format!("{place}.bufferView"))?;
        let extensions = view.extensions.as_ref();
        if let Some(name) = extensions.and_then(|e| e.others.keys().next()) {
            return Ok(Err(format!("is compressed ({})", shortened(name, 40))));
        }
        let buffer = self.get(&self.buffers, Index::new(view.buffer.value() as u32), &place)?;
        let size = kind.size() * width;
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        let range = |start: u64, length: u64, of: &'_ [u8]| {
            let end = start.checked_add(length)?;
            (end <= of.len() as u64).then_some(start as usize..end as usize)
        };
        let count = accessor.count.0;
        let offset = accessor.byte_offset.unwrap_or_default().0;
        let bytes = range(view.byte_offset.unwrap_or_default().0, view.byte_length.0, buffer);
        let needed = (count.saturating_sub(1)).saturating_mul(stride as u64) + size as u64;
        let bytes = bytes.map(|range| &buffer[range]);
        let own = bytes.and_then(|bytes| Some(&bytes[range(offset, needed, bytes)?]));
        let Some(own) = own.filter(|_| stride >= size || count < 2) else {
            let found = format!("{count} elements that end behind their buffer");
            return Err(self.error(place, found, "elements within it"));
        };
        let elements = own.chunks(stride.max(1)).take(count as usize);
        let numbers = elements.flat_map(|element| element[..size].chunks_exact(kind.size()));
        Ok(Ok(numbers.map(|bytes| number(bytes, kind, accessor.normalized)).collect()))
    }

    fn mesh(&self, index: usize) -> Result<Mesh, InputError> {
        let mesh = &self.root.meshes[index];
        let mut all = Ok(Triangles::default());
        let (mut kind, mut two_sided) = (SurfaceKind::Opaque, false);
        for (place, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("meshes[{index}].primitives[{place}]");
            if let Some(material) = primitive.material {
                let material = self.get(&self.root.materials, material, &place)?;
                two_sided |= material.double_sided;
                match material.alpha_mode {
                    Checked::Valid(AlphaMode::Blend) => kind = SurfaceKind::Clear,
                    Checked::Valid(AlphaMode::Mask) if kind == SurfaceKind::Opaque => {
                        kind = SurfaceKind::CutOut;
                    }
                    _ => {}
                }
            }
            let own = self.primitive(primitive, &place)?;
            match (&mut all, own) {
                (Ok(all), Ok(own)) => {
                    let first = all.points.len() as u32;
                    all.points.extend(own.points);
                    let corners = own.corners.into_iter();
                    all.corners.extend(corners.map(|c| c.map(|corner| first.saturating_add(corner))));
                }
                (Ok(_), Err(reason)) => all = Err(reason),
                _ => {}
            }
        }
        let plain = all.and_then(|all| match all.corners.is_empty() {
            true => Err("has no triangles".to_owned()),
            false => Ok(all),
        });
        Ok(Mesh { plain, kind, two_sided })
    }

    fn primitive(
        &self,
        primitive: &Primitive,
        place: &str,
    ) -> Result<Result<Triangles, String>, InputError> {
        let extensions = primitive.extensions.as_ref();
        if let Some(name) = extensions.and_then(|e| e.others.keys().find(|n| n.contains("compression")))
        {
            return Ok(Err(format!("is compressed ({})", shortened(name, 40))));
        }
        let Some(positions) = positions(primitive) else {
            return Ok(Err("has no positions".to_owned()));
        };
        let points = match self.values(positions, 3, place)? {
            Ok(values) => values.chunks_exact(3).map(DVec3::from_slice).collect::<Vec<_>>(),
            Err(reason) => return Ok(Err(reason)),
        };
        let order: Vec<u32> = match primitive.indices {
            None => (0..points.len() as u32).collect(),
            Some(indices) => match self.values(indices, 1, place)? {
                Ok(values) => values.into_iter().map(|v| v as u32).collect(),
                Err(reason) => return Ok(Err(reason)),
            },
        };
        if let Some(index) = order.iter().find(|&&index| index as usize >= points.len()) {
            let expected = format!("an index below {}", points.len());
            return Err(self.error(format!("{place}.indices"), format!("index {index}"), &expected));
        }
        let corners: Vec<[u32; 3]> = match primitive.mode {
            Checked::Valid(Mode::Triangles) => {
                order.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
            }
            Checked::Valid(Mode::TriangleStrip) => order
                .windows(3)
                .enumerate()
                .map(|(i, c)| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[1], c[0], c[2]] })
                .collect(),
            Checked::Valid(Mode::TriangleFan) => {
                let rim = order.get(1..).unwrap_or_default().windows(2);
                rim.map(|c| [order[0], c[0], c[1]]).collect()
            }
            _ => return Ok(Err("has points or lines".to_owned())),
        };
        Ok(Ok(Triangles { points, corners }))
    }

    /// The scene of all triangles.
    fn triangles(
        &self,
        placed: &[Placed],
        meshes: &[Mesh],
        name: &str,
        options: &LoadOptions,
    ) -> Result<Scene, InputError> {
        let plain = |item: &Placed| meshes[item.mesh].plain.as_ref().expect("plain meshes");
        let count = |of: fn(&Triangles) -> usize| placed.iter().map(|i| of(plain(i)) as u64).sum();
        let (triangles, points): (u64, u64) = (count(|t| t.corners.len()), count(|t| t.points.len()));
        let needed = memory::needed_by_triangles(
            triangles.max(points),
            options.per_triangle,
            options.structures,
        );
        memory::check_fits(name, needed, options.structures, memory::free_for(triangles.max(points)))?;
        if triangles.max(points) > u64::from(u32::MAX) / 4 {
            let found = format!("{triangles} triangles");
            return Err(self.error("meshes".to_owned(), found, "at most a billion"));
        }
        let world = |item: &'_ Placed| {
            let place = item.world;
            plain(item).points.iter().map(move |&p| place.transform_point3(p))
        };
        let boxes = placed.iter().map(|item| {
            WorldBox::union_of(world(item).map(|p| WorldBox::new(p, p)))
        });
        let mut surfaces = Surfaces::about(choose_origin(boxes));
        let mut local: Vec<Vec3> = Vec::new();
        for item in placed {
            let mesh = &meshes[item.mesh];
            local.clear();
            local.extend(world(item).map(|p| (p - surfaces.origin).as_vec3()));
            let corners = &plain(item).corners;
            match item.world.matrix3.determinant() < 0.0 {
                false => surfaces.push(mesh.kind, mesh.two_sided, &local, corners),
                true => {
                    let turned: Vec<_> = corners.iter().map(|&[a, b, c]| [a, c, b]).collect();
                    surfaces.push(mesh.kind, mesh.two_sided, &local, &turned);
                }
            }
        }
        surfaces.into_scene(name)
    }

    /// World box of the bounds that the accessors of an item state.
    fn bounds(&self, item: &Placed) -> Result<WorldBox, InputError> {
        let mut all = WorldBox::union_of([]);
        for primitive in &self.root.meshes[item.mesh].primitives {
            let place = format!("meshes[{}]", item.mesh);
            let missing = |place: String| {
                self.error(place, "no bounds of positions", "min and max of three numbers")
            };
            let positions = positions(primitive).ok_or_else(|| missing(place.clone()))?;
            let accessor = self.get(&self.root.accessors, positions, &place)?;
            let corner = |value: &Option<Value>| -> Option<DVec3> {
                let numbers = value.as_ref()?.as_array()?.iter();
                let numbers: Vec<f64> = numbers.map(Value::as_f64).collect::<Option<_>>()?;
                let corner = <[f64; 3]>::try_from(numbers).ok()?;
                let kind = component(accessor)?;
                Some(corner.map(|n| normalised(n, kind, accessor.normalized)).into())
            };
            let ends = corner(&accessor.min).zip(corner(&accessor.max));
            let (min, max) =
                ends.ok_or_else(|| missing(format!("accessors[{}]", positions.value())))?;
            let corners = (0..8).map(|i| {
                let pick = |k: usize| if i >> k & 1 == 0 { min[k] } else { max[k] };
                let p = item.world.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
                WorldBox::new(p, p)
            });
            all = WorldBox::union_of(corners.chain([all]));
        }
        Ok(all)
    }
}

fn value_error(
    file: &str,
    place: &str,
    found: impl Into<String>,
    expected: &str,
) -> InputError {
    InputError::Value {
        file: file.to_owned(),
        place: place.to_owned(),
        found: found.into(),
        expected: expected.to_owned(),
    }
}

fn positions(primitive: &Primitive) -> Option<Index<Accessor>> {
    let semantic = Checked::Valid(Semantic::Positions);
    primitive.attributes.get(&semantic).copied()
}

fn component(accessor: &Accessor) -> Option<ComponentType> {
    match accessor.component_type {
        Checked::Valid(kind) => Some(kind.0),
        Checked::Invalid => None,
    }
}

fn transform(
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        scale.map_or(DVec3::ONE, DVec3::from),
        rotation.map_or(DQuat::IDENTITY, |r| DQuat::from_array(r).normalize()),
        translation.map_or(DVec3::ZERO, DVec3::from),
    )
}

/// A little-endian number; a fraction where it is normalised.
fn number(bytes: &[u8], kind: ComponentType, is_normalised: bool) -> f64 {
    let two = || [bytes[0], bytes[1]];
    let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
    let raw = match kind {
        ComponentType::I8 => f64::from(bytes[0] as i8),
        ComponentType::U8 => f64::from(bytes[0]),
        ComponentType::I16 => f64::from(i16::from_le_bytes(two())),
        ComponentType::U16 => f64::from(u16::from_le_bytes(two())),
        ComponentType::U32 => f64::from(u32::from_le_bytes(four())),
        ComponentType::F32 => f64::from(f32::from_le_bytes(four())),
    };
    normalised(raw, kind, is_normalised)
}

/// A component as glTF 2.0, section 3.11 normalises it; f32 as the file's bytes hold it.
fn normalised(raw: f64, kind: ComponentType, is_normalised: bool) -> f64 {
    let largest = match kind {
        ComponentType::I8 => 127.0,
        ComponentType::U8 => 255.0,
        ComponentType::I16 => 32_767.0,
        ComponentType::U16 => 65_535.0,
        ComponentType::F32 => return f64::from(raw as f32),
        ComponentType::U32 => return raw,
    };
    match is_normalised {
        true => (raw / largest).max(-1.0),
        false => raw,
    }
}
