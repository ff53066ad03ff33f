//! `cullbench check`: goes through a file of certificates with a program that uses no
//! code of what made them.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};
use std::sync::Arc;

use anyhow::{Context, bail};

use super::funnel::claim;
use super::funnel_args::CheckArgs;
use super::{Ending, load_scene, print, text};
use crate::camera::Camera;
use crate::funnel::{Proofs, regions_of};
use crate::input::read_file;
use crate::json::JsonError;
use crate::path::{self, CameraPath, LensDefaults};
use crate::query::ItemId;
use crate::scene::{Scene, Surfaces, WorldBox};
use crate::visibility::fragment::CutOuts;
use crate::visibility::region::{ClaimErrors, Pvs, REJECT, RegionGraph};
use crate::visibility::truth::{
    CameraOf, Certificates, Counts, Facts, Hiders, PlanWall, View as CertifiedView,
    check as check_proofs,
};
use crate::visibility::{Rays, holes_of, surfaces_of, walls_of};
use serde::Serialize;

/// What was found in a file.
#[derive(Default, Serialize)]
struct Checked {
    view_count: usize,
    visible_count: usize,
    hidden_count: usize,
    tied_count: usize,
    along_lines_count: usize,
    undecided_count: usize,
    cell_count: usize,
    claim_count: usize,
    asymmetric_count: usize,
    false_negative_count: usize,
    /// The first proof of each view, and of each claim, that does not hold.
    rejected: Vec<Rejection>,
}

#[derive(Serialize)]
struct Rejection {
    line: usize,
    /// Null for an error of a claim, and for a view as a whole.
    item: Option<u32>,
    reason: String,
}

impl Checked {
    fn add(&mut self, counts: &Counts) {
        self.visible_count += counts.visible;
        self.hidden_count += counts.hidden;
        self.tied_count += counts.tied;
        self.along_lines_count += counts.along_lines;
        self.undecided_count += counts.undecided;
        self.cell_count += counts.cells;
    }

    /// The proofs of one view, which is to be that of a camera.
    fn view(&mut self, line: usize, proofs: &Certificates, facts: &Facts, camera: &Camera) {
        self.view_count += 1;
        let is_its_view =
            Rays::of(camera).is_ok_and(|rays| CertifiedView::of(&rays) == proofs.view);
        if !is_its_view {
            return self.reject(line, "the view is not that of its camera");
        }
        let proven: BTreeSet<ItemId> = proofs.proofs.iter().map(|(item, _)| *item).collect();
        if [proven.len(), proofs.proofs.len()] != [proofs.items; 2] {
            let (items, count) = (proofs.items, proofs.proofs.len());
            let of = proven.len();
            return self.reject(
                line,
                &format!("{count} proofs of {of} items; expected one of each of {items} items"),
            );
        }
        match check_proofs(proofs, facts) {
            Ok(counts) => self.add(&counts),
            Err(rejected) => self.rejected.push(Rejection {
                line,
                item: Some(rejected.item),
                reason: rejected.reason.to_owned(),
            }),
        }
    }

    /// All of a line.
    fn reject(&mut self, line: usize, reason: &str) {
        self.rejected.push(Rejection {
            line,
            item: None,
            reason: reason.to_owned(),
        });
    }

    /// The errors of one claim.
    fn claim(&mut self, line: usize, errors: &ClaimErrors, claim: &Pvs, graph: &RegionGraph) {
        self.claim_count += 1;
        match errors.check(claim, graph) {
            Ok(()) => {
                self.asymmetric_count += errors.asymmetric.len();
                self.false_negative_count += errors.false_negatives.len();
            }
            Err(rejected) => self.reject(line, &rejected.to_string()),
        }
    }
}

/// A scene, loaded once for all lines that are about it.
struct Loaded {
    scene: Scene,
    boxes: Vec<WorldBox>,
    surfaces: Option<Arc<Surfaces>>,
    walls: Vec<PlanWall>,
    /// Items with holes, by how these are typed.
    cut_outs: BTreeMap<String, Vec<bool>>,
    paths: BTreeMap<String, CameraPath>,
    regions: Option<(RegionGraph, Option<Pvs>)>,
}

