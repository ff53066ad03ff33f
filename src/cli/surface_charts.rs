//! The pictures of a crossover surface: time against the number of items, both
//! logarithmic, one line for each structure. It draws what was measured and
//! decides nothing.

use plotters::prelude::*;

use super::chart::{Area, Axis, Drawn, around, is_drawn, left_out, legend, log_log, svg};
use super::palette::{COLOURS, Look, SHAPES};
use super::{surface_tables, text};
use crate::report::{Place, Surface};

const SIZE: (u32, u32) = (900, 560);

/// A picture with a name that fits a file.
pub struct Picture {
    pub name: String,
    pub svg: String,
}

/// One picture for each class of shares that has at least two sizes.
pub fn pictures(surfaces: &[Surface]) -> anyhow::Result<Vec<Picture>> {
    let mut pictures: Vec<Picture> = Vec::new();
    for surface in surfaces {
        for class in surface.classes() {
            let mut beyond = 0;
            let curves: Vec<Curve> = surface
                .structures()
                .into_iter()
                .map(|name| {
                    let mut points = surface.curve(name, class, "query_ns");
                    let all = points.len();
                    points.retain(|&(items, ns)| is_drawn(items as f64) && is_drawn(ns));
                    beyond += all - points.len();
                    (name, points)
                })
                .filter(|(_, points)| points.len() > 1)
                .collect();
            if curves.is_empty() {
                continue;
            }
            let shown = surface_tables::class(class);
            let caption = format!(
                "{}: {shown} visible{}{}",
                surface_tables::title(surface),
                measured(surface, class),
                left_out(beyond)
            );
            let svg = svg(&caption, SIZE, |root| draw(root, &caption, &curves))?;
            let name = file_name(
                [&surface.world, surface.cache, surface.test, &shown],
                &pictures,
            );
            pictures.push(Picture { name, svg });
        }
    }
    Ok(pictures)
}

/// A name of its own, of less than the 255 bytes that file systems take.
fn file_name([world, cache, test, class]: [&str; 4], taken: &[Picture]) -> String {
    let world: String = world.chars().take(160).collect();
    let name = slug(&[&world, cache, test, class].join("-"));
    let is_free = |name: &String| taken.iter().all(|picture| picture.name != *name);
    // Two worlds may look the same to a file system.
    let mut names = (1..).map(|n| match n {
        1 => name.clone(),
        n => format!("{name}-{n}"),
    });
    names.find(is_free).unwrap_or_default()
}

type Curve<'s> = (&'s str, Vec<(usize, f64)>);

/// The shares that a class stands for, where it does not say it by itself.
fn measured(surface: &Surface, class: f64) -> String {
    let here = || surface.places.iter().filter(|place| place.class == class);
    if !here().any(Place::is_off_class) {
        return String::new();
    }
    let shares = || here().map(|place| place.share);
    let least = shares().fold(f64::INFINITY, f64::min);
    let most = shares().fold(0.0, f64::max);
    format!(
        " (measured: {} to {})",
        text::percent(least),
        text::percent(most)
    )
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

fn draw(root: &Area, caption: &str, curves: &[Curve]) -> Drawn {
    let points = || curves.iter().flat_map(|(_, points)| points.iter());
    let items = around(points().map(|p| p.0 as f64), 1.3, 1.3);
    let times = around(points().map(|p| p.1), 1.3, 1.3);
    let axes: [Axis; 2] = [
        ("items", items, &|n| text::count(n.round() as usize)),
        ("mean time per query (thread CPU)", times, &text::time),
    ];
    let mut chart = log_log(root, caption, axes)?;
    for (structure, points) in curves {
        let look = Look::of(structure);
        let colour = COLOURS[look.colour];
        let points: Vec<(f64, f64)> = points.iter().map(|&(n, ns)| (n as f64, ns)).collect();
        let line = LineSeries::new(points.iter().copied(), colour.stroke_width(2));
        chart
            .draw_series(line)?
            .label(*structure)
            .legend(move |(x, y)| EmptyElement::at((x + 8, y)) + area(look) + outline(look));
        let marks = points.iter();
        chart.draw_series(marks.map(|&at| EmptyElement::at(at) + area(look) + outline(look)))?;
    }
    legend(&mut chart, SeriesLabelPosition::UpperLeft)
}

/// Area of a structure's mark.
fn area(look: Look) -> Polygon<(i32, i32)> {
    let colour = if look.hollow {
        WHITE
    } else {
        COLOURS[look.colour]
    };
    Polygon::new(SHAPES[look.shape], colour)
}

/// Outline of a structure's mark.
fn outline(look: Look) -> PathElement<(i32, i32)> {
    let corners = SHAPES[look.shape];
    let outline = corners.iter().chain(&corners[..1]).copied();
    PathElement::new(outline.collect::<Vec<_>>(), COLOURS[look.colour])
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
