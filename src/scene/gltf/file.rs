//! A glTF file with its buffers, and access by its indices and accessors.
//!
//! Chunks of a GLB are read here: the reader of the crate gltf panics on a short one.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Display;
use std::path::Path;
use std::rc::Rc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use glam::{DMat4, DVec3, DVec4};
use gltf::json::accessor::{Accessor, ComponentType};
use gltf::json::buffer::View;
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Index, Node, Root, Value};
use serde::Deserialize;

use crate::input::{InputError, Result, read_file};
use crate::scene::memory;
use crate::shown::{message, plain, shortened};

/// Bytes of a parsed node, the most common object.
const BYTES_PER_OBJECT: u64 = (size_of::<Node>() + size_of::<ExactNode>()) as u64;

/// JSON and binary chunk of a GLB of version 2; `None` if truncated.
fn glb(bytes: &[u8]) -> Option<(&[u8], Option<&[u8]>)> {
    let number = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?) as usize);
    let bytes = bytes.get(..number(8)?)?;
    let chunk = |at: usize| {
        let end = at + 8 + number(at)?;
        Some((bytes.get(at + 4..at + 8)?, bytes.get(at + 8..end)?))
    };
    let (_, json) = chunk(12).filter(|(kind, _)| *kind == b"JSON")?;
    let mut at = 20 + json.len();
    while at + 8 <= bytes.len() {
        let (kind, body) = chunk(at)?;
        if kind == b"BIN\0" {
            return Some((json, Some(body)));
        }
        at += 8 + body.len();
    }
    Some((json, None))
}

/// Parses JSON that glTF 2.0 allows and the typed form refuses.
///
/// Channels without a node, scenes without nodes, numbers beyond f32.
fn lenient(mut json: Value) -> Option<Root> {
    let scenes = json.get_mut("scenes").and_then(Value::as_array_mut);
    for scene in scenes.into_iter().flatten() {
        let nodes = scene.as_object_mut()?.entry("nodes");
        nodes.or_insert_with(|| Value::Array(Vec::new()));
    }
    let animations = json.get_mut("animations").and_then(Value::as_array_mut);
    for animation in animations.into_iter().flatten() {
        let channels = animation.get_mut("channels")?.as_array_mut()?;
        channels.retain(|channel| !channel["target"]["node"].is_null());
    }
    serde_json::from_value(json).ok()
}

/// Nodes and cameras as stated in the file: the typed form rounds numbers to f32.
#[derive(Default, Deserialize)]
pub struct Exact {
    #[serde(default)]
    pub nodes: Vec<ExactNode>,
    #[serde(default)]
    pub cameras: Vec<Value>,
}

/// The transform of a node.
#[derive(Deserialize)]
pub struct ExactNode {
    pub matrix: Option<Box<DMat4>>,
    pub translation: Option<DVec3>,
    pub rotation: Option<DVec4>,
    pub scale: Option<DVec3>,
}

/// Reads a file whose name is relative to the scene.
pub type Beside<'b> = &'b dyn Fn(&str) -> Result<Vec<u8>>;

/// Reads a file in the folder of a scene.
pub fn beside(file: &str, name: &str) -> Result<Vec<u8>> {
    let folder = Path::new(file).parent().unwrap_or(Path::new(""));
    // `-` alone would be standard input.
    let path = folder.join(if name == "-" { "./-" } else { name });
    match path.is_file() || !path.exists() {
        true => Ok(read_file(&path)?.to_vec()),
        false => Err(InputError::at(file, "buffers", plain(name), "a plain file")),
    }
}

/// Decodes percent-encoding of a URI.
fn decoded(uri: &str) -> String {
    let mut parts = uri.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let hex = part.get(..2).filter(|_| !part.starts_with('+'));
        match hex.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) => bytes.extend([&[byte], &part.as_bytes()[2..]].concat()),
            None => bytes.extend([b"%", part.as_bytes()].concat()),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A part of the bytes, by its offset and length.
fn part(bytes: &[u8], first: u64, length: u64) -> Option<&[u8]> {
    let end = usize::try_from(first.checked_add(length)?).ok()?;
    bytes.get(first as usize..end)
}

/// A file with all of its buffers.
pub struct File<'f> {
    pub name: &'f str,
    pub root: Root,
    pub exact: Exact,
    pub buffers: Vec<Rc<Cow<'f, [u8]>>>,
    /// Bytes of all buffers.
    pub bytes: usize,
}

