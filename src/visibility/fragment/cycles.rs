//! Items that overlap in a cycle: A before B before C before A. No order of such
//! items is right; one of them would have to be cut.

use crate::query::ItemId;

/// Number of items on cycles of `before` pairs.
///
/// Those of strongly connected components of more than one item (Kosaraju; Sharir 1981). O(pairs log pairs).
pub(super) fn items_in_cycles(before: &[(ItemId, ItemId)]) -> usize {
    let mut items: Vec<ItemId> = before.iter().flat_map(|&(a, b)| [a, b]).collect();
    items.sort_unstable();
    items.dedup();
    let node = |item| items.binary_search(&item).expect("an item of a pair");
    let (mut next, mut previous) = (vec![Vec::new(); items.len()], vec![Vec::new(); items.len()]);
    for &(a, b) in before {
        let (a, b) = (node(a), node(b));
        next[a].push(b);
        previous[b].push(a);
    }
    let (mut seen, mut finished) = (vec![false; items.len()], Vec::new());
    for root in 0..items.len() {
        finish(&next, root, &mut seen, &mut finished);
    }
    seen.fill(false);
    let components = finished.iter().rev().map(|&root| {
        let mut component = Vec::new();
        finish(&previous, root, &mut seen, &mut component);
        component.len()
    });
    components.filter(|&nodes| nodes > 1).sum()
}

/// Appends the unseen nodes that are reached from a root, successors first.
fn finish(next: &[Vec<usize>], root: usize, seen: &mut [bool], finished: &mut Vec<usize>) {
    if std::mem::replace(&mut seen[root], true) {
        return;
    }
    // Nodes, each with the number of its successors that are done.
    let mut calls = vec![(root, 0)];
    while let Some((at, done)) = calls.last_mut() {
        match next[*at].get(*done) {
            Some(&to) => {
                *done += 1;
                if !std::mem::replace(&mut seen[to], true) {
                    calls.push((to, 0));
                }
            }
            None => finished.extend(calls.pop().map(|(node, _)| node)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_of_cycles_are_counted_and_others_are_not() {
        assert_eq!(items_in_cycles(&[]), 0);
        assert_eq!(items_in_cycles(&[(1, 2), (2, 3), (1, 3)]), 0);
        assert_eq!(
            items_in_cycles(&[(1, 2), (2, 3), (3, 1), (3, 4), (0, 1)]),
            3
        );
        assert_eq!(
            items_in_cycles(&[(1, 2), (2, 1), (5, 6), (6, 7), (7, 5)]),
            5
        );
        let long: Vec<_> = (0..100_000).map(|i| (i, (i + 1) % 100_000)).collect();
        assert_eq!(items_in_cycles(&long), 100_000);
    }
}
