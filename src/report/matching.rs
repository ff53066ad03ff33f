//! Which cells of two reports belong together, by their whole key, and
//! whether they asked and timed the same.

use std::collections::{BTreeMap, BTreeSet};

use super::ReportCell;

/// Values by their key, both in the order in which they come.
pub(super) fn grouped<K: PartialEq, V>(pairs: impl Iterator<Item = (K, V)>) -> Vec<(K, Vec<V>)> {
    let mut groups: Vec<(K, Vec<V>)> = Vec::new();
    for (key, value) in pairs {
        match groups.iter_mut().find(|group| group.0 == key) {
            Some(group) => group.1.push(value),
            None => groups.push((key, vec![value])),
        }
    }
    groups
}

/// Group, structure, and number of cells before it that have both.
/// A report that holds a cell twice loses none of them.
type Key<'r> = (String, &'r str, usize);

fn keyed(cells: &[ReportCell]) -> Vec<(Key<'_>, &ReportCell)> {
    let mut seen = BTreeMap::new();
    let keys = cells.iter().map(|cell| {
        let key = (cell.key().group.id(), cell.structure.as_str());
        let before = seen.entry(key.clone()).or_insert(0);
        *before += 1;
        ((key.0, key.1, *before), cell)
    });
    keys.collect()
}

/// A cell in both reports.
pub(super) type Pair<'r> = (&'r ReportCell, &'r ReportCell);

/// Cells of the same name, and those that only one side has, in their order.
pub(super) struct Matched<'r> {
    pub pairs: Vec<Pair<'r>>,
    pub only_old: Vec<&'r ReportCell>,
    pub only_new: Vec<&'r ReportCell>,
}

pub(super) fn matched<'r>(old: &'r [ReportCell], new: &'r [ReportCell]) -> Matched<'r> {
    let (old, new) = (keyed(old), keyed(new));
    let known: BTreeSet<Key> = old.iter().map(|(key, _)| key.clone()).collect();
    let partners: BTreeMap<Key, &ReportCell> = new.iter().cloned().collect();
    let (mut pairs, mut only_old) = (Vec::new(), Vec::new());
    for (key, cell) in old {
        match partners.get(&key) {
            Some(partner) => pairs.push((cell, *partner)),
            None => only_old.push(cell),
        }
    }
    let only_new = new.into_iter().filter(|(key, _)| !known.contains(key));
    Matched {
        pairs,
        only_old,
        only_new: only_new.map(|(_, cell)| cell).collect(),
    }
}

/// Why the two cells are not the same question, if they are not.
pub(super) fn asked_otherwise((old, new): Pair) -> Option<String> {
    let digests = |what: &str, old: &str, new: &str| {
        let short = |digest: &str| digest.chars().take(8).collect::<String>();
        (old != new).then(|| format!("{what}: digest {} and {}", short(old), short(new)))
    };
    if let Some(reason) = digests("other items", &old.scene.digest, &new.scene.digest) {
        return Some(reason);
    }
    let cameras = (old.path.camera_count, new.path.camera_count);
    if cameras.0 != cameras.1 {
        return Some(format!("{} cameras and {}", cameras.0, cameras.1));
    }
    // A report may not know its cameras.
    let (was, is) = (old.path.digest.as_ref(), new.path.digest.as_ref());
    was.zip(is)
        .and_then(|(was, is)| digests("other cameras", was, is))
}

/// Why the times are not of the same work, if they are not: the mean over other
/// cameras, or of shorter batches, is another figure.
pub(super) fn timed_otherwise((old, new): Pair) -> Option<String> {
    let (was, is) = (&old.times, &new.times);
    if was.cameras_timed != is.cameras_timed {
        let (was, is) = (was.cameras_timed, is.cameras_timed);
        return Some(format!("{was} cameras timed and {is}"));
    }
    (was.batch != is.batch).then(|| format!("batches of {} and {} queries", was.batch, is.batch))
}

#[cfg(test)]
mod tests {
    use super::super::ranking::tests::cell;
    use super::*;

    #[test]
    fn cells_are_matched_by_their_whole_name_each_once() {
        let one = cell("s", 10, "p", "a", 1.0);
        let changed = |change: fn(&mut ReportCell)| {
            let mut other = one.clone();
            change(&mut other);
            let matched = matched(std::slice::from_ref(&one), std::slice::from_ref(&other));
            let counts = (matched.only_old.len(), matched.only_new.len());
            (matched.pairs.len(), counts)
        };
        for change in [
            (|c| c.scene.name.push('x')) as fn(&mut ReportCell),
            |c| c.path.name.push('x'),
            |c| c.path.cache.push('x'),
            |c| c.path.arithmetic.push('x'),
            |c| c.path.planes.push('x'),
            |c| c.path.epsilon = 0.0,
            |c| c.test.push('x'),
            |c| c.structure.push('x'),
        ] {
            assert_eq!(changed(change), (0, (1, 1)));
        }
        // What was measured and found is no part of the name.
        assert_eq!(changed(|c| c.scene.digest.push('x')), (1, (0, 0)));
        let (old, new) = (vec![one.clone(); 3], vec![one.clone(); 2]);
        let some = matched(&old, &new);
        assert_eq!((some.pairs.len(), some.only_old.len()), (2, 1));
        assert!(some.only_new.is_empty());
    }
}
