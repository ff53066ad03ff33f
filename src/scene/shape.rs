//! The shape of the items of a scene within their boxes, as rays meet it.

use super::{Regions, Scene};

named! {
    /// Content of the box of an item.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    #[non_exhaustive]
    pub enum ItemShape {
        /// The box itself, solid.
        Box = "solid boxes",
        /// Walls of a linedef, or the sprite of a thing.
        Wall = "walls",
        /// Triangles: [`Scene::surfaces`].
        Mesh = "triangles",
    }
}

impl Scene {
    /// Shape of the items.
    pub fn item_shape(&self) -> ItemShape {
        match (&self.surfaces, &self.regions) {
            (Some(_), _) => ItemShape::Mesh,
            (None, Regions::Bsp(_)) => ItemShape::Wall,
            (None, _) => ItemShape::Box,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;

    #[test]
    fn shapes_are_those_of_their_sources() {
        for (source, shape) in [
            ("city:n=10", ItemShape::Box),
            ("rooms:n=10", ItemShape::Box),
            ("freedm-map12", ItemShape::Wall),
            ("mesh:spheres:n=2000", ItemShape::Mesh),
        ] {
            let scene = load(source, &Default::default()).unwrap();
            assert_eq!(scene.item_shape(), shape, "{source}");
            // A boxes file holds boxes.
            let settled = scene.settled().unwrap();
            assert_eq!(settled.item_shape(), ItemShape::Box, "{source}");
        }
    }
}
