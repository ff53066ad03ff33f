//! `cullbench verify`: every structure, scene and path against the reference scan.
//!
//! Then random differential cases. Prints the first difference of each kind with the command that
//! reproduces it.

use std::io;
use std::time::Instant;

use anyhow::bail;
use glam::Vec3;
use indicatif::ProgressBar;
use serde::Serialize;

use super::args::VerifyArgs;
use super::document::{Column, Table};
use super::run_resume::{TypedOptions, command_line};
use super::shared_args::first_seed;
use super::{Ending, interrupt, load_scene, print, program, text};
use crate::culling::{CameraView, Culling, CullingTest};
use crate::geometry::ConvexVolume;
use crate::index::{BuildError, DynIndex, Registry, StructureSpec};
use crate::measure::{Status, Subject, Verdict, Workload, count_pass, guarded, judge};
use crate::path::{self, CameraPath};
use crate::query::{ItemId, Located};
use crate::report::grouped;
use crate::scene::memory::{available_bytes, fits_into};
use crate::scene::{FAMILIES, Regions, SAMPLES, Scene, every_part};
use crate::verify::{
    ErrorCount, RandomCase, Trial, Truth, VOLUME_KINDS, explain_containment, explain_visibility,
    points_on_faces, scan, variants,
};

/// Verdicts of the oracle for each scene and path.
const MOST_JUDGED: usize = 60_000;
/// Items of a generated scene if none is named.
const ITEMS: usize = 5_000;
const PATHS: [&str; 4] = [
    "flythrough:frames=32",
    "teleport:frames=32",
    "outside:frames=4",
    "teleport:frames=8,far=inf",
];
const CASES: u64 = 20_000;

pub fn verify(registry: &Registry, args: &VerifyArgs) -> anyhow::Result<Ending> {
    let structures = args.culling.kernel.structures(registry, &args.structure)?;
    let lens = &args.culling.lens;
    let defaults = lens.defaults()?;
    let culling = args.culling.culling(CullingTest::SixPlane.name())?;
    let by_hand = !args.scene.is_empty() || !args.path.is_empty();
    let cases = args.cases.unwrap_or(if by_hand { 0 } else { CASES });
    // Random cases alone, if only they are named.
    let scenes = match (&args.scene[..], args.cases) {
        ([], Some(_)) if !by_hand => Vec::new(),
        ([], _) => {
            let generated = FAMILIES.iter().map(|f| format!("{}:n={ITEMS}", f.name));
            let real = SAMPLES.iter().map(|s| s.name.to_owned());
            let far = "city:n=5000,offset=1e7".to_owned();
            generated.chain([far]).chain(real).collect()
        }
        (named, _) => {
            let parts = named.iter().map(|source| every_part(source));
            parts.collect::<Result<Vec<_>, _>>()?.concat()
        }
    };
    if scenes.is_empty() && cases == 0 {
        bail!("nothing to verify: no scene and --cases 0; expected one or the other");
    }
    let seed = first_seed(args.seed, cases)?;
    interrupt::from_now_on_finish();
    let started = Instant::now();
    let bar = ProgressBar::new(scenes.len() as u64 + 1);
    let (mut checks, mut left_out, mut skipped_items) = (Vec::new(), Vec::new(), 0);
    // The command that checks a scene and path alone has the other options as typed.
    let own = ["scene", "path", "cases", "seed", "format"];
    let typed = TypedOptions::of("verify", "verify", std::env::args_os())?;
    let others = typed.words(|name| !own.contains(&name));
    for source in scenes.iter().take_while(|_| !interrupt::asked()) {
        bar.set_message(text::plain(source));
        let scene = load_scene(source, &lens.scene_args.options(2 * structures.len()))?;
        skipped_items += scene.skipped_items;
        let subjects = [CullingTest::SixPlane, CullingTest::Sphere].map(|test| {
            let build = |spec| Subject::build(spec, false, &scene, test);
            structures.iter().cloned().map(build).collect()
        });
        let paths = paths(args, &scene).into_iter();
        for path in paths.take_while(|_| !interrupt::asked()) {
            let cameras = path::load(&path, &scene, &defaults)?;
            let words = ["verify", "--scene", source, "--path", &path].map(str::to_owned);
            let again = command_line(&[&words[..], &others].concat());
            let rows = check_path(&scene, &cameras, &culling, &subjects, &again, &mut left_out);
            checks.extend(rows?);
        }
        bar.inc(1);
    }
    if cases > 0 && !interrupt::asked() {
        bar.set_message(text::counted(cases as usize, "random case"));
        checks.extend(random_cases(&structures, seed, cases));
    }
    bar.finish_and_clear();
    let outcome = Outcome {
        ok: checks.iter().all(|c| c.difference.is_none())
            && (checks.is_empty() || checks.iter().any(|c| c.status == Status::Ok)),
        verdicts: checks.iter().map(|c| c.verdicts).sum(),
        skipped_items,
        mismatches: checks.iter().filter(|c| c.difference.is_some()).count(),
        against_cameras: culling.unproven().is_none(),
        seconds: started.elapsed().as_secs_f64(),
        seed,
        cases,
        left_out,
        checks,
    };
    print(args.format, &outcome, || show(&outcome))?;
    Ok(Ending::of(outcome.ok))
}

