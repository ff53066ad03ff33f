//! `query`: the columns, the same answer from every structure, the answer of
//! a scalar six-plane test written here, and every way to tell a camera.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::Value;

use super::process::*;
use super::{BOXES, EYE_LOOK};

pub const QUERY: &str =
    "camera,structure,test,total_count,visible_count,visible_id_sum,nodes_tested,items_tested";

/// Runs `query` and checks what holds for every answer: the header, one row
/// per camera and structure in this order, and the same answer from all.
pub fn query(
    folder: &Path,
    scene: &str,
    cameras: &str,
    options: &str,
) -> Vec<BTreeMap<String, String>> {
    let line = format!("query --scene {scene} --cameras {cameras} --structure all {options}");
    let text = works(folder, &line);
    let header = if options.contains("--ids") {
        format!("{QUERY},visible_ids")
    } else {
        QUERY.to_owned()
    };
    assert_eq!(text.lines().next(), Some(header.as_str()));
    let (rows, names) = (rows(&text), structure_names());
    assert_eq!(rows.len() % names.len(), 0, "{scene} {cameras}");
    for (camera, group) in rows.chunks(names.len()).enumerate() {
        for (row, name) in group.iter().zip(&names) {
            assert_eq!(
                (&row["camera"], &row["structure"]),
                (&camera.to_string(), name)
            );
            assert_eq!(row["test"], "six-plane");
            for column in ["total_count", "visible_count", "visible_id_sum"] {
                assert_eq!(
                    row[column], group[0][column],
                    "{scene} camera {camera} {name}"
                );
            }
        }
    }
    rows
}

pub fn number(row: &BTreeMap<String, String>, column: &str) -> u64 {
    row[column].parse().expect(column)
}

#[test]
fn all_structures_agree_on_the_real_scenes() {
    let structures = structure_names().len();
    let cases = [
        ("helsinki_boxes.csv", 11_065, "flythrough:frames=6", 6),
        ("us_counties_boxes.csv", 3_510, "orbit:frames=6", 6),
        ("freedm_map12.wad", 274, "places", 21),
        ("freedm_map20.wad", 1_554, "places", 108),
        ("freedm_map20.wad", 1_554, "teleport:frames=6,far=inf", 6),
    ];
    for (file, total, path, cameras) in cases {
        let rows = query(datasets(), file, path, "");
        assert_eq!(rows.len(), cameras * structures, "{file} {path}");
        assert!(rows.iter().all(|row| number(row, "total_count") == total));
        let seen = rows.iter().filter(|row| number(row, "visible_count") > 0);
        assert!(
            seen.count() * 2 > rows.len(),
            "{file} {path} sees next to nothing"
        );
    }
    // The files are those that come with the program.
    for (file, name) in [
        ("freedm_map12.wad", "freedm-map12"),
        ("helsinki_boxes.csv", "helsinki"),
    ] {
        let digest = |scene: &str| {
            let info = works(datasets(), &format!("scene info {scene} --format json"));
            json(&info)["digest"].clone()
        };
        assert_eq!(digest(file), digest(name));
    }
}

/// A camera whose axes are coordinate axes, and the linear functions that are
/// not negative inside each of its planes: (coefficients, constant).
struct AxisCamera {
    eye: [f64; 3],
    forward: [f64; 3],
    up: [f64; 3],
    fovy: f64,
    aspect: f64,
    near: f64,
    far: Option<f64>,
}

impl AxisCamera {
    fn row(&self) -> String {
        let mut fields: Vec<String> = [self.eye, self.forward, self.up]
            .concat()
            .iter()
            .chain([&self.fovy, &self.aspect, &self.near])
            .map(f64::to_string)
            .collect();
        fields.push(self.far.map_or("inf".to_owned(), |far| far.to_string()));
        fields.join(",")
    }

    fn planes(&self) -> Vec<([f64; 3], f64)> {
        let ([fx, fy, fz], [ux, uy, uz]) = (self.forward, self.up);
        let right = [fy * uz - fz * uy, fz * ux - fx * uz, fx * uy - fy * ux];
        let tangent = (self.fovy.to_radians() / 2.0).tan();
        let mut planes = Vec::new();
        for (axis, slope) in [(self.up, tangent), (right, tangent * self.aspect)] {
            for sign in [1.0, -1.0] {
                // slope * depth - sign * offset >= 0
                let normal = [0, 1, 2].map(|k| slope * self.forward[k] - sign * axis[k]);
                planes.push((normal, 0.0));
            }
        }
        planes.push((self.forward, -self.near));
        planes.extend(self.far.map(|far| (self.forward.map(|c| -c), far)));
        let about_eye = |(normal, d): ([f64; 3], f64)| {
            let at_eye: f64 = (0..3).map(|k| normal[k] * self.eye[k]).sum();
            (normal, d - at_eye)
        };
        planes.into_iter().map(about_eye).collect()
    }
}

/// The largest value of a linear function over a box.
fn largest(b: &[f64; 6], (normal, d): &([f64; 3], f64)) -> f64 {
    let axes = (0..3).map(|k| (normal[k] * b[k]).max(normal[k] * b[k + 3]));
    axes.sum::<f64>() + d
}

