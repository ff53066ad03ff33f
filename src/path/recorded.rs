//! Recorded cameras and points: the CSV formats that other tools write.

use glam::DVec3;

use super::CameraPath;
use crate::camera::{
    Camera, CameraError, FARTHEST, Frame, Lens, LensKind, MATRIX_CONVENTIONS, MATRIX_ENTRIES,
    MatrixConvention, look_at,
};
use crate::input::{InputError, Result, Row, TableReader, finite, note};
use crate::scene::{Scene, WorldBox, memory};
use crate::shown::shortened;

defaults! {
    /// Values for missing columns of a file, and lenses of generated paths.
    ///
    /// `None` leaves the choice to the path.
    #[derive(Clone, Copy, PartialEq, Debug)]
    pub struct LensDefaults {
        /// Full vertical angle of view, 0 < fovy < 180; 60 if nothing is given.
        pub fovy_deg: Option<f64> = None,
        /// Width / height; 16:9 if nothing is given.
        pub aspect: Option<f64> = None,
        /// Distance of the near plane.
        pub near: Option<f64> = None,
        /// `Some(None)` is an infinite far plane.
        pub far: Option<Option<f64>> = None,
        /// Up vector in the image; [`load`](super::load) takes the scene's.
        pub up: DVec3 = DVec3::Z,
        /// Middle of the scene; set by [`load`](super::load).
        pub middle: DVec3 = DVec3::ZERO,
        /// Twice the scene's diagonal; set by [`load`](super::load).
        pub reach: f64 = 1000.0,
        /// Convention for reading files of matrices.
        pub matrix: Option<MatrixConvention> = None,
    }
}

impl LensDefaults {
    /// Angle of view in degrees, and width / height.
    pub fn shape(&self) -> [f64; 2] {
        [
            self.fovy_deg.unwrap_or(60.0),
            self.aspect.unwrap_or(16.0 / 9.0),
        ]
    }

    /// Near and far plane of a recorded camera without either.
    ///
    /// Far is twice the scene's diagonal, or the far side of the scene if the eye is farther
    /// outside; near is a thousandth of far or of twice the diagonal, whichever is smaller.
    pub fn depths(&self, eye: DVec3) -> (f64, Option<f64>) {
        let side = eye.distance(self.middle) + self.reach / 4.0;
        let far = self.far.unwrap_or(Some(side.max(self.reach).min(FARTHEST)));
        (self.near.unwrap_or_else(|| self.near_of(far)), far)
    }

    /// Near plane of a recorded camera whose far plane may lie far beyond the scene.
    fn near_of(&self, far: Option<f64>) -> f64 {
        let far = far.filter(|far| *far > 0.0).unwrap_or(f64::INFINITY);
        far.min(self.reach) / FAR_IN_NEARS
    }

    /// The same defaults with up axis and size of a scene.
    pub fn of_scene(&self, scene: &Scene) -> LensDefaults {
        let WorldBox { min, max } = scene.world_bounds();
        let diagonal = (max - min).length();
        LensDefaults {
            up: scene.up.vector(),
            middle: min / 2.0 + max / 2.0,
            // A point has no size.
            reach: if diagonal > 0.0 { 2.0 * diagonal } else { 2.0 }.min(FARTHEST),
            ..*self
        }
    }
}

/// far / near for cameras without a near plane.
const FAR_IN_NEARS: f64 = 1000.0;

