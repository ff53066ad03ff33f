//! Paths in scenes: specs, files, and refused input.

use super::*;
use crate::camera::{LensKind, MatrixConvention, PlaneOptions};
use crate::spec::tests::{keys, known, listed};

fn scene(source: &str) -> Scene {
    scene::load(source, &Default::default()).unwrap()
}

fn path(source: &str, scene: &Scene) -> CameraPath {
    load(source, scene, &LensDefaults::default()).unwrap()
}

fn visible_share(path: &CameraPath, scene: &Scene) -> f64 {
    let around = scene.surroundings();
    let visible = path.cameras.iter().map(|camera| {
        let volume = camera.volume(&PlaneOptions::default(), &around).unwrap();
        scene.items.iter().filter(|b| volume.sees(b)).count()
    });
    visible.sum::<usize>() as f64 / (path.cameras.len() * scene.items.len()) as f64
}

#[test]
fn the_digest_tells_cameras_apart() {
    let scene = scene("city:n=100");
    let cameras = path("orbit:frames=3", &scene).cameras;
    assert_eq!(digest(&cameras), digest(&cameras.clone()));
    let mut digests = vec![digest(&cameras), digest(&cameras[1..])];
    let turned = {
        let mut turned = cameras.clone();
        turned.swap(0, 1);
        turned
    };
    digests.push(digest(&turned));
    let window = [-1.0, 1.0, -1.0, 1.0];
    for lens in [
        Lens::perspective(50.0, 1.5, 0.1, Some(9.0)),
        Lens::perspective(50.0, 1.5, 0.1, Some(9.5)),
        Lens::perspective(50.0, 1.5, 0.1, None),
        Lens::perspective(50.0, 1.5, 0.2, None),
        Lens::orthographic(50.0, 1.5, 0.1, 9.0),
        Lens::off_axis(window, 0.1, Some(9.0)),
        Lens::off_axis(window, 0.1, None),
    ] {
        let mut other = cameras.clone();
        other[2].lens = lens.unwrap();
        digests.push(digest(&other));
    }
    for (i, one) in digests.iter().enumerate() {
        assert!(one.len() == 64 && !digests[..i].contains(one), "{i}");
    }
}

#[test]
fn every_family_works_on_every_kind_of_scene() {
    for source in [
        "uniform:n=0",
        "uniform:n=1",
        "city:n=300",
        "us-counties",
        "freedm-map12",
    ] {
        let scene = scene(source);
        for family in PATHS
            .iter()
            .filter(|p| !["places", "walk", "animation"].contains(&p.name))
        {
            let path = path(&format!("{}:frames=9", family.name), &scene);
            assert_eq!(path.cameras.len(), 9, "{source} {}", family.name);
            for camera in &path.cameras {
                let volume = camera.volume(&PlaneOptions::default(), &scene.surroundings());
                assert!(volume.is_ok(), "{source} {}", family.name);
            }
        }
    }
}

#[test]
fn outside_sees_everything_and_the_others_see_something() {
    let scene = scene("city:n=2000");
    assert_eq!(
        visible_share(&path("outside:frames=12", &scene), &scene),
        1.0
    );
    for source in [
        "orbit:frames=8",
        "flythrough:frames=32",
        "spin:frames=8",
        "zoom:frames=8",
    ] {
        let share = visible_share(&path(source, &scene), &scene);
        assert!(share > 0.001, "{source}: {share}");
    }
}

#[test]
fn a_visible_share_can_be_asked_for() {
    let scene = scene("uniform:n=20000");
    for (source, wanted) in [
        ("flythrough:visible=2%", 0.02),
        ("teleport:frames=128,visible=0.05", 0.05),
        ("flythrough:visible=1000", 0.05),
        ("flythrough:visible=2k", 0.1),
    ] {
        let share = visible_share(&path(source, &scene), &scene);
        assert!((share / wanted - 1.0).abs() < 0.1, "{source}: {share}");
    }
}

