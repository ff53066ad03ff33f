//! The properties of a structure that follows its items: refitted, or built
//! anew where it declines.

use super::*;

/// Brings an index up to date: by refitting where it can, else by building.
/// An index that cannot must not have changed.
fn update<T: FrustumQuery>(
    index: &mut T,
    items: &[Aabb],
    moved: &[ItemId],
    questions: &Questions,
) -> Result<(), String> {
    let before = questions.answers(index);
    if index.refit(items, moved) {
        return Ok(());
    }
    ensure(before == questions.answers(index), || {
        format!(
            "{} on '{}': refit refused, but changed the structure",
            T::INFO.name,
            questions.scene
        )
    })?;
    *index = build(&questions.scene, items)?;
    Ok(())
}

/// After 0.1 %, 1 %, 10 % and 100 % of the items have moved, one after the
/// other, a structure that refits answers as one built anew.
pub fn refit_equals_a_fresh_build<T: FrustumQuery>() -> Result<(), String> {
    let mut scenes = generated_scenes(1000)?;
    for (name, items) in edge_scenes() {
        if ["all the same", "needles", "inverted among sound"].contains(&name) {
            scenes.push((Questions::on_edge(name, &items), items));
        }
    }
    for (mut questions, mut items) in scenes {
        let mut dice = Dice::new(11);
        let width = f64::from(Aabb::union_of(&items).extent().max_element());
        let mut index: T = build(&questions.scene, &items)?;
        update(&mut index, &items, &[], &questions)?;
        for step in [1000, 100, 10, 1] {
            let moved: Vec<ItemId> = (0..items.len() as ItemId)
                .skip(step / 3)
                .step_by(step)
                .collect();
            for (at, &id) in moved.iter().enumerate() {
                // Most move a little, some far.
                let far = if at % 5 == 0 { 0.5 } else { 0.01 };
                let by = (dice.normal3() * width * far).as_vec3();
                let b = &mut items[id as usize];
                *b = Aabb::new(b.min + by, b.max + by);
            }
            update(&mut index, &items, &moved, &questions)?;
            questions.points = points(&items);
            let moved_points = moved.iter().take(20).map(|&id| items[id as usize].max);
            questions.points.extend(moved_points);
            let right = questions
                .visible_is_right(&index, &items)
                .and_then(|()| questions.locate_is_right(&index, &items));
            right.map_err(|error| format!("after {} moves: {error}", moved.len()))?;
        }
    }
    Ok(())
}

/// An item that becomes empty is gone, and one that becomes sound is there.
pub fn items_that_come_and_go_are_followed<T: FrustumQuery>() -> Result<(), String> {
    for (name, mut items) in edge_scenes() {
        if !["one", "coplanar", "inverted among sound", "only inverted"].contains(&name) {
            continue;
        }
        let questions = Questions::on_edge(name, &items);
        let mut index: T = build(name, &items)?;
        let flip = |b: &Aabb| Aabb::new(b.max, b.min);
        let last = items.len() - 1;
        // The first and the last turn about (a sound box becomes empty and
        // the other way round) and back, then all of them at once.
        let steps = [vec![0], vec![0], vec![last], vec![last]];
        let all: Vec<ItemId> = (0..items.len() as ItemId).collect();
        let ids = |step: Vec<usize>| step.into_iter().map(|i| i as ItemId).collect();
        for moved in steps.map(ids).into_iter().chain([all.clone(), all]) {
            for &id in &moved {
                items[id as usize] = flip(&items[id as usize]);
            }
            update(&mut index, &items, &moved, &questions)?;
            let right = questions
                .visible_is_right(&index, &items)
                .and_then(|()| questions.locate_is_right(&index, &items));
            right.map_err(|error| format!("{} items turned about: {error}", moved.len()))?;
        }
    }
    Ok(())
}
