//! Which cells of two reports belong together. It owns the name of a cell and
//! nothing that is said about it.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::ReportCell;

/// What a cell is found by in another report.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct CellName<'r> {
    pub scene: &'r str,
    pub path: &'r str,
    pub cache: &'r str,
    pub test: &'r str,
    pub arithmetic: &'r str,
    pub planes: &'r str,
    pub epsilon: f64,
    pub structure: &'r str,
}

impl CellName<'_> {
    pub(super) fn of(cell: &ReportCell) -> CellName<'_> {
        let path = &cell.path;
        CellName {
            scene: &cell.scene.name,
            path: &path.name,
            cache: &path.cache,
            test: &cell.test,
            arithmetic: &path.arithmetic,
            planes: &path.planes,
            epsilon: path.epsilon,
            structure: &cell.structure,
        }
    }
}

/// The name in an order, and how many cells of that name come before it: a
/// report that holds a cell twice loses none of them.
type Key<'r> = ([&'r str; 7], u64, usize);

fn keyed(cells: &[ReportCell]) -> Vec<(Key<'_>, &ReportCell)> {
    let mut seen = BTreeMap::new();
    let keys = cells.iter().map(|cell| {
        let n = CellName::of(cell);
        let texts = [
            n.scene,
            n.path,
            n.cache,
            n.test,
            n.arithmetic,
            n.planes,
            n.structure,
        ];
        // Zero has two signs and one meaning.
        let epsilon = (n.epsilon + 0.0).to_bits();
        let before = seen.entry((texts, epsilon)).or_insert(0);
        *before += 1;
        ((texts, epsilon, *before), cell)
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
    let known: BTreeSet<Key> = old.iter().map(|(key, _)| *key).collect();
    let partners: BTreeMap<Key, &ReportCell> = new.iter().copied().collect();
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
