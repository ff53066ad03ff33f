//! What a structure says of itself: its name, what kind it is, whose it is and
//! what it can do. Declared, never guessed from a name; the conformance suite
//! holds a structure to what it has declared.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A structure's declaration, [`RegionIndex::INFO`](super::RegionIndex::INFO).
///
/// ```
/// use cullbench::index::{Info, Kind, Origin};
/// const INFO: Info = Info::new("tiles", "tiles of 32 items", Kind::Grid, Origin::Crate("mine"))
///     .refits();
/// assert!(INFO.capabilities.refits && !INFO.capabilities.ranges);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct Info {
    /// As typed on the command line; no registry has it twice.
    pub name: &'static str,
    /// One line for `cullbench list`; says so if the layout is special.
    pub summary: &'static str,
    /// Scan, tree or grid.
    pub kind: Kind,
    /// Whose code it is.
    pub origin: Origin<&'static str>,
    /// What it can do beyond the contract.
    pub capabilities: Capabilities,
    /// The form that lectures show, kept to be read beside the others: timed where
    /// it is named, or all are, and no part of the list `default`.
    pub textbook: bool,
}

/// How a structure goes about a query.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub enum Kind {
    /// Looks at every item.
    Scan,
    /// Nodes within nodes.
    Tree,
    /// Cells side by side, none within another.
    Grid,
}

/// Whose code answers.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub enum Origin<Name = String> {
    /// This crate's, even where another crate built the tree.
    Ours,
    /// The crate of that name.
    Crate(Name),
    /// Written here after somebody's code that cannot be asked itself.
    StandIn(Name),
}

/// What a structure can do beyond the contract. Everything is off unless
/// declared; region search is in the contract.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Capabilities {
    /// [`RegionIndex::refit`](super::RegionIndex::refit) takes over items that
    /// have moved; without, it always declines.
    pub refits: bool,
    /// [`RegionIndex::tree_order`](super::RegionIndex::tree_order): answers
    /// may be ranges of the structure's own order.
    pub ranges: bool,
    /// A build makes use of several threads.
    pub threaded_build: bool,
}

impl Info {
    /// Peak bytes per item of a build, its index included.
    ///
    /// Measured: 24 to 48 of scans, up to 245 of our trees and grids.
    pub(super) fn build_bytes(&self) -> usize {
        match (self.kind, self.origin) {
            (Kind::Scan, _) => 64,
            (_, Origin::Ours) => 256,
            _ => 512,
        }
    }

    /// A structure that can do what the contract asks, and no more.
    pub const fn new(
        name: &'static str,
        summary: &'static str,
        kind: Kind,
        origin: Origin<&'static str>,
    ) -> Info {
        Info {
            name,
            summary,
            kind,
            origin,
            capabilities: Capabilities {
                refits: false,
                ranges: false,
                threaded_build: false,
            },
            textbook: false,
        }
    }

    /// Declares [`Capabilities::refits`].
    pub const fn refits(mut self) -> Info {
        self.capabilities.refits = true;
        self
    }

    /// Declares [`Capabilities::ranges`].
    pub const fn ranges(mut self) -> Info {
        self.capabilities.ranges = true;
        self
    }

    /// Declares [`Capabilities::threaded_build`].
    pub const fn threaded_build(mut self) -> Info {
        self.capabilities.threaded_build = true;
        self
    }

    /// Declares [`Info::textbook`].
    pub const fn textbook(mut self) -> Info {
        self.textbook = true;
        self
    }

    /// The same under another name: for a variant with parameters of its own.
    pub const fn named(mut self, name: &'static str) -> Info {
        self.name = name;
        self
    }
}

impl Capabilities {
    /// The names of those it has.
    pub fn names(&self) -> Vec<&'static str> {
        let all = [
            (self.refits, "refits"),
            (self.ranges, "ranges"),
            (self.threaded_build, "threaded-build"),
        ];
        all.into_iter()
            .filter_map(|(has, name)| has.then_some(name))
            .collect()
    }
}

impl Kind {
    /// As JSON and lists have it.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Scan => "scan",
            Kind::Tree => "tree",
            Kind::Grid => "grid",
        }
    }
}

impl<Name> Origin<Name> {
    /// Whether the code that answers is this crate's own.
    pub fn is_ours(&self) -> bool {
        matches!(self, Origin::Ours)
    }

    /// Whether it is the code of another crate itself, no stand-in for it.
    pub fn is_crate(&self) -> bool {
        matches!(self, Origin::Crate(_))
    }
}

impl Origin<&str> {
    /// The same with a name of its own, for what outlives the structure.
    pub fn owned(self) -> Origin {
        match self {
            Origin::Ours => Origin::Ours,
            Origin::Crate(name) => Origin::Crate(name.to_owned()),
            Origin::StandIn(of) => Origin::StandIn(of.to_owned()),
        }
    }
}

impl<Name: fmt::Display> fmt::Display for Origin<Name> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::Ours => f.write_str("ours"),
            Origin::Crate(name) => write!(f, "crate {name}"),
            Origin::StandIn(of) => write!(f, "stand-in for {of}"),
        }
    }
}
