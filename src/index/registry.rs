//! The registry: a row per structure, made from its declaration.
//!
//! It is a value: another crate adds its own structure with [`Registry::with`] and passes
//! the registry to `cli::main_with`.

use std::hint::black_box;

use serde::Deserialize;
use serde_json::{Map, Value, json};

#[cfg(feature = "peers")]
use super::peers;
use super::{
    Auto, Bsp, BspTextbook, BuildError, Bvh, BvhTextbook, DynIndex, Execution, Info, Input, Linear,
    LinearScalar, Moving, Octree, OctreeTextbook, Quadtree, QuadtreeTextbook, RegionIndex,
    UniformGrid, UpdatePolicy, Wide, WithKernel, caught,
};
use crate::geometry::PlaneTree;
use crate::json::told;
use crate::query::ItemId;
use crate::spec::{Spec, SpecError};
use crate::threads::Pool;

/// Name in a list that stands for all structures.
const ALL: &str = "all";
/// Name in a list that stands for the structures timed by default in still scenes.
pub const DEFAULT: &str = "default";
/// Name in a list that stands for the structures timed by default where items move.
pub const MOTION: &str = "motion";

/// A build without the structure's type; parameters are JSON.
type Build = fn(Execution, &Input<'_>, &Value) -> Result<Box<dyn DynIndex>, BuildError>;

/// A row of a registry: a structure without its type.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// The structure's declaration.
    pub info: Info,
    /// Builds the structure from parameters as JSON (missing ones take their defaults).
    pub build: Build,
    /// All parameters of a request, defaults filled in.
    pub params: fn(&Value) -> Result<Value, BuildError>,
}

impl Row {
    /// The row of a structure, from its declaration.
    pub const fn of<T: RegionIndex + 'static>() -> Row {
        fn typed<T: RegionIndex>(params: &Value) -> Result<T::Params, BuildError> {
            let structure = T::INFO.name;
            let mut filled = serde_json::to_value(T::Params::default()).unwrap_or_default();
            match (filled.as_object_mut(), params.as_object()) {
                (Some(all), Some(given)) => {
                    // Without nulls: JSON has no other form of NaN and infinity.
                    all.retain(|_, value| !value.is_null());
                    // Only a key that serde ignores takes any value; the alias of a field does not,
                    // nor a field that is not serialised.
                    let unknown = given.keys().find(|key| {
                        let mut probe = all.clone();
                        probe.insert((*key).clone(), json!([[]])).is_none()
                            && T::Params::deserialize(Value::Object(probe)).is_ok()
                    });
                    if let Some(key) = unknown {
                        let known = Vec::from_iter(all.keys().map(String::as_str)).join(", ");
                        let reason = format!("a field '{key}'; expected {known}");
                        return Err(BuildError::Params { structure, reason });
                    }
                    all.extend(given.clone());
                }
                // Parameters that are not a map, such as `()` or a number.
                (None, Some(given)) if given.is_empty() => {}
                _ => filled = params.clone(),
            }
            let own = |error| T::Params::deserialize(params).map_err(|_| error);
            // Once defaults are filled in, an alias is a duplicate key.
            let read = serde_path_to_error::deserialize(&filled).or_else(own);
            read.map_err(|error: serde_path_to_error::Error<serde_json::Error>| {
                // serde's message about a value lacks its key.
                let key = error.path().to_string();
                let (found, expected) = told(error.inner());
                let found = match filled.get(&key) {
                    Some(value) if !found.starts_with("a field") => format!("{key}={value}"),
                    _ => found,
                };
                BuildError::Params {
                    structure,
                    reason: match expected {
                        Some(expected) => format!("{found}; expected {expected}"),
                        None => found,
                    },
                }
            })
        }
        Row {
            info: T::INFO,
            build: |execution, input, params| {
                let pool = Pool::new(execution.threads);
                let index = T::build(&input.pool(&pool), &typed::<T>(params)?)?;
                let kernel = execution.kernel;
                Ok(Box::new(WithKernel { index, kernel }))
            },
            params: |params| {
                let filled = typed::<T>(params)?;
                Ok(serde_json::to_value(filled).unwrap_or_default())
            },
        }
    }
}

/// Structures by name, in the order of the help.
///
/// ```
/// use cullbench::index::{Registry, Wide};
/// let structures = Registry::empty().with::<Wide>().structures("wide:order=morton")?;
/// assert_eq!(structures[0].row.info.name, "wide");
/// # Ok::<(), cullbench::index::SpecError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Registry {
    rows: Vec<Row>,
}

/// The structures of the feature `peers`, for the hint that a build lacks it.
const PEERS: [&str; 5] = [
    "peer-obvhs",
    "peer-parry3d",
    "peer-rstar",
    "peer-bvh",
    "peer-bevy-style",
];

