//! What the proofs of a scene are made of: which boxes hide, and what rays end at.

use glam::DVec3;

use super::world::{FunnelInput, World};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::hiders::Ground;
use crate::visibility::truth::{
    Certificates, Ends, Hiders, PlanWall, Prover, RayIndex, SampleTruth, SurfaceIndex, certify,
};
use crate::visibility::{Rays, Solids};

/// A scene as the search for proofs takes it.
pub enum Material<'w> {
    /// Solid boxes.
    Boxes(&'w Solids, RayIndex),
    /// Boxes of which some have holes.
    CutOuts(&'w Solids, Holes),
    /// Triangles, and boxes inside those of some items and below the ground.
    Triangles {
        /// The boxes around the items.
        around: Solids,
        /// Those inside, each with its item.
        within: Vec<(ItemId, WorldBox)>,
        /// The ground, and the boxes below it.
        ground: Option<(&'w Ground, Vec<WorldBox>)>,
        /// What rays end at.
        index: SurfaceIndex,
        /// The walls of a map.
        walls: Vec<PlanWall>,
    },
}

/// Which boxes have holes.
pub struct Holes {
    typed: String,
    is_cut_out: Vec<bool>,
    all: RayIndex,
    /// Of those without holes.
    whole: RayIndex,
}

impl Material<'_> {
    /// Of a scene as the funnel has it.
    pub fn of<'w>(input: &FunnelInput, world: &'w World) -> Material<'w> {
        let Some(solids) = world.solids.as_ref() else {
            let around = Solids::of(world.scene);
            let inner = world.hiders.inner().iter();
            let inner = inner.map(|(item, b)| (*item, WorldBox::within(b, around.origin)));
            let surfaces = world
                .surfaces
                .as_ref()
                .expect("triangles of what is no solid box");
            let ground = world.hiders.ground().map(|ground| {
                let below = ground.boxes.iter();
                let below = below.map(|b| WorldBox::within(b, around.origin));
                (ground, below.collect())
            });
            return Material::Triangles {
                ground,
                within: inner.filter(|(_, b)| b.min.cmplt(b.max).all()).collect(),
                around,
                index: SurfaceIndex::build(surfaces),
                walls: world.walls().to_vec(),
            };
        };
        let all = RayIndex::build(solids);
        let (Some(typed), Some(holes)) = (input.cut_outs, world.cut_outs.as_ref()) else {
            return Material::Boxes(solids, all);
        };
        let items = 0..world.items() as ItemId;
        let is_cut_out: Vec<bool> = items.clone().map(|id| holes.of(id).is_some()).collect();
        let whole: Vec<ItemId> = items.filter(|&id| !is_cut_out[id as usize]).collect();
        let holes = Holes {
            typed: typed.to_string(),
            whole: RayIndex::build_of(solids, &whole),
            is_cut_out,
            all,
        };
        Material::CutOuts(solids, holes)
    }

    /// Proofs of the items in question in a view, whose samples show `truth`; `is_inside`:
    /// the eye is in the scene's regions.
    pub fn certify(
        &self,
        scene: &str,
        rays: &Rays,
        is_inside: bool,
        truth: &SampleTruth,
        items: &[ItemId],
        threads: usize,
    ) -> Certificates {
        match self {
            Material::Boxes(solids, index) => {
                let prover = Prover::new(solids, index, rays);
                let ends = Ends::Boxes(index);
                certify(scene, &prover, ends, rays, truth, items, threads)
            }
            Material::CutOuts(solids, holes) => {
                let hide = Hiders::Uncut(holes.typed.clone());
                let prover = Prover::hidden_by(hide, solids, &holes.whole, rays);
                let ends = Ends::CutOuts(&holes.all, &holes.is_cut_out);
                let truth = SampleTruth::of(solids, &holes.all, rays, truth.grid, threads);
                certify(scene, &prover, ends, rays, &truth, items, threads)
            }
            Material::Triangles {
                around,
                within,
                ground,
                index,
                walls,
            } => {
                let walls = if is_inside { &walls[..] } else { &[] };
                let items_there = around.boxes.len() as ItemId;
                let mut boxes = around.clone();
                let mut hide = Vec::new();
                let below = ground.iter().filter(|(ground, _)| ground.is_below(rays));
                let below = below.flat_map(|(_, below)| below).map(|b| (None, b));
                let beyond = |(item, _): &&(ItemId, _)| {
                    begins_beyond_near(rays, &around.boxes[*item as usize])
                };
                let within = within.iter().filter(beyond);
                for (item, b) in below.chain(within.map(|(item, b)| (Some(*item), b))) {
                    boxes.push(b);
                    hide.push((item, [b.min.to_array(), b.max.to_array()]));
                }
                let numbers: Vec<ItemId> = (items_there..boxes.boxes.len() as ItemId).collect();
                let hiders = RayIndex::build_of(&boxes, &numbers);
                let prover = Prover::hidden_by(Hiders::Within(hide), &boxes, &hiders, rays);
                let prover = prover.among(walls);
                let ends = Ends::Triangles(index);
                certify(scene, &prover, ends, rays, truth, items, threads)
            }
        }
    }
}

/// Whether an item is clearly beyond the near plane of a view: of another, what is in
/// front of the box inside it may be cut away.
fn begins_beyond_near(rays: &Rays, own: &WorldBox) -> bool {
    let camera = rays.camera();
    let (eye, forward) = (camera.frame.eye, camera.frame.forward());
    let nearest = DVec3::select(forward.cmpgt(DVec3::ZERO), own.min, own.max);
    let size = own.min.abs().max(own.max.abs()).max(eye.abs());
    let near = camera.lens.near();
    let slack = 1e-8 * (near.abs() + size.max_element());
    (nearest - eye).dot(forward) > near + slack
}