impl Loaded {
    /// The regions, with the claim of the scene itself.
    fn regions(&mut self) -> anyhow::Result<Option<&(RegionGraph, Option<Pvs>)>> {
        if self.regions.is_none() {
            self.regions = regions_of(&self.scene)?;
        }
        Ok(self.regions.as_ref())
    }

    /// Works out which items have holes by what hides in a view.
    fn cut_out(&mut self, hiders: &Hiders) -> anyhow::Result<()> {
        let Hiders::Uncut(typed) = hiders else {
            return Ok(());
        };
        if !self.cut_outs.contains_key(typed) {
            let parsed = CutOuts::parse(typed)?;
            self.regions()?;
            let graph = self.regions.as_ref().map(|(graph, _)| graph);
            let holes = holes_of(&parsed, &self.scene, graph);
            let items = 0..self.scene.items.len() as ItemId;
            let is_cut_out = items.map(|item| holes.of(item).is_some()).collect();
            self.cut_outs.insert(typed.clone(), is_cut_out);
        }
        Ok(())
    }

    /// Whether a camera's eye, and all that is before its near plane, is in the regions.
    fn is_inside(&mut self, camera: &Camera) -> anyhow::Result<bool> {
        let regions = self.regions()?;
        let rays = Rays::of(camera).ok();
        let both = regions.zip(rays);
        Ok(both.is_some_and(|((graph, _), rays)| graph.homes(&rays, &mut Vec::new())))
    }

    /// What the proofs of a view are held against.
    fn facts(&self, hiders: &Hiders, is_inside: bool) -> Facts<'_> {
        let cut_out = match hiders {
            Hiders::Uncut(typed) => self.cut_outs.get(typed).map_or(&[][..], Vec::as_slice),
            _ => &[],
        };
        Facts {
            boxes: &self.boxes,
            cut_out,
            surfaces: self.surfaces.as_deref(),
            walls: if is_inside { &self.walls } else { &[] },
        }
    }

    /// The camera that a view is said to be of.
    fn camera(&mut self, of: &CameraOf, lens: &LensDefaults) -> anyhow::Result<Camera> {
        let CameraOf { path, index } = of;
        if !self.paths.contains_key(path) {
            let found = path::load(path, &self.scene, lens)?;
            self.paths.insert(path.clone(), found);
        }
        let cameras = &self.paths[path].cameras;
        let camera = cameras.get(*index).copied();
        camera.with_context(|| {
            let count = cameras.len();
            format!("it is about camera {index} of '{path}'; expected one below {count}")
        })
    }
}

