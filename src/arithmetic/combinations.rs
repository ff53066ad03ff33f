//! Combinations: pairs, triples and quadruples of planes.

/// All ascending choices of `N` numbers below `count`, in lexicographic order.
pub fn combinations<const N: usize>(count: usize) -> impl Iterator<Item = [usize; N]> {
    let first = (N <= count).then(|| std::array::from_fn(|i| i));
    std::iter::successors(first, move |last: &[usize; N]| {
        // The last number that can grow; those after it follow it.
        let at = (0..N).rfind(|&i| last[i] + N - i < count)?;
        let mut next = *last;
        for (number, i) in next[at..].iter_mut().zip(1..) {
            *number = last[at] + i;
        }
        Some(next)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_ascend_in_lexicographic_order() {
        let pairs: Vec<[usize; 2]> = combinations(3).collect();
        assert_eq!(pairs, [[0, 1], [0, 2], [1, 2]]);
        assert_eq!(combinations::<4>(3).count(), 0);
    }
}
