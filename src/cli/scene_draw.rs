//! `cullbench scene draw`: a scene from above and the cells of a structure.
//!
//! With a camera, both in the colours of a query's verdicts.

use anyhow::{Context, bail};
use glam::Vec3;

use super::command_args::SceneDrawArgs;
use super::plan::Plan;
use super::sheet::{Cells, Class};
use super::{Ending, expect_places, load_scene, tell, text, write_text};
use crate::culling::{CameraView, Culling};
use crate::geometry::Aabb;
use crate::index::{DynIndex, Registry, Row, StructureSpec, TreeCell, verdicts};
use crate::measure::input_of;
use crate::path;
use crate::query::Containment;
use crate::scene::Scene;

/// Items of a scene without a camera.
const ITEMS: &[Class] = rows! { Class { colour, words, is_key }
    "#9fb4c4", "items", false;
};

/// Items of a scene with a camera.
const SEEN: &[Class] = rows! { Class { colour, words, is_key }
    "#c8cdd2", "outside of the frustum", false;
    "#009e73", "visible", true;
};

/// Items by what the query of a structure did with them.
const VERDICTS: &[Class] = rows! { Class { colour, words, is_key }
    "#c8cdd2", "outside, rejected with their cell", false;
    "#cc79a7", "outside, tested one by one", false;
    "#009e73", "visible, tested one by one", true;
    "#005c43", "visible, accepted with their cell", true;
};
const REJECTED: usize = 0;
const OUTSIDE: usize = 1;
const VISIBLE: usize = 2;
const ACCEPTED: usize = 3;

/// Cells without a camera.
const CELLS: &[Class] = rows! { Class { colour, words, is_key }
    "#0072b2", "cells", false;
};

/// Cells by the verdict of a query.
const CELL_VERDICTS: &[Class] = rows! { Class { colour, words, is_key }
    "#b0b0b0", "cells not reached", false;
    "#d55e00", "cells rejected, outside", true;
    "#009e73", "cells accepted, inside", true;
    "#0072b2", "cells opened, across a plane", false;
};

pub fn draw(registry: &Registry, args: &SceneDrawArgs) -> anyhow::Result<Ending> {
    let inputs: Vec<&String> = args.camera.iter().chain([&args.scene]).collect();
    expect_places(&[("--out", &Some(args.out.clone()))], &inputs)?;
    let defaults = args.lens.defaults()?;
    let structure = args.structure.as_deref();
    let structure = structure.map(|text| divided(registry, text)).transpose()?;
    let loading = args.lens.scene_args.options(structure.iter().len());
    let scene = load_scene(&args.scene, &loading)?;
    let mut caption = vec![scene.name.clone()];
    if scene.skipped_items > 0 {
        caption.push(text::items(scene.items.len(), scene.skipped_items));
    }
    let camera = match &args.camera {
        None => None,
        Some(source) => {
            let path = path::load(source, &scene, &defaults)?;
            let (frame, last) = (args.frame as usize, path.cameras.len().saturating_sub(1));
            let Some(camera) = path.cameras.get(frame) else {
                let cameras = format!("0 to {last}, the cameras of {}", path.name);
                bail!("--frame is {frame}; expected {cameras}");
            };
            caption.push(format!("camera {frame} of {}", path.name));
            Some((*camera, path.place(frame)))
        }
    };
    let around = scene.surroundings();
    let view = camera.as_ref().map(|(camera, place)| {
        let view = Culling::default().view(camera, &around);
        view.with_context(|| place.clone())
    });
    let view = view.transpose()?;
    let index = structure.as_ref().map(|spec| {
        caption.push(format!("{}, levels 0 to {}", spec.label, args.depth));
        spec.build(input_of(&scene, &scene.items))
    });
    let index = index.transpose()?;
    let cells = index.as_ref().map_or(Vec::new(), |index| index.cells());
    let verdicts = view.as_ref().map(|view| verdicts(&cells, view.as_any()));
    let class_of = match (&view, &index, &verdicts) {
        (Some(view), Some(index), Some(verdicts)) => {
            classes(&scene, view, index.as_ref(), &cells, verdicts)
        }
        (Some(view), ..) => {
            let class = |item: &Aabb| usize::from(view.as_any().sees(item));
            scene.items.iter().map(class).collect()
        }
        _ => vec![0; scene.items.len()],
    };
    let class_of_cell = |cell: usize| match verdicts.as_ref().and_then(|all| all[cell]) {
        None => 0,
        Some(Containment::Outside) => 1,
        Some(Containment::Inside) => 2,
        Some(Containment::Straddles) => 3,
    };
    let plan = Plan {
        caption: caption.join("; "),
        scene: &scene,
        camera: camera.as_ref().map(|(camera, _)| camera),
        classes: match (&view, &index) {
            (None, _) => ITEMS,
            (_, None) => SEEN,
            _ => VERDICTS,
        },
        class_of: &|item| class_of[item],
        cells: index.is_some().then(|| Cells {
            cells: &cells,
            classes: match view {
                Some(_) => CELL_VERDICTS,
                None => CELLS,
            },
            class_of: &class_of_cell,
            depth: args.depth,
        }),
    };
    write_text(&args.out, &plan.svg())?;
    let mut told = text::items(scene.items.len(), scene.skipped_items);
    if index.is_some() {
        told += &format!(", {}", text::counted(cells.len(), "cell"));
    }
    if let Some(verdicts) = verdicts.filter(|_| index.is_some()) {
        let tested = verdicts.iter().flatten().count();
        told += &format!(", of which the query tests {}", text::count(tested));
    }
    let deeper = cells.iter().filter(|cell| cell.level > args.depth).count();
    if deeper > 0 {
        let deeper = text::counted(deeper, "cell");
        told += &format!("; not drawn: {deeper} below level {}", args.depth);
    }
    tell(&format!("{}: {told}", args.out.display()));
    Ok(Ending::Ok)
}

