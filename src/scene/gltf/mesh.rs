//! Meshes of a glTF file as triangles.

use glam::{BVec3, DVec3};
use gltf::json::accessor::{Accessor, ComponentType};
use gltf::json::material::{AlphaMode, Material};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Value};
use serde::Deserialize;

use super::file::{File, component, normalised};
use crate::input::Result;
use crate::scene::SurfaceKind;
use crate::scene::surface::{BOX, own_points};

/// The drawn parts of a mesh.
#[derive(Default)]
pub struct Mesh {
    pub points: Vec<DVec3>,
    pub corners: Vec<[u32; 3]>,
    /// Kind of each triangle, by the material of its primitive.
    pub kinds: Vec<SurfaceKind>,
    /// For each triangle, true if it is two-sided.
    pub two_sided: Vec<bool>,
    /// Points and vertices of lines, which only count for the box.
    pub loose: Vec<DVec3>,
    /// True if triangles were read, not only boxes of bounds.
    pub has_own: bool,
    /// The reason why some of it has no triangles.
    pub reason: Option<String>,
}

impl Mesh {
    fn push(&mut self, points: &[DVec3], corners: &[[u32; 3]], kind: SurfaceKind, two_sided: bool) {
        let first = self.points.len() as u32;
        self.points.extend(points);
        let shift = |c: &[u32; 3]| c.map(|corner| first.saturating_add(corner));
        self.corners.extend(corners.iter().map(shift));
        self.kinds.resize(self.corners.len(), kind);
        self.two_sided.resize(self.corners.len(), two_sided);
    }
}

/// Returns false for an alpha mask that is opaque everywhere.
///
/// Opaque: no texture, vertex colours, other kind of colour or low alpha.
fn has_holes(material: &Material, primitive: &Primitive) -> bool {
    let own = &material.pbr_metallic_roughness;
    let cutoff = material.alpha_cutoff.unwrap_or_default();
    let colours = Checked::Valid(Semantic::Colors(0));
    own.base_color_texture.is_some()
        || own.base_color_factor.0[3] < cutoff.0
        || primitive.attributes.contains_key(&colours)
        || extension(material, "KHR_materials_pbrSpecularGlossiness").is_some()
}

/// Effect of a primitive's triangles on a ray.
fn kind_of(material: &Material, primitive: &Primitive) -> SurfaceKind {
    let transmission = extension(material, "KHR_materials_transmission");
    // The factor's default is 0: opaque.
    let factor = transmission.and_then(|t| t["transmissionFactor"].as_f64());
    match material.alpha_mode {
        _ if factor.is_some_and(|factor| factor > 0.0) => SurfaceKind::Clear,
        Checked::Valid(AlphaMode::Blend) => SurfaceKind::Clear,
        Checked::Valid(AlphaMode::Mask) if has_holes(material, primitive) => SurfaceKind::CutOut,
        _ => SurfaceKind::Opaque,
    }
}

fn extension<'m>(material: &'m Material, name: &str) -> Option<&'m Value> {
    material.extensions.as_ref()?.others.get(name)
}