#[test]
fn answers_are_those_of_a_scalar_six_plane_test() {
    let cameras = [
        AxisCamera {
            eye: [0.0; 3],
            forward: [1.0, 0.0, 0.0],
            up: [0.0, 0.0, 1.0],
            fovy: 90.0,
            aspect: 1.0,
            near: 10.0,
            far: Some(70.0),
        },
        AxisCamera {
            eye: [5.0, -80.0, 3.0],
            forward: [0.0, 1.0, 0.0],
            up: [1.0, 0.0, 0.0],
            fovy: 40.0,
            aspect: 2.0,
            near: 1.0,
            far: None,
        },
        AxisCamera {
            eye: [-20.0, 10.0, 90.0],
            forward: [0.0, 0.0, -1.0],
            up: [0.0, -1.0, 0.0],
            fovy: 60.0,
            aspect: 0.5,
            near: 0.5,
            far: Some(150.0),
        },
    ];
    let planes: Vec<_> = cameras.iter().map(AxisCamera::planes).collect();
    // Boxes that no plane comes near, so that no rounding matters.
    let mut random = Random(7);
    let mut boxes: Vec<[f64; 6]> = Vec::new();
    while boxes.len() < 2000 {
        let low = [0; 3].map(|_| random.between(-100, 100) as f64);
        let high = low.map(|l| l + random.between(0, 40) as f64 / 4.0);
        let b = [low, high].concat().try_into().expect("six numbers");
        if planes
            .iter()
            .flatten()
            .all(|plane| largest(&b, plane).abs() > 0.01)
        {
            boxes.push(b);
        }
    }
    let line = |b: &[f64; 6]| b.map(|v| v.to_string()).join(",");
    let scene = format!(
        "{BOXES}\n{}\n",
        boxes.iter().map(line).collect::<Vec<_>>().join("\n")
    );
    let header =
        "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z,up_x,up_y,up_z,fovy_deg,aspect,near,far";
    let rows_of_cameras: Vec<String> = cameras.iter().map(AxisCamera::row).collect();
    let text = format!("{header}\n{}\n", rows_of_cameras.join("\n"));
    let folder = folder(&[("s.csv", scene.as_bytes()), ("c.csv", text.as_bytes())]);
    let rows = query(folder.path(), "s.csv", "c.csv", "--ids");
    let structures = structure_names().len();
    assert_eq!(rows.len(), 3 * structures);
    for row in rows {
        let planes = &planes[number(&row, "camera") as usize];
        let sees = |b: &[f64; 6]| planes.iter().all(|plane| largest(b, plane) >= 0.0);
        let wanted: Vec<u64> = (0..)
            .zip(&boxes)
            .filter(|(_, b)| sees(b))
            .map(|(id, _)| id)
            .collect();
        assert!((20..1500).contains(&wanted.len()), "{}", wanted.len());
        let found: Vec<u64> = row["visible_ids"]
            .split(' ')
            .map(|id| id.parse().expect("an id"))
            .collect();
        assert_eq!(
            found, wanted,
            "camera {} {}",
            row["camera"], row["structure"]
        );
        assert_eq!(number(&row, "visible_count"), wanted.len() as u64);
        assert_eq!(number(&row, "visible_id_sum"), wanted.iter().sum::<u64>());
        assert_eq!(number(&row, "total_count"), 2000);
    }
}

#[test]
fn query_in_json_has_the_columns_of_csv() {
    let folder = with_good_files(&[]);
    let (scene, path) = ("uniform:n=300", "teleport:frames=5");
    let rows = query(folder.path(), scene, path, "--ids");
    for ids in [false, true] {
        let more = if ids { "--ids" } else { "" };
        let line = format!("query --scene {scene} --cameras {path} --format json {more}");
        let text = works(folder.path(), &line);
        let objects = json(&text);
        let objects = objects.as_array().expect("an array");
        assert_eq!(objects.len(), rows.len());
        for (object, row) in objects.iter().zip(&rows) {
            let wanted: BTreeSet<&str> = row
                .keys()
                .map(String::as_str)
                .filter(|k| ids || *k != "visible_ids")
                .collect();
            assert_eq!(keys(object), wanted);
            for (key, value) in object.as_object().expect("an object") {
                let plain = match value {
                    Value::String(text) => text.clone(),
                    Value::Array(ids) => ids
                        .iter()
                        .map(Value::to_string)
                        .collect::<Vec<_>>()
                        .join(" "),
                    other => other.to_string(),
                };
                assert_eq!(plain, row[key], "{key}");
            }
        }
    }
}