/// Every fourth item is in the middle; the others are all around.
#[test]
fn a_visible_share_holds_where_the_order_of_items_repeats() {
    let mut rng = SeededRng::new(5);
    let boxes = (0..32_000).map(|i| {
        let centre = (rng.point() - 0.5) * if i % 4 == 0 { 100.0 } else { 1000.0 };
        WorldBox::new(centre, centre + 1.0)
    });
    let scene = Scene::from_boxes("b", &boxes.collect::<Vec<_>>()).unwrap();
    for (source, wanted) in [
        ("flythrough:visible=10%", 0.1),
        ("flythrough:visible=2%", 0.02),
    ] {
        let share = visible_share(&path(source, &scene), &scene);
        assert!((share / wanted - 1.0).abs() < 0.2, "{source}: {share}");
    }
}

/// Two distant items make the scene large.
///
/// A near that grows with far loses the dense rest.
#[test]
fn a_share_that_only_a_nearer_far_plane_reaches_is_found() {
    let mut rng = SeededRng::new(5);
    let dense = (0..1_000).map(|_| rng.point() * 2.0 - 1.0);
    let dense = dense.map(|at| WorldBox::new(at, at + 0.02));
    let far_off = [-500.0, 500.0].map(DVec3::splat);
    let far_off = far_off.map(|at| WorldBox::new(at, at + 1.0));
    let boxes: Vec<_> = dense.chain(far_off).collect();
    let scene = Scene::from_boxes("b", &boxes).unwrap();
    let path = path("orbit:radius=0.00001,frames=16,visible=5%", &scene);
    let share = visible_share(&path, &scene);
    assert!((share / 0.05 - 1.0).abs() < 0.2, "{share}");
}

#[test]
fn a_near_that_was_asked_for_stays_beside_a_visible_share() {
    let scene = scene("uniform:n=5000");
    let plain = LensDefaults::default();
    let of_options = LensDefaults {
        near: Some(0.25),
        ..plain
    };
    for (source, defaults, wanted) in [
        ("flythrough:frames=8,visible=5%,near=0.5", &plain, Some(0.5)),
        ("flythrough:frames=8,visible=5%", &of_options, Some(0.25)),
        ("street:frames=8,visible=1%", &plain, Some(0.1)),
        ("flythrough:frames=8,visible=5%", &plain, None),
    ] {
        for camera in load(source, &scene, defaults).unwrap().cameras {
            let (near, far) = (camera.lens.near(), camera.lens.far().unwrap());
            assert_eq!(near, wanted.unwrap_or(far / 1000.0), "{source}");
        }
    }
    // A more distant far plane does not move the near plane.
    let near = |source| path(source, &scene).cameras[0].lens.near();
    assert_eq!(near("orbit:frames=2,far=1e6"), near("orbit:frames=2"));
    let error = load("orbit:visible=5%,far=10", &scene, &plain).unwrap_err();
    let wanted = "far=10 beside visible=5%; expected one of them";
    assert!(error.to_string().contains(wanted), "{error}");
}

#[test]
fn a_count_is_met_in_scenes_of_any_size() {
    for n in [5_000, 1_000_000] {
        let scene = scene(&format!("uniform:n={n}"));
        let path = path("flythrough:frames=32,visible=200", &scene);
        let visible = visible_share(&path, &scene) * f64::from(n);
        assert!((visible / 200.0 - 1.0).abs() < 0.15, "{n}: {visible}");
    }
    // Few views of few items leave little to sample: all are counted.
    let scene = scene("uniform:n=100000");
    let path = path("street:frames=8,visible=50", &scene);
    let visible = visible_share(&path, &scene) * 1e5;
    assert!((visible / 50.0 - 1.0).abs() < 0.05, "{visible}");
}

#[test]
fn the_last_view_of_a_zoom_has_its_power() {
    let scene = scene("city:n=100");
    for frames in [2, 9] {
        let path = path(&format!("zoom:frames={frames},power=8"), &scene);
        let half = |camera: &Camera| {
            let LensKind::Perspective { fovy_deg, .. } = camera.lens.kind() else {
                panic!("no perspective");
            };
            (fovy_deg.to_radians() / 2.0).tan()
        };
        let [first, .., last] = &path.cameras[..] else {
            panic!("{frames} views");
        };
        assert!((half(first) / half(last) - 8.0).abs() < 1e-9, "{frames}");
    }
}

