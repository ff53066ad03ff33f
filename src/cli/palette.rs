//! Colours of series, and the colour and mark of each structure, the same in every
//! picture and on every page.

/// Red, green and blue.
type Rgb = [u8; 3];

/// Colours on white, distinguishable by colour-blind readers and by brightness. The
/// last is for scans and for what is not to stand out.
const COLOURS: [Rgb; 8] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [0, 0, 0],
    [120, 120, 120],
];

/// The same colours on a dark ground.
const ON_DARK: [Rgb; 8] = [
    [78, 165, 224],
    [240, 128, 60],
    [42, 190, 148],
    [221, 150, 190],
    [140, 210, 250],
    [240, 185, 60],
    [240, 240, 240],
    [150, 150, 150],
];

/// Colour and mark of a structure.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Look {
    /// Index into [`COLOURS`].
    pub colour: usize,
    /// Index into [`SHAPES`].
    pub shape: usize,
    /// Outlined; the structures with a place of their own are filled.
    pub hollow: bool,
}

/// Corners of marks around the origin: disc, square, diamond, triangle.
pub const SHAPES: [&[(i32, i32)]; 4] = [
    &[
        (-2, -5),
        (2, -5),
        (5, -2),
        (5, 2),
        (2, 5),
        (-2, 5),
        (-5, 2),
        (-5, -2),
    ],
    &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
    &[(0, -6), (6, 0), (0, 6), (-6, 0)],
    &[(0, -6), (6, 4), (-6, 4)],
];

/// Colour index of scans.
const GREY: usize = 7;

/// Structures with a look of their own: name, colour, shape.
const OWN: [(&str, usize, usize); 9] = [
    ("wide", 0, 0),
    ("bvh", 1, 1),
    ("octree", 2, 2),
    ("bsp", 3, 3),
    ("quadtree", 4, 1),
    ("uniform-grid", 5, 2),
    ("kd", 6, 3),
    ("linear", GREY, 0),
    ("linear-scalar", GREY, 2),
];

impl Look {
    /// The look of series `n` that is no structure.
    pub fn nth(n: usize) -> Look {
        Look {
            colour: n % GREY,
            shape: n % SHAPES.len(),
            hollow: n >= GREY,
        }
    }

    /// The look of a structure by its label. Any other label than those with a look of
    /// their own has a hollow mark that its text decides.
    pub fn of(label: &str) -> Look {
        if let Some(&(_, colour, shape)) = OWN.iter().find(|own| own.0 == label) {
            return Look {
                colour,
                shape,
                hollow: false,
            };
        }
        // FNV-1a.
        let hash = label.bytes().fold(0x811c_9dc5_u32, |hash, byte| {
            (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
        }) as usize;
        Look {
            colour: hash % GREY,
            shape: hash / GREY % SHAPES.len(),
            hollow: true,
        }
    }
}

/// Rules of a style sheet: the class `cN` has colour N.
fn rules(colours: [Rgb; 8]) -> String {
    let rule = |(n, [r, g, b]): (usize, Rgb)| format!(".c{n}{{color:rgb({r},{g},{b})}}");
    colours.into_iter().enumerate().map(rule).collect()
}

/// Rules for a light ground.
pub fn on_light() -> String {
    rules(COLOURS)
}

/// Rules for light and dark grounds; print is light.
pub fn style() -> String {
    let (light, dark) = (rules(COLOURS), rules(ON_DARK));
    format!("{light}@media screen and (prefers-color-scheme:dark){{{dark}}}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_of_their_own_differ_and_others_are_hollow() {
        let own = OWN.map(|(name, ..)| Look::of(name));
        for (n, look) in own.iter().enumerate() {
            assert!(!own[..n].contains(look), "{look:?}");
        }
        let other = Look::of("peer-bvh");
        assert!(other.hollow && other.colour < GREY && other == Look::of("peer-bvh"));
    }
}
