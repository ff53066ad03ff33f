//! Quake III maps (IBSP of version 46).
//!
//! Surfaces and brushes are items, with their triangles; the open leaves of the map's own BSP tree
//! are regions; spawn points are camera places.
//!
//! Moving parts are at their positions in the file, and coordinates are the file's.

mod faces;
mod lumps;
mod tree;

use std::sync::Arc;

use glam::{DVec3, Vec3};

use self::faces::{Faces, PER_PATCH, brush, brush_box, patch};
use self::lumps::{OTHERS, lump};
pub use self::tree::{LeafNode, LeafTree};
use super::records::Table;
use super::{
    CameraPlace, ItemKind, Labels, LoadOptions, Regions, Scene, SurfaceKind, Surfaces, WorldBox,
};
use crate::geometry::Aabb;
use crate::input::{Result, note_counted};

/// Height of a player's eyes above a spawn point, in map units.
const EYE_HEIGHT: f64 = 26.0;
/// Shader contents: a brush is solid, or translucent.
const SOLID: i32 = 1;
const TRANSLUCENT: i32 = 0x2000_0000;
/// Shader flag: a surface that is not drawn.
const NO_DRAW: i32 = 0x80;
/// Most triangle corners per vertex; maps have about two.
const MOST_CORNERS: u64 = 16;

/// A map's tree, and the visibility between its clusters.
#[derive(Clone, Debug)]
pub struct QuakeMap {
    /// Its open leaves are the regions.
    pub tree: LeafTree,
    /// Number of clusters.
    pub clusters: usize,
    /// Number of surfaces without triangles, which are not items: flares.
    pub bare: usize,
    /// Bytes per row, and a row of bits for each cluster.
    ///
    /// `None` if the map has no visibility table.
    seen: Option<(usize, Vec<u8>)>,
}

/// Recognises a map by its magic; also matches formats that are refused by name.
pub fn is_ibsp(bytes: &[u8]) -> bool {
    let mut others = OTHERS.iter().map(|other| other.0);
    bytes.starts_with(b"IBSP") || others.any(|magic| bytes.starts_with(magic))
}

impl QuakeMap {
    fn read(bytes: &[u8], file: &str) -> Result<QuakeMap> {
        let lump = |number| lump(bytes, file, number);
        let (nodes, leaves, visibility) = (lump(3)?, lump(4)?, lump(16)?);
        let stated = |at| match visibility.len() {
            0..8 => None,
            _ => usize::try_from(visibility.int(0, at)).ok(),
        };
        let table = stated(0).zip(stated(4)).filter(|&(count, row_bytes)| {
            let rows = count.checked_mul(row_bytes);
            count.div_ceil(8) <= row_bytes && rows.is_some_and(|rows| rows <= visibility.len() - 8)
        });
        if table.is_none() && visibility.len() > 0 {
            let found = format!("visibility of {} bytes", visibility.len());
            let expected = "a count, bytes of a row, and a row of bits for each cluster";
            return Err(visibility.error(0, 0, found, expected));
        }
        let count = table.map(|(count, _)| count);
        let tree = LeafTree::read(&nodes, &leaves, &lump(2)?, count)?;
        let last = tree.clusters.iter().max();
        Ok(QuakeMap {
            clusters: count.unwrap_or(last.map_or(0, |&last| last as usize + 1)),
            bare: 0,
            seen: table.map(|(count, row_bytes)| {
                let rows = &visibility.data[8..8 + count * row_bytes];
                (row_bytes, rows.to_vec())
            }),
            tree,
        })
    }

    /// The map's visibility between clusters.
    ///
    /// `None` if it has no such table: all clusters then see each other.
    pub fn sees(&self) -> Option<impl Fn(u32, u32) -> bool> {
        let (row_bytes, rows) = self.seen.as_ref()?;
        Some(move |from: u32, to: u32| {
            let at = from as usize * row_bytes + to as usize / 8;
            rows[at] >> (to % 8) & 1 == 1
        })
    }
}

/// Effect of a shader on light.
fn kind_of(shaders: &Table, shader: usize, is_drawn: bool) -> SurfaceKind {
    let [flags, contents] = [64, 68].map(|at| shaders.int(shader, at));
    let hides = contents & (SOLID | TRANSLUCENT) == SOLID;
    match hides && !(is_drawn && flags & NO_DRAW != 0) {
        true => SurfaceKind::Opaque,
        false => SurfaceKind::Clear,
    }
}

