//! Queries on several threads: one query of the wide tree, split over its
//! frontier among a crew that waits for it, and many cameras at once. How a
//! part is searched is the tree's business.

use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{Builder, Scope};

use super::wide::{Scratch, Wide};
use super::{DynIndex, TreeOrder};
use crate::geometry::{LANES, PlaneMask};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::{AnyView, ItemId, NoRecorder, Ranges, Sink, View};
use crate::threads::share;

/// What each of many cameras sees: `out[i]` is the answer to `views[i]`, in the
/// structure's own order and the same whatever the number of threads. Former
/// contents of `out` are dropped, its memory is used again.
///
/// Starts and ends the threads: worth it from some hundred microseconds of work
/// on. With one thread, a loop of [`DynIndex::see`].
pub fn see_each(
    index: &dyn DynIndex,
    views: &[AnyView<'_>],
    threads: usize,
    out: &mut Vec<Vec<ItemId>>,
) {
    out.resize_with(views.len(), Vec::new);
    let together = (views.len() / (4 * threads.max(1))).clamp(1, 8);
    let jobs = views.chunks(together).zip(out.chunks_mut(together));
    share(threads, jobs, |(views, answers)| {
        for (view, answer) in views.iter().zip(answers) {
            answer.clear();
            index.see(*view, answer);
        }
    });
}

/// Parts of a query that is split, whatever the number of threads; more threads
/// than this find nothing to do.
const PARTS: usize = 8;

/// A query is split where its frontier has so many blocks.
const ENOUGH_BLOCKS: usize = 128;

/// A query stays whole if fewer items than this are undecided where it would be
/// split: waking a thread takes longer than what it would save. What is inside
/// does not count: it is copied, and another thread's copy is copied again.
const LEAST_UNDECIDED: usize = 1 << 16;

type Job<'env> = Box<dyn FnOnce() -> Vec<ItemId> + Send + 'env>;

/// Threads that wait for queries of one tree, for as long as their scope lasts.
///
/// ```
/// use cullbench::index::{Crew, Wide, WideParams};
/// use cullbench::{camera::PlaneOptions, path, scene};
///
/// let city = scene::load("city:n=20000", &Default::default())?;
/// let orbit = path::load("orbit:frames=8", &city, &Default::default())?;
/// let tree = Wide::build_on(2, &city.items, &WideParams::default())?;
/// std::thread::scope(|scope| {
///     let mut crew = Crew::new(scope, &tree, 2);
///     let mut visible = Vec::new();
///     for camera in &orbit.cameras {
///         let volume = camera.volume(&PlaneOptions::default(), &city.surroundings())?;
///         visible.clear();
///         crew.see((&volume).into(), &mut visible);
///     }
///     Ok::<(), cullbench::camera::CameraError>(())
/// })?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Crew<'env> {
    tree: &'env Wide,
    kernel: Kernel,
    workers: Vec<Worker<'env>>,
}

/// The end of a line to a thread that does one job at a time.
struct Worker<'env> {
    jobs: Sender<Job<'env>>,
    done: Receiver<Vec<ItemId>>,
    /// Memory for its next answer.
    spare: Vec<ItemId>,
}

impl<'env> Crew<'env> {
    /// A crew of so many threads, of which the caller's is one; fewer where the
    /// system gives no more. They end with the crew.
    pub fn new<'scope>(
        scope: &'scope Scope<'scope, 'env>,
        tree: &'env Wide,
        threads: usize,
    ) -> Crew<'env> {
        let hire = |_| {
            let (jobs, to_do) = channel::<Job<'env>>();
            let (answers, done) = channel();
            let work = move || {
                while let Ok(job) = to_do.recv() {
                    if answers.send(job()).is_err() {
                        break;
                    }
                }
            };
            Builder::new().spawn_scoped(scope, work).ok()?;
            Some(Worker {
                jobs,
                done,
                spare: Vec::new(),
            })
        };
        let workers = (1..threads.min(PARTS)).map_while(hire).collect();
        Crew {
            tree,
            kernel: Kernel::best(),
            workers,
        }
    }

    /// The same crew, asking by another kernel than the best.
    pub fn by(self, kernel: Kernel) -> Self {
        Crew { kernel, ..self }
    }

    /// Threads that queries are split among, the caller's included.
    pub fn threads(&self) -> usize {
        self.workers.len() + 1
    }

    /// Appends what the view sees: the set that [`DynIndex::see`] gives.
    ///
    /// The order is another one where the query is large enough to be split,
    /// but the same whatever the number of threads: it is always split into the
    /// same parts, and the answers of the parts follow each other.
    pub fn see(&mut self, view: AnyView<'_>, out: &mut Vec<ItemId>) {
        match view {
            AnyView::Volume(view) => self.see_view(view, out),
            AnyView::Spheres(view) => self.see_view(view, out),
            AnyView::Wide(view) => self.see_view(view, out),
            AnyView::Relative(view) => self.see_view(view, out),
        }
    }

    fn see_view<V>(&mut self, view: &V, out: &mut Vec<ItemId>)
    where
        V: View + Clone + Send + Sync + 'env,
    {
        let (tree, kernel) = (self.tree, self.kernel);
        let mut parts = kernel.run(Split { tree, view });
        let search = move |view: &V, parts: Vec<Part>, out: &mut Vec<ItemId>| {
            kernel.run(SearchParts {
                tree,
                view,
                parts: &parts,
                out,
            });
        };
        if parts.len() > 1 {
            let shared = Arc::new(view.clone());
            // From the end, so that what is left at last is the first share.
            for (i, worker) in self.workers.iter_mut().enumerate().rev() {
                let share = parts.split_off(parts.len() * (i + 1) / (i + 2));
                let (view, mut answer) = (Arc::clone(&shared), std::mem::take(&mut worker.spare));
                let job = move || {
                    answer.clear();
                    search(&view, share, &mut answer);
                    answer
                };
                let sent = worker.jobs.send(Box::new(job));
                sent.expect("a worker waits as long as its crew lasts");
            }
            search(view, parts, out);
            for worker in &mut self.workers {
                let answer = worker.done.recv();
                worker.spare = answer.expect("a worker answers every job");
                out.extend_from_slice(&worker.spare);
            }
        } else {
            search(view, parts, out);
        }
    }
}

