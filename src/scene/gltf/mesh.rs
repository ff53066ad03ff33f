//! Meshes of a glTF file as triangles.

use glam::DVec3;
use gltf::json::accessor::{Accessor, ComponentType};
use gltf::json::material::{AlphaMode, Material};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Value};

use super::file::{File, component};
use crate::input::Result;
use crate::scene::SurfaceKind;
use crate::scene::surface::own_points;
use crate::shown::shortened;

/// The triangles of a mesh, or why it has none that can be read.
pub type Mesh = Result<Triangles, String>;

#[derive(Default)]
pub struct Triangles {
    pub points: Vec<DVec3>,
    pub corners: Vec<[u32; 3]>,
    /// Kind of each triangle, by the material of its primitive.
    pub kinds: Vec<SurfaceKind>,
    /// Sides of each triangle, alike.
    pub two_sided: Vec<bool>,
}

/// Returns false for a mask that is opaque everywhere.
///
/// It has no texture, colours of vertices, other kind of colour or low alpha.
fn has_holes(material: &Material, primitive: &Primitive) -> bool {
    let own = &material.pbr_metallic_roughness;
    let cutoff = material.alpha_cutoff.unwrap_or_default();
    let colours = Checked::Valid(Semantic::Colors(0));
    own.base_color_texture.is_some()
        || own.base_color_factor.0[3] < cutoff.0
        || primitive.attributes.contains_key(&colours)
        || extension(material, "KHR_materials_pbrSpecularGlossiness").is_some()
}

fn extension<'m>(material: &'m Material, name: &str) -> Option<&'m Value> {
    material.extensions.as_ref()?.others.get(name)
}

impl File<'_> {
    /// How many numbers the accessors of a mesh state.
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
        let mesh = &self.root.meshes[index];
        let mut all = Ok(Triangles::default());
        for (place, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("meshes[{index}].primitives[{place}]");
            let Some(positions) = positions(primitive) else {
                continue;
            };
            let (mut kind, mut two_sided) = (SurfaceKind::Opaque, false);
            if let Some(material) = primitive.material {
                let material = self.get(&self.root.materials, material, &place)?;
                two_sided = material.double_sided;
                let transmission = extension(material, "KHR_materials_transmission");
                // The factor's default is 0: opaque.
                let factor = transmission.and_then(|t| t["transmissionFactor"].as_f64());
                let is_glass = factor.is_some_and(|factor| factor > 0.0);
                match material.alpha_mode {
                    _ if is_glass => kind = SurfaceKind::Clear,
                    Checked::Valid(AlphaMode::Blend) => kind = SurfaceKind::Clear,
                    Checked::Valid(AlphaMode::Mask) if has_holes(material, primitive) => {
                        kind = SurfaceKind::CutOut;
                    }
                    _ => {}
                }
            }
            let own = self.primitive(primitive, positions, &place)?;
            match (&mut all, own) {
                (Ok(all), Ok(own)) => {
                    let first = all.points.len() as u32;
                    all.points.extend(own.points);
                    let shift = |c: [u32; 3]| c.map(|corner| first.saturating_add(corner));
                    all.corners.extend(own.corners.into_iter().map(shift));
                    all.kinds.resize(all.corners.len(), kind);
                    all.two_sided.resize(all.corners.len(), two_sided);
                }
                (Ok(_), Err(reason)) => all = Err(reason),
                _ => {}
            }
        }
        Ok(all.and_then(|mut all| {
            // Each item would have a copy of points without a triangle.
            all.points = own_points(&all.points, &mut all.corners);
            let has_any = !all.corners.is_empty();
            has_any.then_some(all).ok_or("has no triangles".to_owned())
        }))
    }

    /// Refuses indices that are no whole numbers.
    fn check_indices(&self, index: Index<Accessor>) -> Result<()> {
        use ComponentType::{U8, U16, U32};
        let accessor = &self.root.accessors[index.value()];
        let kind = component(accessor).filter(|_| !accessor.normalized);
        if matches!(kind, Some(U8 | U16 | U32)) {
            return Ok(());
        }
        let number = component(accessor).map_or(0, ComponentType::as_gl_enum);
        let found = match accessor.normalized {
            true => "normalized indices".to_owned(),
            false => format!("indices of type {number}"),
        };
        let expected = "5121, 5123 or 5125, not normalized";
        Err(self.error(format!("accessors[{}]", index.value()), found, expected))
    }

    fn primitive(
        &self,
        primitive: &Primitive,
        positions: Index<Accessor>,
        place: &str,
    ) -> Result<Mesh> {
        let extensions = primitive.extensions.as_ref();
        let mut names = extensions.into_iter().flat_map(|e| e.others.keys());
        if let Some(name) = names.find(|name| name.contains("compression")) {
            return Ok(Err(format!("is compressed ({})", shortened(name, 40))));
        }
        let points: Vec<DVec3> = match self.values(positions, 3, place)? {
            Ok(values) => values.chunks_exact(3).map(DVec3::from_slice).collect(),
            Err(reason) => return Ok(Err(reason)),
        };
        let order: Vec<u32> = match primitive.indices {
            None => (0..points.len() as u32).collect(),
            Some(indices) => match self.values(indices, 1, place)? {
                Ok(values) => {
                    self.check_indices(indices)?;
                    values.into_iter().map(|v| v as u32).collect()
                }
                Err(reason) => return Ok(Err(reason)),
            },
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
            Checked::Valid(_) => return Ok(Err("has points or lines".to_owned())),
            Checked::Invalid => {
                return Err(self.error(place, "an unknown mode", "a mode of 0 to 6"));
            }
        };
        Ok(Ok(Triangles {
            points,
            corners,
            ..Triangles::default()
        }))
    }
}

/// The accessor of positions; `None` where nothing is drawn.
pub fn positions(primitive: &Primitive) -> Option<Index<Accessor>> {
    let semantic = Checked::Valid(Semantic::Positions);
    primitive.attributes.get(&semantic).copied()
}