/// Reads a cameras CSV: poses, or view-projection matrices.
///
/// Poses: `eye_x,eye_y,eye_z`, then `look_*` or `forward_*`, and any of `up_*`, `fovy_deg`,
/// `aspect`, `near`, `far` (empty or `inf` = infinite), `ortho_height` (world units: the lens is
/// orthographic, `fovy_deg` empty; empty: perspective). Matrices: `m00,m01,..,m33` (row, column)
/// and none of the others. Times in `time_s` must ascend; an empty one is unknown. Columns in any
/// order; a note names unread ones, except labels such as `name`.
///
/// # Errors
/// The line of the first value that is not a number or gives no valid camera, or of a time before
/// the last one; a file without cameras; matrices without a convention, or with an eye or a lens;
/// both a place to look at and a direction.
pub fn read_cameras_csv(bytes: &[u8], file: &str, defaults: &LensDefaults) -> Result<CameraPath> {
    let mut table = TableReader::open(bytes, file, &[&MATRIX_ENTRIES[..], &OF_EYES].concat())?;
    // With a convention also for other names, such as `_11`: the error is then about matrices.
    let has = |names: &[&str]| names.iter().any(|name| table.column(name).is_some());
    let is_matrix = has(&MATRIX_ENTRIES) || defaults.matrix.is_some() && !has(&OF_EYES);
    let read: CameraReader = match is_matrix {
        true => matrices(&table, defaults.matrix)?,
        false => eyes(&table, defaults)?,
    };
    let (clock, mut last, mut times) = (table.column("time_s"), f64::NEG_INFINITY, Vec::new());
    let (lines, cameras): (Vec<u64>, Vec<Camera>) = rows(&mut table, file, "no camera", |row| {
        if let Some(column) = clock.filter(|column| !row.text(*column).is_empty()) {
            last = row.time(column, last)?;
            times.push(last);
        }
        Ok((row.line, read(row)?))
    })?
    .into_iter()
    .unzip();
    match is_matrix {
        true => table.note_unread(&MATRIX_ENTRIES, &[TIME]),
        false => table.note_unread(&OF_EYES, &SYNONYMS),
    }
    let (all, empty) = (cameras.len(), cameras.len() - times.len());
    if ![0, all].contains(&empty) {
        times.clear();
        let of = format!("{empty} of {all} rows");
        note(&format!("{file}: time_s is empty in {of}; no time is used"));
    }
    Ok(CameraPath {
        name: file.to_owned(),
        times,
        cameras,
        lines,
        ..CameraPath::default()
    })
}

/// Makes the camera of a row, from the columns of one kind of file.
type CameraReader<'a> = Box<dyn Fn(&Row) -> Result<Camera> + 'a>;

/// Bytes that callers derive from a row, such as views.
const BESIDE: usize = 64;

/// All rows of a table, at least one.
fn rows<T>(
    table: &mut TableReader,
    file: &str,
    none: &str,
    mut read: impl FnMut(&Row) -> Result<T>,
) -> Result<Vec<T>> {
    let mut found: Vec<T> = Vec::new();
    while let Some(row) = table.next_row() {
        // The length of a pipe is unknown until it is read.
        if found.len() == found.capacity() {
            let needed = 2 * found.capacity() * (size_of::<T>() + BESIDE);
            memory::check_fits(file, needed as u64, 0, found.len() as u64)?;
        }
        found.push(read(&row?)?);
    }
    table.expect_rows(found.len(), none)?;
    Ok(found)
}

/// The error of a row whose numbers give no valid camera.
fn refused(row: &Row, error: CameraError) -> InputError {
    match error {
        CameraError::Invalid { found, expected } => row.error(found, expected),
        other => row.error(other, "a camera"),
    }
}

/// Columns that a matrix makes redundant.
#[rustfmt::skip]
const OF_EYES: [&str; 17] = [
    "eye_x", "eye_y", "eye_z", "look_x", "look_y", "look_z", "forward_x", "forward_y", "forward_z",
    "up_x", "up_y", "up_z", "fovy_deg", "ortho_height", "aspect", "near", "far",
];

/// The column of seconds as other programs name it.
const TIME: (&str, &str) = ("time", "time_s");

/// Columns that other programs write, and their equivalents here.
const SYNONYMS: [(&str, &str); 6] = [
    TIME,
    ("fovx_deg", "fovy_deg, the vertical one"),
    ("hfov", "fovy_deg, the vertical one"),
    ("roll", "up_x,up_y,up_z"),
    ("pitch", "forward_x,forward_y,forward_z"),
    ("yaw", "forward_x,forward_y,forward_z"),
];

fn matrices<'a>(
    table: &TableReader,
    convention: Option<MatrixConvention>,
) -> Result<CameraReader<'a>> {
    let columns = table.columns(&MATRIX_ENTRIES)?;
    if let Some(other) = OF_EYES.iter().find(|name| table.column(name).is_some()) {
        let found = format_args!("columns of a matrix and '{other}'");
        return Err(table.error(found, "m00 to m33 alone, or an eye and a lens"));
    }
    let convention = convention.ok_or_else(|| {
        let known = MATRIX_CONVENTIONS.map(|row| row.1).join(", ");
        let expected = format!("--matrix-convention with one of {known}");
        table.error("matrices, but not how to read them", expected)
    })?;
    Ok(Box::new(move |row| {
        let entries = bytemuck::cast(row.finite_numbers(&columns)?);
        Camera::of_matrix(entries, convention).map_err(|error| refused(row, error))
    }))
}