/// Checks all structures on the cameras of one path; one row per structure.
///
/// Over boxes and over spheres, with every kind of volume.
fn check_path(
    scene: &Scene,
    cameras: &CameraPath,
    culling: &Culling,
    [over_boxes, over_spheres]: &[Vec<Subject>; 2],
    again: &str,
    left_out: &mut Vec<String>,
) -> anyhow::Result<Vec<Check>> {
    let mut rows: Vec<Check> = Vec::new();
    let workloads = workloads(scene, cameras, culling, left_out)?.into_iter();
    for (kind, workload) in workloads.take_while(|_| !interrupt::asked()) {
        let subjects = match workload.culling.test {
            CullingTest::Sphere => over_spheres,
            _ => over_boxes,
        };
        let mut checked = check(&workload, subjects, &kind, again);
        judge_camera_level(&workload, &mut checked, &kind, again);
        if rows.is_empty() {
            rows = checked;
            continue;
        }
        // The first difference is kept.
        for (row, more) in rows.iter_mut().zip(checked) {
            row.volumes += more.volumes;
            row.verdicts += more.verdicts;
            if row.status == Status::Ok {
                (row.status, row.difference) = (more.status, more.difference);
            }
        }
    }
    Ok(rows)
}

fn paths(args: &VerifyArgs, scene: &Scene) -> Vec<String> {
    if !args.path.is_empty() {
        return args.path.clone();
    }
    let own = (!scene.places.is_empty()).then_some("places");
    PATHS.into_iter().chain(own).map(str::to_owned).collect()
}

/// The queries of a path for each kind of volume, culling test and arithmetic.
///
/// Only the first has the points to locate.
fn workloads<'a>(
    scene: &'a Scene,
    cameras: &CameraPath,
    culling: &Culling,
    left_out: &mut Vec<String>,
) -> anyhow::Result<Vec<(String, Workload<'a>)>> {
    // Bytes of a camera with all its kinds of volumes: 25,000 measured.
    let needed = 26_000 * cameras.cameras.len() as u64;
    let what = format!("all kinds of volumes of the cameras of '{}'", cameras.name);
    fits_into(available_bytes(), [&what, "", "fewer cameras"], needed)?;
    let around = scene.surroundings();
    let first = format!("{} perspective", culling.arithmetic.name());
    let mut all = vec![(first, Workload::new(scene, cameras, culling)?)];
    // The first kind is the camera itself.
    let none = cameras.clone().at_most(0);
    for kind in &VOLUME_KINDS[1..] {
        let workload = Workload::new(scene, &none, &Culling::default())?;
        all.push(((*kind).to_owned(), workload));
    }
    for (i, camera) in cameras.cameras.iter().enumerate() {
        // None if f32 cannot hold six planes, which `left_out` reports.
        let volumes = variants(camera, &culling.planes, &around, i).unwrap_or_default();
        for (kind, volume) in volumes.into_iter().skip(1) {
            let of_kind = all.iter_mut().find(|(name, _)| name == kind);
            let (_, workload) = of_kind.expect("one of each kind");
            workload.views.push(CameraView::Volume(volume));
        }
    }
    for other in Culling::all(culling.planes).filter(|other| other != culling) {
        let kind = format!("{} {}", other.test.name(), other.arithmetic.name());
        match Workload::new(scene, cameras, &other) {
            Ok(mut workload) => {
                workload.points.clear();
                all.push((kind, workload));
            }
            Err(error) => left_out.push(format!("{}: {kind} left out: {error}", scene.name)),
        }
    }
    Ok(all)
}

