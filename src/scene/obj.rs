//! Wavefront OBJ: every object or group with faces is an item.
//!
//! A group that is opened again is another item of the same name. Faces become opaque triangles,
//! counter-clockwise as seen from the outside: fans, or ears of a concave face. Boxes contain the
//! vertices as written. Weights and colours of vertices, normals and texture coordinates have no
//! effect. Source: Wavefront Technologies, Advanced Visualizer Manual, appendix B1, "Object Files
//! (.obj)".
//!
//! Our own reader: the crate tobj (4.0.5) panics in debug builds on `f 1/-5 2/-5 3/-5`, makes
//! triangles of `l 1 2 3 4`, and checks indices without knowing the line.

use std::collections::BTreeSet;
use std::fmt::Display;

use glam::DVec3;

use super::face::add_triangles;
use super::surface::own_points;
use super::{Labels, LoadOptions, Scene, Surfaces, UpAxis, WorldBox, choose_origin, memory};
use crate::input::{InputError, Result, finite, note};
use crate::shown::{counted, first_of, shortened};

/// First words of lines that are interpreted.
const KNOWN: [&[u8]; 8] = [b"v", b"f", b"o", b"g", b"vt", b"vn", b"vp", b"s"];
/// First words of lines that are reported as not read.
const UNREAD: [&[u8]; 4] = [b"mtllib", b"usemtl", b"l", b"p"];
/// Bytes in memory per byte of a file that is one large polygon.
const BYTES_PER_BYTE: u64 = 12;
/// Most unread words that are counted.
const MOST_UNREAD: usize = 100;

/// Recognises OBJ by the first word that is no comment and no header of boxes CSV.
pub fn is_obj(bytes: &[u8]) -> bool {
    let lines = text(bytes).split(|byte| matches!(byte, b'\n' | b'\r'));
    let mut lines = lines.map(|line| line.trim_ascii());
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(b"#"));
    first.is_some_and(|line| {
        let word = words(line).next().unwrap_or_default();
        let is_header = line.windows(5).any(|part| part == b"min_x");
        let is_known = KNOWN.iter().chain(&UNREAD).any(|known| *known == word);
        is_known && word.len() < line.len() && !is_header
    })
}

/// Reads a scene; y is up unless the options say otherwise.
///
/// # Errors
/// The first line with invalid numbers or a missing vertex; a file without faces; a scene that does
/// not fit into memory or into f32.
pub fn read_obj(bytes: &[u8], file: &str, name: &str, options: &LoadOptions) -> Result<Scene> {
    let size = bytes.len() as u64;
    let needed = size.saturating_mul(BYTES_PER_BYTE);
    memory::check_fits(name, needed, options.structures, size)?;
    let mut obj = Obj {
        file,
        points: Vec::new(),
        corners: Vec::new(),
        items: vec![(String::new(), 0)],
        object: String::new(),
        unread: BTreeSet::new(),
    };
    let (mut rest, mut number) = (text(bytes), 1);
    while !rest.is_empty() {
        let (line, lines) = first_line(rest);
        obj.line(line, number)?;
        (rest, number) = (&rest[line.len()..], number + lines);
    }
    let triangles = obj.corners.len() as u64;
    let number = number.max(2) - 1;
    if triangles == 0 {
        let expected = "at least one line 'f' with three corners";
        return Err(obj.error(number, "no faces", expected));
    }
    if triangles > u64::from(u32::MAX) / 4 || obj.points.len() as u64 > u64::from(u32::MAX) {
        let found = format!("{triangles} triangles");
        return Err(obj.error(number, found, "at most a billion"));
    }
    options.check_fits(name, None, triangles)?;
    if !obj.unread.is_empty() {
        let unread = first_of(&obj.unread.iter().collect::<Vec<_>>(), 8);
        let what = format_args!("lines that are not read: {unread}; all surfaces are opaque");
        note(&format!("{file}: {what}"));
    }
    Ok(Scene {
        up: options.up.unwrap_or(UpAxis::Y),
        ..obj.into_scene(name)?
    })
}

/// The bytes without a byte order mark.
fn text(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let words = line.split(|byte| byte.is_ascii_whitespace() || *byte == b'\\');
    words.filter(|word| !word.is_empty())
}

