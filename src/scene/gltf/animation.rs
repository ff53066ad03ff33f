//! Cameras of a glTF file: lenses, and the animation that moves one.
//!
//! Between keys, translations and scales are interpolated linearly and rotations along the arc;
//! cubic splines by Hermite's polynomials.

use std::array;
use std::collections::{BTreeSet, HashMap};
use std::iter::successors;
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, DVec4};
use gltf::json::Value;
use gltf::json::animation::{Channel, Interpolation, Property};
use gltf::json::validation::Checked;

use super::Order;
use super::file::File;
use crate::input::Result;
use crate::scene::{CameraPlace, PlaceView};
use crate::shown::counted;

/// The animated camera of a file.
#[derive(Clone, Debug)]
pub struct CameraAnimation {
    /// Transforms from the root to the camera.
    chain: Vec<Motion>,
    lens: Option<PlaceView>,
    /// Seconds of the first and of the last key.
    pub seconds: [f64; 2],
    /// Number of cameras that animations move.
    pub cameras: usize,
    /// Number of animations that move this one.
    pub clips: usize,
}

impl CameraAnimation {
    /// The camera at a time in seconds; `None` if its transform has no direction.
    pub fn at(&self, time: f64) -> Option<CameraPlace> {
        let own = self.chain.iter().map(|motion| motion.at(time));
        let world = own.fold(DAffine3::IDENTITY, |above, own| above * own);
        place_of(world, self.lens)
    }
}

/// Translation, rotation and scale; `None` if not stated.
pub type Parts = [Option<DVec4>; 3];

/// Transform of a node over time.
#[derive(Clone, Debug)]
struct Motion {
    still: DAffine3,
    parts: Parts,
    tracks: [Option<Arc<Track>>; 3],
}

/// Animation, index in it, animated part, and the channel itself.
type Moving<'f> = (usize, usize, usize, &'f Channel);

/// Tracks by input, output, width and interpolation; channels may share one.
type Tracks = HashMap<[usize; 4], Arc<Track>>;

#[derive(Clone, Debug)]
struct Track {
    times: Vec<f64>,
    /// One per time; three for a cubic spline: a value between its tangents.
    values: Vec<DVec4>,
    interpolation: Interpolation,
}

impl Motion {
    fn at(&self, time: f64) -> DAffine3 {
        if self.tracks.iter().all(Option::is_none) {
            return self.still;
        }
        transform(array::from_fn(|part| match &self.tracks[part] {
            Some(track) => Some(track.at(time, part == 1)),
            None => self.parts[part],
        }))
    }
}

impl Track {
    fn at(&self, time: f64, is_rotation: bool) -> DVec4 {
        let next = self.times.partition_point(|key| *key <= time);
        let last = next.saturating_sub(1);
        let is_cubic = self.interpolation == Interpolation::CubicSpline;
        let value = |key: usize| self.values[if is_cubic { 3 * key + 1 } else { key }];
        let is_between = next > 0 && next < self.times.len();
        if !is_between || self.interpolation == Interpolation::Step {
            return value(last);
        }
        let (from, to) = (value(last), value(next));
        let length = self.times[next] - self.times[last];
        let share = (time - self.times[last]) / length;
        match is_rotation {
            _ if is_cubic => {
                let (square, rest) = (share * share, 1.0 - share);
                let [leaves, arrives] = [self.values[3 * last + 2], self.values[3 * next]];
                let bent = leaves * (rest * rest * share) - arrives * (square * rest);
                from.lerp(to, square * (3.0 - 2.0 * share)) + bent * length
            }
            false => from.lerp(to, share),
            true => {
                let [from, to] = [from, to].map(|v| DQuat::from_vec4(v).normalize());
                from.slerp(to, share).into()
            }
        }
    }
}

/// A camera with this transform; `None` if it has no direction.
pub fn place_of(world: DAffine3, lens: Option<PlaceView>) -> Option<CameraPlace> {
    let [forward, up] =
        [DVec3::NEG_Z, DVec3::Y].map(|axis| world.transform_vector3(axis).normalize_or_zero());
    (forward != DVec3::ZERO).then_some(CameraPlace {
        eye: world.translation,
        forward,
        view: lens.map(|lens| PlaceView { up, ..lens }),
    })
}

/// The affine transform of its parts.
pub fn transform([moved, turned, scaled]: Parts) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        scaled.map_or(DVec3::ONE, DVec4::truncate),
        turned.map_or(DQuat::IDENTITY, |r| DQuat::from_vec4(r).normalize()),
        moved.map_or(DVec3::ZERO, DVec4::truncate),
    )
}

/// The lens of a camera; its up vector is meaningless.
fn lens(camera: &Value) -> Option<PlaceView> {
    let lens = &camera[camera["type"].as_str()?];
    let number = |name: &str| lens[name].as_f64();
    // A negative sign mirrors the view: the volume is the same.
    let half = |name: &str| number(name).map(f64::abs);
    let aspect = || Some(half("xmag")? / half("ymag")?);
    Some(PlaceView {
        up: DVec3::Y,
        fovy_deg: number("yfov").map(f64::to_degrees),
        ortho_height: half("ymag").map(|half| 2.0 * half),
        aspect: number("aspectRatio").or_else(aspect),
        near: number("znear")?,
        far: number("zfar"),
    })
}

