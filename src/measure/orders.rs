//! The order of the tasks in each round, balanced so that neither a position
//! nor a neighbour favours a task. Timing itself is `timing`'s.

use crate::scene::SeededRng;

/// Orders in which every task takes every position once and follows every other
/// once in as many rounds as there are tasks (twice in twice as many for
/// odd numbers): a Williams square (E. J. Williams 1949, "Experimental designs
/// balanced for the estimation of residual effects of treatments"), its names
/// drawn again for each block. A task behind one that streams through
/// the caches starts worse than others; a fixed neighbour would be a bias.
pub struct Orders {
    names: Vec<usize>,
    turn: usize,
    rng: SeededRng,
}

impl Orders {
    pub fn new(count: usize, seed: u64) -> Orders {
        Orders {
            names: (0..count).collect(),
            turn: 0,
            rng: SeededRng::new(seed),
        }
    }

    /// The next round's order.
    pub fn next(&mut self) -> Vec<usize> {
        let count = self.names.len();
        let block = if count.is_multiple_of(2) {
            count
        } else {
            2 * count
        };
        let turn = self.turn.checked_rem(block).unwrap_or(0);
        if turn == 0 {
            for i in (1..count).rev() {
                self.names.swap(i, self.rng.below(i + 1));
            }
        }
        self.turn += 1;
        // 0, 1, n-1, 2, n-2, ...: every difference once.
        let zigzag = |k: usize| match k % 2 {
            1 => k.div_ceil(2),
            _ => count - k / 2,
        };
        let places = (0..count).map(|k| self.names[(zigzag(k) + turn) % count]);
        match turn < count {
            true => places.collect(),
            false => places.rev().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everyone_takes_every_place_and_follows_everyone_equally_often() {
        for (count, rounds, often) in [(2, 2, 1), (6, 6, 1), (8, 8, 1), (5, 10, 2), (9, 18, 2)] {
            let mut orders = Orders::new(count, 7);
            // A second block, drawn again.
            for _ in 0..2 {
                let mut taken = vec![vec![0; count]; count];
                let mut follows = vec![vec![0; count]; count];
                for _ in 0..rounds {
                    let order = orders.next();
                    for (place, &c) in order.iter().enumerate() {
                        taken[c][place] += 1;
                    }
                    for pair in order.windows(2) {
                        follows[pair[1]][pair[0]] += 1;
                    }
                }
                for c in 0..count {
                    assert!(taken[c].iter().all(|&n| n == often), "{count}: {taken:?}");
                    let others = (0..count).filter(|&other| other != c);
                    assert!(
                        others.clone().all(|other| follows[c][other] == often),
                        "{count}: {follows:?}"
                    );
                }
            }
        }
        assert!(Orders::new(0, 1).next().is_empty());
        assert_eq!(Orders::new(1, 1).next(), [0]);
    }
}