/// Returns a line with its continuations by backslashes, and their number.
///
/// A comment ends with its line.
fn first_line(text: &[u8]) -> (&[u8], u64) {
    let (mut end, mut lines) = (0, 0);
    let is_end = |at: usize| match text[at] {
        b'\r' => text.get(at + 1) != Some(&b'\n'),
        byte => byte == b'\n',
    };
    while let Some(last) = (end..text.len()).find(|at| is_end(*at)) {
        let own = &text[end..=last];
        (end, lines) = (end + own.len(), lines + 1);
        let is_continued = own.trim_ascii_end().ends_with(b"\\");
        if !is_continued || words(own).any(|word| word.starts_with(b"#")) {
            return (&text[..end], lines);
        }
    }
    (text, lines + 1)
}

struct Obj<'f> {
    file: &'f str,
    points: Vec<DVec3>,
    /// Triangles as indices of points.
    corners: Vec<[u32; 3]>,
    /// Name and first triangle; the last item may have no triangles yet.
    items: Vec<(String, usize)>,
    /// Name of the object that is being read.
    object: String,
    unread: BTreeSet<String>,
}

impl Obj<'_> {
    fn error(&self, line: u64, found: impl Display, expected: impl Display) -> InputError {
        InputError::line(self.file, line, found, expected)
    }

    fn line(&mut self, line: &[u8], number: u64) -> Result<()> {
        let mut words = words(line).take_while(|word| !word.starts_with(b"#"));
        let Some(word) = words.next() else {
            return Ok(());
        };
        match word {
            b"v" => {
                let mut point = [0.0; 3];
                for (axis, value) in ["x", "y", "z"].iter().zip(&mut point) {
                    let word = words.next().unwrap_or_default();
                    let text = String::from_utf8_lossy(word);
                    *value = finite(&text).map_err(|expected| {
                        let found = format!("{axis} '{}'", shortened(&text, 60));
                        self.error(number, found, expected)
                    })?;
                }
                // Numbers of a weight or a colour.
                let more = words.count();
                if more > 4 {
                    let found = format!("a vertex of {}", counted(3 + more, "number"));
                    return Err(self.error(number, found, "3 to 7"));
                }
                self.points.push(point.into());
            }
            b"f" => {
                let face = words.map(|word| self.corner(word, number));
                let face: Vec<u32> = face.collect::<Result<_>>()?;
                if face.len() < 3 {
                    let found = counted(face.len(), "corner");
                    return Err(self.error(number, found, "three or more"));
                }
                add_triangles(&self.points, &face, &mut self.corners)
                    .map_err(|found| self.error(number, found, "at most 1,000, or triangles"))?;
            }
            b"o" | b"g" => {
                let start = line.iter().position(|byte| *byte == word[0]).unwrap_or(0) + 1;
                let is_comment =
                    |at: &usize| line[*at] == b'#' && line[at - 1].is_ascii_whitespace();
                let end = (start..line.len()).find(is_comment);
                let name = String::from_utf8_lossy(&line[start..end.unwrap_or(line.len())]);
                let plain = |line: &str| line.trim().trim_end_matches('\\').trim().to_owned();
                let lines: Vec<String> = name.lines().map(plain).collect();
                let mut name = lines.join(" ").trim().to_owned();
                self.items.pop_if(|(_, first)| *first == self.corners.len());
                match word {
                    b"o" => self.object.clone_from(&name),
                    // A group without a name is part of its object.
                    _ if name.is_empty() => name.clone_from(&self.object),
                    _ => {}
                }
                self.items.push((name, self.corners.len()));
            }
            _ if word.contains(&0) => {
                return Err(self.error(number, "zero bytes, as in UTF-16 text", "UTF-8 text"));
            }
            _ if KNOWN.contains(&word) || self.unread.len() == MOST_UNREAD => {}
            _ => {
                let word = shortened(&String::from_utf8_lossy(word), 20);
                self.unread.insert(format!("'{word}'"));
            }
        }
        Ok(())
    }

    /// The point of `7`, `-1` or `7/3/2`.
    fn corner(&self, word: &[u8], number: u64) -> Result<u32> {
        let own = word.split(|byte| *byte == b'/').next().unwrap_or_default();
        let index = std::str::from_utf8(own).ok();
        let index = index.and_then(|own| own.parse::<i64>().ok());
        let count = self.points.len() as i64;
        let place = index.and_then(|index| index.checked_add(if index < 0 { count } else { -1 }));
        match place {
            Some(place) if (0..count).contains(&place) => Ok(place as u32),
            _ => {
                let word = shortened(&String::from_utf8_lossy(word), 60);
                let found = format!("corner '{word}' after {}", counted(count as usize, "point"));
                let expected = match count {
                    0 => "vertices before faces".to_owned(),
                    _ => format!("an index from 1 to {count} or from -{count} to -1"),
                };
                Err(self.error(number, found, expected))
            }
        }
    }

    fn into_scene(mut self, name: &str) -> Result<Scene> {
        let end = self.corners.len();
        self.items.pop_if(|(_, first)| *first == end);
        self.items.push((String::new(), end));
        let corners = self.corners.iter().flatten();
        let corners = corners.map(|&corner| WorldBox::at(self.points[corner as usize]));
        let mut surfaces = Surfaces::about(choose_origin(corners));
        let (mut labels, mut places) = (Labels::new("name"), Vec::new());
        for pair in self.items.windows(2) {
            let triangles = &mut self.corners[pair[0].1..pair[1].1];
            let points = own_points(&self.points, triangles, &mut places);
            surfaces.push_written(&points, triangles);
            labels.push(&pair[0].0);
        }
        Ok(Scene {
            labels: vec![labels],
            ..surfaces.into_scene(name)?
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::SeededRng;
    use super::*;

    /// Triangles in four groups, one of them empty, and everything that is skipped.
    const TEXT: &str = "\u{feff}# made by hand \\
mtllib none.mtl
o solid
v 1000000.1 0 0 1.0
v 1000001.7 +0. -0 0.1 0.2 0.3 # weight
v\t1000000.1 2e0 .5 \r
v 1000000.1 0 3
vt 0 0
vn 0 0 1
s off
f 1/1/1 3/-1/-9 2//7
f 1 2 4
g empty
g other  part
usemtl steel
f -3 -2 -1
f 1 4 \\
  3
l 1 2 3 4 # a line \\
g last # of all
f 1 2 3 4";

    fn read(text: &[u8]) -> Result<Scene> {
        read_obj(text, "t.obj", "t", &LoadOptions::default())
    }

    #[test]
    fn objects_and_groups_with_faces_are_items_with_boxes_of_their_vertices() {
        assert!(is_obj(TEXT.as_bytes()));
        assert!(!is_obj(b"s\tmin_x\tmin_y\n") && !is_obj(b"# from Excel\ng ; min_x;min_y\n"));
        let scene = read(TEXT.as_bytes()).unwrap();
        let names = [0, 1, 2].map(|item| scene.labels[0].get(item).to_owned());
        assert_eq!(names, ["solid", "other  part", "last"]);
        assert_eq!((scene.up, scene.items.len()), (UpAxis::Y, 3));
        let surfaces = scene.surfaces.as_ref().unwrap();
        let counts: Vec<u32> = surfaces.of_item.iter().map(|r| r.end - r.start).collect();
        assert_eq!(counts, [2, 2, 2]);
        let points = [
            [0.1, 0.0, 0.0],
            [1.7, 0.0, 0.0],
            [0.1, 2.0, 0.5],
            [0.1, 0.0, 3.0],
        ];
        let points = points.map(|[x, y, z]| DVec3::new(1e6 + x, y, z));
        // As written: 1000000.1 and not its neighbour by addition.
        let written = [1_000_000.1, 1_000_001.7];
        for (item, b) in scene.items.iter().enumerate() {
            let all = WorldBox::union_of(points.map(WorldBox::at));
            for axis in 0..3 {
                let exact = match axis {
                    0 => written,
                    _ => [all.min[axis], all.max[axis]],
                };
                let stored = [b.min[axis], b.max[axis]];
                for (side, (stored, exact)) in stored.into_iter().zip(exact).enumerate() {
                    let out =
                        (f64::from(stored) - (exact - scene.origin[axis])) * [-1.0, 1.0][side];
                    let ulp = f64::from(stored.abs().next_up() - stored.abs());
                    assert!(
                        (0.0..=ulp).contains(&out),
                        "{item}, {axis}: {stored} for {exact}"
                    );
                }
            }
            let held = surfaces.bounds(item);
            assert!(b.min.cmple(held.min).all() && b.max.cmpge(held.max).all());
        }
    }

    #[test]
    fn a_group_without_a_name_is_of_the_object_before_it() {
        let points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for (groups, wanted) in [
            ("o house\ng\nf 1 2 3\ng\nf 1 3 2\n", ["house"; 2]),
            ("o house\ng roof\ng\nf 1 2 3\no\nf 1 3 2\n", ["house", ""]),
        ] {
            let scene = read(format!("{points}{groups}").as_bytes()).unwrap();
            let names = [0, 1].map(|item| scene.labels[0].get(item).to_owned());
            assert_eq!(names, wanted);
        }
    }

    #[test]
    fn single_triangles_are_items_of_their_own() {
        let options = LoadOptions::default();
        let scene = read(TEXT.as_bytes())
            .unwrap()
            .by_triangle(&options)
            .unwrap();
        assert_eq!(scene.items.len(), 6);
        assert_eq!(scene.labels[0].get(3), "other  part");
        let surfaces = scene.surfaces.as_ref().unwrap();
        // The first three points, and the first, second and fourth.
        for (written, item) in scene.written().zip([0, 1, 2, 3, 4, 5]) {
            let (b, held) = (scene.items[item], surfaces.bounds(item));
            assert!(b.min.cmple(held.min).all() && b.max.cmpge(held.max).all());
            let x = (written.min.x, written.max.x);
            assert!(x == (1_000_000.1, 1_000_001.7) || item % 2 == 1, "{x:?}");
        }
        let boxes = Scene::from_boxes("b", &[]).unwrap().by_triangle(&options);
        let error = boxes.map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("no triangles; expected"), "{error}");
    }

    #[test]
    fn lines_end_as_an_editor_counts_them() {
        let text = "# old\nv 0 0 0\nv 1 0 0\nv 0 1 \\\n0\nf 1 2 3\n";
        for end in ["\n", "\r", "\r\n"] {
            let bytes = text.replace('\n', end);
            let read = |bytes: &str| {
                assert!(is_obj(bytes.as_bytes()), "{end:?}");
                read_obj(bytes.as_bytes(), "t.obj", "t", &LoadOptions::default())
            };
            assert_eq!(read(&bytes).unwrap().items.len(), 1);
            let error = read(&(bytes + "v 1")).map(|_| ()).unwrap_err().to_string();
            assert!(error.starts_with("t.obj, line 7: "), "{end:?}: {error}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let cases = [
            ("", "line 1: no faces; expected at least one line 'f'"),
            ("v 1 2 3\np 1\n", "line 2: no faces"),
            ("v 1 2\n", "line 1: z ''; expected a finite number"),
            ("v 1 nan 3\n", "y 'nan'; expected a finite number"),
            (
                "#\n\nv 1 2,5 3\n",
                "line 3: y '2,5'; expected a decimal point",
            ),
            (
                "v 1 2 3 4 5 6 7 8\n",
                "a vertex of 8 numbers; expected 3 to 7",
            ),
            (
                "v 1 2 3\nf 1 1 2\n",
                "line 2: corner '2' after 1 point; expected an index from 1",
            ),
            ("v 1 2 3\nf 1 1 0\n", "corner '0'"),
            ("v 1 2 3\nf 1 1 -2/1\n", "corner '-2/1'"),
            ("v 1 2 3\nf 1 -9223372036854775808 1\n", "corner '-922"),
            ("f 1 2 3\n", "expected vertices before faces"),
            ("v 1 2 3\nf 1 \\\n 1\n", "line 2: 2 corners; expected three"),
            ("v 1 2 3\n\\\nf\n", "line 2: no corners"),
            ("v 1 2 3\nf 1 1 /\n", "corner '/'"),
            ("\0v\0 \x001\n", "zero bytes, as in UTF-16"),
            (
                "v 1e300 2 3\nv -1e300 2 3\nf 1 1 2\n",
                "expected min <= max within the range of f32",
            ),
        ];
        for (text, wanted) in cases {
            let error = read(text.as_bytes()).map(|_| ()).unwrap_err().to_string();
            assert!(error.contains(wanted), "{text:?}: {error}");
            assert!(error.contains("expected") && !error.contains('\n'));
        }
    }

    #[test]
    fn other_texts_are_no_obj() {
        for text in [
            "min_x,min_y\n",
            "v,w\n1,2\n",
            "{}",
            "",
            "# only",
            "solid x\n",
            "v\n",
        ] {
            assert!(!is_obj(text.as_bytes()), "{text}");
        }
    }

    #[test]
    fn no_damage_ends_in_a_panic() {
        let mut rng = SeededRng::new(5);
        for _ in 0..3000 {
            let mut bytes = TEXT.as_bytes().to_vec();
            for _ in 0..1 + rng.below(3) {
                let at = rng.below(bytes.len());
                bytes[at] = b"0123456789-e.vfog/\\\n#\0 "[rng.below(23)];
            }
            if let Err(error) = read(&bytes) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}
