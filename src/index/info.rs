//! The declaration of a structure: name, kind, origin, capabilities.
//!
//! The conformance suite checks each structure against it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A structure's declaration, [`RegionIndex::INFO`](super::RegionIndex::INFO).
///
/// ```
/// use cullbench::index::{Info, Kind, Origin};
/// const INFO: Info = Info::new("tiles", "tiles of 32 items", Kind::Grid, Origin::Crate("mine"))
///     .refits();
/// assert!(INFO.refits && !INFO.ranges);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Info {
    /// Name on the command line; unique in a registry.
    pub name: &'static str,
    /// One line for `cullbench list`, with special properties of the layout.
    pub summary: &'static str,
    /// Scan, tree or grid.
    pub kind: Kind,
    /// Author of the code.
    pub origin: Origin<&'static str>,
    /// True if [`refit`](super::RegionIndex::refit) takes over items that have moved.
    ///
    /// Otherwise it always declines.
    pub refits: bool,
    /// True if answers may be ranges of the structure's own order.
    ///
    /// The order is [`RegionIndex::tree_order`](super::RegionIndex::tree_order).
    pub ranges: bool,
    /// True if a build uses several threads.
    pub threaded_build: bool,
    /// True if only timed when named, or with `all`; not part of the list `default`.
    ///
    /// A variant for comparison, or one that is always identical to another of the list.
    pub on_request: bool,
    /// True if only timed when named, or by default where items move.
    ///
    /// Motion is the only advantage of such a structure.
    pub for_motion: bool,
}

named! {
    /// The kind of a structure's search.
    #[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    #[cfg_attr(test, derive(schemars::JsonSchema))]
    #[non_exhaustive]
    pub enum Kind {
        /// Tests every item.
        Scan = "scan",
        /// Nodes within nodes.
        Tree = "tree",
        /// Cells side by side, none within another.
        Grid = "grid",
    }
}

/// Author of the code that answers queries.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub enum Origin<Name = String> {
    /// This crate, even where another crate builds the tree.
    Ours,
    /// The crate of that name.
    Crate(Name),
    /// This crate, modelled on code that cannot be called itself.
    StandIn(Name),
}

macro_rules! declares {
    ($($(#[$about:meta])* $flag:ident)+) => {
        impl Info {
            $($(#[$about])*
            pub const fn $flag(mut self) -> Info {
                self.$flag = true;
                self
            })+
        }
    };
}

declares! {
    /// Declares the capability `refits`.
    refits
    /// Declares the capability `ranges`.
    ranges
    /// Declares the capability `threaded_build`.
    threaded_build
    /// Declares [`Info::on_request`].
    on_request
    /// Declares [`Info::for_motion`].
    for_motion
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

    /// A structure without capabilities beyond the contract.
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
            refits: false,
            ranges: false,
            threaded_build: false,
            on_request: false,
            for_motion: false,
        }
    }

    /// A structure of this crate.
    pub(crate) const fn ours(name: &'static str, summary: &'static str, kind: Kind) -> Info {
        Info::new(name, summary, kind, Origin::Ours)
    }

    /// Names of the declared capabilities.
    pub fn capabilities(&self) -> Vec<&'static str> {
        let all = [
            (self.refits, "refits"),
            (self.ranges, "ranges"),
            (self.threaded_build, "threaded-build"),
        ];
        let declared = all.into_iter().filter(|(is_declared, _)| *is_declared);
        declared.map(|(_, name)| name).collect()
    }
}

impl<Name> Origin<Name> {
    /// Returns whether this crate's code answers, not a stand-in.
    pub fn is_ours(&self) -> bool {
        matches!(self, Origin::Ours)
    }
}

impl Origin<&str> {
    /// Converts to an owned name.
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

#[cfg(test)]
mod tests {
    use super::*;

    impl Info {
        /// The same declarations under another name.
        pub const fn named(mut self, name: &'static str) -> Info {
            self.name = name;
            self
        }
    }
}