fn eyes<'a>(table: &TableReader, defaults: &'a LensDefaults) -> Result<CameraReader<'a>> {
    let vector = |name: &str| {
        let names = ["x", "y", "z"].map(|axis| format!("{name}_{axis}"));
        let has_any = names.iter().any(|name| table.column(name).is_some());
        let columns = table.columns(&names.each_ref().map(String::as_str));
        (has_any, columns)
    };
    let eye = vector("eye").1?;
    let [(has_look, look), (by_forward, forward), (has_up, up)] =
        ["look", "forward", "up"].map(vector);
    if has_look && by_forward {
        let expected = "a place to look at or a direction, not both";
        return Err(table.error("columns look_* and forward_*", expected));
    }
    if !has_look && !by_forward {
        let all = shortened(&table.header.join(","), 60);
        let found = format_args!("no column 'look_x' or 'forward_x' in '{all}'");
        return Err(table.error(found, "columns look_* (a place) or forward_* (a direction)"));
    }
    let target = if by_forward { forward? } else { look? };
    let up = has_up.then_some(up).transpose()?;
    let lens = ["fovy_deg", "ortho_height", "aspect", "near", "far"];
    let [fovy, height, aspect, near, far] = lens.map(|name| table.column(name));
    let by_scene = far.is_none() && defaults.far.is_none();
    Ok(Box::new(move |row| {
        let number = |column: Option<usize>, default: f64| {
            column.map_or(Ok(default), |column| row.finite_number(column))
        };
        let eye = point(row, eye)?;
        let target = point(row, target)?;
        let up = up.map_or(Ok(defaults.up), |columns| point(row, columns))?;
        let far = match far.map(|column| row.text(column)) {
            Some("") => None,
            Some(text) => {
                let far = text.parse::<f64>().ok();
                let far = far.filter(|far| *far > f64::NEG_INFINITY);
                let found = || format!("far '{}'", shortened(text, 60));
                let comma = finite(text).err().filter(|why| why.contains("comma"));
                let expected = comma.unwrap_or("a number above 0, inf or nothing");
                let refused = || row.error(found(), expected);
                let far = far.ok_or_else(refused)?;
                Some(far).filter(|far| far.is_finite())
            }
            None => defaults.depths(eye).1,
        };
        let is_filled = |column: &usize| !row.text(*column).is_empty();
        let height = height.filter(is_filled);
        if height.and(fovy).is_some_and(|column| is_filled(&column)) {
            return Err(row.error("fovy_deg and ortho_height", "one of them, not both"));
        }
        let height = height.map(|column| row.finite_number(column)).transpose()?;
        let [fovy_deg, wide] = defaults.shape();
        let fovy_deg = number(fovy.filter(|_| height.is_none()), fovy_deg)?;
        let aspect = number(aspect, wide)?;
        let near = number(near, defaults.near.unwrap_or_else(|| defaults.near_of(far)))?;
        let looking = match by_forward {
            true => Frame::looking_along,
            false => look_at,
        };
        let camera = looking(eye, target, up).and_then(|frame| {
            let kind = match height {
                Some(height) => LensKind::Orthographic { height, aspect },
                None => LensKind::Perspective { fovy_deg, aspect },
            };
            let lens = Lens::new(kind, near, far)?;
            Ok(Camera { frame, lens })
        });
        camera.map_err(|mut error| {
            if let CameraError::Invalid { found, expected } = &mut error {
                *expected = match *expected {
                    _ if !has_up && found.starts_with("up is") => "columns up_x,up_y,up_z",
                    "near < far" if by_scene => "near < far: a column far, or --far",
                    other => other,
                };
            }
            refused(row, error)
        })
    }))
}

/// Reads a points CSV with the columns `x,y,z`.
///
/// # Errors
/// The line of the first value that is not a finite number; a file without points.
pub fn read_points_csv(bytes: &[u8], file: &str) -> Result<Vec<DVec3>> {
    let mut table = TableReader::open(bytes, file, &["x", "y", "z"])?;
    let columns = table.columns(&["x", "y", "z"])?;
    let points = rows(&mut table, file, "no point", |row| point(row, columns))?;
    table.note_unread(&["x", "y", "z"], &[]);
    Ok(points)
}

