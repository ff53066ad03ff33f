//! The open nodes of a depth-first traversal: a stack that needs the heap for
//! degenerate trees only.

/// Open subtrees kept without the heap: enough for any balanced tree.
const NEAR: usize = 64;

/// Open nodes, each with a state of the traversal such as its open planes.
pub struct Stack<M> {
    near: [(u32, M); NEAR],
    used: usize,
    /// Deeper levels of degenerate trees.
    far: Vec<(u32, M)>,
}

impl<M: Copy> Stack<M> {
    #[inline(always)]
    pub fn new(root: (u32, M)) -> Self {
        Stack {
            near: [root; NEAR],
            used: 1,
            far: Vec::new(),
        }
    }

    #[inline(always)]
    pub fn pop(&mut self) -> Option<(u32, M)> {
        if let Some(top) = self.far.pop() {
            return Some(top);
        }
        self.used = self.used.checked_sub(1)?;
        Some(self.near[self.used])
    }

    #[inline(always)]
    pub fn push(&mut self, entry: (u32, M)) {
        if let Some(slot) = self.near.get_mut(self.used) {
            *slot = entry;
            self.used += 1;
        } else {
            self.far.push(entry);
        }
    }
}