impl Registry {
    /// A registry without structures.
    pub const fn empty() -> Registry {
        Registry { rows: Vec::new() }
    }

    /// All structures of this build.
    ///
    /// The crate's own and, with the feature `peers`, those of other crates.
    pub fn builtin() -> Registry {
        let own = Registry::empty()
            .with::<LinearScalar>()
            .with::<Linear>()
            .with::<Bsp>()
            .with::<Octree>()
            .with::<Quadtree>()
            .with::<Bvh>()
            .with::<Wide>()
            .with::<Moving>()
            .with::<Auto>()
            .with::<UniformGrid>()
            .with::<BspTextbook>()
            .with::<OctreeTextbook>()
            .with::<QuadtreeTextbook>()
            .with::<BvhTextbook>();
        #[cfg(feature = "peers")]
        let own = own
            .with::<peers::PeerObvhs>()
            .with::<peers::PeerParry3d>()
            .with::<peers::PeerRstar>()
            .with::<peers::PeerBvh>()
            .with::<peers::PeerBevyStyle>();
        own
    }

    /// Adds a structure.
    ///
    /// # Panics
    /// If that name is taken or cannot be typed: a programming error, which the message names.
    pub fn with<T: RegionIndex + 'static>(self) -> Registry {
        self.with_row(Row::of::<T>())
    }

    /// Adds a row.
    ///
    /// # Panics
    /// The panics of [`Registry::with`].
    pub fn with_row(mut self, row: Row) -> Registry {
        let name = row.info.name;
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        assert!(
            name.starts_with(|c: char| c.is_ascii_alphanumeric())
                && name.chars().all(is_plain)
                && ![ALL, DEFAULT, MOTION].contains(&name),
            "structure '{name}' cannot be typed; expected a name of letters, digits, '-', '_' \
             and '.' other than '{ALL}', '{DEFAULT}' and '{MOTION}'"
        );
        assert!(
            self.named(name).is_none(),
            "structure '{name}' is in the registry already; expected another Info::name"
        );
        self.rows.push(row);
        self
    }

    /// All rows, in the order in which they were added.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The row of the structure of exactly this name.
    pub fn named(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.info.name == name)
    }

    /// One structure with its parameters: `bvh` or `bvh:leaf=4`.
    ///
    /// # Errors
    /// An unknown structure (with the nearest name), an unknown or bad
    /// parameter, or one out of range.
    pub fn structure(&self, text: &str) -> Result<StructureSpec, SpecError> {
        let spec = Spec::parse(text)?;
        let Some(&row) = self.named(spec.name()) else {
            if PEERS.contains(&spec.name()) {
                return Err(SpecError::new(format_args!(
                    "structure '{}' is not in this build; expected one made with `cargo build \
                     --features peers`",
                    spec.name()
                )));
            }
            let known = self.rows.iter().map(|row| row.info.name);
            return Err(SpecError::unknown("structure", spec.name(), known));
        };
        // Numbers and booleans as such, anything else as text.
        let parsed = |text: &str| serde_json::from_str(text).unwrap_or_else(|_| Value::from(text));
        let given = |(key, text): (&str, &str)| (key.to_owned(), parsed(text));
        let given: Map<String, Value> = spec.given().map(given).collect();
        let params = (row.params)(&Value::Object(given)).map_err(SpecError::new)?;
        let has_given = spec.given().next().is_some();
        let spec = StructureSpec {
            label: text.to_owned(),
            row,
            params,
            execution: Execution::default(),
            policy: UpdatePolicy::default(),
        };
        // The build checks ranges: a build over no items, which may fail in any other way without
        // an error here.
        let no_planes = PlaneTree::default();
        let nothing = Input::new(&[]).own_tree(Some(&no_planes));
        match has_given.then(|| spec.build(nothing)) {
            Some(Err(error @ BuildError::Params { .. })) => Err(SpecError::new(error)),
            _ => Ok(spec),
        }
    }

    /// The structures with certain declarations, with their default parameters.
    fn specs(&self, is_meant: fn(&Info) -> bool) -> Result<Vec<StructureSpec>, SpecError> {
        let meant = self.rows.iter().filter(|row| is_meant(&row.info));
        meant.map(|row| self.structure(row.info.name)).collect()
    }

    /// The structures of a comma-separated list.
    ///
    /// `all` are all of them, `motion` those that are not [on request](Info::on_request), and
    /// `default` those of `motion` that are not only [for motion](Info::for_motion).
    ///
    /// # Errors
    /// The errors of [`Registry::structure`]; an empty list, a structure named twice.
    pub fn structures(&self, list: &str) -> Result<Vec<StructureSpec>, SpecError> {
        let mut chosen: Vec<StructureSpec> = Vec::new();
        for text in Spec::split_list(list) {
            let more = match text.as_str() {
                ALL => self.specs(|_| true)?,
                DEFAULT => self.specs(|info| !info.on_request && !info.for_motion)?,
                MOTION => self.specs(|info| !info.on_request)?,
                _ => vec![self.structure(&text)?],
            };
            for spec in more {
                if chosen.iter().any(|c| c.label == spec.label) {
                    let found = format_args!("structure '{}' is named twice", spec.label);
                    return Err(SpecError::new(format_args!("{found}; expected each once")));
                }
                chosen.push(spec);
            }
        }
        if chosen.is_empty() {
            return Err(SpecError::new(
                "no structure is named; expected 'all', 'default', 'motion' or a list such as linear,bvh",
            ));
        }
        Ok(chosen)
    }
}

