//! Any bytes as test vectors: no panic, one-line errors, and what is read can
//! be asked.
#![no_main]

use cullbench::index::Registry;
use cullbench::stress::{read_vectors, replay};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| match read_vectors(bytes, "fuzz.json") {
    Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    Ok(vectors) => {
        let linear = Registry::builtin().structures("linear");
        let linear = linear.expect("a structure");
        // Certificates grow with the fourth power of the planes.
        let few = |v: &&cullbench::stress::Vector| v.planes.iter().flatten().count() < 9;
        for vector in vectors.iter().filter(few) {
            let _ = replay(vector, &linear);
        }
    }
});