/// A structure that has cells.
fn divided(registry: &Registry, text: &str) -> anyhow::Result<StructureSpec> {
    let spec = registry.structure(text)?;
    // More boxes than the largest block holds.
    let cube = |i: u8| Aabb::around(Vec3::splat(i.into()), Vec3::splat(0.25));
    let boxes: Vec<Aabb> = (0..64).map(cube).collect();
    let has_cells = |row: &&Row| {
        let spec = registry.structure(row.info.name);
        let index = spec.ok().and_then(|spec| spec.build(&boxes).ok());
        index.is_some_and(|index| !index.cells().is_empty())
    };
    if has_cells(&&spec.row) {
        return Ok(spec);
    }
    let rows = registry.rows().iter().filter(has_cells);
    let names: Vec<_> = rows.map(|row| row.info.name).collect();
    let (name, names) = (spec.info().name, names.join(", "));
    bail!("structure '{name}' has no cells to draw; expected one of {names}")
}

/// Class of each item by what a query did with it.
fn classes(
    scene: &Scene,
    view: &CameraView,
    index: &dyn DynIndex,
    cells: &[TreeCell<'_>],
    verdicts: &[Option<Containment>],
) -> Vec<usize> {
    let mut class_of = vec![REJECTED; scene.items.len()];
    let mut visible = Vec::new();
    index.query(view.as_any(), &mut visible);
    for item in visible {
        class_of[item as usize] = ACCEPTED;
    }
    for (cell, verdict) in cells.iter().zip(verdicts) {
        if *verdict == Some(Containment::Straddles) {
            for &item in cell.items {
                let class = &mut class_of[item as usize];
                *class = if *class == ACCEPTED { VISIBLE } else { OUTSIDE };
            }
        }
    }
    class_of
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::LensDefaults;
    use crate::query::{AnyVolume, ItemId, QueryCost};
    use crate::scene;

    /// Costs of a query as the cells show it.
    ///
    /// Nodes tested and rejected, items tested and accepted untested.
    fn shown(cells: &[TreeCell<'_>], volume: AnyVolume<'_>) -> [usize; 4] {
        let (mut cost, mut inside) = ([0; 4], None);
        for (cell, verdict) in cells.iter().zip(verdicts(cells, volume)) {
            inside = inside.filter(|level| *level < cell.level);
            match verdict {
                Some(Containment::Inside) => inside = Some(cell.level),
                Some(Containment::Outside) => cost[1] += 1,
                Some(Containment::Straddles) => cost[2] += cell.items.len(),
                None => {}
            }
            cost[0] += usize::from(verdict.is_some());
            cost[3] += inside.map_or(0, |_| cell.items.len());
        }
        cost
    }

    #[test]
    fn cells_hold_each_item_once_and_show_what_a_query_counts() {
        let scene = scene::load("city:n=3000", &Default::default()).expect("a scene");
        let cameras = path::load("flythrough:frames=6", &scene, &LensDefaults::default());
        let cameras = cameras.expect("a path").cameras;
        let mut drawn = Vec::new();
        for spec in Registry::builtin().structures("all").expect("names") {
            let index = spec.build(&scene.items).expect("a structure");
            let cells = index.cells();
            if cells.is_empty() {
                continue;
            }
            drawn.push(spec.info().name);
            let mut ids: Vec<ItemId> = Vec::new();
            for cell in &cells {
                let within = |id: &ItemId| cell.bounds.contains(&scene.items[*id as usize]);
                assert!(cell.items.iter().all(within), "{}: {cell:?}", spec.label);
                ids.extend(cell.items);
            }
            ids.sort_unstable();
            assert!(ids.iter().copied().eq(0..3000), "{}", spec.label);
            for camera in &cameras {
                let volume = camera.volume(&Default::default(), &scene.surroundings());
                let volume = volume.expect("a frustum");
                let (mut seen, mut cost) = (Vec::new(), QueryCost::default());
                index.query_counted((&volume).into(), &mut seen, &mut cost);
                let nodes = [cost.nodes_tested, cost.subtrees_rejected];
                let items = [cost.items_tested, cost.items_accepted_untested];
                let counted = [nodes, items].concat().into_iter().map(|n| n as usize);
                let shown = shown(&cells, (&volume).into());
                assert_eq!(counted.collect::<Vec<_>>(), shown, "{}", spec.label);
            }
        }
        assert!(drawn.len() >= 8, "{drawn:?}");
    }
}
