//! How a structure is built and asked: the instruction set and the number of
//! threads, as a value that a [`StructureSpec`](super::StructureSpec) carries.
//! Nothing of it is the process's: two specs may differ in it side by side.

use crate::kernel::Kernel;

/// The kernel that answers queries and the threads that a build may use. The
/// answers are the same whatever it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Execution {
    /// Instruction set of queries.
    pub kernel: Kernel,
    /// Threads of builds, at least 1.
    pub threads: usize,
}

/// The best kernel of this machine, and one thread.
impl Default for Execution {
    fn default() -> Self {
        Execution {
            kernel: Kernel::best(),
            threads: 1,
        }
    }
}

/// A structure that is asked by a kernel of its own choice, as a
/// [`DynIndex`](super::DynIndex); the structure itself is asked by the best.
pub struct By<T> {
    /// The structure.
    pub index: T,
    /// The kernel that answers its queries.
    pub kernel: Kernel,
}