/// Reads a map as a scene: surfaces first, then brushes, in the order of the file.
///
/// # Errors
/// The first value that the format does not allow, by its byte.
pub fn read_ibsp(bytes: &[u8], file: &str, name: &str, options: &LoadOptions) -> Result<Scene> {
    let mut map = QuakeMap::read(bytes, file)?;
    let lump = |number| lump(bytes, file, number);
    let (surfaces, brushes, shaders) = (lump(13)?, lump(8)?, lump(1)?);
    check_counts(lump, name, options)?;
    let (mut boxes, mut kinds) = (Vec::new(), Labels::new("kind"));
    let mut all = Surfaces::about(DVec3::ZERO);
    let mut push = |label, kind, bounds: &Aabb, faces: Option<&Faces>| {
        boxes.push(WorldBox::of(bounds, DVec3::ZERO));
        kinds.push(label);
        match faces {
            Some((points, triangles)) => all.push(kind, false, points, triangles),
            None => all.push_box(kind, bounds),
        }
    };
    let all_but = |other| move |_: &usize| options.items != other;
    for surface in (0..surfaces.len()).filter(all_but(ItemKind::Brushes)) {
        let shader = surfaces.index(surface, 0, &shaders)?;
        match faces_of(&surfaces, surface, [&lump(10)?, &lump(11)?])? {
            Some((label, bounds, faces)) => {
                let kind = kind_of(&shaders, shader, true);
                push(label, kind, &bounds, Some(&faces));
            }
            None => map.bare += 1,
        }
    }
    let (planes, sides) = (lump(2)?, lump(9)?);
    for at in (0..brushes.len()).filter(all_but(ItemKind::Surfaces)) {
        let of_brush = brushes.range(at, 0, &sides)?.map(|side| {
            let plane = sides.index(side, 0, &planes)?;
            Ok((planes.vector(plane, 0)?, planes.float(plane, 12)?))
        });
        let of_brush = of_brush.collect::<Result<Vec<_>>>()?;
        let bounds = brush_box(&brushes, at, &of_brush)?;
        let kind = kind_of(&shaders, brushes.index(at, 8, &shaders)?, false);
        let label = match kind {
            SurfaceKind::Opaque => "brush",
            _ => "volume",
        };
        push(label, kind, &bounds, brush(&of_brush, &bounds).as_ref());
    }
    // Coordinates are f32 in the file: the origin is zero.
    let scene = Scene::about(name, &boxes, DVec3::ZERO)?;
    Ok(Scene {
        unit: Some("map units"),
        surfaces: Some(Arc::new(all)),
        own_tree: Some(map.tree.plane_tree()),
        regions: Regions::Leaves(Arc::new(map)),
        labels: vec![kinds],
        places: places(&String::from_utf8_lossy(lump(0)?.data), file),
        ..scene
    })
}

/// Refuses a map whose surfaces or brushes share their parts.
///
/// It would be much larger in memory than in the file.
fn check_counts<'a>(
    lump: impl Fn(usize) -> Result<Table<'a>>,
    name: &str,
    options: &LoadOptions,
) -> Result<()> {
    let (surfaces, vertices, corners) = (lump(13)?, lump(10)?, lump(11)?);
    let (brushes, sides) = (lump(8)?, lump(9)?);
    let total = |table: &Table, at, of: &Table| -> Result<u64> {
        let counts = (0..table.len()).map(|i| Ok(table.range(i, at, of)?.len() as u64));
        counts.sum()
    };
    let points = total(&surfaces, 12, &vertices)?;
    let (ends, faces) = (total(&surfaces, 20, &corners)?, total(&brushes, 0, &sides)?);
    let most = [1, MOST_CORNERS].map(|each| each * vertices.len() as u64);
    let most = [most[0], most[1], sides.len() as u64];
    if points > most[0] || ends > most[1] || faces > most[2] {
        let found = format!("{points} vertices, {ends} indices and {faces} sides in all");
        return Err(surfaces.error(0, 0, found, format!("at most {most:?}")));
    }
    let items = (surfaces.len() + brushes.len()) as u64;
    let triangles = ends / 3 + points * PER_PATCH as u64 / 4 + 4 * faces;
    options.check_fits(name, Some(items), triangles)
}

