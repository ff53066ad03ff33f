//! Joins the shards of one plan into a single run.
//!
//! Shards that must not be mixed are refused by name; groups are in the order of the whole plan.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::folder::{self, save_report};

use super::reading::read_stream;
use super::stream::{Header, Stream, pairs};
use super::writing::{self, SAMPLE_COLUMNS, SAMPLES, STREAM, folder_of, temporary_folder_in};
use crate::input::InputError;
use crate::measure::GroupKey;
use crate::shown::first_of;

/// Shards of one run, joined but not written.
pub struct Merged {
    /// The stream of the whole run.
    pub stream: Stream,
    /// Per part: the file of its samples, and their byte range.
    samples: Vec<(PathBuf, [u64; 2])>,
}

/// Joins the folders of shards.
///
/// `line` has the options that the shards have in common, and their joint command; the caller
/// compares them.
///
/// # Errors
/// No shard or an unfinished one; another seed, suite, structure, machine, build or source; a cell
/// in two shards, a group in none.
pub fn merge(folders: &[PathBuf], line: (&[String], &str)) -> Result<Merged, InputError> {
    let mut shards = Vec::new();
    for path in folders {
        let (stream, _) = read_stream(&path.join(STREAM))?;
        if !stream.is_finished() {
            let path = path.display();
            return Err(InputError::new(format!(
                "{path}: the run is not finished; expected a finished one (run --resume --out {path})"
            )));
        }
        shards.push((path, stream));
    }
    let Some((first, begin)) = shards.first() else {
        return Err(InputError::new("no shard; expected one or more"));
    };
    for (n, (path, stream)) in shards.iter().enumerate() {
        let is_whole = stream.header.run.shard.is_none();
        let mut before = shards[..n].iter();
        let reason = is_whole
            .then(|| "a whole run; expected a shard (run --shard i/n)".to_owned())
            .or_else(|| another_plan(&begin.header, &stream.header, first))
            .or_else(|| before.find_map(|(before, other)| overlap(stream, other, before)));
        if let Some(reason) = reason {
            return Err(writing::at(path, reason));
        }
    }
    let whole = begin.header.whole();
    let has = |key: &GroupKey| shards.iter().any(|(_, s)| s.header.groups.contains(key));
    let missing = pairs(whole.iter().filter(|key| !has(key)));
    if !missing.is_empty() {
        let missing = first_of(&missing, NAMED);
        return Err(InputError::new(format!(
            "no shard has {missing}; expected all of the plan"
        )));
    }
    let mut parts = Vec::new();
    for (path, stream) in &shards {
        let mut from = SAMPLE_COLUMNS.len() as u64;
        let file = path.join(SAMPLES);
        for kept in &stream.parts {
            parts.push((kept, (file.clone(), [from, kept.samples_end])));
            from = kept.samples_end;
        }
        let found = folder::length_of_samples(&file).map_err(writing::io(&file))?;
        if found < from {
            let why = format!("{found} sound bytes; expected {from} that stream.jsonl refers to");
            return Err(writing::at(&file, why));
        }
    }
    // The order of a single run: process by process, scene by scene.
    let place = |key: &GroupKey| whole.iter().position(|other| other == key);
    let scene = |key: &GroupKey| whole.iter().position(|other| other.scene == key.scene);
    parts.sort_by_key(|(kept, _)| {
        let part = &kept.part;
        (part.process, scene(&part.key), place(&part.key))
    });
    let mut samples_end = SAMPLE_COLUMNS.len() as u64;
    let kept = parts.into_iter().map(|(part, samples)| {
        samples_end += samples.1[1] - samples.1[0];
        let mut part = part.clone();
        part.samples_end = samples_end;
        (part, samples)
    });
    let (kept, samples) = kept.unzip();
    let streams: Vec<&Stream> = shards.iter().map(|(_, stream)| stream).collect();
    Ok(Merged {
        stream: Stream {
            header: joined(&streams, line),
            parts: kept,
            finished_at: streams.iter().filter_map(|s| s.finished_at.clone()).max(),
        },
        samples,
    })
}

