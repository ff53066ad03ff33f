//! Portal rectangles.
//!
//! A window is the rectangle of the image that an opening covers, intersected with the window before it (Luebke and Georges 1995, "Portals and
//! mirrors: simple, fast evaluation of potentially visible sets").

use super::opening::Opening;
use super::search::Windows;
use super::view::View;

/// Rectangles: left, right, bottom, top, slopes per unit of depth.
#[derive(Clone, Default, Debug)]
pub struct PortalRect {
    current: [f64; 4],
}

impl Windows for PortalRect {
    type Window = [f64; 4];

    fn begin(&mut self, view: &View) -> [f64; 4] {
        view.window
    }

    fn narrow(&mut self, view: &View, (_, opening): (u32, &Opening), window: [f64; 4]) -> bool {
        let Some(seen) = view.rectangle(opening) else {
            return false;
        };
        self.current = [
            window[0].max(seen[0]),
            window[1].min(seen[1]),
            window[2].max(seen[2]),
            window[3].min(seen[3]),
        ];
        self.current[0] <= self.current[1] && self.current[2] <= self.current[3]
    }

    fn is_within(&self, outer: [f64; 4]) -> bool {
        let inner = &self.current;
        outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] && inner[3] <= outer[3]
    }

    fn keep(&mut self) -> [f64; 4] {
        self.current
    }
}