pub fn check(args: &CheckArgs) -> anyhow::Result<Ending> {
    let file = args.certificates.display().to_string();
    let bytes = read_file(&args.certificates)?;
    let stored = claim(args.pvs.as_deref())?;
    let lens = args.lens.defaults()?;
    let mut scenes: BTreeMap<String, Loaded> = BTreeMap::new();
    let mut checked = Checked::default();
    // The views and claims so far.
    let mut about = BTreeSet::new();
    for (number, line) in bytes
        .split(|byte| *byte == b'\n')
        .enumerate()
        .filter(|(_, line)| !line.trim_ascii().is_empty())
    {
        let number = number + 1;
        let place = || format!("{file}, line {number}");
        let line = Proofs::from_json(line).map_err(|error| {
            let error = JsonError {
                line: number,
                ..error
            };
            let expected = error.expected_of("the certificates of a view or the errors of a claim");
            anyhow::anyhow!(
                "{file}, {}: {}; expected {expected}",
                error.place(),
                error.found
            )
        })?;
        let name = args.scene.as_deref().unwrap_or(line.scene()).to_owned();
        if !scenes.contains_key(&name) {
            let scene = load_scene(&name, &args.scene_args, 1)
                .with_context(|| format!("{}: the scene it is about", place()))?;
            scenes.insert(
                name.clone(),
                Loaded {
                    boxes: scene.written().collect(),
                    surfaces: surfaces_of(&scene)?,
                    walls: walls_of(&scene)?,
                    cut_outs: BTreeMap::new(),
                    paths: BTreeMap::new(),
                    regions: None,
                    scene,
                },
            );
        }
        let Some(loaded) = scenes.get_mut(&name) else {
            continue;
        };
        match line {
            Proofs::View(proofs) => {
                let (found, boxes) = (loaded.boxes.len(), proofs.boxes);
                if found != boxes {
                    bail!(
                        "{}: it is about {boxes} boxes; expected the {found} of scene '{name}'",
                        place()
                    );
                }
                let Some(of) = &proofs.camera else {
                    bail!(
                        "{}: a view of no camera; expected the field 'camera'",
                        place()
                    );
                };
                if !about.insert(format!("{name}\n{}\n{}", of.path, of.index)) {
                    bail!(
                        "{}: camera {} of '{}' a second time; expected it once",
                        place(),
                        of.index,
                        of.path
                    );
                }
                let camera = loaded.camera(of, &lens).with_context(place)?;
                loaded.cut_out(&proofs.hiders).with_context(place)?;
                let is_inside = !loaded.walls.is_empty() && loaded.is_inside(&camera)?;
                let facts = loaded.facts(&proofs.hiders, is_inside);
                checked.view(number, &proofs, &facts, &camera);
            }
            Proofs::Claim(errors) => {
                if !about.insert(format!("{name}\n{}", errors.claim)) {
                    bail!(
                        "{}: the claim of {} a second time; expected it once",
                        place(),
                        errors.claim
                    );
                }
                let Some((graph, own)) = loaded.regions()? else {
                    bail!("{}: scene '{name}' has no regions; expected some", place());
                };
                let claim = match errors.claim == REJECT.name {
                    true => own.as_ref(),
                    false => stored.as_deref(),
                };
                let Some(claim) = claim else {
                    let claim = &errors.claim;
                    bail!(
                        "{}: it is about the claim of {claim}; expected it {}",
                        place(),
                        match errors.claim == REJECT.name {
                            true => "in the map",
                            false => "as --pvs FILE",
                        }
                    );
                };
                let found = [claim.len(), graph.len()];
                if found != [errors.regions; 2] {
                    bail!(
                        "{}: it is about {} regions; expected the {} of the claim and the {} of \
                         scene '{name}'",
                        place(),
                        errors.regions,
                        found[0],
                        found[1]
                    );
                }
                checked.claim(number, &errors, claim, graph);
            }
        }
    }
    if checked.view_count + checked.claim_count == 0 {
        bail!("{file}: no certificate in it; expected at least one line");
    }
    print(args.format, &checked, || {
        show(&checked, &mut text::terminal())
    })?;
    Ok(Ending::of(checked.rejected.is_empty()))
}

fn show(checked: &Checked, out: &mut impl Write) -> io::Result<()> {
    for Rejection { line, item, reason } in &checked.rejected {
        let item = item
            .map(|item| format!(", item {item}"))
            .unwrap_or_default();
        writeln!(out, "line {line}{item}: rejected, {reason}")?;
    }
    let mut decided = checked.visible_count + checked.hidden_count;
    decided += checked.tied_count + checked.along_lines_count;
    if checked.view_count > 0 {
        writeln!(
            out,
            "{}: {} proven visible, {} proven hidden ({} of images), {} hidden but for ties, {} \
             but along lines of the image, {} undecided.",
            text::counted(checked.view_count, "view"),
            checked.visible_count,
            checked.hidden_count,
            text::counted(checked.cell_count, "part"),
            checked.tied_count,
            checked.along_lines_count,
            checked.undecided_count
        )?;
    }
    if checked.claim_count > 0 {
        decided += checked.asymmetric_count + checked.false_negative_count;
        writeln!(
            out,
            "{} of what is seen from where: {} with a line of sight, {} visible in one direction \
             only.",
            text::counted(checked.claim_count, "claim"),
            text::counted(checked.false_negative_count, "false negative"),
            text::counted(checked.asymmetric_count, "pair"),
        )?;
    }
    match checked.rejected.len() {
        0 => writeln!(out, "All {decided} proofs hold."),
        count => writeln!(
            out,
            "{} of views or claims with a proof that does not hold.",
            text::counted(count, "line")
        ),
    }
}
