//! Tables of the results of a run.
//!
//! A single scene and path has a row per structure, several have a row each. The terminal shows a
//! summary of them, documents all. Names of cells: for a sentence, for a column of a table, and
//! short.

use std::collections::BTreeSet;

use super::document::{Block, Table};
use super::{scene_facts, text};
use crate::culling::{Culling, CullingTest};
use crate::measure::{CellKey, GroupKey, Metric, Status};
use crate::path::CameraFacts;
use crate::report::{Comparison, Overall, ReportCell, grouped, times_as_fast};
use crate::shown::first_of;
use crate::spec::parse_number;
use crate::statistics::Estimate;

/// Comparisons of one cache state and culling test each.
///
/// With the settings that distinguish the groups, "cold, six-box"; empty for a single one.
pub fn groups<'a, 'r>(all: &'a [Comparison<'r>]) -> Vec<(String, Vec<&'a Comparison<'r>>)> {
    let groups = grouped(all.iter().map(|comparison| (key(comparison), comparison)));
    let differs = |n: &usize| groups.iter().any(|(key, _)| key[*n] != groups[0].0[*n]);
    let parts: Vec<usize> = (0..3).filter(differs).collect();
    let name = |key: [&str; 3]| text::joined(parts.iter().map(|&n| key[n].replace("_ns", "")));
    let groups = groups.into_iter();
    groups.map(|(key, group)| (name(key), group)).collect()
}

/// Cache state, culling test and kind of time: times of others are not averaged.
fn key<'r>(comparison: &Comparison<'r>) -> [&'r str; 3] {
    let about = comparison.about();
    [&about.path.cache, &about.test, about.ranked_by()]
}

/// Lines above a table: the scene, the queries, and their answers.
pub fn heads(comparison: &Comparison) -> Vec<String> {
    let cell = comparison.about();
    let (scene, path) = (&cell.scene, &cell.path);
    let axes = (!scene.up.is_empty()).then(|| scene_facts::axes(scene));
    let of_scene = text::joined([
        text::items(scene.total_count, scene.skipped_items),
        text::counted(scene.region_count, "region"),
        axes.unwrap_or_default(),
    ]);
    let of_scene = match scene.total_count {
        0 if scene.digest.is_empty() => "no process finished".to_owned(),
        0 => of_scene + "; nothing is ranked",
        _ => of_scene,
    };
    let views = text::counted(path.camera_count, "view");
    let cache = Some(&*path.cache).filter(|cache| *cache != "warm");
    let motion = text::some(path.views_per_frame.checked_sub(1), |queries| {
        let checked = comparison.timed(|cell| cell.times.cameras_checked).max();
        let frames = checked.unwrap_or(0) / (queries + 1);
        let queries = text::counted(queries + 1, "query");
        // Cells without times do not state frames.
        match text::counted(frames, "frame") {
            _ if frames == 0 => format!("{}: {queries} per frame", path.motion),
            frames => format!("{}: {frames}, {queries} each", path.motion),
        }
    });
    // Sets of a coarse test are larger than the visible set.
    let excess = comparison.of_any("excess").filter(|excess| *excess > 0.005);
    let culled = comparison.of_any("cull_rate");
    // All may be false positives: then there is no share of visible ones.
    let judged = comparison.judged();
    let none = judged.filter(|j| j.errors.visible == 0 && j.errors.false_positives > 0);
    let none = none.map(|judged| text::counted(judged.judged_queries, "checked view"));
    let visible = culled.map(|culled| {
        let share = 1.0 - culled;
        let returned = text::short_percent(share) + " of the items are";
        let seen = excess.map(|excess| text::short_percent(share / (1.0 + excess)));
        match (seen, &none) {
            (Some(seen), _) => format!("{returned} returned, about {seen} visible"),
            (_, Some(views)) => format!("{returned} returned, none visible in {views}"),
            _ => format!("{returned} visible"),
        }
    });
    // Empty if all are the culling test's own.
    let errors = judged.map(|judged| judged.errors);
    let errors = errors.filter(|errors| errors.by_storage > 0 || errors.by_planes > 0);
    let sources = errors.map(|errors| text::sources(errors) + " by storage/planes/test");
    let excess = comparison.metric_of_any("excess");
    let excess = match excess.map(|excess| excess.estimate().per(0.01)) {
        None => sources.map(|items| format!("false positives {items}")),
        Some(share) => {
            let sources = text::some(sources, |items| format!(" ({items})"));
            let rate = text::rate(Some(share), 1.0);
            let views = judged.map(|judged| text::counted(judged.judged_queries, "checked view"));
            Some(match (share.value == 0.0 && share.upper.is_none(), views) {
                (true, Some(views)) => format!("no false positives in {views}"),
                _ => format!("{rate} % false positives{sources}"),
            })
        }
    };
    let asked = [&views, &cell.test, cache.unwrap_or_default()].map(str::to_owned);
    let asked = text::joined(asked.into_iter().chain(unusual(&cell.key().group)));
    let lens = path.lens.as_ref();
    let matrix = lens.and_then(|lens| lens.matrix.as_ref());
    let matrices = matrix.map(scene_facts::matrices);
    let lines = [
        format!("{}: {of_scene}", scene.name),
        format!("{}: {asked}", path.name),
        motion,
        text::some(lens, scene_facts::lens),
        text::some(matrices, |told| format!("matrices: {told}")),
        text::joined(visible.into_iter().chain(excess)),
    ];
    lines.into_iter().filter(|line| !line.is_empty()).collect()
}