/// Items that are only visible together, and one that is visible at any scale.
#[test]
fn a_share_below_all_that_can_be_reached_is_refused() {
    let boxes = |n| vec![WorldBox::new(DVec3::ZERO, DVec3::ONE); n];
    for (n, path, wanted) in [
        (1, "orbit:frames=8,visible=2%", "at least 100% of 'b'"),
        (100, "orbit:frames=8,visible=5", "at least 100% of 'b'"),
        (
            100,
            "outside:frames=4,visible=2%",
            "0% or 25.0%, and no share between, of 'b'",
        ),
        (100, "outside:frames=4,visible=20%", ""),
        (0, "orbit:frames=8,visible=2%", "(2%) of at least one item"),
        (1, "orbit:visible=1", "(2%); no count is possible of 1 item"),
        (
            2,
            "orbit:visible=2",
            "(2%); no count is possible of 2 items",
        ),
        (3, "orbit:visible=3", "(2%) or a count of 2"),
    ] {
        let scene = Scene::from_boxes("b", &boxes(n)).unwrap();
        let told = load(path, &scene, &LensDefaults::default()).map(|_| ());
        let told = told
            .map_err(|error| error.to_string())
            .err()
            .unwrap_or_default();
        assert!(
            told.contains(wanted) && told.is_empty() == wanted.is_empty(),
            "{path}: {told}"
        );
    }
    let scene = Scene::from_boxes("b", &boxes(9)).unwrap();
    let mut away = path("outside:frames=4", &scene);
    for Camera { frame, .. } in &mut away.cameras {
        *frame = Frame::looking_along(frame.eye, -frame.forward(), frame.v()).unwrap();
    }
    let told = away.seeing(&scene, 0.2, None).map(drop).unwrap_err();
    let wanted = "at most 0% of 'b' along it; expected a path that sees items";
    assert!(told.to_string().ends_with(wanted), "{told}");
}

#[test]
fn every_parameter_of_the_list_is_one_and_no_other() {
    let map = scene("freedm-map12");
    for family in PATHS.iter().filter(|p| p.name != "animation") {
        let listed = listed(&format!("{PATH_PARAMS}, {}", family.params));
        for (key, default) in &listed {
            // Defaults that are not numbers.
            let value = match key.as_str() {
                "near" => "0.5",
                "far" => "1e6",
                "visible" => "5%",
                // Places of maps have a height.
                "height" if family.name == "street" => continue,
                _ => default,
            };
            let frames = if key == "frames" { "" } else { ",frames=4" };
            let source = format!("{}:{key}={value}{frames}", family.name);
            let made = load(&source, &map, &LensDefaults::default());
            assert!(made.is_ok(), "{source}: {:?}", made.err());
        }
        let unknown = format!("{}:frames=2,no=1", family.name);
        let error = load(&unknown, &map, &LensDefaults::default()).unwrap_err();
        assert_eq!(known(&error.to_string()), keys(&listed), "{}", family.name);
    }
}

#[test]
fn the_maps_things_are_camera_places() {
    let map = scene("freedm-map12");
    let things = path("places", &map);
    assert_eq!(things.cameras.len(), map.places.len());
    let none = load("places", &scene("city:n=10"), &LensDefaults::default());
    assert!(none.unwrap_err().to_string().contains("no camera places"));
    let none = load("walk", &scene("city:n=10"), &LensDefaults::default());
    assert!(none.unwrap_err().to_string().contains("has no doors"));
}

#[test]
fn of_more_items_fewer_cameras_set_the_share() {
    let most = [0, 8_000, 160_000, 1_000_000, 100_000_000].map(calibrate::most_cameras);
    assert_eq!(most, [128, 128, 128, 20, 16]);
}

