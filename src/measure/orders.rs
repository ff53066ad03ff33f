//! The order of the tasks in each round of a timed pass.
//!
//! Balanced, so that neither a position nor a neighbour favours a task.

use crate::scene::SeededRng;

/// Balanced orders of n tasks: a Williams square per block of n rounds.
///
/// In a block every task takes every position once and follows every other task once; for
/// odd n a block has 2n rounds, and everything occurs twice. Each block permutes the tasks
/// at random. (E. J. Williams 1949, "Experimental designs balanced for the estimation of
/// residual effects of treatments".) A task that follows one that streams through the
/// caches starts worse than others, so a fixed neighbour would be a bias.
pub struct Orders {
    names: Vec<usize>,
    turn: usize,
    rng: SeededRng,
}

impl Orders {
    /// Orders of `count` tasks.
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