fn point(row: &Row, columns: [usize; 3]) -> Result<DVec3> {
    Ok(row.finite_numbers(&columns)?.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::tell_notes;
    use crate::scene::read_boxes_csv;
    use std::sync::Mutex;

    fn read(text: &str) -> Result<CameraPath> {
        read_cameras_csv(text.as_bytes(), "c.csv", &LensDefaults::default())
    }

    #[test]
    fn full_rows_in_any_order_and_bare_ones_with_defaults() {
        let full = "far,near,eye_x,eye_y,eye_z,note,look_x,look_y,look_z,up_x,up_y,up_z,fovy_deg,aspect\n\
                    inf,0.5,1,2,3,hello,1,2,-7,0,1,0,90,1.5\n,0.5,1,2,3,,1,2,-7,0,1,0,90,1.5\n\
                    3.4028235e38,0.5,1,2,3,,1,2,-7,0,1,0,90,1.5\n+Infinity,0.5,1,2,3,,1,2,-7,0,1,0,90,1.5\n";
        let path = read(full).unwrap();
        assert_eq!(path.cameras, [path.cameras[0]; 4]);
        assert_eq!(path.cameras[0].frame.eye, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(path.cameras[0].frame.forward(), -DVec3::Z);
        assert_eq!(
            path.cameras[0].lens,
            Lens::perspective(90.0, 1.5, 0.5, None).unwrap()
        );
        let bare = "eye_x,eye_y,eye_z,forward_x,forward_y,forward_z\n0,0,0,0,2,0\n";
        let path = read(bare).unwrap();
        assert_eq!(path.cameras[0].frame.forward(), DVec3::Y);
        assert_eq!(path.cameras[0].frame.v(), DVec3::Z);
    }

    /// A far plane beyond the scene does not push the near plane into it.
    #[test]
    fn near_is_a_thousandth_of_the_nearer_of_far_and_scene() {
        let header = "eye_x,eye_y,eye_z,look_x,look_y,look_z,far\n";
        for (far, near) in [("10", 0.01), ("1e4", 1.0), ("1e38", 1.0), ("inf", 1.0)] {
            let path = read(&format!("{header}0,0,0,1,0,0,{far}\n")).unwrap();
            assert_eq!(path.cameras[0].lens.near(), near, "{far}");
        }
        let far = Some(Some(1e6));
        let defaults = LensDefaults {
            far,
            ..LensDefaults::default()
        };
        assert_eq!(defaults.depths(DVec3::ZERO), (1.0, Some(1e6)));
    }

    /// Line by line: with a height the lens is orthographic, without one perspective.
    #[test]
    fn a_height_is_an_orthographic_lens() {
        let header = "eye_x,eye_y,eye_z,look_x,look_y,look_z,fovy_deg,ortho_height,aspect,near,far";
        let eye = "0,0,0,1,0,0";
        let path = read(&format!("{header}\n{eye},,20,2,-5,9\n{eye},70,,2,1,9\n"));
        let lenses: Vec<Lens> = path.unwrap().cameras.iter().map(|c| c.lens).collect();
        let parallel = Lens::orthographic(20.0, 2.0, -5.0, 9.0).unwrap();
        let perspective = Lens::perspective(70.0, 2.0, 1.0, Some(9.0)).unwrap();
        assert_eq!(lenses, [parallel, perspective]);
        for (lens, wanted) in [
            (
                ",0,2,1,9",
                "the window is empty: 0 to 0 (height); expected low < high",
            ),
            (",-3,2,1,9", "0 to -3 (height)"),
            (",2,2,1,inf", "far is inf; expected a finite number"),
            (",2,2,9,9", "near is 9 and far 9"),
            (",high,2,1,9", "ortho_height 'high'"),
            (",,2,1,9", "fovy_deg"),
        ] {
            let error = read(&format!("{header}\n{eye},{lens}\n"));
            let error = error.unwrap_err().to_string();
            assert!(
                error.starts_with("c.csv, line 2: ") && error.contains(wanted),
                "{error}"
            );
        }
    }

    #[test]
    fn bad_cameras_name_their_line_and_the_rule() {
        let header =
            "eye_x,eye_y,eye_z,look_x,look_y,look_z,up_x,up_y,up_z,fovy_deg,aspect,near,far";
        let good = "0,0,0,1,0,0,0,0,1,60,1,1,9";
        let cases = [
            ("0,0,0,1,0,0,0,0,1,0,1,1,9", "field of view is 0"),
            (
                "0,0,0,1,0,0,0,0,1,60,1,9,9",
                "near is 9 and far 9; expected near < far",
            ),
            ("0,0,0,1,0,0,0,0,1,60,1,0,9", "near is 0"),
            ("0,0,0,0,0,2,0,0,1,60,1,1,9", "parallel"),
            ("0,0,0,0,0,0,0,0,1,60,1,1,9", "same point"),
            ("0,0,0,1,0,0,0,0,1,60,-1,1,9", "aspect ratio is -1"),
            ("0,0,zero,1,0,0,0,0,1,60,1,1,9", "eye_z 'zero'"),
            ("0,0,nan,1,0,0,0,0,1,60,1,1,9", "eye_z 'nan'"),
        ];
        for (row, wanted) in cases {
            let error = read(&format!("{header}\n{good}\n{row}\n"))
                .unwrap_err()
                .to_string();
            assert!(
                error.starts_with("c.csv, line 3: ") && error.contains(wanted),
                "{error}"
            );
        }
        assert!(read("").unwrap_err().to_string().contains("an empty file"));
        let none = read(&format!("{header}\n")).unwrap_err().to_string();
        assert!(none.contains("no camera"), "{none}");
        let both = read(&format!("{header},forward_z\n{good},1\n"));
        let wanted = "c.csv, line 1: columns look_* and forward_*; expected a place to look at or a \
                      direction, not both";
        assert_eq!(both.unwrap_err().to_string(), wanted);
        let wrong = read("x,y,z\n1,2,3\n").unwrap_err().to_string();
        assert!(wrong.contains("no column 'eye_x'"), "{wrong}");
        let row_d3d = LensDefaults {
            matrix: Some(MatrixConvention::RowD3d),
            ..LensDefaults::default()
        };
        let wrong = read_cameras_csv(b"_11,_12\n1,2\n", "c.csv", &row_d3d);
        let wrong = wrong.unwrap_err().to_string();
        assert!(wrong.contains("no column 'm00'"), "{wrong}");
    }

    #[test]
    fn cameras_come_in_the_order_of_their_times() {
        let read = |times: [&str; 3]| {
            let rows = times.map(|time| format!("{time},0,0,0,1,0,0\n")).concat();
            read(&format!(
                "time_s,eye_x,eye_y,eye_z,look_x,look_y,look_z\n{rows}"
            ))
        };
        assert_eq!(read(["-1", "", "0.5"]).unwrap().cameras.len(), 3);
        assert_eq!(read(["2", "2", "2.5"]).unwrap().cameras.len(), 3);
        let error = |times| read(times).unwrap_err().to_string();
        let wanted = "c.csv, line 4: time_s 1 after 2; expected times in ascending order";
        assert_eq!(error(["0", "2", "1"]), wanted);
        assert!(error(["0", "now", "1"]).contains("line 3: time_s 'now'"));
    }

    #[test]
    fn columns_that_are_not_read_are_told_once() {
        static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());
        tell_notes(|note| HEARD.lock().unwrap().push(note.to_owned()));
        let cameras = "eye_x,eye_y,eye_z,look_x,look_y,look_z,time_s,fov,Far,zfar,ortho_size,roll,,name,size,hfov\n\
                       0,0,0,1,0,0,0,90,9,9,9,0,,a,1,90\n";
        let points = "x,y,z,X\n1,2,3,4\n";
        let boxes = "min_x,min_y,min_z,max_x,max_y,max_z,Min_X,max_speed\n0,0,0,1,1,1,2,3\n";
        for _ in 0..2 {
            read_cameras_csv(cameras.as_bytes(), "note-c.csv", &Default::default()).unwrap();
            read_points_csv(points.as_bytes(), "note-p.csv").unwrap();
            read_boxes_csv(boxes.as_bytes(), "note-b.csv", false).unwrap();
        }
        let heard = HEARD.lock().unwrap();
        let heard: Vec<&String> = heard
            .iter()
            .filter(|n| n.starts_with("note: note-"))
            .collect();
        assert_eq!(
            heard,
            [
                "note: note-c.csv, line 1: columns that are not read: 'fov' (did you mean 'fovy_deg'?), \
                 'Far' (did you mean 'far'?), 'zfar' (did you mean 'far'?), 'ortho_size' (did you \
                 mean 'ortho_height'?), 'roll' (did you mean 'up_x,up_y,up_z'?), 'size', \
                 'hfov' (did you mean 'fovy_deg, the vertical one'?)",
                "note: note-p.csv, line 1: columns that are not read: 'X' (did you mean 'x'?)",
                "note: note-b.csv: column 'Min_X' is kept as a label beside 'min_x'",
            ]
        );
    }

    #[test]
    fn points_are_three_columns() {
        assert_eq!(
            read_points_csv("z,y,x\n3,2,1\n".as_bytes(), "p.csv").unwrap(),
            [DVec3::new(1.0, 2.0, 3.0)]
        );
        for (text, wanted) in [
            ("", "empty file"),
            ("\n\n\nx,y,z\n", "line 5: no point"),
            ("x,y,z\n1,2,q\n", "z 'q'"),
        ] {
            let error = read_points_csv(text.as_bytes(), "p.csv")
                .unwrap_err()
                .to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