impl File<'_> {
    /// The number of numbers that the accessors of a mesh state.
    pub fn numbers(&self, mesh: usize) -> u64 {
        let count = |index: Index<Accessor>| {
            let accessor = self.root.accessors.get(index.value());
            accessor.map_or(0, |accessor| accessor.count.0)
        };
        let primitives = self.root.meshes[mesh].primitives.iter();
        let numbers = primitives.map(|primitive| {
            let points = positions(primitive).map_or(0, count);
            let indices = primitive.indices.map_or(0, count);
            points.saturating_mul(3).saturating_add(indices)
        });
        numbers.fold(0, u64::saturating_add)
    }

    pub fn mesh(&self, index: usize) -> Result<Mesh> {
        let primitives = self.root.meshes[index].primitives.iter().enumerate();
        let drawn = primitives.filter_map(|(i, own)| Some((i, own, positions(own)?)));
        let mut all = Mesh::default();
        for (place, primitive, positions) in drawn.clone() {
            let place = format!("meshes[{index}].primitives[{place}]");
            let names = primitive.extensions.iter().flat_map(|e| e.others.keys());
            let names = names.filter(|name| name.contains("compression"));
            let mut accessors = [Some(positions), primitive.indices].into_iter().flatten();
            let unread = accessors.find_map(|index| self.unread(index));
            match self.compressed(names, unread.is_none()).or(unread) {
                Some(reason) => self.push_box(&mut all, positions, &reason)?,
                None => self.primitive(&mut all, primitive, positions, &place)?,
            }
        }
        if all.corners.is_empty() && all.loose.is_empty() {
            for (.., positions) in drawn {
                self.push_box(&mut all, positions, "has no triangles")?;
            }
        }
        // Each item would copy the points that no triangle uses.
        all.points = own_points(&all.points, &mut all.corners, &mut Vec::new());
        Ok(all)
    }

    /// Appends the box of the accessor's bounds, which is visible and hides nothing.
    fn push_box(&self, all: &mut Mesh, positions: Index<Accessor>, reason: &str) -> Result<()> {
        all.reason.get_or_insert_with(|| reason.to_owned());
        let place = format!("accessors[{}]", positions.value());
        let accessor = self.get(&self.root.accessors, positions, &place)?;
        let corner = |value: &Option<Value>| -> Option<DVec3> {
            let corner = <[f64; 3]>::deserialize(value.as_ref()?).ok()?;
            let kind = component(accessor)?;
            let corner = corner.map(|n| normalised(n, kind, accessor.normalized));
            Some(corner.into())
        };
        let ends = corner(&accessor.min).zip(corner(&accessor.max));
        let ends = ends.filter(|(min, max)| min.cmple(*max).all());
        let (min, max) = ends.ok_or_else(|| {
            let expected = "min <= max of three numbers each";
            self.error(place, "no bounds of positions", expected)
        })?;
        let corners: [DVec3; 8] = std::array::from_fn(|i| {
            DVec3::select(BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), min, max)
        });
        all.push(&corners, &BOX, SurfaceKind::CutOut, false);
        Ok(())
    }

    /// Refuses indices that are not unsigned integers.
    fn check_indices(&self, index: Index<Accessor>) -> Result<()> {
        use ComponentType::{U8, U16, U32};
        let accessor = &self.root.accessors[index.value()];
        let found = match component(accessor) {
            _ if accessor.normalized => "normalized indices".to_owned(),
            Some(U8 | U16 | U32) => return Ok(()),
            other => {
                let number = other.map_or(0, ComponentType::as_gl_enum);
                format!("indices of type {number}")
            }
        };
        let expected = "5121, 5123 or 5125, not normalized";
        Err(self.error(format!("accessors[{}]", index.value()), found, expected))
    }

    fn primitive(
        &self,
        all: &mut Mesh,
        primitive: &Primitive,
        positions: Index<Accessor>,
        place: &str,
    ) -> Result<()> {
        let material = primitive.material;
        let material = material.map(|index| self.get(&self.root.materials, index, place));
        let material = material.transpose()?;
        let kind = material.map_or(SurfaceKind::Opaque, |own| kind_of(own, primitive));
        let two_sided = material.is_some_and(|own| own.double_sided);
        let points = self.values(positions, 3, place)?;
        let points: Vec<DVec3> = points.chunks_exact(3).map(DVec3::from_slice).collect();
        let order: Vec<u32> = match primitive.indices {
            None => (0..points.len() as u32).collect(),
            Some(indices) => {
                let values = self.values(indices, 1, place)?;
                self.check_indices(indices)?;
                values.into_iter().map(|v| v as u32).collect()
            }
        };
        if let Some(&index) = order.iter().find(|&&index| index as usize >= points.len()) {
            self.get(&points, Index::new(index), &format!("{place}.indices"))?;
        }
        let is_bad = |&&index: &&u32| !points[index as usize].is_finite();
        if let Some(&index) = order.iter().find(is_bad) {
            let found = format!("point {index} is {}", points[index as usize]);
            let place = format!("accessors[{}]", positions.value());
            return Err(self.error(place, found, "finite numbers"));
        }
        let corners: Vec<[u32; 3]> = match primitive.mode {
            Checked::Valid(Mode::Triangles) => order.as_chunks().0.to_vec(),
            Checked::Valid(Mode::TriangleStrip) => {
                let strip = order.windows(3).enumerate();
                strip.map(|(i, c)| [c[i % 2], c[1 - i % 2], c[2]]).collect()
            }
            Checked::Valid(Mode::TriangleFan) => {
                let rim = order.get(1..).unwrap_or_default().windows(2);
                rim.map(|c| [order[0], c[0], c[1]]).collect()
            }
            Checked::Valid(_) => {
                let reason = || "has points or lines".to_owned();
                all.reason.get_or_insert_with(reason);
                all.loose.extend(order.iter().map(|&i| points[i as usize]));
                return Ok(());
            }
            Checked::Invalid => {
                return Err(self.error(place, "an unknown mode", "a mode of 0 to 6"));
            }
        };
        all.has_own |= !corners.is_empty();
        all.push(&points, &corners, kind, two_sided);
        Ok(())
    }
}

/// The accessor of positions; `None` if nothing is drawn.
pub fn positions(primitive: &Primitive) -> Option<Index<Accessor>> {
    let semantic = Checked::Valid(Semantic::Positions);
    primitive.attributes.get(&semantic).copied()
}