impl<'f> File<'f> {
    pub fn open(bytes: &'f [u8], name: &'f str, beside: Beside) -> Result<File<'f>> {
        let error = |found: String| InputError::at(name, "JSON", found, "glTF 2.0");
        let (json, mut bin) = match bytes.starts_with(b"glTF") {
            true => glb(bytes).ok_or_else(|| {
                let found = match bytes.get(4..8) {
                    Some([2, 0, 0, 0]) => "a length or chunk beyond the end, or no JSON in front",
                    _ => "a GLB of another version",
                };
                InputError::byte(name, 4, found, "a whole GLB of version 2, JSON first")
            })?,
            false => (bytes, None),
        };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        // Some exporters pad with zero bytes instead of spaces.
        let last = json.iter().rposition(|byte| *byte != 0);
        let json = &json[..last.map_or(0, |last| last + 1)];
        let objects = json.iter().filter(|byte| **byte == b'{').count() as u64;
        memory::check_fits(name, objects * BYTES_PER_OBJECT, 0, objects)?;
        let root = serde_json::from_slice(json).or_else(|e| {
            let json: Value = serde_json::from_slice(json).unwrap_or_default();
            // glTF 1.0 uses names for indices of 2.0.
            let found = match json["meshes"].is_object() {
                true => "glTF 1.0".to_owned(),
                false => message(&e.to_string()),
            };
            lenient(json).ok_or_else(|| error(found))
        });
        let root: Root = root?;
        let (own, least) = (&root.asset.version, root.asset.min_version.as_ref());
        let other = Some(own).filter(|own| !own.starts_with("2."));
        if let Some(version) = other.or(least.filter(|least| *least != "2.0")) {
            let version = shortened(version, 20);
            return Err(error(format!("glTF of version '{version}'")));
        }
        let exact = serde_json::from_slice(json).map_err(|e| error(message(&e.to_string())))?;
        let mut file = File {
            name,
            root,
            exact,
            buffers: Vec::new(),
            bytes: 0,
        };
        let listed = std::mem::take(&mut file.root.buffers);
        // Thousands of buffers may refer to one file.
        let mut linked: HashMap<&str, Rc<Cow<[u8]>>> = HashMap::new();
        for (index, buffer) in listed.iter().enumerate() {
            let bytes = match &buffer.uri {
                None => Rc::new(Cow::Borrowed(bin.take().unwrap_or_default())),
                Some(uri) => match linked.get(uri.as_str()) {
                    Some(known) => known.clone(),
                    None => Rc::new(Cow::Owned(file.linked(index, uri, beside)?)),
                },
            };
            if let Some(uri) = &buffer.uri {
                linked.insert(uri, bytes.clone());
            }
            file.bytes += bytes.len();
            file.buffers.push(bytes);
        }
        file.root.buffers = listed;
        Ok(file)
    }

    fn linked(&self, buffer: usize, uri: &str, beside: Beside) -> Result<Vec<u8>> {
        let error =
            |found: &str, expected| self.error(format!("buffers[{buffer}].uri"), found, expected);
        let (head, data) = uri.split_once(',').unwrap_or((uri, ""));
        let head = head.to_ascii_lowercase();
        if head.starts_with("data:") {
            let data = STANDARD_NO_PAD.decode(decoded(data).trim_end_matches('='));
            let data = data.ok().filter(|_| head.ends_with(";base64"));
            return data.ok_or_else(|| error("bytes that are no base64", "base64 data"));
        }
        if uri.contains("://") || uri.is_empty() {
            let found = format!("'{}'", shortened(uri, 60));
            return Err(error(&found, "a file beside this one"));
        }
        let place = format!("{}, buffers[{buffer}].uri", self.name);
        beside(&decoded(uri)).map_err(|found| match found.to_string() {
            told if told.starts_with(self.name) => found,
            told => InputError::new(format_args!("{place}: {told}")),
        })
    }

    pub fn error(&self, place: impl Display, found: impl Display, expected: &str) -> InputError {
        InputError::at(self.name, place, found, expected)
    }

    pub fn get<'s, T>(&self, all: &'s [T], index: Index<T>, place: &str) -> Result<&'s T> {
        let index = index.value();
        all.get(index).ok_or_else(|| {
            let expected = match all.len() {
                0 => "no index, as there is nothing to name".to_owned(),
                count => format!("an index below {count}"),
            };
            self.error(place, format!("index {index}"), &expected)
        })
    }

    /// Vectors of an accessor, `width` numbers each.
    pub fn vectors(&self, index: Index<Accessor>, width: usize, place: &str) -> Result<Vec<DVec4>> {
        if let Some(why) = self.unread(index) {
            return Err(self.error(place, why, "plain accessors"));
        }
        let values = self.values(index, width, place)?;
        let vector = |numbers: &[f64]| {
            let mut vector = [0.0; 4];
            vector[..width].copy_from_slice(numbers);
            DVec4::from(vector)
        };
        Ok(values.chunks_exact(width).map(vector).collect())
    }

    /// The reason why the bytes of an accessor are not read; `None` if they are.
    pub fn unread(&self, index: Index<Accessor>) -> Option<String> {
        let accessor = self.root.accessors.get(index.value())?;
        let Some(view) = accessor.buffer_view else {
            let why = || "has accessors without bytes".to_owned();
            return accessor.sparse.is_none().then(why);
        };
        let view = self.root.buffer_views.get(view.value())?;
        let has_bytes = !self.buffers.get(view.buffer.value())?.is_empty();
        self.compressed(view.extensions.as_ref()?.others.keys(), has_bytes)
    }

    /// The reason why compressed data is not read, unless core glTF has it too.
    pub fn compressed<'e>(
        &self,
        mut extensions: impl Iterator<Item = &'e String>,
        is_plain_too: bool,
    ) -> Option<String> {
        let required = &self.root.extensions_required;
        let name = extensions.find(|name| !is_plain_too || required.contains(name))?;
        Some(format!("is compressed ({})", shortened(name, 40)))
    }

    /// Numbers of an accessor, `width` per element.
    ///
    /// Normalised if the accessor says so.
    pub fn values(&self, index: Index<Accessor>, width: usize, place: &str) -> Result<Vec<f64>> {
        let accessor = self.get(&self.root.accessors, index, place)?;
        let place = &format!("accessors[{}]", index.value());
        let no_type = || self.error(place, "no known type", "a type of glTF 2.0");
        let (Some(kind), Checked::Valid(dimensions)) = (component(accessor), accessor.type_) else {
            return Err(no_type());
        };
        if dimensions.multiplicity() != width {
            let found = format!("elements of {} numbers", dimensions.multiplicity());
            return Err(self.error(place, found, &format!("{width} numbers")));
        }
        let (count, form) = (accessor.count.0, (kind, width, accessor.normalized));
        let mut all = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.unwrap_or_default();
                self.elements(view, offset, count, form, place)?
            }
            None if count > self.bytes as u64 => {
                let expected = format!("at most {}, one for each byte of buffers", self.bytes);
                return Err(self.error(place, format!("{count} elements of zeros"), &expected));
            }
            None => vec![0.0; count as usize * width],
        };
        if let Some(sparse) = &accessor.sparse {
            let (at, own, count) = (&sparse.indices, &sparse.values, sparse.count.0);
            let Checked::Valid(of_index) = at.component_type else {
                return Err(no_type());
            };
            let of_index = (of_index.0, 1, false);
            let indices = self.elements(at.buffer_view, at.byte_offset, count, of_index, place)?;
            let values = self.elements(own.buffer_view, own.byte_offset, count, form, place)?;
            for (index, value) in indices.into_iter().zip(values.chunks_exact(width)) {
                let element = all.chunks_exact_mut(width).nth(index as usize);
                let found = || format!("sparse element {index}");
                let error = || self.error(place, found(), "an index below its count");
                element.ok_or_else(error)?.copy_from_slice(value);
            }
        }
        Ok(all)
    }

    /// Numbers of elements of a view, with their type, width and normalisation.
    fn elements(
        &self,
        view: Index<View>,
        offset: USize64,
        count: u64,
        (kind, width, is_normalised): (ComponentType, usize, bool),
        place: &str,
    ) -> Result<Vec<f64>> {
        let of_view = format!("{place}.bufferView");
        let view = self.get(&self.root.buffer_views, view, &of_view)?;
        let buffer = Index::new(view.buffer.value() as u32);
        let buffer = self.get(&self.buffers, buffer, place)?;
        if buffer.is_empty() {
            let place = format!("buffers[{}]", view.buffer.value());
            return Err(self.error(place, "no bytes", "a uri, or the BIN chunk of a GLB"));
        }
        let size = kind.size() * width;
        let stride = view.byte_stride.filter(|_| count > 1);
        let stride = stride.map_or(size, |stride| stride.0);
        let first = view.byte_offset.unwrap_or_default().0;
        let bytes = part(buffer, first, view.byte_length.0);
        let needed = (count.saturating_sub(1)).saturating_mul(stride as u64);
        let needed = needed.saturating_add(size as u64);
        let own = bytes.and_then(|bytes| part(bytes, offset.0, needed));
        let Some(own) = own.filter(|_| stride >= size) else {
            let found = format!("{count} elements that end behind their buffer");
            return Err(self.error(place, found, "elements within it"));
        };
        let elements = own.chunks(stride).take(count as usize);
        let numbers = elements.flat_map(|element| element[..size].chunks_exact(kind.size()));
        let numbers = numbers.map(|bytes| number(bytes, kind, is_normalised));
        Ok(numbers.collect())
    }
}

pub fn component(accessor: &Accessor) -> Option<ComponentType> {
    match accessor.component_type {
        Checked::Valid(kind) => Some(kind.0),
        Checked::Invalid => None,
    }
}

/// A little-endian number; a fraction if it is normalised.
fn number(bytes: &[u8], kind: ComponentType, is_normalised: bool) -> f64 {
    let mut four = [0; 4];
    four[..bytes.len()].copy_from_slice(bytes);
    let word = u32::from_le_bytes(four);
    let raw = match kind {
        ComponentType::I8 => f64::from(word as i8),
        ComponentType::I16 => f64::from(word as i16),
        ComponentType::F32 => f64::from(f32::from_bits(word)),
        ComponentType::U8 | ComponentType::U16 | ComponentType::U32 => f64::from(word),
    };
    normalised(raw, kind, is_normalised)
}

/// A component, normalised if its accessor says so: glTF 2.0, section 3.11.
///
/// f32 as in the file's bytes.
pub fn normalised(raw: f64, kind: ComponentType, is_normalised: bool) -> f64 {
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
