//! Rectangles of set bits.

use std::ops::Range;

/// Calls `each` with the columns and rows of every rectangle of set bits that is as wide as
/// it can be: all runs of rows, and of each the runs of columns that are set in all of
/// them; column `k` is bit `k`. O(rows² x runs).
pub fn rectangles(rows: &[u64], mut each: impl FnMut(Range<usize>, Range<usize>)) {
    for first in 0..rows.len() {
        let mut common = u64::MAX;
        for (last, row) in rows.iter().enumerate().skip(first) {
            common &= row;
            if common == 0 {
                break;
            }
            let mut left = common;
            while left != 0 {
                let at = left.trailing_zeros();
                let end = at + (left >> at).trailing_ones();
                left &= u64::MAX.checked_shl(end).unwrap_or(0);
                each(at as usize..end as usize, first..last + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SeededRng;

    #[test]
    fn they_are_those_of_a_plain_search() {
        let mut rng = SeededRng::new(6);
        for _ in 0..200 {
            let word =
                |rng: &mut SeededRng| (0..64).fold(0, |w, _| w << 1 | u64::from(rng.below(4) > 0));
            let rows = [0; 5].map(|_| word(&mut rng));
            let mut found = Vec::new();
            rectangles(&rows, |columns, rows| found.push((rows, columns)));
            let mut wanted = Vec::new();
            for first in 0..5 {
                for end in first + 1..=5 {
                    let is_set = |k: usize| rows[first..end].iter().all(|row| row >> k & 1 == 1);
                    let starts = (0..64).filter(|&k| is_set(k) && (k == 0 || !is_set(k - 1)));
                    let run = |k: usize| k..(k..64).find(|&k| !is_set(k)).unwrap_or(64);
                    wanted.extend(starts.map(|k| (first..end, run(k))));
                }
            }
            assert_eq!(found, wanted);
        }
        let mut found = Vec::new();
        rectangles(&[u64::MAX], |columns, rows| found.push((columns, rows)));
        assert_eq!(found, [(0..64, 0..1)]);
    }
}