/// A part of a query: places that are wholly inside, and blocks of one level
/// that are still to be looked at, with their open planes.
#[derive(Default, Debug)]
struct Part {
    inside: Vec<Range<u32>>,
    level: usize,
    blocks: Vec<u32>,
    open: Vec<PlaneMask>,
}

/// Goes down until the frontier is wide, and cuts it into parts: one, or
/// [`PARTS`] of them, each with a like share of the items that are inside and of
/// the blocks.
struct Split<'a, V> {
    tree: &'a Wide,
    view: &'a V,
}

impl<V: View> Work for Split<'_, V> {
    type Output = Vec<Part>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Vec<Part> {
        let Split { tree, view } = self;
        let count = tree.ids().len();
        let mut inside = Vec::new();
        let mut level = tree.depth().saturating_sub(1);
        if count == 0 {
            return Vec::new();
        }
        let mut scratch = Scratch::taken();
        if view.mask() == 0 {
            inside.push(0..count as u32);
            scratch.resume(&[], &[]);
        } else {
            scratch.start(isa, view);
        }
        while level > 0 && (1..ENOUGH_BLOCKS).contains(&scratch.frontier().0.len()) {
            let mut ranges = Ranges::onto(&mut inside);
            // This sink never breaks off.
            let _ = tree.descend(
                isa,
                view,
                level - 1..level,
                &mut ranges,
                &mut NoRecorder,
                &mut scratch,
            );
            level -= 1;
        }
        let (blocks, open) = scratch.frontier();
        let certain: usize = inside.iter().map(ExactSizeIterator::len).sum();
        let span = LANES << (level * LANES.ilog2() as usize);
        let undecided = blocks.len().saturating_mul(span);
        let count = if undecided < LEAST_UNDECIDED {
            1
        } else {
            PARTS
        };
        let mut left = inside.into_iter();
        let mut next = 0..0;
        let mut parts = Vec::with_capacity(count);
        for part in 0..count {
            let bound = |all: usize, part: usize| all * part / count;
            let mut wanted = bound(certain, part + 1) - bound(certain, part);
            let mut mine = Vec::new();
            while wanted > 0 {
                if next.is_empty() {
                    let Some(range) = left.next() else { break };
                    next = range;
                }
                let end = next.end.min(next.start + wanted as u32);
                wanted -= (end - next.start) as usize;
                mine.push(next.start..end);
                next.start = end;
            }
            let of_frontier = bound(blocks.len(), part)..bound(blocks.len(), part + 1);
            parts.push(Part {
                inside: mine,
                level,
                blocks: blocks[of_frontier.clone()].to_vec(),
                open: open[of_frontier].to_vec(),
            });
        }
        scratch.give_back();
        parts
    }
}

/// Searches parts one after the other.
struct SearchParts<'a, V> {
    tree: &'a Wide,
    view: &'a V,
    parts: &'a [Part],
    out: &'a mut Vec<ItemId>,
}

impl<V: View> Work for SearchParts<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let SearchParts {
            tree,
            view,
            parts,
            out,
        } = self;
        let mut scratch = Scratch::taken();
        for part in parts {
            for range in &part.inside {
                // A Vec never breaks off, here and below.
                let _ = out.accept(&tree.ids()[range.start as usize..range.end as usize]);
            }
            if part.blocks.is_empty() {
                continue;
            }
            scratch.resume(&part.blocks, &part.open);
            let heights = 0..part.level;
            let _ = tree.descend(isa, view, heights, out, &mut NoRecorder, &mut scratch);
            let _ = tree.search_leaves(isa, view, out, &mut NoRecorder, &mut scratch);
        }
        scratch.give_back();
    }
}
