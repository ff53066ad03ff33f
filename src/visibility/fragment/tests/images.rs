//! Images through holes and stencils, and the rectangles that hold them.

use super::*;

#[test]
fn through_the_holes_of_cut_outs_is_seen_what_is_behind_them() {
    let solids = Solids::of(&load("city:n=400", &Default::default()).unwrap());
    let index = RayIndex::build(&solids);
    let mask = |item: usize| [Mask::Fence, Mask::Foliage].get(item % 3).copied();
    let surface = |item| mask(item).map(|mask| TiledMask { mask, tile: 4.0 });
    let surfaces = AlphaMasks {
        of_item: (0..solids.boxes.len()).map(surface).collect(),
    };
    let (mut through, mut clear) = (0, 0);
    for camera in cameras(&solids, 6) {
        let rays = Rays::of(&camera).unwrap();
        let canvas = Canvas::of(&rays, GRID);
        let tests = Tests {
            surfaces: Some(&surfaces),
            stencil: None,
        };
        let drawn = draw(&canvas, all(&solids), &tests);
        clear += drawn.counts.clear_count;
        let solid = draw(&canvas, all(&solids), &Tests::default());
        let opaque =
            |body: &SolidBox, probe: &_, at: &_| surfaces.opaque(body.item, &body.b, probe, at);
        let truth = SampleTruth::of_opaque(&index, &opaque, &rays, GRID, 1, u64::MAX);
        let truth = truth.expect("no limit");
        assert_eq!(drawn.visible(&canvas), truth.visible);
        let (ids, solid) = (drawn.ids(), solid.ids());
        assert_eq!(ids, fronts(&index, &opaque, &rays, GRID));
        for (sample, &id) in ids.iter().enumerate() {
            let probe = &canvas.probes[sample];
            let mut along = index.all_hits(&probe.ray);
            along.sort_by(|a, b| probe.compare(&a.1, &b.1).then(a.0.cmp(&b.0)));
            let opaque =
                |item: ItemId, at| surfaces.opaque(item, &solids.boxes[item as usize], probe, at);
            let first = along.iter().find(|(item, at)| opaque(*item, at));
            assert_eq!(id, first.map_or(NO_ITEM, |first| first.0));
            through += usize::from(id != solid[sample] && id != NO_ITEM);
        }
    }
    assert!(
        through > 100 && clear > 500,
        "the premise: {through} {clear}"
    );
}

/// A portal pass draws only its samples, with what the full view shows there.
#[test]
fn a_stencil_saves_samples_and_changes_nothing_where_it_is_marked() {
    let wall = |y: [f64; 2], z: [f64; 2]| {
        WorldBox::new(DVec3::new(10.0, y[0], z[0]), DVec3::new(10.5, y[1], z[1]))
    };
    let mut boxes = vec![
        wall([-20.0, -1.0], [-20.0, 20.0]),
        wall([1.0, 20.0], [-20.0, 20.0]),
        wall([-1.0, 1.0], [2.0, 20.0]),
        wall([-1.0, 1.0], [-20.0, 0.0]),
        // A pillar in front of the portal.
        WorldBox::new(DVec3::new(7.0, 0.0, 0.0), DVec3::new(7.5, 0.5, 3.0)),
    ];
    let mut rng = SeededRng::new(3);
    let first_beyond = boxes.len();
    for _ in 0..200 {
        let at = DVec3::new(12.0, -15.0, -15.0) + rng.point() * 30.0;
        boxes.push(WorldBox::around(at, rng.point() * 2.0));
    }
    let solids = judge::solids(&boxes);
    let frame = Frame::looking_along(DVec3::new(0.0, 0.3, 1.0), DVec3::X, DVec3::Z).unwrap();
    let lens = Lens::perspective(60.0, 1.5, 0.5, None).unwrap();
    let canvas = Canvas::of(&Rays::of(&Camera { frame, lens }).unwrap(), GRID);
    let pieces = all(&solids);
    let (room, beyond) = pieces.split_at(first_beyond);
    let walls = draw(&canvas, room.iter().copied(), &Tests::default());
    let portal = wall([-1.0, 1.0], [0.0, 2.0]);
    let portal = WorldBox::new(portal.min, DVec3::new(10.0, portal.max.y, portal.max.z));
    let stencil = walls.stencil(&canvas, &[portal]);
    let count = stencil.marked.iter().filter(|marked| **marked).count();
    assert!((5..400).contains(&count), "{count}");
    let tests = Tests {
        stencil: Some(&stencil),
        surfaces: None,
    };
    let (masked, open) = (
        draw(&canvas, beyond.iter().copied(), &tests),
        draw(&canvas, beyond.iter().copied(), &Tests::default()),
    );
    let mut behind = 0;
    for sample in 0..GRID.samples() {
        let (masked, open) = (masked.front[sample], open.front[sample]);
        assert_eq!(masked, open.filter(|_| stencil.marked[sample]));
        // A sample is marked if its ray reaches the portal before any wall or pillar.
        let ray = &canvas.probes[sample].ray;
        let entry = |b: &WorldBox| judge::entry(ray, b);
        let before = |portal: &judge::Depth| {
            let room = boxes[..first_beyond].iter().filter_map(entry);
            room.filter(|depth| judge::order(depth, portal).is_lt())
                .count()
        };
        let sees = entry(&portal).is_some_and(|portal| before(&portal) == 0);
        assert_eq!(stencil.marked[sample], sees);
        behind += usize::from(!sees && entry(&portal).is_some());
    }
    assert!(behind > 3, "the premise: {behind}");
    let (with, without) = (masked.counts, open.counts);
    assert_eq!(with.asked_count + with.kept_out_count, without.asked_count);
    assert!(with.fragment_count > 0 && with.fragment_count * 4 < without.fragment_count);
}

#[test]
fn screen_rectangles_hold_every_sample_that_meets_the_box() {
    let mut rng = SeededRng::new(30);
    let grid = SampleGrid::new(16, 12);
    let (mut met, mut held) = (0, 0);
    for _ in 0..400 {
        let solids = judge::solids(&judge::ties(&mut rng, 12));
        let rays = Rays::of(&judge::camera(&mut rng)).unwrap();
        let canvas = Canvas::of(&rays, grid);
        for b in &solids.boxes {
            let rectangle = canvas.screen.rectangle(b);
            held += rectangle.as_ref().map_or(0, Rectangle::samples);
            for sample in 0..grid.samples() {
                let probe = &canvas.probes[sample];
                if probe.enter(b, f64::INFINITY).is_some() {
                    let (column, row) = (sample as u32 % 16, sample as u32 / 16);
                    let holds =
                        |r: &Rectangle| r.columns.contains(&column) && r.rows.contains(&row);
                    assert!(rectangle.as_ref().is_some_and(holds), "{b:?} {rays:?}");
                    met += 1;
                }
            }
        }
    }
    assert!(met > 5000 && held < 8 * met, "the premise: {met} of {held}");
}
