//! A second camera, written out from the lecture and sharing no formula with
//! the crate's: it measures how far a point lies inside each face in eye space
//! and never forms a plane or a matrix. What the crate says is judged by it.

use cullbench::camera::{Camera, Lens, look_at};
use cullbench::geometry::FrustumPlane;
use glam::DVec3;

/// The lens as a user states it.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    Perspective { fovy_deg: f64, aspect: f64 },
    Orthographic { height: f64, aspect: f64 },
    OffAxis { window: [f64; 4] },
}

/// All that a user states about a camera.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    pub eye: DVec3,
    pub look: DVec3,
    pub up: DVec3,
    pub kind: Kind,
    pub near: f64,
    pub far: Option<f64>,
}

impl Setup {
    /// The crate's camera for the same statement.
    pub fn camera(&self) -> Camera {
        let (near, far) = (self.near, self.far);
        let lens = match self.kind {
            Kind::Perspective { fovy_deg, aspect } => {
                Lens::perspective(fovy_deg, aspect, near, far)
            }
            Kind::Orthographic { height, aspect } => {
                Lens::orthographic(height, aspect, near, far.expect("a far plane"))
            }
            Kind::OffAxis { window } => Lens::off_axis(window, near, far),
        };
        Camera {
            frame: look_at(self.eye, self.look, self.up).expect("a frame"),
            lens: lens.expect("a lens"),
        }
    }

    /// The camera by hand.
    pub fn view(&self) -> View {
        let n = (self.eye - self.look).normalize();
        let u = self.up.cross(n).normalize();
        let v = n.cross(u);
        let parallel = matches!(self.kind, Kind::Orthographic { .. });
        let window = match self.kind {
            Kind::Perspective { fovy_deg, aspect } => {
                let y = (fovy_deg / 360.0 * std::f64::consts::PI).tan();
                [-y * aspect, y * aspect, -y, y]
            }
            Kind::Orthographic { height, aspect } => {
                let (x, y) = (height * aspect / 2.0, height / 2.0);
                [-x, x, -y, y]
            }
            Kind::OffAxis { window } => window.map(|edge| edge / self.near),
        };
        View {
            eye: self.eye,
            u,
            v,
            n,
            parallel,
            window,
            near: self.near,
            far: self.far,
        }
    }
}

/// Eye, axes and the window: at depth 1, or at any depth if the sides are
/// parallel.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub eye: DVec3,
    pub u: DVec3,
    pub v: DVec3,
    pub n: DVec3,
    pub parallel: bool,
    pub window: [f64; 4],
    pub near: f64,
    pub far: Option<f64>,
}

impl View {
    /// How much wider the window is at `depth` than as stated.
    fn spread(&self, depth: f64) -> f64 {
        if self.parallel { 1.0 } else { depth }
    }

    /// The world point at `depth` that lies `across` (0 left, 1 right) and
    /// `upward` (0 bottom, 1 top) in the window there.
    pub fn point(&self, across: f64, upward: f64, depth: f64) -> DVec3 {
        let [left, right, bottom, top] = self.window;
        let x = (left + (right - left) * across) * self.spread(depth);
        let y = (bottom + (top - bottom) * upward) * self.spread(depth);
        self.eye + self.u * x + self.v * y - self.n * depth
    }

    pub fn faces(&self) -> &'static [FrustumPlane] {
        let count = if self.far.is_some() { 6 } else { 5 };
        &FrustumPlane::ALL[..count]
    }

    /// How far inside `face` the point lies: a Euclidean distance, negative
    /// outside.
    pub fn inside(&self, face: FrustumPlane, p: DVec3) -> f64 {
        let to_p = p - self.eye;
        let (x, y, depth) = (to_p.dot(self.u), to_p.dot(self.v), -to_p.dot(self.n));
        let [left, right, bottom, top] = self.window;
        let beside = |offset: f64, edge: f64| {
            if self.parallel {
                offset - edge
            } else {
                (offset - edge * depth) / edge.hypot(1.0)
            }
        };
        match face {
            FrustumPlane::Left => beside(x, left),
            FrustumPlane::Right => -beside(x, right),
            FrustumPlane::Bottom => beside(y, bottom),
            FrustumPlane::Top => -beside(y, top),
            FrustumPlane::Near => depth - self.near,
            FrustumPlane::Far => self.far.map_or(f64::INFINITY, |far| far - depth),
        }
    }

    /// The smallest of [`View::inside`]: positive for a visible point.
    pub fn depth_inside(&self, p: DVec3) -> f64 {
        let all = self.faces().iter().map(|&face| self.inside(face, p));
        all.fold(f64::INFINITY, f64::min)
    }

    /// The unit vector that leads into the volume through `face`.
    pub fn inward(&self, face: FrustumPlane) -> DVec3 {
        let [left, right, bottom, top] = self.window;
        let lean = |axis: DVec3, edge: f64| {
            if self.parallel {
                axis
            } else {
                (axis + self.n * edge).normalize()
            }
        };
        match face {
            FrustumPlane::Left => lean(self.u, left),
            FrustumPlane::Right => -lean(self.u, right),
            FrustumPlane::Bottom => lean(self.v, bottom),
            FrustumPlane::Top => -lean(self.v, top),
            FrustumPlane::Near => -self.n,
            FrustumPlane::Far => self.n,
        }
    }

    /// A far plane, or a stand-in for the infinite one.
    pub fn far_or(&self, ratio: f64) -> f64 {
        self.far.unwrap_or(self.near * ratio)
    }

    /// The corners of the volume down to depth `far`, near ones first.
    pub fn corners(&self, far: f64) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let depth = if i < 4 { self.near } else { far };
            self.point((i & 1) as f64, (i >> 1 & 1) as f64, depth)
        })
    }
}
