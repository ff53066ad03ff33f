//! What a culling answers to every camera by the plain loop, and how wrong that
//! is. No structure and no clock.

use super::points::Views;
use crate::culling::{Culling, CullingTest};
use crate::geometry::Aabb;
use crate::index::BuildError;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::verify::{ErrorCount, Truth};

/// What one culling answers to every camera, and how wrong that is.
pub(super) struct Judged {
    pub culling: Culling,
    pub answers: Vec<Vec<ItemId>>,
    pub errors: ErrorCount,
    pub refused: Option<String>,
}

impl Judged {
    pub fn refused(culling: Culling, error: &BuildError) -> Judged {
        Judged {
            culling,
            answers: Vec::new(),
            errors: ErrorCount::default(),
            refused: Some(error.to_string()),
        }
    }

    /// Answers from `items`, judged by the truth about the scene's own.
    pub fn new(scene: &Scene, items: &[Aabb], views: &Views, truths: &[Truth]) -> Judged {
        let culling = views.culling;
        let mut errors = ErrorCount::default();
        let judged = views.views.iter().zip(truths).map(|(view, truth)| {
            let seen = items.iter().zip(0..).filter(|(b, _)| view.as_any().sees(b));
            let answer: Vec<ItemId> = seen.map(|(_, id)| id).collect();
            errors += blamed(culling.test, truth.errors(&scene.items, &answer));
            answer
        });
        Judged {
            answers: judged.collect(),
            culling,
            errors,
            refused: views.refused.clone(),
        }
    }

    /// Ids of every answer.
    pub fn counts(&self) -> Vec<u64> {
        self.answers.iter().map(|a| a.len() as u64).collect()
    }
}

/// Errors with the excess put down to planes or to the test.
fn blamed(test: CullingTest, errors: ErrorCount) -> ErrorCount {
    match test {
        CullingTest::Sphere => errors.of_spheres(),
        CullingTest::Exact => errors.of_exact_test(),
        CullingTest::SixPlane | CullingTest::SixBox => errors,
    }
}