/// A single camera of a glTF file does not make a street.
#[test]
fn on_a_street_places_of_maps_alone_are_eyes() {
    let mut city = scene("city:n=300");
    let free = path("street:frames=5", &city).cameras;
    city.places = path("orbit:frames=1", &city)
        .cameras
        .iter()
        .map(place)
        .collect();
    assert_eq!(path("street:frames=5", &city).cameras, free);
    let map = scene("freedm-map12");
    for camera in path("street:frames=5", &map).cameras {
        assert!(map.places.iter().any(|place| place.eye == camera.frame.eye));
    }
}

fn place(camera: &Camera) -> scene::CameraPlace {
    scene::CameraPlace {
        eye: camera.frame.eye,
        forward: camera.frame.forward(),
        view: None,
    }
}

#[test]
fn what_cannot_be_a_path_says_why() {
    let scene = scene("city:n=10");
    for (source, wanted) in [
        ("orbt", "did you mean 'orbit'"),
        ("orbit:frame=3", "did you mean 'frames'"),
        (
            "flythrough:waypoints=3",
            "waypoints is '3'; expected a whole number from 4 to 10000",
        ),
        (
            "zoom:power=1",
            "power is '1'; expected a number above 1 and below 1000000",
        ),
        ("orbit:fovy=0", "field of view is 0"),
        ("orbit:near=5,far=5", "near < far"),
        ("orbit:visible=10", "visible=10; expected a share"),
        ("orbit:visible=1", "count from 2 to 9"),
        ("orbit:visible=100%", "visible=100%; expected"),
        ("orbit:visible=200%", "visible=200%; expected a share"),
        ("orbit:visible=0%", "visible=0%; expected a share"),
        ("orbit:visible=2.5", "visible=2.5; expected"),
        ("orbit:visible=-1", "visible=-1; expected"),
        ("nothing.csv", "No such file"),
        ("nothing.txt", "No such file"),
        ("no/where", "No such file"),
        ("datasets/", "datasets/: Is a directory"),
    ] {
        let error = load(source, &scene, &LensDefaults::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains(wanted), "{source}: {error}");
    }
}

#[test]
fn of_a_large_scene_some_views_are_tested_for_items() {
    let scene = scene("uniform:n=100000");
    let mut cameras = path("outside:frames=250", &scene).cameras;
    assert!(warnings(&scene, "p", &cameras).is_empty());
    for Camera { frame, .. } in &mut cameras {
        *frame = Frame::looking_along(frame.eye, -frame.forward(), frame.v()).unwrap();
    }
    let nothing = |views: &str| {
        format!("p: nothing of uniform:n=100000 as loaded is visible in any of {views}")
    };
    let told = |cameras: &[Camera]| warnings(&scene, "p", cameras);
    assert_eq!(told(&cameras), [nothing("125 of 250 views")]);
    assert_eq!(told(&cameras[..200]), [nothing("200 views")]);
}