/// Checks the reference's answers against the oracle, for some of the cameras.
///
/// All structures that agreed share these answers. Includes points on the cameras' faces if the
/// planes are safe.
pub fn judge_camera_level(workload: &Workload, checks: &mut [Check], kind: &str, again: &str) {
    let mut errors = judge(workload, MOST_JUDGED).errors;
    let (missed, or_points) = match workload.culling.unproven().is_none() {
        true => {
            errors += on_the_faces(workload);
            (errors.dropped(), " (or points on the faces)")
        }
        // Contacts have no guarantee.
        false => (errors.false_negatives, ""),
    };
    if missed == 0 {
        return;
    }
    for check in checks.iter_mut().filter(|c| c.difference.is_none()) {
        check.status = Status::Unsafe;
        check.difference = Some(format!(
            "{kind} volume, camera level: missed {}{or_points} and {}, the deepest by {}\n  again: {again}",
            text::counted(errors.false_negatives as usize, "visible item"),
            text::counted(errors.touch_dropped as usize, "boundary contact"),
            text::significant(errors.worst_miss)
        ));
    }
}

/// Differences of the views from the truth for points on their own faces.
///
/// Few scenes have boxes that near. The epsilon is made for the scene's extent, so points beyond it
/// are left out.
fn on_the_faces(workload: &Workload) -> ErrorCount {
    let around = workload.scene.surroundings();
    let mut errors = ErrorCount::default();
    for (camera, view) in workload.cameras.iter().zip(&workload.views) {
        let Ok(volume) = camera.convex_volume_f64(&around) else {
            continue;
        };
        let mut points = points_on_faces(camera, around.origin, volume.planes());
        points.retain(|point| point.reach().cmple(around.reach).all());
        if let Some(truth) = Truth::of_camera(camera, around.origin, &points) {
            let answer: Vec<ItemId> = scan(&points, |p| view.as_any().sees(p)).collect();
            errors += truth.errors(&points, &answer);
        }
    }
    errors
}

pub fn check(workload: &Workload, subjects: &[Subject], kind: &str, again: &str) -> Vec<Check> {
    let counted = count_pass(workload, subjects, &|_, _| ());
    let scene = workload.scene;
    let questions = workload.views.len() * scene.items.len()
        + workload.points.len() * scene.regions.boxes(&scene.items).len();
    let checks = subjects.iter().zip(counted).map(|(subject, counted)| {
        let status = counted.verdict.status;
        let reason = counted.verdict.reason.filter(|_| status.is_failure());
        let is_asked = status == Status::Ok || status.is_failure();
        Check {
            volumes: workload.views.len(),
            verdicts: if is_asked { questions as u64 } else { 0 },
            status,
            difference: reason.map(|reason| format!("{kind} volume, {reason}\n  again: {again}")),
            scene: scene.name.clone(),
            path: workload.path.clone(),
            structure: subject.spec.label.clone(),
        }
    });
    checks.collect()
}

