//! The properties of a structure that follows its items: refitted, or built again
//! where it declines.

use super::*;

/// Brings an index up to date: by refitting where it can, else by building.
/// An index that cannot must not have changed.
fn update<T: RegionIndex>(index: &mut T, asked: &Questions, moved: &[ItemId]) -> Outcome {
    let before = asked.answers(index);
    if index.refit(&asked.items, moved) {
        return Ok(());
    }
    ensure(before == asked.answers(index), || {
        "refit refused, but changed the structure".to_owned()
    })?;
    *index = build(&asked.items)?;
    Ok(())
}

/// After 0.1 %, 1 %, 10 % and 100 % of the items have moved, one after the
/// other, a structure that refits answers as a newly built one.
pub fn refit_equals_a_fresh_build<T: RegionIndex>() -> Outcome {
    let degenerate = ["all the same", "needles", "inverted among sound"];
    let degenerate = edges().filter(|asked| degenerate.contains(&asked.scene.as_str()));
    let scenes = generated_scenes(1000)?.into_iter().chain(degenerate);
    each(scenes, |asked, index: &mut T| {
        let mut rng = SeededRng::new(11);
        let width = f64::from(Aabb::union_of(&asked.items).extent().max_element());
        update(index, asked, &[])?;
        for step in [1000, 100, 10, 1] {
            let all = 0..asked.items.len() as ItemId;
            let moved: Vec<ItemId> = all.skip(step / 3).step_by(step).collect();
            for (at, &id) in moved.iter().enumerate() {
                // Most move a little, some far.
                let far = if at % 5 == 0 { 0.5 } else { 0.01 };
                let by = (rng.normal3() * width * far).as_vec3();
                let b = &mut asked.items[id as usize];
                *b = Aabb::new(b.min + by, b.max + by);
            }
            update(index, asked, &moved)?;
            asked.points = points(&asked.items);
            let corners = moved.iter().map(|&id| asked.items[id as usize].max);
            asked.points.extend(corners.take(20));
            let right = asked.both_are_right(index);
            right.map_err(|error| format!("after {} moves: {error}", moved.len()))?;
        }
        Ok(())
    })
}

/// An item that becomes empty is gone, and one that becomes sound is there.
pub fn items_that_come_and_go_are_followed<T: RegionIndex>() -> Outcome {
    let names = ["one", "coplanar", "inverted among sound", "only inverted"];
    let scenes = edges().filter(|asked| names.contains(&asked.scene.as_str()));
    each(scenes, |asked, index: &mut T| {
        let last = asked.items.len() as ItemId - 1;
        let all: Vec<ItemId> = (0..=last).collect();
        // The first and the last turn about (a sound box becomes empty and
        // the other way round) and back, then all of them at once.
        let steps = [vec![0], vec![0], vec![last], vec![last], all.clone(), all];
        for moved in steps {
            for &id in &moved {
                let b = &mut asked.items[id as usize];
                *b = Aabb::new(b.max, b.min);
            }
            update(index, asked, &moved)?;
            let right = asked.both_are_right(index);
            right.map_err(|error| format!("{} items turned about: {error}", moved.len()))?;
        }
        Ok(())
    })
}
