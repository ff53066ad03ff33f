//! `cullbench stress`: test vectors and generated extremes on every structure.
//!
//! Prints a line per category with what passed, and each kind of failure with the structures that
//! fail, or all rows as JSON.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::time::Instant;

use anyhow::bail;
use indicatif::ProgressBar;

use super::args::StressArgs;
use super::document::{Column, Table};
use super::shared_args::first_seed;
use super::{Ending, interrupt, print, text};
use crate::index::{Execution, Registry, StructureSpec};
use crate::kernel::Kernel;
use crate::report::grouped;
use crate::stress::extremes::{self, Extremes, VerdictCounts};
use crate::stress::{
    Name, ORACLE, Row, Section, Status, Vector, built_in, read_vectors_file, replay,
};

pub fn stress(registry: &Registry, args: &StressArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let mut vectors: Vec<Vector> = Vec::new();
    let mut ids = BTreeSet::new();
    for file in &args.vectors {
        let mut more = read_vectors_file(file)?;
        if more.is_empty() {
            bail!("{}: no vector; expected at least one", file.display());
        }
        for Name(id) in more.iter_mut().map(|vector| &mut vector.id) {
            // Another file has this id as well.
            if !ids.insert(id.clone()) {
                *id = format!("{}: {id}", file.display());
            }
        }
        vectors.extend(more);
    }
    if args.vectors.is_empty() {
        vectors = built_in()?;
    }
    let cases = args.cases;
    let seed = first_seed(args.seed, cases)?;
    interrupt::from_now_on_finish();
    let started = Instant::now();
    // A smaller check of every other instruction set of this machine.
    let chosen = args.kernel.execution()?.kernel;
    let is_other = |kernel: &Kernel| args.kernel.name.is_none() && *kernel != chosen;
    let mut sections = Vec::new();
    let (mut by_others, mut names) = (0, Vec::new());
    let passes = Kernel::available().filter(is_other);
    let passes = passes.map(|kernel| (kernel, cases.min(OF_OTHERS)));
    let passes: Vec<(Kernel, u64)> = passes.chain([(chosen, cases)]).collect();
    let vector_passes = (vectors.len() * passes.len()) as u64;
    let case_passes: u64 = passes.iter().map(|pass| extremes::total(pass.1)).sum();
    let bar = ProgressBar::new(vector_passes + case_passes);
    for (kernel, cases) in passes {
        let by_kernel = |spec: &StructureSpec| {
            let threads = spec.execution.threads;
            spec.clone().by(Execution { kernel, threads })
        };
        let structures: Vec<StructureSpec> = structures.iter().map(by_kernel).collect();
        let mut found = Vec::new();
        for (category, own) in grouped(vectors.iter().map(|v| (v.category(), v))) {
            let mut section = Section::new(category);
            for vector in own.into_iter().take_while(|_| !interrupt::asked()) {
                bar.set_message(text::plain(&vector.id.0));
                section.cases += 1;
                section.boxes += vector.boxes().len() as u64;
                section.rows.extend(replay(vector, &structures));
                bar.inc(1);
            }
            found.extend((section.cases > 0).then_some(section));
        }
        if cases > 0 && !interrupt::asked() {
            let extremes = Extremes {
                structures: &structures,
                seed,
                cases,
                threads: std::thread::available_parallelism().map_or(1, |n| n.get().min(2)),
            };
            found.extend(extremes.run(&|family| {
                if bar.message() != family {
                    bar.set_message(family.to_owned());
                }
                bar.inc(1);
                interrupt::asked()
            }));
        }
        if kernel != chosen {
            let rows = |section: &Section| section.rows.len();
            let all: usize = found.iter().map(rows).sum();
            names.extend((all > 0).then(|| kernel.name()));
            found = failures(found, kernel);
            by_others += all - found.iter().map(rows).sum::<usize>();
        }
        sections.extend(found);
    }
    bar.finish_and_clear();
    let rows: Vec<&Row> = sections.iter().flat_map(|section| &section.rows).collect();
    if !interrupt::heard() && by_others == 0 && rows.is_empty() {
        let files = args.vectors.iter().map(|file| file.display().to_string());
        let files = text::joined(files);
        bail!("{files}: nothing to check; expected planes, a camera or points in a vector");
    }
    print(args.format, &rows, || {
        let mut note = match by_others {
            0 => String::new(),
            count => format!("; {} more by {}", text::count(count), names.join(" and ")),
        };
        note += ["", "; interrupted: others were left out"][usize::from(interrupt::heard())];
        table(&sections, started.elapsed().as_secs_f64(), &note)
    })?;
    let is_right = rows.iter().all(|row| row.status != Status::Fail);
    Ok(Ending::of(is_right))
}

