//! Any bytes as cameras CSV and as points CSV: no panic, one-line errors, and
//! cameras that are accepted have planes or a typed error.
#![no_main]

use cullbench::camera::{MatrixConvention, PlaneOptions, Surroundings};
use cullbench::path::{LensDefaults, read_cameras_csv, read_points_csv};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for matrix in [None, Some(MatrixConvention::ColumnGl)] {
        let defaults = LensDefaults {
            matrix,
            ..LensDefaults::default()
        };
        match read_cameras_csv(bytes, "fuzz.csv", &defaults) {
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
            Ok(path) => {
                for camera in &path.cameras {
                    let _ = camera.volume(&PlaneOptions::default(), &Surroundings::default());
                }
            }
        }
    }
    if let Err(error) = read_points_csv(bytes, "fuzz.csv") {
        assert!(!error.to_string().contains('\n'), "{error}");
    }
});