fn random_cases(structures: &[StructureSpec], seed: u64, cases: u64) -> Vec<Check> {
    let path = format!("{} from seed {seed}", text::counted(cases as usize, "case"));
    let of = |structure: &StructureSpec| Check {
        scene: RANDOM.to_owned(),
        path: path.clone(),
        structure: structure.label.clone(),
        ..Check::default()
    };
    let mut checks: Vec<Check> = structures.iter().map(of).collect();
    let seeds = (0..cases).map(|i| seed.wrapping_add(i));
    for case_seed in seeds.take_while(|_| !interrupt::asked()) {
        let case = RandomCase::new(case_seed);
        let mut trials = [(); 3].map(|()| Trial::new(case.items.len()));
        let [seen, holding, overlapping] = &mut trials;
        seen.set_view(&case.items, &case.volume);
        holding.set_expected(Regions::Items.holding(case.point, &case.items));
        overlapping.set_expected(case.overlapping());
        for (spec, check) in structures.iter().zip(&mut checks) {
            check.volumes += 1;
            check.verdicts += 3 * case.items.len() as u64;
            if check.difference.is_some() {
                continue;
            }
            let found = match spec.build(&case.items) {
                Ok(index) => guarded(|| differ(&case, index.as_ref(), &mut trials)).flatten(),
                Err(BuildError::Refused { .. }) => Ok(()),
                Err(error @ BuildError::Panicked { .. }) => {
                    Err(Verdict::new(Status::Panicked, error.to_string()))
                }
                Err(error) => Err(Verdict::new(Status::Wrong, error.to_string())),
            };
            if let Err(Verdict { status, reason }) = found {
                check.status = status;
                let kind = VOLUME_KINDS[case.kind];
                let items = text::counted(case.items.len(), "item");
                let (program, kernel) = (program::name(), spec.execution.kernel.name());
                let again = format!("{program} verify --cases 1 --seed {case_seed}");
                check.difference = Some(format!(
                    "{kind} volume, {items}: {}\n  again: {again} --structure '{}' --kernel {kernel}",
                    reason.unwrap_or_default(),
                    spec.label
                ));
            }
        }
    }
    checks
}

/// Compares one structure's answers to a random case with those of the reference.
fn differ(
    case: &RandomCase,
    index: &dyn DynIndex,
    [seen, holding, overlapping]: &mut [Trial; 3],
) -> Result<(), Verdict> {
    let item = |id: usize| case.items.get(id);
    let visible = |id| Some(explain_visibility(item(id)?, &case.volume));
    seen.run(|out| index.visible(&case.volume, out))
        .map_err(|fault| Verdict::of(&fault, "", visible))?;
    let holds = |id| Some(explain_containment(item(id)?, case.point));
    let out = holding
        .run(|out| index.locate(case.point, out))
        .map_err(|fault| Verdict::of(&fault, "region search: ", holds))?;
    let nowhere = Vec3::new(case.point.x, f32::NAN, case.point.z);
    let mut many = Located::default();
    let points = [case.point, nowhere, case.point];
    index.query_many(&points, &mut many);
    for (n, right) in [out, &[], out].into_iter().enumerate() {
        let found = many.iter().nth(n).unwrap_or_default();
        if found != right || many.len() != points.len() {
            let one_sided = |id: &&ItemId| !found.contains(id) || !right.contains(id);
            let first = right.iter().chain(found).find(one_sided);
            let first = text::some(first, |id| format!("; first: item {id}"));
            let found = format!("{} has {} items in a batch", points[n], found.len());
            let why = format!("region search: {found}, {} alone{first}", right.len());
            return Err(Verdict::new(Status::Wrong, why));
        }
    }
    let volume = ConvexVolume::of_box(&case.region);
    let overlaps = |id| Some(format!("{:?} by {:?}", item(id)?, case.region));
    let answer = overlapping.run(|out| index.visible(&volume, out));
    answer.map_err(|fault| Verdict::of(&fault, "search by a box: ", overlaps))?;
    Ok(())
}

/// Name of the random cases in place of a scene.
const RANDOM: &str = "random";

/// One structure on one scene and path, or on all random cases.
#[derive(Default, Serialize)]
pub struct Check {
    scene: String,
    path: String,
    structure: String,
    volumes: usize,
    verdicts: u64,
    status: Status,
    /// The first difference and the command that reproduces it.
    pub difference: Option<String>,
}