/// A column of a single figure: header and metric.
pub type Figure = (&'static str, &'static str);

/// Figures of queries by priority; a summary has the first two.
pub const OF_QUERIES: [Figure; 10] = [
    ("build", "build_ms"),
    ("bytes/item", "memory_bytes_per_item"),
    ("repaid after", "break_even_queries"),
    ("p95", "query_ns_p95"),
    ("nodes tested", "nodes_tested"),
    ("items tested", "items_tested"),
    ("/ read", "times_read"),
    ("/ copy", "times_memcpy"),
    ("locate", "locate_ns"),
    ("update of 1 %", "update_ms"),
];

/// Figures of frames, before the first two of queries.
///
/// A summary of a motion has the first three and `x after 100`.
pub const OF_FRAMES: [Figure; 8] = [
    ("worst", "worst_frame_ns"),
    ("update", "update_ns"),
    ("query", "query_ns"),
    ("further query", "further_query_ns"),
    ("x after 1", "ageing_1"),
    ("x after 10", "ageing_10"),
    ("x after 100", "ageing_100"),
    ("x after 1000", "ageing_1000"),
];

/// A figure in its unit; a time in full has its interval.
fn figure(metric: &Metric, is_full: bool) -> String {
    match metric.unit.as_str() {
        "ns" | "ms" if is_full => text::time_with(metric),
        "ns" | "ms" => text::time_with(&Metric::of(Estimate::exact(metric.value), &metric.unit)),
        "bytes" => format!("{:.1}", metric.value),
        "queries" => text::count(metric.value as usize),
        _ => text::significant(metric.value),
    }
}

/// A row per structure of one scene and path.
///
/// In full with intervals, lower bounds and every figure; else the columns that fit a wide
/// terminal.
pub fn structures(comparison: &Comparison, base: Option<&str>, is_full: bool) -> Table {
    let is_still = comparison.about().path.motion.is_empty();
    let time = ["time per frame", "time per query"][usize::from(is_still)];
    let figures = match (is_still, is_full) {
        (true, true) => OF_QUERIES.to_vec(),
        (true, false) => [&OF_QUERIES[..3], &OF_QUERIES[4..6]].concat(),
        (false, true) => [&OF_FRAMES, &OF_QUERIES[..2]].concat(),
        (false, false) => [&OF_FRAMES[..3], &OF_FRAMES[6..7], &OF_QUERIES[..2]].concat(),
    };
    let peer = comparison.fastest_peer().filter(|_| is_full);
    let of_base = text::some(base, |base| format!("vs {}", text::plain(base)));
    let head = ["structure", "rank", time, &of_base].into_iter();
    let head = head.chain(figures.iter().map(|figure| figure.0));
    let mut table = Table::of_numbers(head.chain(["vs fastest peer", "status"]));
    let mut add = |rank: String, cell: &ReportCell| {
        let is_ok = cell.status == Status::Ok;
        let speedup = base.and_then(|base| comparison.speedup(base, cell));
        let of_peer = peer.and_then(|peer| times_as_fast(peer, cell));
        let status = cell.status.name().to_owned();
        let row = [
            text::plain(&cell.structure),
            rank,
            cell.time().map_or(status.clone(), text::time_with),
            text::some(speedup.filter(|_| is_ok), |found| ratio(found, is_full)),
        ];
        let figure = |(_, name): &Figure| {
            text::some(cell.metrics.get(*name), |metric| figure(metric, is_full))
        };
        let last = [
            text::some(of_peer.filter(|_| is_ok), text::significant),
            text::some((is_full && !is_ok).then_some(status), |status| status),
        ];
        let row = row.into_iter().chain(figures.iter().map(figure));
        table.add_row(row.chain(last));
    };
    for cell in &comparison.cells {
        let rank = cell.rank.map_or("-".to_owned(), |rank| rank.to_string());
        add(rank, cell);
    }
    for cell in comparison.bounds.iter().filter(|_| is_full) {
        add("lower bound".to_owned(), cell);
    }
    table.without_empty_columns()
}

