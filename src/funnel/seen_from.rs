//! From where the region stage looks.

use serde::{Serialize, Serializer};

named! {
    /// From where the region stage looks.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    #[non_exhaustive]
    pub enum SeenFrom, SEEN_FROM {
        Eye = "eye", "what the camera may see";
        Region = "region", "what may be seen from anywhere in the eye's regions";
    }
}

impl Serialize for SeenFrom {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        out.serialize_str(self.name())
    }
}