#[derive(Serialize)]
struct Outcome {
    ok: bool,
    verdicts: u64,
    /// Bad items that were left out of the scenes.
    skipped_items: usize,
    /// Number of checks with a difference, however many verdicts in each are wrong.
    mismatches: usize,
    /// True if answers were compared with the cameras as written too.
    against_cameras: bool,
    seconds: f64,
    seed: u64,
    cases: u64,
    /// Culling tests without a view of a camera, each with the reason.
    left_out: Vec<String>,
    checks: Vec<Check>,
}

fn show(outcome: &Outcome) -> io::Result<()> {
    let width = text::width();
    let all = outcome.checks.iter();
    let all = grouped(all.map(|check| (check.structure.as_str(), check)));
    let columns: &[Column<&Vec<&Check>>] = &[
        ("structure", |own| text::shortened(&own[0].structure, 30)),
        (">paths", |own| {
            let of_paths = own.iter().filter(|check| check.scene != RANDOM);
            text::count(of_paths.count())
        }),
        (">volumes", |own| {
            text::count(own.iter().map(|check| check.volumes).sum())
        }),
        (">verdicts", |own| {
            let verdicts = own.iter().map(|check| check.verdicts).sum::<u64>();
            text::count(verdicts as usize)
        }),
        ("status", |own| {
            let mut statuses: Vec<&str> = own.iter().map(|check| check.status.name()).collect();
            statuses.sort_unstable();
            statuses.dedup();
            statuses.join(", ")
        }),
    ];
    let table = Table::with(all.iter().map(|(_, own)| own), columns);
    let mut told = vec![table.fitted(width)];
    for check in &outcome.checks {
        if let Some(difference) = &check.difference {
            let (structure, scene, path) = (&check.structure, &check.scene, &check.path);
            let about = text::plain(&format!("{structure} on {scene}, {path}"));
            told.push(format!("{about}:\n  {difference}"));
        }
    }
    let own = all.iter().map(|(_, own)| own);
    let differ = own.filter(|own| own.iter().any(|check| check.difference.is_some()));
    let is_silent = |check: &&Check| check.difference.is_none() && check.status != Status::Ok;
    let silent = all.iter().filter(|(_, own)| own.iter().any(is_silent));
    let (of, checks) = (text::counted(all.len(), "structure"), outcome.checks.len());
    let reference = "the reference scan";
    let checked = format!(
        "{}: {} in {:.1} s ({:.1} million/s), {}",
        match (differ.count(), silent.count(), &all[..]) {
            (0, 0, []) => "Nothing was checked".to_owned(),
            (0, 0, [(one, _)]) => format!("{one} returns the sets of {reference}"),
            (0, 0, _) => format!("All {of} return the sets of {reference}"),
            (0, silent, _) if silent == all.len() =>
                "No structure answered (see status)".to_owned(),
            (0, silent, _) => format!(
                "{silent} of {of} did not answer (see status), the others return the sets of \
                 {reference}"
            ),
            (1, ..) => format!("1 of {of} differs from {reference} or misses what the cameras see"),
            (wrong, ..) =>
                format!("{wrong} of {of} differ from {reference} or miss what the cameras see"),
        },
        text::counted(outcome.verdicts as usize, "verdict"),
        outcome.seconds,
        outcome.verdicts as f64 / outcome.seconds / 1e6,
        match outcome.mismatches {
            0 => "no mismatches".to_owned(),
            failed => format!("{failed} of {checks} checks failed (structure x path)"),
        }
    );
    told.push(text::wrapped(&checked, width));
    let left_out = outcome.left_out.iter();
    told.extend(left_out.map(|line| text::wrapped(&text::plain(line), width)));
    if !outcome.against_cameras {
        let doubt = "Planes without the full margin may drop visible items: a few cameras were \
                     checked, points on their faces were not.";
        told.push(text::wrapped(doubt, width));
    }
    text::print(&told)
}

#[cfg(test)]
mod tests;