/// One camera, told in many ways.
#[test]
fn cameras_may_be_told_in_every_way_of_the_format() {
    let same = [
        "eye_x,eye_y,eye_z,look_x,look_y,look_z,up_x,up_y,up_z,fovy_deg,aspect,near,far\n1,-2,3,1,98,3,0,0,1,50,1.5,2,400\n",
        "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z,up_x,up_y,up_z,fovy_deg,aspect,near,far\n1,-2,3,0,7,0,0,0,5,50,1.5,2,400\n",
        "far,up_z,note,near,look_z,eye_z,fovy_deg,up_x,eye_x,look_x,time_s,aspect,look_y,eye_y,up_y\n400,1,hello,2,3,3,50,0,1,1,0.5,1.5,98,-2,0\n",
        "\u{feff}eye_x , eye_y,eye_z,look_x,look_y,look_z,up_x,up_y,up_z,fovy_deg,aspect,near,far\r\n 1,-2,3, 1,98,3,0,0,1,5e1,+1.5,2.0,400\r\n",
        "eye_x,eye_y,eye_z,look_x,look_y,look_z,fovy_deg,aspect,near,far\n1,-2,3,1,98,3,50,1.5,2,400\n",
    ];
    let scene = "uniform:n=3000,side=600";
    let folder = folder(&[]);
    let answer = |text: &str, options: &str| -> String {
        fs::write(folder.path().join("c.csv"), text).expect("writable");
        let line = format!("query --scene {scene} --cameras c.csv --ids {options}");
        works(folder.path(), &line)
    };
    let wanted = answer(same[0], "");
    assert!(number(&rows(&wanted)[0], "visible_count") > 10, "{wanted}");
    for text in same {
        assert_eq!(answer(text, ""), wanted, "{text}");
    }
    // Columns win over options; options stand in for columns.
    let bare = format!("{EYE_LOOK}\n1,-2,3,1,98,3\n");
    fs::write(folder.path().join("c.csv"), same[0]).expect("writable");
    let options = "--fovy 20 --aspect 1 --near 300 --far 310";
    let line = format!("query --scene {scene} --cameras c.csv --ids {options}");
    let told = cullbench(folder.path(), &line);
    assert_eq!(told.out, wanted);
    assert!(
        told.err
            .contains("not used, its cameras have their own: --fovy"),
        "{told:?}"
    );
    assert_eq!(
        answer(&bare, "--fovy 50 --aspect 1.5 --near 2 --far 400"),
        wanted
    );
    let others = [
        "--fovy 20 --aspect 1.5 --near 2 --far 400",
        "--fovy 50 --aspect 1 --near 2 --far 400",
        "--fovy 50 --aspect 1.5 --near 300 --far 400",
        "--fovy 50 --aspect 1.5 --near 2 --far 310",
    ];
    for options in others {
        assert_ne!(answer(&bare, options), wanted, "{options}");
    }
    // Infinite: empty, inf, the option.
    let far = |value: &str| answer(&format!("{EYE_LOOK},far\n1,-2,3,1,98,3,{value}\n"), "");
    let infinite = far("");
    for text in ["inf", "Infinity", "+inf"] {
        assert_eq!(far(text), infinite, "{text}");
    }
    assert_eq!(answer(&bare, "--far inf"), infinite);
    let count = |text: &str| number(&rows(text)[0], "visible_count");
    assert!(count(&far("200")) < count(&infinite));
    assert!(count(&infinite) >= count(&answer(&bare, "")));
}

/// 60 degrees, 16:9, far twice the scene's diagonal or its far side, near far/1000.
///
/// A box just inside and one just outside, in units a thousand times as large too. The diagonal is 700.
#[test]
fn the_lens_defaults_are_the_documented_ones() {
    let boxes = "0,1.3,0,0,1.39,0\n0,1.41,0,0,1.5,0\n0,100,57,0,100,57.5\n0,100,58,0,100,59\n\
                 102,100,0,102.5,100,0\n103,100,0,104,100,0\n\
                 -96,0,-200,-96,0,-200\n104,600,100,104,600,100\n";
    let cameras = "0,0,0,0,1,0\n0,-9000,0,0,1,0\n";
    let scaled = |text: &str| {
        let number = |n: &str| (n.parse::<f64>().expect("a number") * 1000.0).to_string();
        let row = |row: &str| row.split(',').map(number).collect::<Vec<_>>().join(",");
        text.lines().map(row).collect::<Vec<_>>().join("\n")
    };
    for [boxes, cameras] in [[boxes, cameras], [&scaled(boxes), &scaled(cameras)]] {
        let [boxes, cameras] = [
            format!("{BOXES}\n{boxes}"),
            format!("{EYE_LOOK}\n{cameras}"),
        ];
        let folder = folder(&[("s.csv", boxes.as_bytes()), ("c.csv", cameras.as_bytes())]);
        for row in query(folder.path(), "s.csv", "c.csv", "--ids") {
            let wanted = ["1 2 4 7", "0 1 2 3 4 5 6 7"];
            let camera = number(&row, "camera") as usize;
            assert_eq!(row["visible_ids"], wanted[camera], "{}", row["structure"]);
        }
        let info = works(folder.path(), "scene info s.csv --path c.csv --format json");
        let lens = &json(&info)["cameras"]["lens"];
        let [near, far] = ["near", "far"].map(|depth| lens[depth][0].as_f64().expect("a number"));
        assert!(
            far == 1000.0 * near && (far == 1400.0 || far == 1.4e6),
            "{lens}"
        );
    }
}
