//! Items that overlap in a cycle: A before B before C before A. No order of such
//! items is right; one of them would have to be cut.

use std::collections::HashMap;

use crate::query::ItemId;

/// How many items lie on a cycle of `before` pairs: the strongly connected
/// components of more than one item (Tarjan 1972). O(pairs).
pub(super) fn items_in_cycles(before: &[(ItemId, ItemId)]) -> usize {
    let mut number: HashMap<ItemId, usize> = HashMap::new();
    let mut next: Vec<Vec<usize>> = Vec::new();
    for &(a, b) in before {
        let [a, b] = [a, b].map(|item| {
            *number.entry(item).or_insert_with(|| {
                next.push(Vec::new());
                next.len() - 1
            })
        });
        next[a].push(b);
    }
    const UNSEEN: usize = usize::MAX;
    let (mut index, mut low) = (vec![UNSEEN; next.len()], vec![0; next.len()]);
    let mut on_stack = vec![false; next.len()];
    let (mut stack, mut counter, mut cyclic) = (Vec::new(), 0, 0);
    for root in 0..next.len() {
        if index[root] != UNSEEN {
            continue;
        }
        // A node and how many of its successors are done.
        let mut calls = vec![(root, 0)];
        while let Some((at, done)) = calls.last_mut() {
            let at = *at;
            if *done == 0 && index[at] == UNSEEN {
                (index[at], low[at]) = (counter, counter);
                counter += 1;
                stack.push(at);
                on_stack[at] = true;
            }
            if let Some(&to) = next[at].get(*done) {
                *done += 1;
                if index[to] == UNSEEN {
                    calls.push((to, 0));
                } else if on_stack[to] {
                    low[at] = low[at].min(index[to]);
                }
                continue;
            }
            if low[at] == index[at] {
                let from = stack.iter().rposition(|&node| node == at).unwrap_or(0);
                let component = stack.split_off(from);
                component.iter().for_each(|&node| on_stack[node] = false);
                if component.len() > 1 {
                    cyclic += component.len();
                }
            }
            calls.pop();
            if let Some(&(above, _)) = calls.last() {
                low[above] = low[above].min(low[at]);
            }
        }
    }
    cyclic
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