type Surface = (&'static str, Aabb, Faces);

/// Kind, box and triangles of a surface, if it has any.
fn faces_of(
    surfaces: &Table,
    i: usize,
    [vertices, corners]: [&Table; 2],
) -> Result<Option<Surface>> {
    let of_vertex = |vertex| vertices.vector(vertex, 0);
    let points = surfaces.range(i, 12, vertices)?.map(of_vertex);
    let points = points.collect::<Result<Vec<Vec3>, _>>()?;
    let bounds = Aabb::of_points(points.iter().copied());
    let label = match surfaces.int(i, 8) {
        1 => "polygon",
        2 => {
            let sizes = [96, 100].map(|at| usize::try_from(surfaces.int(i, at)).unwrap_or(0));
            let [width, height] = sizes;
            let is_patch = sizes.iter().all(|size| size % 2 == 1 && *size >= 3);
            if !is_patch || width.checked_mul(height) != Some(points.len()) {
                let found = format!("a patch of {width} x {height} of {} points", points.len());
                return Err(surfaces.error(i, 96, found, "odd numbers from 3 on"));
            }
            return Ok(Some(("patch", bounds, patch(&points, width))));
        }
        3 => "mesh",
        4 => return Ok(None),
        kind => {
            let found = format!("surface {i} of type {kind}");
            return Err(surfaces.error(i, 8, found, "1 to 4"));
        }
    };
    let of_corner = |at: usize| match corners.int(at, 0) {
        corner if (0..points.len() as i64).contains(&corner.into()) => Ok(corner as u32),
        corner => {
            let found = format!("vertex {corner} of surface {i}");
            Err(corners.error(at, 0, found, format!("less than {}", points.len())))
        }
    };
    let order = surfaces.range(i, 20, corners)?.map(of_corner);
    let order = order.collect::<Result<Vec<u32>, _>>()?;
    // Clockwise as seen from the front.
    let triangles = order.chunks_exact(3).map(|c| [c[0], c[2], c[1]]);
    let triangles: Vec<[u32; 3]> = triangles.collect();
    Ok((!triangles.is_empty()).then_some((label, bounds, (points, triangles))))
}

/// The places where players start, in their direction of view.
fn places(entities: &str, file: &str) -> Vec<CameraPlace> {
    let (mut places, mut bad, mut moved) = (Vec::new(), 0, 0);
    let (entities, is_whole) = entities_of(entities);
    for words in entities {
        let value = |key: &str| {
            let mut pairs = words.chunks_exact(2);
            let pair = pairs.find(|pair| pair[0].eq_ignore_ascii_case(key));
            pair.map(|pair| pair[1])
        };
        let numbers = |key: &str| -> Option<Vec<f64>> {
            let number = |word: &str| word.parse::<f32>().ok().map(f64::from);
            value(key)?.split_whitespace().map(number).collect()
        };
        let class = value("classname").unwrap_or_default();
        let is_of_team = class.ends_with("spawn") || class.ends_with("player");
        if !(class.starts_with("info_player_") || class.starts_with("team_CTF_") && is_of_team) {
            let is_part = value("model").is_some_and(|model| model.starts_with('*'));
            let has_origin = numbers("origin").is_some_and(|at| at.iter().any(|x| *x != 0.0));
            moved += usize::from(is_part && has_origin);
            continue;
        }
        let of_three = |key| <[f64; 3]>::try_from(numbers(key)?).ok().map(DVec3::from);
        let yaw = || numbers("angle")?.first().copied();
        let angles = of_three("angles").or_else(|| Some(DVec3::Y * yaw()?));
        let angles = angles.unwrap_or_default();
        let Some(origin) = of_three("origin").filter(|at| at.is_finite() && angles.is_finite())
        else {
            bad += 1;
            continue;
        };
        let [pitch, yaw] = [angles.x, angles.y].map(f64::to_radians);
        let level = libm::cos(pitch);
        // The scoreboard camera stands exactly at its place.
        let is_camera = class == "info_player_intermission";
        let height = if is_camera { 0.0 } else { EYE_HEIGHT };
        places.push(CameraPlace {
            eye: origin + DVec3::Z * height,
            forward: DVec3::new(
                libm::cos(yaw) * level,
                libm::sin(yaw) * level,
                -libm::sin(pitch),
            ),
            view: None,
        });
    }
    let bad = (bad, "spawn point", "without a place, left out");
    let what = "with an origin, where the file has it and not there";
    let open = (!is_whole).into();
    let lost = "in the entities not closed: places may be missing";
    let open = (open, "quote, comment or brace", lost);
    note_counted(file, [bad, (moved, "part", what), open]);
    places
}

/// Keys and values of each entity, alternating; false if something is not closed.
fn entities_of(mut text: &str) -> (Vec<Vec<&str>>, bool) {
    let (mut all, mut words, mut is_whole) = (Vec::new(), Vec::new(), true);
    while let Some(at) = text.find(['"', '{', '}', '/']) {
        let rest = &text[at + 1..];
        let mut split = |end| {
            is_whole &= rest.contains(end);
            rest.split_once(end).unwrap_or((rest, ""))
        };
        text = match text.as_bytes()[at] {
            b'"' => {
                let (word, rest) = split("\"");
                words.push(word);
                rest
            }
            b'/' if rest.starts_with('/') => rest.trim_start_matches(|c| c != '\n'),
            b'/' if rest.starts_with('*') => split("*/").1,
            brace @ (b'{' | b'}') => {
                // The brace before, or a quote, is not closed.
                is_whole &= brace == b'}' && words.len().is_multiple_of(2) || words.is_empty();
                all.push(std::mem::take(&mut words));
                rest
            }
            _ => rest,
        };
    }
    is_whole &= words.is_empty();
    all.push(words);
    (all, is_whole)
}

#[cfg(test)]
mod tests;
