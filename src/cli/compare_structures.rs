//! What `query` and `locate` share: asking one structure after another (a
//! large scene does not fit in memory several times), and noticing when they
//! disagree.

use std::collections::BTreeMap;

use cullbench::geometry::Aabb;
use cullbench::index::{DynIndex, StructureSpec};
use cullbench::query::{ItemId, QueryCost};
use cullbench::scene::Scene;
use cullbench::threads::{self, share};

/// One structure's answer to one question.
pub struct Answer {
    pub question: usize,
    pub structure: String,
    pub ids: Option<Vec<ItemId>>,
    pub count: usize,
    pub id_sum: u64,
    pub cost: QueryCost,
}

/// Asks every structure every question; answers in the order of questions,
/// then of structures. Ids (ascending) are kept only if wanted.
pub fn ask_all(
    structures: &[StructureSpec],
    scene: &Scene,
    boxes: &[Aabb],
    questions: usize,
    keep_ids: bool,
    ask: impl Fn(&dyn DynIndex, usize, &mut Vec<ItemId>, &mut QueryCost) + Sync,
) -> anyhow::Result<Vec<Answer>> {
    let mut answers: Vec<Vec<Answer>> = (0..questions).map(|_| Vec::new()).collect();
    for spec in structures {
        let index = spec
            .build_with(boxes, scene.own_tree.as_ref())
            .map_err(|error| anyhow::anyhow!("structure '{}': {error}", spec.label))?;
        share(
            threads::chosen(),
            answers.iter_mut().enumerate(),
            |(question, row)| {
                let (mut out, mut cost) = (Vec::new(), QueryCost::default());
                ask(index.as_ref(), question, &mut out, &mut cost);
                if keep_ids {
                    out.sort_unstable();
                }
                row.push(Answer {
                    question,
                    structure: spec.label.clone(),
                    count: out.len(),
                    id_sum: cullbench::measure::id_sum(&out),
                    ids: keep_ids.then_some(out),
                    cost,
                });
            },
        );
    }
    Ok(answers.into_iter().flatten().collect())
}

/// Says which questions were answered differently; true if none was.
pub fn all_agree(answers: &[Answer], what: &str) -> bool {
    let mut first: BTreeMap<usize, &Answer> = BTreeMap::new();
    let mut agree = true;
    for answer in answers {
        let base = first.entry(answer.question).or_insert(answer);
        if (base.count, base.id_sum) != (answer.count, answer.id_sum) {
            agree = false;
            super::tell(&format!(
                "error: {what} {}: {} finds {} ids with sum {}, {} finds {} with sum {}",
                answer.question,
                base.structure,
                base.count,
                base.id_sum,
                answer.structure,
                answer.count,
                answer.id_sum
            ));
        }
    }
    agree
}

/// Ids as the CSV columns hold them: ascending, separated by spaces.
pub fn joined(ids: &[ItemId]) -> String {
    let texts: Vec<String> = ids.iter().map(ItemId::to_string).collect();
    texts.join(" ")
}
