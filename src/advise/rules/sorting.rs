//! Sorting what is left from front to back: with an early z-test a hidden fragment that
//! comes late is not shaded. Pays where many layers lie behind each other and shading
//! is dear. Predicted from the layers along a few rays.

use std::rc::Rc;

use glam::DVec3;

use super::super::case::Case;
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit, not_applicable};
use super::hidden::{self, Met, PROBED, PROBES, Removal};
use crate::camera::Camera;
use crate::query::ItemId;
use crate::visibility::fragment::order::front_to_back;
use crate::visibility::fragment::{Canvas, DepthOrder, Piece, Tests, draw, draw_surfaces};
use crate::visibility::{Rays, SampleGrid, Solids};

pub(super) const RULE: Rule = Rule {
    name: "sorting",
    left_out: "sorting what is left from front to back",
    advice: [
        "no sorting: draw in the order of the tree",
        "sort what is left from front to back",
    ],
    statistic_name: "share of the shaded fragments that an early z-test saves once items are sorted",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare,
};

/// Samples of the images that fragments are counted in, and of the image they stand for.
const COUNTED: SampleGrid = SampleGrid::new(160, 90);
const SHADED: SampleGrid = SampleGrid::new(1920, 1080);

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let scene = case.scene();
    let met = Rc::new(Met::of(scene));
    let solids = Rc::new(Solids::of(scene));
    let views = hidden::sights(case).map_err(not_applicable)?;
    let frames = hidden::frames(views.len(), PROBED);
    let few = frames.map(|n| {
        let mut items = Vec::new();
        case.query(n, &mut items);
        View {
            rays: views[n].0,
            solids: solids.clone(),
            met: met.clone(),
            origin: scene.origin,
            items,
        }
    });
    let few: Vec<View> = few.collect();
    let shade_ns = case.options.shade_ns;
    let cameras: Vec<_> = views.iter().map(|(rays, _)| *rays.camera()).collect();
    let forced = Forced {
        on: format!(
            "box-distance against {}, {}x{}",
            case.spec.label, SHADED.width, SHADED.height
        ),
        kept: Way::Other(Box::new(move |n, out| {
            case.query(n, out);
            front_to_back(&solids, &cameras[n], out);
        })),
        left_out: Way::Base,
        same: true,
        judged: true,
    };
    Ok(hidden::weighed(omission, forced, move || Removal {
        unit: ["shaded fragment", "shaded fragments"],
        with: hidden::mean(few.iter().map(|view| view.shaded(true))),
        without: hidden::mean(few.iter().map(|view| view.shaded(false))),
        cost_ns: shade_ns,
        predicted: predicted(&few),
    }))
}

/// What the frustum leaves of a view, in the order in which the tree hands it on.
struct View {
    rays: Rays,
    solids: Rc<Solids>,
    met: Rc<Met>,
    origin: DVec3,
    items: Vec<ItemId>,
}

impl View {
    /// Fragments that pass an early z-test when they come.
    fn shaded(&self, sorted: bool) -> f64 {
        let mut items = self.items.clone();
        if sorted {
            front_to_back(&self.solids, self.rays.camera(), &mut items);
        }
        let passed = match &*self.met {
            Met::Boxes(_) => {
                let pieces: Vec<Piece> = items.into_iter().map(Piece::whole).collect();
                let canvas = Canvas::of(&self.rays, COUNTED);
                draw(&canvas, &self.solids, &pieces, &Tests::default())
                    .tally
                    .passed
            }
            Met::Triangles(index, _) => {
                let mut left = items.clone();
                left.sort_unstable();
                let place = |item| left.binary_search(item).unwrap_or_default() as ItemId;
                let pieces = items.iter().map(place).map(Piece::whole).collect();
                let no_parts = |_: &Solids, _: &Camera, _: &mut Vec<Piece>| ();
                let orders: [(&dyn DepthOrder, _); 1] = [(&no_parts, pieces)];
                let (rays, zero) = (&self.rays, self.origin);
                draw_surfaces(rays, COUNTED, index, zero, &left, &orders)[0]
                    .0
                    .passed
            }
        };
        passed as f64 * (SHADED.samples() as f64 / COUNTED.samples() as f64)
    }
}

/// Of n layers in random order 1 + 1/2 + ... + 1/n are nearer than all before them
/// (Knuth, The Art of Computer Programming, 1.2.10): so many are shaded, and in order
/// only one.
fn predicted(few: &[View]) -> f64 {
    let (mut shaded, mut covered) = (0.0, 0.0);
    for view in few {
        for row in 0..PROBES.height {
            for column in 0..PROBES.width {
                let ray = view.rays.sample(PROBES, column, row);
                let layers = view.met.layers(&ray);
                shaded += (1..=layers).map(|n| 1.0 / n as f64).sum::<f64>();
                covered += f64::from(u8::from(layers > 0));
            }
        }
    }
    match covered > 0.0 {
        true => 1.0 - covered / shaded,
        false => 0.0,
    }
}