/// "4.04 x", in full with its 95 % interval.
fn ratio(found: Estimate, is_full: bool) -> String {
    let interval = text::interval(found.ends().filter(|_| is_full), 1.0);
    format!("{} x{interval}", text::significant(found.value))
}

/// Speed-ups over the base, and their geometric means.
///
/// A row per scene and path, a column per structure. The base has its times; `*` marks the fastest
/// and its ties.
pub fn matrix(names: Vec<String>, all: &[&Comparison], overall: &Overall) -> Table {
    let is_base = |name: &str| overall.base == Some(name);
    let mut columns: Vec<_> = overall.standings.iter().collect();
    columns.sort_by_key(|standing| !is_base(standing.structure));
    let head = columns.iter().map(|standing| standing.structure);
    let mut table = Table::of_numbers(["scene, path"].into_iter().chain(head));
    for (name, comparison) in names.into_iter().zip(all) {
        let figure = |structure: &str| {
            let mut cells = comparison.cells.iter();
            let Some(cell) = cells.find(|cell| cell.structure == structure) else {
                return String::new();
            };
            let speedup = overall.base.filter(|base| *base != structure);
            let speedup = speedup.and_then(|base| comparison.speedup(base, cell));
            let shown = match (cell.rank, speedup) {
                (None, _) => return cell.status.name().to_owned(),
                (_, Some(speedup)) => text::significant(speedup.value),
                (_, None) => text::some(cell.time(), |time| text::time(time.value)),
            };
            let is_first = cell.rank == Some(1) && !comparison.is_blind();
            let mark = if is_first { "*" } else { "" };
            format!("{mark}{shown}")
        };
        let figures = columns.iter().map(|standing| figure(standing.structure));
        table.add_row([name].into_iter().chain(figures));
    }
    if let Some(base) = overall.base {
        let means = columns.iter();
        let means = means.map(|standing| text::some(standing.speedup, text::significant));
        let label = format!("geometric mean, x {base}");
        table.add_row([label].into_iter().chain(means));
    }
    table
}

/// Summary of several scenes and paths: as many structures as fit.
pub fn of_many(all: &[&Comparison], overall: &Overall, width: usize) -> Vec<Block> {
    let about = || all.iter().map(|comparison| comparison.about());
    let up: BTreeSet<&str> = about().map(|cell| cell.scene.up.as_str()).collect();
    // Unknown for a scene that did not load.
    let up: Vec<&str> = up.into_iter().filter(|up| !up.is_empty()).collect();
    // A single value if it is the same in all.
    let lens = about().filter_map(|cell| cell.path.lens.clone());
    let lens = lens.reduce(CameraFacts::with);
    let lens = lens.as_ref().map(scene_facts::lens);
    let group = about().next().map(|about| about.key().group);
    let cold = |group: &GroupKey| (group.cache != "warm").then(|| group.cache.clone());
    let asked = text::some(group, |group| {
        let test = [group.test.clone()].into_iter().chain(cold(&group));
        text::joined(test.chain(unusual(&group)))
    });
    let lens = lens.map(|lens| format!("{asked}; {} up; {lens}", up.join(" or ")));
    let cut = |label: &String| text::without_middle(&text::plain(label), [width / 4; 2]);
    let names = distinct(&labels(all), cut, |label| text::plain(label));
    let mut parts = matrix(names, all, overall).parts(width);
    let hidden = parts.split_off(1);
    let hidden: usize = hidden.iter().map(|part| part.header.len() - 1).sum();
    let more = text::counted(hidden, "further structure");
    let more = (hidden > 0).then(|| format!("{more}: --all-columns"));
    let mut blocks: Vec<Block> = lens.into_iter().map(Block::Line).collect();
    blocks.extend(parts.into_iter().map(Block::Table));
    let lines = [legend(all, overall)].into_iter().chain(more);
    blocks.extend(lines.map(Block::Line));
    blocks
}

/// Meaning of the figures of a [`matrix`].
pub fn legend(all: &[&Comparison], overall: &Overall) -> String {
    let unit = text::some(overall.base, |base| {
        let per = all[0].about().ranked_by().replace("_ns", "");
        format!("; {base}: time per {per}, others: x {base}")
    });
    format!("* fastest or tied{unit}")
}

