//! The pictures of a run as files.
//!
//! Growth with the number of items, and the speed-ups of each scene and path.

use super::figure::picture;
use super::{run_figures, surface_tables};
use crate::report::{Overall, Report, comparisons, surfaces};

/// A picture with a name that fits a file.
pub struct Picture {
    pub name: String,
    pub svg: String,
}

/// A picture for each class of shares that has at least two sizes, and one for each
/// scene and path that ranks anything.
pub fn pictures(report: &Report) -> Vec<Picture> {
    let mut pictures: Vec<Picture> = Vec::new();
    let mut add = |words: [&str; 4], figure| {
        let name = file_name(words, &pictures);
        let svg = picture(&[figure], 1);
        pictures.push(Picture { name, svg });
    };
    for surface in surfaces(comparisons(report)) {
        for (shown, figure) in surface_tables::growth(&surface) {
            add(
                [&surface.world, surface.cache, surface.test, &shown],
                figure,
            );
        }
    }
    for comparison in &comparisons(report) {
        let about = comparison.about();
        let base = Overall::of(&[comparison]).base;
        if let Some(mut figure) = base.and_then(|base| run_figures::speedups(comparison, base)) {
            let [scene, path] = [&about.scene.name, &about.path.name];
            figure.caption = format!("{scene}, {path}: {}", figure.caption);
            add([scene, path, &about.path.cache, &about.test], figure);
        }
    }
    pictures
}

/// A name of its own, of less than the 255 bytes that file systems take.
fn file_name(words: [&str; 4], taken: &[Picture]) -> String {
    let words = words.map(|word| word.chars().take(70).collect::<String>());
    let name: String = slug(&words.join("-")).chars().take(200).collect();
    let is_free = |name: &String| taken.iter().all(|picture| picture.name != *name);
    // Two worlds may look the same to a file system.
    let mut names = (1..).map(|n| match n {
        1 => name.clone(),
        n => format!("{name}-{n}"),
    });
    names.find(is_free).unwrap_or_default()
}

/// Letters, digits and points; a dash for anything else.
fn slug(words: &str) -> String {
    let plain = words.chars().map(|c| match c {
        c if c.is_ascii_alphanumeric() || c == '.' => c,
        _ => '-',
    });
    let name: String = plain.collect::<String>().replace("--", "-");
    name.trim_matches(['-', '.']).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fit_a_file() {
        assert_eq!(
            slug("city:seed=7-warm-six-plane-0.1 %"),
            "city-seed-7-warm-six-plane-0.1"
        );
        assert_eq!(slug("../a/b.csv"), "a-b.csv");
        let world = "x".repeat(3000);
        let mut pictures: Vec<Picture> = Vec::new();
        for world in [&world, &format!("{world}y"), "a", "a-warm-t-2 %-2", "a"] {
            let name = file_name([world, "warm", "t", "2 %"], &pictures);
            assert!(
                name.len() < 250 && pictures.iter().all(|p| p.name != name),
                "{name}"
            );
            let svg = String::new();
            pictures.push(Picture { name, svg });
        }
    }
}
