//! Tests of random cases: a panic, and a wrong answer to a batch of points.

use super::*;
use crate::geometry::Aabb;
use crate::index::{LinearScalar, MemoryUsage, RegionIndex, Row};
use crate::query::{AnyVolume, QueryCost};
use serde_json::Value;

const PANICS: Row = Row {
    info: LinearScalar::INFO.named("panics"),
    build: |_, _, _| panic!("deep in a peer's code"),
    params: |_| Ok(Value::Null),
};

/// Loses the first item of every point of a batch.
struct Batches(Box<dyn DynIndex>);

impl DynIndex for Batches {
    fn memory(&self) -> MemoryUsage {
        self.0.memory()
    }
    fn query(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>) {
        self.0.query(volume, out);
    }
    fn query_counted(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        self.0.query_counted(volume, out, cost);
    }
    fn query_many(&self, points: &[Vec3], out: &mut Located) {
        let mut right = Located::default();
        self.0.query_many(points, &mut right);
        out.clear();
        for ids in right.iter() {
            out.push(ids.get(1..).unwrap_or_default());
        }
    }
    fn refit(&mut self, _: &[Aabb], _: &[ItemId]) -> bool {
        false
    }
}

#[test]
fn a_wrong_answer_of_a_batch_names_the_point_and_the_first_item() {
    let case = RandomCase {
        items: vec![Aabb::around(Vec3::ZERO, Vec3::ONE); 2],
        volume: ConvexVolume::from_planes(&[]).expect("all of space"),
        kind: 0,
        point: Vec3::ZERO,
        region: Aabb::around(Vec3::ZERO, Vec3::ONE),
    };
    let linear = StructureSpec::parse("linear").expect("linear");
    let index = Batches(linear.build(&case.items).expect("two items"));
    let mut trials = [(); 3].map(|()| Trial::new(2));
    trials.iter_mut().for_each(|t| t.set_expected([0, 1]));
    let reason = differ(&case, &index, &mut trials)
        .err()
        .and_then(|v| v.reason);
    let wanted = "region search: [0, 0, 0] has 1 items in a batch, 2 alone; first: item 0";
    assert_eq!(reason.as_deref(), Some(wanted));
}

#[test]
fn a_panic_in_a_random_case_is_its_status_and_says_how_to_see_it_again() {
    let spec = StructureSpec {
        label: "panics".to_owned(),
        row: PANICS,
        params: Value::Null,
        execution: Default::default(),
        policy: Default::default(),
    };
    let linear = StructureSpec::parse("linear").expect("linear");
    let checks = random_cases(&[spec, linear], 5, 3);
    assert_eq!(
        [checks[0].status, checks[1].status],
        [Status::Panicked, Status::Ok]
    );
    let told = checks[0].difference.as_deref().unwrap_or_default();
    assert!(
        told.contains("deep in a peer's code") && told.contains("--seed 5 --structure 'panics'"),
        "{told}"
    );
}

#[test]
fn a_structure_that_refused_to_build_is_not_called_right() {
    let scene = crate::scene::load("uniform:n=50", &Default::default()).expect("uniform");
    let cameras = path::load("orbit:frames=2", &scene, &Default::default()).expect("orbit");
    let linear = StructureSpec::parse("linear").expect("linear");
    let refused = StructureSpec {
        label: "refuses".to_owned(),
        row: Row {
            info: LinearScalar::INFO.named("refuses"),
            build: |_, _, _| {
                Err(crate::index::BuildError::Refused {
                    structure: "refuses",
                    reason: "too many alike".to_owned(),
                })
            },
            params: |_| Ok(Value::Null),
        },
        ..linear.clone()
    };
    let subjects = [CullingTest::SixPlane, CullingTest::Sphere].map(|test| {
        let build = |spec: &StructureSpec| Subject::build(spec.clone(), false, &scene, test);
        [&linear, &refused].map(build).into_iter().collect()
    });
    let rows = check_path(
        &scene,
        &cameras,
        &Culling::default(),
        &subjects,
        "again",
        &mut Vec::new(),
    )
    .expect("rows");
    assert!(rows[0].status == Status::Ok && rows[0].verdicts > 0);
    assert!(rows[1].status == Status::Refused && rows[1].verdicts == 0);
    assert!(rows[1].difference.is_none());
}
