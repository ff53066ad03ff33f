//! An exercise: a quadtree with two bodies left out. docs/LECTURES.md explains it.
//!
//! Write `divide` and `walk`, where it says TASK. `cargo test` marks both: the conformance
//! suite compares all answers with a scan, `it_divides` counts the items that are tested.
//! `cargo run --release -- run --structure linear-scalar,quadtree-textbook,my-quadtree`
//! measures the tree, `scene draw` shows it.

use std::ops::ControlFlow;
use std::process::ExitCode;

use cullbench::geometry::{Aabb, PlaneMask};
use cullbench::index::{
    BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, Registry, TreeCell, indexable,
};
use cullbench::query::{Containment, Context, ItemId, QueryVolume, Recorder};

/// Most items of a node that is not divided.
const LEAF: usize = 8;
/// Most levels below the root: coincident items can never be divided.
const DEPTH: u32 = 16;

/// A cell with the items that no cell within contains.
struct Node {
    /// Contains every item from here down.
    bounds: Aabb,
    boxes: Vec<Aabb>,
    ids: Vec<ItemId>,
    children: Vec<Node>,
}

impl Node {
    /// A node that keeps all items, and its items with those of all nodes below it.
    fn with(bounds: Aabb, items: Vec<(ItemId, Aabb)>) -> Node {
        let (ids, boxes) = items.into_iter().unzip();
        let children = Vec::new();
        Node {
            bounds,
            boxes,
            ids,
            children,
        }
    }

    /// Divides a cell with `items` into four quarters along x and y, and those again.
    ///
    /// A cell with at most `LEAF` items stays whole, and so does one at depth 0. An item
    /// goes to a quarter that contains it (`Aabb::contains`); if none does, it stays here.
    /// Quarters without items are left out.
    fn divide(bounds: Aabb, items: Vec<(ItemId, Aabb)>, depth: u32) -> Node {
        // TASK 1: divide.
        let _ = (LEAF, depth);
        Node::with(bounds, items)
    }

    /// Passes the items that `volume` sees to the query: `cx.accept(&[id])?`.
    ///
    /// `volume.classify(&self.bounds, mask, cx.recorder())` returns the verdict about the
    /// cell and the mask for what is in it. `Outside`: no item is seen. `Inside`: all are
    /// (`accept_all`). `Straddles`: test each item by `volume.admits`, then walk the
    /// children. Count what is tested, for the columns of `query`:
    /// `cx.recorder().nodes_tested(1)`, `items_tested(n)`, `subtrees_rejected(1)`.
    fn walk<Q: QueryVolume, C: Context>(
        &self,
        volume: &Q,
        mask: PlaneMask,
        cx: &mut C,
    ) -> ControlFlow<()> {
        // TASK 2: walk.
        let _ = (volume, mask, cx, Containment::Outside, &self.boxes);
        ControlFlow::Continue(())
    }

    /// Passes all items from here down to the query.
    #[allow(dead_code, reason = "called by the body of `walk`")]
    fn accept_all<C: Context>(&self, cx: &mut C) -> ControlFlow<()> {
        cx.recorder().subtree_accepted(self.ids.len());
        cx.accept(&self.ids)?;
        self.children
            .iter()
            .try_for_each(|child| child.accept_all(cx))
    }

    fn add_cells<'a>(&'a self, level: u32, cells: &mut Vec<TreeCell<'a>>) {
        cells.push(TreeCell {
            level,
            bounds: self.bounds,
            half_space: None,
            items: &self.ids,
        });
        for child in &self.children {
            child.add_cells(level + 1, cells);
        }
    }

    fn bytes(&self) -> MemoryUsage {
        let mut sum = MemoryUsage {
            node_bytes: size_of::<Node>(),
            item_bytes: size_of_val(&self.boxes[..]) + size_of_val(&self.ids[..]),
        };
        for below in self.children.iter().map(Node::bytes) {
            sum.node_bytes += below.node_bytes;
            sum.item_bytes += below.item_bytes;
        }
        sum
    }
}

struct MyQuadtree {
    root: Node,
}

impl RegionIndex for MyQuadtree {
    const INFO: Info = Info::new(
        "my-quadtree",
        "the exercise",
        Kind::Tree,
        Origin::Crate("exercise"),
    );
    type Params = ();

    fn build(input: &Input<'_>, _: &()) -> Result<Self, BuildError> {
        // Refuses NaN and infinity, leaves empty boxes out.
        let ids = indexable(input.items)?.into_iter();
        let items: Vec<_> = ids.map(|id| (id, input.items[id as usize])).collect();
        let bounds = Aabb::union_of(items.iter().map(|(_, b)| b));
        let root = Node::divide(bounds, items, DEPTH);
        Ok(MyQuadtree { root })
    }

    fn memory(&self) -> MemoryUsage {
        self.root.bytes()
    }

    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        // The bounds of no items are empty, and an empty box has no verdict.
        if self.root.bounds.is_empty() {
            return ControlFlow::Continue(());
        }
        self.root.walk(volume, volume.mask(), cx)
    }

    fn cells(&self) -> Vec<TreeCell<'_>> {
        let mut cells = Vec::new();
        self.root.add_cells(0, &mut cells);
        cells
    }
}

fn main() -> ExitCode {
    cullbench::cli::main_with(Registry::builtin().with::<MyQuadtree>())
}

#[cfg(test)]
cullbench::conformance!(MyQuadtree);

#[cfg(test)]
#[test]
fn it_divides() {
    use cullbench::index::FrustumQuery;
    use glam::Vec3;

    let corner = |i: u16| Vec3::new(f32::from(i % 64), f32::from(i / 64), 0.0);
    let items: Vec<Aabb> = (0..4096)
        .map(|i| Aabb::new(corner(i) + 0.1, corner(i) + 0.4))
        .collect();
    let tree = MyQuadtree::build(&Input::new(&items), &()).expect("finite boxes");
    let (ids, cost) = tree.counted(&Aabb::new(corner(70), corner(200) + 1.0));
    let tested = cost.comparisons();
    assert!(
        !ids.is_empty() && tested < 400,
        "{tested} boxes of 4096 are tested for {}",
        ids.len()
    );
}