impl Merged {
    /// Writes the four files of a run into a folder that is new or empty.
    ///
    /// They are written to a temporary folder and renamed, in an empty folder the stream last, so
    /// that an interruption leaves no partial run.
    ///
    /// # Errors
    /// A folder that contains a run or other files; errors of the file system and of `check`, which
    /// is called before every long step.
    pub fn write(&self, out: &Path, check: &dyn Fn() -> io::Result<()>) -> Result<(), InputError> {
        let io = writing::io(out);
        folder::refuse_taken(out)?;
        let out = match out.exists() {
            true => fs::canonicalize(out).map_err(io)?,
            false => out.to_owned(),
        };
        let parent = folder_of(&out);
        if fs::read_dir(&out).is_ok_and(|mut entries| entries.next().is_some()) {
            let found = "has other files; expected an empty or new folder";
            return Err(io(io::Error::other(found)));
        }
        fs::create_dir_all(parent).map_err(io)?;
        let (beside, lock) = temporary_folder_in(parent).map_err(io)?;
        let all = self.write_samples(&beside.path().join(SAMPLES), check);
        all.map_err(io)?;
        let stream = beside.path().join(STREAM);
        let lines = self.stream.lines().map(|line| line.to_json());
        let lines: io::Result<Vec<Vec<u8>>> = lines.collect();
        let written = lines.and_then(|lines| fs::write(stream, lines.concat()));
        written.map_err(io)?;
        save_report(beside.path(), &self.stream.report())?;
        check().map_err(io)?;
        if out.exists() {
            // An existing folder, possibly a shell's working directory, is kept; the stream makes
            // it a run.
            let listed = fs::read_dir(beside.path()).map_err(io)?;
            let listed: io::Result<Vec<_>> = listed.map(|file| Ok(file?.file_name())).collect();
            let mut names = listed.map_err(io)?;
            names.sort_by_key(|name| name == STREAM);
            for name in names {
                fs::rename(beside.path().join(&name), out.join(&name)).map_err(io)?;
            }
        } else {
            fs::rename(beside.path(), &out).map_err(io)?;
            let _ = beside.keep();
        }
        drop(lock);
        Ok(())
    }

    fn write_samples(&self, path: &Path, check: &dyn Fn() -> io::Result<()>) -> io::Result<()> {
        let mut out = BufWriter::new(File::create_new(path)?);
        out.write_all(SAMPLE_COLUMNS.as_bytes())?;
        for (file, [from, to]) in &self.samples {
            check()?;
            let mut file = File::open(file)?;
            file.seek(SeekFrom::Start(*from))?;
            io::copy(&mut file.take(to - from), &mut out)?;
        }
        out.flush()
    }
}

/// The reason why a shard is not of the same plan, machine and build.
fn another_plan(begin: &Header, own: &Header, first: &Path) -> Option<String> {
    let first = first.display();
    let told = |differs| format!("{differs} in {first}; expected the same in all shards");
    let differs = own.differs(begin).map(told);
    let other = "expected the same scenes, paths and tests";
    let other = || format!("a shard of another plan than {first}; {other}");
    differs.or_else(|| (begin.whole() != own.whole()).then(other))
}

/// A cell that two shards share, or a scene that differs under one name.
fn overlap<'s>(own: &'s Stream, other: &'s Stream, first: &Path) -> Option<String> {
    let first = first.display();
    let mut groups = own.header.groups.iter();
    if let Some(key) = groups.find(|key| other.header.groups.contains(key)) {
        let pair = pairs([key]).concat();
        return Some(format!(
            "{pair} is in {first} as well; expected every cell in one shard"
        ));
    }
    // A scene that could not be loaded has no digest.
    let scenes = |stream: &'s Stream| {
        let parts = stream.parts.iter().map(|kept| &kept.part);
        let known = parts.filter(|part| !part.scene.digest.is_empty());
        known.map(|part| (&part.key.scene, &part.scene.digest))
    };
    let differs = |(name, digest): &(&String, &String)| {
        scenes(other).any(|(other, found)| other == *name && found != *digest)
    };
    let (scene, _) = scenes(own).find(differs)?;
    Some(format!(
        "scene '{scene}' is another one than in {first}; expected the same file"
    ))
}

/// Most missing scenes and paths that a message names.
const NAMED: usize = 4;

/// The header of the joint run of the shards.
fn joined(shards: &[&Stream], (args, command): (&[String], &str)) -> Header {
    let headers = || shards.iter().map(|stream| &stream.header);
    let mut header = shards[0].header.clone();
    let loads = headers().filter_map(|h| h.machine.load);
    header.machine.load = loads.reduce(f64::max);
    let begun = headers().map(|h| &h.run.started_at).min();
    header.run.started_at = begun.cloned().unwrap_or_default();
    header.run.id = format!("{}-of-{}", header.run.id, shards.len());
    header.run.command = command.to_owned();
    header.args = args.to_vec();
    header.run.shard = None;
    header.groups = header.whole().to_vec();
    header.whole.clear();
    header
}