/// Most failures in the table, each with all structures that fail alike.
const MOST_SHOWN: usize = 100;

/// Cases of each extreme per instruction set other than the chosen one.
const OF_OTHERS: u64 = 2;

/// The failures with another instruction set, which they name.
fn failures(mut sections: Vec<Section>, kernel: Kernel) -> Vec<Section> {
    for section in &mut sections {
        // The oracle does not use instruction sets.
        let differs = |row: &Row| row.status == Status::Fail && row.structure != ORACLE;
        section.rows.retain(differs);
        for row in &mut section.rows {
            row.kernel = Some(kernel.name());
        }
        section.name = format!("{} by {kernel}", section.name);
        section.verdicts = VerdictCounts::default();
    }
    sections.retain(|section| !section.rows.is_empty());
    sections
}

fn table(sections: &[Section], seconds: f64, note: &str) -> io::Result<()> {
    let columns: &[Column<&Section>] = &[
        ("category", |s| s.name.clone()),
        (">cases", |s| text::count(s.cases as usize)),
        (">boxes", |s| text::count(s.boxes as usize)),
        (">rows", |s| text::count(s.rows.len())),
        (">passed", |s| text::count(s.count(Status::Pass))),
        (">refused", |s| text::count(s.count(Status::Refused))),
        (">failed", |s| text::count(s.count(Status::Fail))),
    ];
    let width = text::width();
    let mut reported = vec![Table::with(sections, columns).fitted(width)];
    let rows = || sections.iter().flat_map(|section| &section.rows);
    // Equal except for structure, test and instruction set.
    let mut alike = BTreeMap::<_, Vec<String>>::new();
    for row in rows().filter(|row| row.status == Status::Fail) {
        let by = text::some(row.kernel, |kernel| format!(" by {kernel}"));
        let key = (&row.id, row.level.name(), &row.expected, &row.got);
        let who = alike.entry(key).or_default();
        who.push(format!("{} {}{by}", row.structure, row.test));
    }
    for ((id, level, expected, got), who) in alike.iter().take(MOST_SHOWN) {
        let (id, who) = (text::plain(id), text::first_of(who, 3));
        reported.push(format!("{id}, {level} level, {who}:"));
        reported.push(format!("  expected {expected}\n  got {got}"));
    }
    if alike.len() > MOST_SHOWN {
        let more = text::counted(alike.len() - MOST_SHOWN, "further kind");
        reported.push(format!("{more}: --format json"));
    }
    let mut verdicts = VerdictCounts::default();
    sections.iter().for_each(|s| verdicts += s.verdicts);
    if verdicts.boxes > 0 {
        let line = format!(
            "{} checked at camera level: {} visible, {} of them boundary contacts ({} too close \
             to decide); {} and {}; dropped without the epsilon: {}; refused because sums could \
             overflow: {}",
            text::counted(verdicts.boxes as usize, "box"),
            text::count(verdicts.errors.visible as usize),
            text::count(verdicts.ties as usize),
            text::count(verdicts.errors.undecided as usize),
            text::counted(verdicts.errors.false_negatives as usize, "false negative"),
            text::counted(
                verdicts.errors.touch_dropped as usize,
                "dropped boundary contact"
            ),
            text::count(verdicts.lost_without_epsilon as usize),
            text::count(verdicts.refused as usize),
        );
        reported.push(text::wrapped(&line, width) + "\n");
    }
    let count = |status| text::count(rows().filter(|row| row.status == status).count());
    let [passed, refused, failed] = [Status::Pass, Status::Refused, Status::Fail].map(count);
    let checks = text::counted(rows().count(), "check");
    let line = format!(
        "{checks} in {seconds:.1} s: {passed} passed, {refused} refused as they must be, {failed} \
         failed{note}"
    );
    reported.push(text::wrapped(&line, width));
    text::print(&reported)
}
