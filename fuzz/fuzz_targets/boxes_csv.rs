//! Any bytes as boxes CSV: no panic, one-line errors, and what is read can be
//! written and read again.
#![no_main]

use cullbench::scene::{read_boxes_csv, write_boxes_csv};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for skip in [false, true] {
        match read_boxes_csv(bytes, "fuzz.csv", skip) {
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
            Ok(scene) => {
                let mut text = Vec::new();
                write_boxes_csv(&scene, &mut text).expect("a Vec takes everything");
                let again = read_boxes_csv(&text[..], "again.csv", false);
                if let Ok(again) = again {
                    assert_eq!(again.items.len(), scene.items.len());
                }
            }
        }
    }
});
