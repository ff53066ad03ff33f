//! The search for proofs against the judge and the check.

use super::*;
use crate::query::ItemId;
use crate::scene::SeededRng;
use crate::visibility::SampleGrid;
use crate::visibility::truth::{
    Class, Ends, Facts, SampleTruth, certify, check, judge, visible_by_random_rays,
};

/// No ray sees what is proven hidden, all witnesses see their items, and `check`
/// agrees with all of it.
#[test]
fn proofs_hold_in_worlds_full_of_ties() {
    let mut rng = SeededRng::new(21);
    let mut classes = [0; 6];
    for world in 0..150 {
        let count = 2 + rng.below(10);
        let boxes = judge::ties(&mut rng, count);
        let solids = judge::solids(&boxes);
        let index = RayIndex::build(&solids);
        let rays = Rays::of(&judge::camera(&mut rng)).unwrap();
        let truth = SampleTruth::of(&solids, &index, &rays, SampleGrid::new(8, 8), 1);
        let prover = Prover::new(&solids, &index, &rays);
        let items: Vec<ItemId> = (0..boxes.len() as ItemId).collect();
        let certificates = certify(
            "ties",
            &prover,
            Ends::Boxes(&index),
            &rays,
            &truth,
            &items,
            1,
        );
        let checked = check(&certificates, &Facts::of_boxes(&boxes));
        assert!(
            checked.is_ok(),
            "{world}: {checked:?} {certificates:?} {boxes:?}"
        );
        let seen = visible_by_random_rays(&index, &rays, 500, world, 1);
        for (item, proof) in &certificates.proofs {
            let class = Class::of(&truth, *item, proof);
            classes[class as usize] += 1;
            if truth.sees(*item) {
                assert!(
                    matches!(proof, Proof::Witness { .. }),
                    "{world} {item} {proof:?}"
                );
            }
            let seen = seen.contains(item);
            assert!(class != Class::Hidden || !seen, "{world} {item}");
            // And where it does tie, the front item is another.
            assert!(class != Class::Tied || !truth.front.contains(item));
            if let Proof::Witness { origin, direction } = proof {
                let ray = prover.view().ray(*origin, *direction);
                assert!(judge::front(&ray, &boxes).contains(item));
            }
        }
    }
    let [visible, _, hidden, tied, lines, undecided] = classes;
    println!("{classes:?}");
    assert!(
        visible > 150 && hidden > 150 && tied > 0 && lines > 0 && undecided < hidden / 2,
        "{classes:?}"
    );
}

#[test]
fn items_of_a_street_are_all_decided() {
    let scene = crate::scene::load("city:n=2000", &Default::default()).unwrap();
    let solids = Solids::of(&scene);
    let index = RayIndex::build(&solids);
    let eye = DVec3::new(-8.0, 20.0, 1.7);
    let frame = crate::camera::look_at(eye, DVec3::new(-8.0, 300.0, 1.7), DVec3::Z).unwrap();
    let lens = crate::camera::Lens::perspective(60.0, 1.5, 0.1, None).unwrap();
    let rays = Rays::of(&crate::camera::Camera { frame, lens }).unwrap();
    let truth = SampleTruth::of(&solids, &index, &rays, SampleGrid::new(90, 60), 1);
    let prover = Prover::new(&solids, &index, &rays);
    let items: Vec<ItemId> = (0..2000).collect();
    let certificates = [1, 3].map(|threads| {
        certify(
            "street",
            &prover,
            Ends::Boxes(&index),
            &rays,
            &truth,
            &items,
            threads,
        )
    });
    assert_eq!(certificates[0], certificates[1]);
    let counts = check(&certificates[0], &Facts::of_boxes(&solids.boxes)).unwrap();
    assert_eq!(
        (counts.visible + counts.hidden, counts.undecided),
        (2000, 0)
    );
    assert!(counts.visible >= truth.visible.len() && truth.visible.len() > 10);
}