#[test]
fn a_matrix_of_a_view_alone_is_doubted() {
    let scene = scene("uniform:n=50");
    let view = [
        [0.0, 1.0, 0.0, -3.0],
        [0.0, 0.0, 1.0, 2.0],
        [1.0, 0.0, 0.0, -10.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let told = |rows: [[f64; 4]; 4]| {
        let camera = Camera::of_matrix(rows, MatrixConvention::ColumnGl).unwrap();
        warnings(&scene, "p", &[camera]).join(", ")
    };
    assert!(told(view).contains("1 of 1 camera matrices without a lens"));
    let wider = view.map(|row| row.map(|x| x / 8.0));
    assert!(!told([wider[0], wider[1], wider[2], view[3]]).contains("lens"));
}

#[test]
fn angles_in_radians_are_doubted() {
    let scene = scene("uniform:n=50");
    let told = |fovy: [f64; 2]| {
        let row = |fovy| format!("0,0,0,1,0,0,{fovy}\n");
        let text = "eye_x,eye_y,eye_z,look_x,look_y,look_z,fovy_deg\n".to_owned();
        let text = text + &fovy.map(row).concat();
        let read = read_cameras_csv(text.as_bytes(), "c", &LensDefaults::default());
        let told = warnings(&scene, "c", &read.unwrap().cameras).join(", ");
        told.contains("c: a field of view under 2 degrees in all cameras")
    };
    // A zoom may end that narrow.
    assert_eq!([[1.1, 0.8], [60.0, 1.0]].map(told), [true, false]);
}

#[test]
fn reversed_depth_from_0_to_1_is_doubted_where_it_is_read_from_minus_1() {
    let scene = scene("uniform:n=50");
    let (near, far) = (0.1, 60.0);
    let rows = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, near / (far - near), near * far / (far - near)],
        [0.0, 0.0, -1.0, 0.0],
    ];
    // Depth -1 is a water plane.
    let oblique = [
        [1.155, 0.0, 0.0, 0.0],
        [0.0, -0.4977, 1.659, -9.954],
        [0.0, -0.9578, 2.136, -29.6],
        [0.0, 0.9578, 0.2873, 29.6],
    ];
    let told = |convention, rows| {
        let camera = Camera::of_matrix(rows, convention).unwrap();
        let told = warnings(&scene, "p", &[camera]).join(", ");
        told.contains("depth -1 is never reached")
    };
    let conventions = [MatrixConvention::ColumnGl, MatrixConvention::ColumnD3d];
    assert_eq!(conventions.map(|name| told(name, rows)), [true, false]);
    assert!(!told(conventions[0], oblique));
}

/// Two cameras along y with z up, and one that is rolled, turned down or far away.
#[test]
fn doubts_are_about_the_cameras_that_are_doubtful() {
    let scene = Scene::from_boxes("b", &[WorldBox::new(-DVec3::ONE, DVec3::ONE)]).unwrap();
    let told = |eye: f64, up: DVec3, near: &str| {
        let header = "eye_x,eye_y,eye_z,look_x,look_y,look_z,up_x,up_y,up_z";
        let [one, two] = [(DVec3::X, up), (DVec3::Y, DVec3::Z)].map(|(axis, up)| {
            let [x, y, z] = (axis * -eye).to_array();
            format!("{x},{y},{z},0,0,0,{},{},{},{near}\n", up.x, up.y, up.z)
        });
        let rows = format!("{header},near\n{one}{two}{two}");
        let path = read_cameras_csv(
            rows.as_bytes(),
            "c",
            &LensDefaults::default().of_scene(&scene),
        );
        path.map_or_else(
            |e| vec![e.to_string()],
            |p| warnings(&scene, "c", &p.cameras),
        )
    };
    assert_eq!(told(5.0, DVec3::Z, "1"), [""; 0]);
    let rolled = "c: y is up in 1 of 3 cameras, z in b";
    assert_eq!(told(5.0, DVec3::Y, "1"), [rolled]);
    let down = "c: 1 of 3 cameras rolled by more than 45 degrees, first with (0.000, 0.000, -1.000) up; z is up in b";
    assert_eq!(told(5.0, -DVec3::Z, "1"), [down]);
    let far = told(1e300, DVec3::Z, "1").concat();
    assert!(far.contains("as loaded, up to 2.89e299"), "{far}");
    let near = "near is 100 and far 6.928203230275509; expected near < far: a column far, or --far";
    assert_eq!(told(5.0, DVec3::Z, "100"), [format!("c, line 2: {near}")]);
}

#[test]
fn a_long_path_is_thinned_evenly() {
    let scene = scene::load("uniform:n=5", &Default::default()).unwrap();
    let mut all = path("orbit:frames=10", &scene);
    all.lines = (2..12).collect();
    all.times = (0..10).map(f64::from).collect();
    assert_eq!(all.clone().at_most(10).lines, all.lines);
    let some = all.clone().at_most(4);
    assert_eq!(some.lines, [2, 4, 7, 9]);
    assert_eq!(some.times, [0.0, 2.0, 5.0, 7.0]);
    assert_eq!(some.cameras[3], all.cameras[7]);
    assert_eq!((all.left_out, some.left_out), (0, 6));
}
