//! What is known of an item by samples and proofs together.

use super::certificate::{Except, Proof};
use super::sample::SampleTruth;
use crate::query::ItemId;

named! {
    /// What is known of an item in a view.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
    #[non_exhaustive]
    pub enum Class {
        /// Some sample sees it.
        Visible = "visible",
        /// No sample sees it, but a ray between them does.
        SubSample = "sub-sample",
        /// No ray of the view sees it.
        Hidden = "hidden",
        /// It is the front item of no ray, but may tie with one of a lower number.
        Tied = "tied",
        /// It is the front item of no ray, but perhaps of some along lines of the
        /// image, where its border touches what hides it.
        AlongLines = "along-lines",
        /// No proof was found either way.
        Undecided = "undecided",
    }
}

impl Class {
    /// By the truth of a sample grid and by a proof.
    pub fn of(truth: &SampleTruth, item: ItemId, proof: &Proof) -> Class {
        match proof {
            _ if truth.sees(item) => Class::Visible,
            Proof::Witness { .. } => Class::SubSample,
            Proof::AroundEye | Proof::Walls(_) => Class::Hidden,
            Proof::Cover { except, .. } => match except {
                Except::Nothing => Class::Hidden,
                Except::Ties => Class::Tied,
                Except::Lines => Class::AlongLines,
            },
            Proof::Undecided => Class::Undecided,
        }
    }
}