impl File<'_> {
    /// Lens of the camera of a node, if it states one.
    pub fn lens_of(&self, node: usize) -> Result<Option<PlaceView>> {
        let Some(camera) = self.root.nodes[node].camera else {
            return Ok(None);
        };
        let place = format!("nodes[{node}].camera");
        self.get(&self.root.cameras, camera, &place)?;
        let lens = lens(&self.exact.cameras[camera.value()]);
        let place = || format!("cameras[{}]", camera.value());
        let expected = "type 'perspective' or 'orthographic', with the object of that name";
        let error = || self.error(place(), "no lens", expected);
        lens.map(Some).ok_or_else(error)
    }

    /// The first camera that an animation moves, by its first animation.
    pub fn camera_animation(&self, order: &Order) -> Result<Option<CameraAnimation>> {
        let mut channels: HashMap<usize, Vec<Moving>> = HashMap::new();
        for (clip, animation) in self.root.animations.iter().enumerate() {
            for (number, channel) in animation.channels.iter().enumerate() {
                if let Some(part) = part(channel) {
                    let own = channels.entry(channel.target.node.value()).or_default();
                    own.push((clip, number, part, channel));
                }
            }
        }
        let moved = self.below(order, |node| channels.contains_key(&node));
        let is_animated = |node: &usize| moved[*node] && self.root.nodes[*node].camera.is_some();
        let animated = order.iter().map(|(node, _)| *node).filter(is_animated);
        let Some(camera) = animated.clone().next() else {
            return Ok(None);
        };
        let parents: HashMap<usize, Option<usize>> = order.iter().copied().collect();
        let mut nodes: Vec<usize> = successors(Some(camera), |node| parents[node]).collect();
        nodes.reverse();
        let own = nodes.iter().filter_map(|node| channels.get(node)).flatten();
        let clips: BTreeSet<usize> = own.map(|(clip, ..)| *clip).collect();
        let (mut chain, mut known) = (Vec::new(), Tracks::new());
        let mut seconds = [f64::INFINITY, f64::NEG_INFINITY];
        for index in nodes {
            let mut tracks = [None, None, None];
            let own = channels.get(&index).into_iter().flatten();
            for own in own.filter(|own| clips.first() == Some(&own.0)) {
                let track = self.track(own, &mut known)?;
                seconds[0] = seconds[0].min(track.times[0]);
                seconds[1] = seconds[1].max(track.times[track.times.len() - 1]);
                tracks[own.2] = Some(track);
            }
            chain.push(Motion {
                still: self.local(index)?,
                parts: self.parts(index),
                tracks,
            });
        }
        Ok(Some(CameraAnimation {
            chain,
            lens: self.lens_of(camera)?,
            seconds,
            cameras: animated.count(),
            clips: clips.len(),
        }))
    }

    fn track(&self, own: &Moving, known: &mut Tracks) -> Result<Arc<Track>> {
        let &(clip, number, part, channel) = own;
        let place = &format!("animations[{clip}].channels[{number}]");
        let samplers = &self.root.animations[clip].samplers;
        let sampler = self.get(samplers, channel.sampler, place)?;
        let width = if part == 1 { 4 } else { 3 };
        let (interpolation, each) = match sampler.interpolation {
            Checked::Valid(Interpolation::CubicSpline) => (Interpolation::CubicSpline, 3),
            Checked::Valid(other) => (other, 1),
            _ => return Err(self.error(place, "an unknown interpolation", "LINEAR")),
        };
        let (input, output) = (sampler.input, sampler.output);
        let key = [input.value(), output.value(), width, interpolation as usize];
        if let Some(track) = known.get(&key) {
            return Ok(track.clone());
        }
        let times = self.vectors(input, 1, place)?;
        let times: Vec<f64> = times.iter().map(|time| time.x).collect();
        let values = self.vectors(output, width, place)?;
        let ascend = times.is_sorted_by(|a, b| a < b) && times.iter().all(|t| t.is_finite());
        if !ascend || times.is_empty() || each * times.len() != values.len() {
            let counts = [counted(times.len(), "time"), counted(values.len(), "value")];
            let found = match ascend {
                true => counts.join(" and "),
                false => "times that do not ascend".to_owned(),
            };
            let expected = format!("ascending times with {} each", counted(each, "value"));
            return Err(self.error(place, found, &expected));
        }
        let track = Arc::new(Track {
            times,
            values,
            interpolation,
        });
        known.insert(key, track.clone());
        Ok(track)
    }
}

/// Part of a transform that a channel animates; `None` for another property.
pub fn part(channel: &Channel) -> Option<usize> {
    match channel.target.path {
        Checked::Valid(Property::Translation) => Some(0),
        Checked::Valid(Property::Rotation) => Some(1),
        Checked::Valid(Property::Scale) => Some(2),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use serde_json::json;

    use crate::scene::gltf::tests::{animated, animation_of, read};

    #[test]
    fn channels_of_one_sampler_share_its_keys() {
        let mut file = animated();
        file["scenes"][0]["nodes"] = json!([3]);
        let nodes = file["nodes"].as_array_mut().unwrap();
        nodes.push(json!({"children": [2]}));
        let mut channel = file["animations"][0]["channels"][0].clone();
        channel["target"]["node"] = json!(3);
        let channels = file["animations"][0]["channels"].as_array_mut().unwrap();
        channels.push(channel);
        let scene = read(&file).unwrap();
        let chain = &animation_of(&scene).chain;
        let tracks: Vec<_> = chain
            .iter()
            .flat_map(|own| own.tracks.iter().flatten())
            .collect();
        assert!(tracks.len() == 2 && Arc::ptr_eq(tracks[0], tracks[1]));
    }
}
