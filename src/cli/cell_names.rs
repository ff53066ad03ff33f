//! Names of cells: in a sentence, in a column of a table, and in few characters.

use super::text;
use crate::culling::{Culling, CullingTest};
use crate::measure::{CellKey, GroupKey};
use crate::shown::{plain, shortened, without_middle};

/// A cell by its name in a sentence.
pub fn name(cell: &CellKey) -> String {
    let (structure, scene) = (&cell.structure, &cell.group.scene);
    format!("{structure} on {scene}, {}", question(&cell.group))
}

/// Structure in at most twenty characters; its last parameter stays.
pub fn short_structure(name: &str) -> String {
    without_middle(&plain(name), [8, 9])
}

/// Scene and path in short, with the test and the cache state that are no defaults.
///
/// At most `room` characters; the scene is cut first.
pub fn place(group: &GroupKey, room: usize, short: fn(&str) -> String) -> String {
    let other = |text: &String, usual: &str| (text != usual).then(|| text.clone());
    let test = other(&group.test, CullingTest::SixPlane.name());
    let cache = other(&group.cache, "warm");
    let motion = other(&group.motion, "").map(|motion| short(&motion));
    let parts = [Some(short(&group.path)), test, cache, motion];
    let parts = parts.into_iter().flatten().chain(unusual(group));
    let rest: String = parts.map(|part| format!(" {part}")).collect();
    let scene = short(&group.scene);
    if text::across(&scene) + text::across(&rest) <= room {
        return scene + &rest;
    }
    let most = room.saturating_sub(3);
    let left = most.saturating_sub(text::across(&rest) + 3).max(8);
    shortened(&(shortened(&scene, left) + &rest), most)
}

/// All of a key that is no default, but for the scene.
pub fn question(group: &GroupKey) -> String {
    let cold = Some(&group.cache).filter(|cache| *cache != "warm");
    let test = group.test.clone() + &text::some(cold, |cache| format!(" ({cache})"));
    let asked = [group.path.clone(), test, group.motion.clone()];
    text::joined(asked.into_iter().chain(unusual(group)))
}

/// Arithmetic, plane derivation and epsilon, where they are no defaults.
fn unusual(group: &GroupKey) -> impl Iterator<Item = String> {
    let usual = GroupKey::of("", "", false, &Culling::default(), "");
    let epsilon = |key: &GroupKey| format!("epsilon {}", key.epsilon);
    let facts = |key: &GroupKey| [key.arithmetic.clone(), key.planes.clone(), epsilon(key)];
    let both = facts(group).into_iter().zip(facts(&usual));
    both.filter(|(own, usual)| own != usual).map(|(own, _)| own)
}
