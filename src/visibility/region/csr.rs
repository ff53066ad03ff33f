//! Lists of lists in two tables (compressed sparse rows).

/// Lists that lie one behind the other.
#[derive(Clone, Debug)]
pub struct Csr<T> {
    /// Start of each list; one more at the end.
    starts: Vec<u32>,
    pub all: Vec<T>,
}

impl<T: Clone> Csr<T> {
    /// Joins lists. O(entries).
    pub fn of(lists: &[Vec<T>]) -> Csr<T> {
        let ends = lists.iter().scan(0, |end, list| {
            *end += list.len() as u32;
            Some(*end)
        });
        Csr {
            starts: std::iter::once(0).chain(ends).collect(),
            all: lists.concat(),
        }
    }

    /// Number of lists.
    pub fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// A list. O(1).
    #[inline]
    pub fn list(&self, at: u32) -> &[T] {
        let at = at as usize;
        &self.all[self.starts[at] as usize..self.starts[at + 1] as usize]
    }
}