/// A structure as typed on the command line: its row with parameters.
#[derive(Clone, Debug)]
pub struct StructureSpec {
    /// The typed text: `bvh` or `bvh:leaf=4`.
    pub label: String,
    /// The structure.
    pub row: Row,
    /// All parameters, defaults filled in.
    pub params: Value,
    /// Kernel and threads.
    ///
    /// The best kernel and one thread unless changed by [`StructureSpec::by`].
    pub execution: Execution,
    /// Policy of updates after items have moved.
    pub policy: UpdatePolicy,
}

impl StructureSpec {
    /// A structure of the built-in registry.
    ///
    /// [`Registry::structure`] finds those of other registries.
    ///
    /// # Errors
    /// The errors of [`Registry::structure`].
    pub fn parse(text: &str) -> Result<StructureSpec, SpecError> {
        Registry::builtin().structure(text)
    }

    /// Sets kernel and threads.
    pub fn by(self, execution: Execution) -> StructureSpec {
        StructureSpec { execution, ..self }
    }

    /// Threads that share one query: the parameter `threads`, by default 1.
    ///
    /// The name is reserved: see [`RegionIndex::Params`].
    pub fn query_threads(&self) -> usize {
        self.params["threads"].as_u64().unwrap_or(1) as usize
    }

    /// Returns true if builds or queries share threads.
    pub fn is_threaded(&self) -> bool {
        self.query_threads() > 1 || self.execution.threads > 1
    }

    /// The structure's declaration.
    pub fn info(&self) -> &Info {
        &self.row.info
    }

    /// Builds the structure, with the threads of [`StructureSpec::execution`].
    ///
    /// # Errors
    /// The errors of [`RegionIndex::build`]; a panic of the structure's code; too little memory.
    pub fn build<'a>(&self, input: impl Into<Input<'a>>) -> Result<Box<dyn DynIndex>, BuildError> {
        let input = input.into();
        let count = input.items.len();
        let needed = count.saturating_mul(self.info().build_bytes());
        // Reserved and released unused: a later allocation failure would abort the program.
        let mut room = Vec::<u8>::new();
        if room.try_reserve_exact(needed).is_err() {
            let structure = self.info().name;
            return Err(BuildError::OutOfMemory {
                structure,
                count,
                needed,
            });
        }
        drop(black_box(room));
        let build = || (self.row.build)(self.execution, &input, &self.params);
        caught(build).unwrap_or_else(|message| Err(BuildError::Panicked { message }))
    }

    /// Updates an index after items have moved; returns true for a refit.
    ///
    /// Refits if the structure can, else rebuilds. The number of items must be that of the build;
    /// another number needs [`StructureSpec::build`].
    ///
    /// # Errors
    /// A moved item with a NaN or infinite bound, or an id out of range: the index is unchanged.
    /// The errors of [`StructureSpec::build`], and a refit that panics: the index is unreliable
    /// until it is rebuilt.
    pub fn update(
        &self,
        index: &mut Box<dyn DynIndex>,
        input: Input<'_>,
        moved: &[ItemId],
    ) -> Result<bool, BuildError> {
        let items = input.items;
        for item in moved.iter().map(|&id| id as usize) {
            match items.get(item) {
                Some(b) if b.is_finite() => {}
                Some(&bounds) => return Err(BuildError::NonFiniteItem { item, bounds }),
                None => {
                    let reason = format!("moved item {item} of {}; expected less", items.len());
                    let structure = self.info().name;
                    return Err(BuildError::Refused { structure, reason });
                }
            }
        }
        let refitted = caught(|| index.refit(items, moved));
        if refitted.map_err(|message| BuildError::Panicked { message })? {
            return Ok(true);
        }
        *index = self.build(input)?;
        Ok(false)
    }
}

#[cfg(test)]
mod tests;