/// Short names of scenes and paths: "city 100k flythrough 2 %".
///
/// Two that would be equal are shortened around their difference.
pub fn labels(all: &[&Comparison]) -> Vec<String> {
    let keys: Vec<GroupKey> = all.iter().map(|c| c.about().key().group).collect();
    labels_of(&keys)
}

fn labels_of(keys: &[GroupKey]) -> Vec<String> {
    type Part = fn(&GroupKey) -> &String;
    const PARTS: [Part; 3] = [|key| &key.scene, |key| &key.path, |key| &key.motion];
    let of = |key: &GroupKey, show: &dyn Fn(Part, &String) -> String| {
        let parts = PARTS.map(|part| show(part, part(key)));
        parts.join(" ").trim_end().to_owned()
    };
    let differing = |part: Part, name: &String| {
        let all: Vec<String> = keys.iter().map(|key| part(key).clone()).collect();
        about_difference(name, &all)
    };
    distinct(
        keys,
        |key| of(key, &|_, name| short(name)),
        |key| of(key, &differing),
    )
}

/// A name; if it is long, its beginning and the part that differs.
///
/// The part begins where the most similar other name differs.
fn about_difference(name: &str, all: &[String]) -> String {
    const ROOM: usize = 32;
    let alike = |other: &String| {
        let both = name.chars().zip(other.chars());
        both.take_while(|(own, other)| own == other).count()
    };
    let others = all.iter().filter(|other| *other != name);
    let same = others.map(alike).max().unwrap_or(0);
    let start = same.saturating_sub(ROOM / 4);
    let name = text::plain(name);
    if name.chars().count() <= ROOM || start <= ROOM / 4 {
        return text::shortened(&name, ROOM);
    }
    let rest: String = name.chars().skip(start).collect();
    text::shortened(&name, ROOM / 4) + &text::without_middle(&rest, [ROOM / 2, ROOM / 4])
}

/// Short names; full ones if two different ones have the same.
pub fn distinct<T: PartialEq>(
    all: &[T],
    short: impl Fn(&T) -> String,
    full: impl Fn(&T) -> String,
) -> Vec<String> {
    let names: Vec<String> = all.iter().map(short).collect();
    let named = || all.iter().zip(&names);
    let is_taken = |one, name| named().any(|(other, of)| of == name && other != one);
    let shown = named().map(|(one, name)| match is_taken(one, name) {
        true => full(one),
        false => name.clone(),
    });
    shown.collect()
}

/// A file without its folder, a spec without keys and frames: "city 100k".
pub fn short(source: &str) -> String {
    let Some((name, parameters)) = source.rsplit_once(':').filter(|(_, p)| p.contains('=')) else {
        let file = source.rsplit(['/', '\\']).next();
        return text::shortened(file.unwrap_or(source), 24);
    };
    let value = |pair: &str| match pair.split_once('=')? {
        ("frames", _) => None,
        ("n", count) => Some(format!(" {}", short_count(count))),
        ("visible", share) => Some(format!(" {}", share.replace('%', " %"))),
        _ => Some(format!(" {pair}")),
    };
    let values = parameters.split(',').filter_map(value);
    text::shortened(&format!("{name}{}", values.collect::<String>()), 36)
}

/// "100000" as "100k".
fn short_count(typed: &str) -> String {
    let count = parse_number(typed).unwrap_or(f64::NAN);
    match (count % 1e6 == 0.0, count % 1e3 == 0.0) {
        (true, _) if count > 0.0 => format!("{}M", count / 1e6),
        (false, true) => format!("{}k", count / 1e3),
        _ => typed.to_owned(),
    }
}

/// Reasons why cells are not ok, each once with its scenes and paths.
pub fn reasons(group: &[&Comparison]) -> Vec<String> {
    notes(group, |cell| {
        let reason = cell.reason.as_ref()?;
        Some(format!("{}: {reason}", cell.status.name()))
    })
}

/// Choices of structures, each once with its scenes and paths.
pub fn choices(group: &[&Comparison]) -> Vec<String> {
    notes(group, |cell| cell.chose.clone())
}

