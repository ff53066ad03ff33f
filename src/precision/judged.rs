//! What a culling answers to every camera by the plain loop, and how wrong that
//! is. No structure and no clock.

use crate::camera::Camera;
use crate::culling::{CameraView, Culling, CullingTest};
use crate::geometry::Aabb;
use crate::index::BuildError;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::verify::{ErrorCount, Truth};

/// The truth about each camera, where answers are to be judged.
pub(super) type Truths<'t> = Option<&'t [Truth]>;

/// What one culling answers to every camera, and how wrong that is.
pub(super) struct Judged {
    pub culling: Culling,
    pub views: Vec<CameraView>,
    pub answers: Vec<Vec<ItemId>>,
    pub errors: ErrorCount,
    pub refused: Option<String>,
}

impl Judged {
    pub fn refused(culling: Culling, error: &BuildError) -> Judged {
        Judged {
            culling,
            views: Vec::new(),
            answers: Vec::new(),
            errors: ErrorCount::default(),
            refused: Some(error.to_string()),
        }
    }

    /// Answers from `items`, judged by the truth about the scene's own; the views
    /// alone where there is none.
    pub fn new(
        scene: &Scene,
        items: &[Aabb],
        cameras: &[Camera],
        truths: Truths,
        culling: Culling,
    ) -> Judged {
        let mut judged = Judged {
            culling,
            views: Vec::new(),
            answers: Vec::new(),
            errors: ErrorCount::default(),
            refused: None,
        };
        let around = scene.surroundings();
        for (i, camera) in cameras.iter().enumerate() {
            let view = match culling.view(camera, &around) {
                Ok(view) => view,
                Err(error) => {
                    judged.refused = Some(error.to_string());
                    return judged;
                }
            };
            judged.views.push(view);
            let truth = truths.and_then(|truths| truths.get(i));
            let (Some(truth), Some(view)) = (truth, judged.views.last()) else {
                continue;
            };
            let seen = items.iter().zip(0..).filter(|(b, _)| view.as_any().sees(b));
            let answer: Vec<ItemId> = seen.map(|(_, id)| id).collect();
            judged.errors += blamed(culling.test, truth.errors(&scene.items, &answer));
            judged.answers.push(answer);
        }
        judged
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
