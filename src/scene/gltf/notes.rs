//! Notes about parts of a glTF file that are ignored or drawn differently.

use std::collections::{BTreeMap, HashSet};

use gltf::json::validation::Checked;

use super::animation::part;
use super::file::File;
use super::mesh::Mesh;
use super::{Order, Placed};
use crate::input::{note, note_counted};
use crate::shown::{counted, first_of, shortened};

/// Parts of names of extensions that need no note.
///
/// They are read, have their own note, or do not change geometry.
#[rustfmt::skip]
const HARMLESS: [&str; 7] =
    ["compression", "instancing", "lights", "materials", "quantization", "texture", "visibility"];

impl File<'_> {
    /// Marks the nodes of a kind and all nodes below them.
    pub fn below(&self, order: &Order, is_of_kind: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut marked = vec![false; self.root.nodes.len()];
        for &(node, parent) in order {
            marked[node] = is_of_kind(node) || parent.is_some_and(|parent| marked[parent]);
        }
        marked
    }

    /// Notes items that are boxes, or have parts that are.
    pub fn note_without_triangles(&self, placed: &[Placed], meshes: &[Mesh]) {
        let reason = |item: &Placed| Some((meshes[item.mesh].reason.as_ref()?, item.mesh));
        let met = placed.iter().rev().filter_map(reason);
        let count = counted(met.clone().count(), "item");
        let what = match placed.iter().any(|item| meshes[item.mesh].has_own) {
            true => &format!("{count} with parts without triangles, which hide nothing"),
            false => "items are boxes without triangles",
        };
        // The first mesh of each reason.
        let met: BTreeMap<&String, usize> = met.collect();
        let line = |(reason, mesh): (&String, usize)| format!("meshes[{mesh}] {reason}");
        let met: Vec<String> = met.into_iter().map(line).collect();
        if !met.is_empty() {
            note(&format!("{}: {what}: {}", self.name, first_of(&met, 3)));
        }
    }

    /// Notes unread parts and differences in drawing; `cameras` have a direction.
    #[rustfmt::skip]
    pub fn note_unread(&self, placed: &[Placed], order: &Order, cameras: usize) {
        let (root, nodes) = (&self.root, &self.root.nodes);
        let channels = root.animations.iter().flat_map(|clip| &clip.channels);
        let channels = channels.filter(|c| matches!(c.target.path, Checked::Valid(_)));
        let (moving, morphing): (Vec<_>, Vec<_>) = channels.partition(|c| part(c).is_some());
        let [moving, morphing] = [moving, morphing].map(|channels| -> HashSet<usize> {
            channels.into_iter().map(|c| c.target.node.value()).collect()
        });
        let moved = self.below(order, |node| moving.contains(&node));
        let hidden = self.below(order, |node| {
            let own = nodes[node].extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
            own.is_some_and(|own| own["visible"] == false)
        });
        let is_morphed = |item: &Placed| {
            let own = nodes[item.node].weights.as_ref();
            let mut weights = own.or(root.meshes[item.mesh].weights.as_ref()).into_iter().flatten();
            morphing.contains(&item.node) || weights.any(|weight| *weight != 0.0)
        };
        let items = |is: &dyn Fn(&Placed) -> bool| placed.iter().filter(|item| is(item)).count();
        let read = |is: &dyn Fn(usize) -> bool| order.iter().filter(|(node, _)| is(*node)).count();
        let is_used = |node: usize| nodes[node].mesh.is_some() || nodes[node].camera.is_some();
        let used = (0..nodes.len()).filter(|node| is_used(*node)).count();
        note_counted(self.name, [
            (items(&|i| nodes[i.node].skin.is_some()), "item", "with a skin, placed by its node and not by joints"),
            (items(&is_morphed), "item", "with morph weights, as stored and not morphed"),
            (items(&|i| moved[i.node]), "item", "that an animation moves, placed where its node stands: it is not played"),
            (items(&|i| hidden[i.node]), "item", "hidden by KHR_node_visibility, read all the same"),
            (read(&|n| nodes[n].camera.is_some()) - cameras, "camera", "without a direction of view, left out"),
            (root.scenes.len().saturating_sub(1), "further scene", "not read"),
            (used - read(&is_used), "node", "with a mesh or a camera outside of the scene, not read"),
        ]);
        if root.extensions_used.iter().any(|name| name == "KHR_animation_pointer") {
            let what = "KHR_animation_pointer is not read: what it moves stays as it is stored";
            note(&format!("{}: {what}", self.name));
        }
        let is_unknown = |name: &&String| !HARMLESS.iter().any(|part| name.contains(part));
        let required = root.extensions_required.iter().filter(is_unknown);
        let names: Vec<String> = required.map(|name| shortened(name, 40)).collect();
        if !names.is_empty() {
            note(&format!("{}: extensions that it requires, not read: {}", self.name, first_of(&names, 8)));
        }
    }
}