fn notes(group: &[&Comparison], of: impl Fn(&ReportCell) -> Option<String>) -> Vec<String> {
    let labels = labels(group);
    let own = group.iter().zip(&labels).flat_map(|(one, label)| {
        let cells = one.cells.iter().chain(&one.bounds);
        cells.map(move |cell| (cell, label))
    });
    let notes =
        own.filter_map(|(cell, label)| Some((format!("{}: {}", cell.structure, of(cell)?), label)));
    let lines = grouped(notes).into_iter().map(|(line, on)| {
        let places = match group.len() {
            1 => String::new(),
            all if on.len() == all => " (on all)".to_owned(),
            _ => format!(" (on {})", first_of(&on, 2)),
        };
        text::plain(&line) + &places
    });
    lines.collect()
}

/// A cell by its name in a sentence.
pub fn name(cell: &CellKey) -> String {
    let (structure, scene) = (&cell.structure, &cell.group.scene);
    format!("{structure} on {scene}, {}", question(&cell.group))
}

/// Structure in at most twenty characters; its last parameter is kept.
pub fn short_structure(name: &str) -> String {
    text::without_middle(&text::plain(name), [8, 9])
}

/// Scene and path in short, with test and cache state unless default.
///
/// At most `room` characters; the scene is shortened first.
pub fn place(group: &GroupKey, room: usize, short: fn(&str) -> String) -> String {
    let other = |text: &String, usual: &str| (text != usual).then(|| text.clone());
    let test = other(&group.test, CullingTest::SixPlane.name());
    let cache = other(&group.cache, "warm");
    let motion = other(&group.motion, "").map(|motion| short(&motion));
    let parts = [Some(short(&group.path)), test, cache, motion];
    let parts = parts.into_iter().flatten().chain(unusual(group));
    let rest: String = parts.map(|part| format!(" {part}")).collect();
    let scene = short(&group.scene);
    if text::across(&scene) + text::across(&rest) <= room {
        return scene + &rest;
    }
    let most = room.saturating_sub(3);
    let left = most.saturating_sub(text::across(&rest) + 3).max(8);
    text::shortened(&(text::shortened(&scene, left) + &rest), most)
}

/// All settings of a key that are not defaults, except the scene.
pub fn question(group: &GroupKey) -> String {
    let cold = Some(&group.cache).filter(|cache| *cache != "warm");
    let test = group.test.clone() + &text::some(cold, |cache| format!(" ({cache})"));
    let asked = [group.path.clone(), test, group.motion.clone()];
    text::joined(asked.into_iter().chain(unusual(group)))
}

/// Arithmetic, plane derivation and epsilon, unless default.
pub fn unusual(group: &GroupKey) -> impl Iterator<Item = String> {
    let usual = GroupKey::of("", "", false, &Culling::default(), "");
    // f64 has no epsilon.
    let epsilon = |key: &GroupKey| match key.arithmetic.as_str() {
        "f64" => format!("epsilon {}", usual.epsilon),
        _ => format!("epsilon {}", key.epsilon),
    };
    let facts = |key: &GroupKey| [key.arithmetic.clone(), key.planes.clone(), epsilon(key)];
    let both = facts(group).into_iter().zip(facts(&usual));
    both.filter(|(own, usual)| own != usual).map(|(own, _)| own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_short_unless_two_are_the_same() {
        let key = |scene: &str, path: &str| GroupKey {
            scene: scene.to_owned(),
            path: path.to_owned(),
            ..GroupKey::default()
        };
        let [fly, longer] = [128, 512].map(|n| format!("flythrough:frames={n},visible=2%"));
        // Paths of other scenes do not matter.
        let apart = [key("city:n=100000", &fly), key("helsinki", &longer)];
        let short = ["city 100k flythrough 2 %", "helsinki flythrough 2 %"];
        assert_eq!(labels_of(&apart), short);
        let alike = labels_of(&[key("helsinki", &fly), key("helsinki", &longer)]);
        assert_eq!(
            alike,
            [format!("helsinki {fly}"), format!("helsinki {longer}")]
        );
    }

    #[test]
    fn long_names_are_cut_where_they_differ() {
        let own = |roofs: &str| format!("helsinki_city_centre_export_2024_{roofs}_roofs.csv");
        let all = ["with", "without", "no"].map(own);
        let cut = all.each_ref().map(|name| about_difference(name, &all));
        assert_eq!(cut[0], "helsinki...024_with_roofs.csv");
        assert_eq!(cut[1], "helsinki...024_without_roofs.csv");
        assert_eq!(cut[2], "helsinki...rt_2024_no_roofs.csv");
        let seeds = [
            "city:n=300,seed=1".to_owned(),
            "city:n=300,seed=2".to_owned(),
        ];
        assert_eq!(about_difference(&seeds[0], &seeds), seeds[0]);
    }
}
