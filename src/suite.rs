//! The suites of the main job: which scenes, which ways through them, how
//! long. A table and nothing else.

use crate::measure::{Effort, Extras};

/// A named set of scenes and paths with the time to spend on them.
#[non_exhaustive]
pub struct Suite {
    /// Value of `--suite`.
    pub name: &'static str,
    /// One line for `cullbench list scenes`.
    pub summary: &'static str,
    /// Scenes with their paths, in the order in which they are measured.
    pub plan: &'static [SuiteScene],
    /// Processes, rounds and times.
    pub effort: Effort,
    /// The list of structures where none are named.
    pub structures: &'static str,
}

/// A scene of a suite with the ways through it.
#[non_exhaustive]
pub struct SuiteScene {
    /// Spec of the scene.
    pub scene: &'static str,
    /// Specs of the paths.
    pub paths: &'static [&'static str],
    /// Measured with cold caches as well as with warm ones.
    pub cold: bool,
}

/// Scenes with the ways through them, each of them cold as well or not.
macro_rules! scenes {
    (cold: $cold:literal; $($scene:literal $paths:expr;)+) => {
        &[$(SuiteScene { scene: $scene, paths: &$paths, cold: $cold }),+]
    };
}

/// From a thousandth of the items to all of them, and further ways. Many views
/// for small scenes, where a few would train the branch predictor; few for large
/// ones, of which every query has branches enough and a scan takes milliseconds.
macro_rules! surface {
    ($frames:literal $(, $more:expr)*) => {
        [
            concat!("flythrough:frames=", $frames, ",visible=0.1%"),
            concat!("flythrough:frames=", $frames, ",visible=2%"),
            concat!("orbit:frames=", $frames, ",visible=20%"),
            concat!("outside:frames=", $frames)
            $(, $more)*
        ]
    };
}

/// The same number of visible items whatever the size of the scene.
const FIXED_COUNT: &str = "flythrough:frames=256,visible=500";

/// Effort of short suites.
const SHORT: Effort = Effort {
    processes: 10,
    rounds: [2, 40],
    task_ns: 2.5e6,
    pass_ns: 7e6,
    extras: Extras::All,
};

/// Effort of long ones.
const LONG: Effort = Effort {
    rounds: [3, 40],
    task_ns: 40e6,
    pass_ns: 100e6,
    ..SHORT
};

/// All suites. The first one is what `cullbench run` does by itself.
pub static SUITES: &[Suite] = &[
    Suite {
        name: "quick",
        summary: "five generated worlds of 50k to 100k items and the four real ones; about a minute",
        plan: scenes! { cold: false;
            "uniform:n=100000" ["flythrough:frames=128,visible=2%", "teleport:frames=128,visible=0.1%"];
            "clustered:n=100000" ["flythrough:frames=128,visible=2%"];
            "city:n=100000" ["flythrough:frames=128,visible=2%", "outside:frames=128"];
            "forest:n=100000" ["orbit:frames=128"];
            "rooms:n=50000" ["spin:frames=256"];
            "freedm-map12" ["places"];
            "freedm-map20" ["places", "flythrough:frames=512"];
            "helsinki" ["flythrough:frames=512,visible=2%", "zoom:frames=512"];
            "us-counties" ["orbit:frames=512", "outside:frames=512"];
        },
        effort: SHORT,
        structures: "default",
    },
    Suite {
        name: "standard",
        summary: "like quick, with a million items, more paths and more rounds; several minutes",
        plan: scenes! { cold: false;
            "uniform:n=10000" ["flythrough:frames=512,visible=2%"];
            "uniform:n=1000000" ["flythrough:visible=0.1%", "flythrough:visible=2%", "orbit", "outside"];
            "clustered:n=1000000" ["flythrough:visible=2%", "orbit"];
            "city:n=1000000" ["flythrough:visible=2%", "spin", "outside"];
            "forest:n=1000000" ["flythrough:visible=2%", "orbit"];
            "rooms:n=1000000" ["flythrough:visible=0.1%", "teleport"];
            "freedm-map12" ["places", "teleport:frames=512"];
            "freedm-map20" ["places", "flythrough:frames=512", "teleport:frames=512"];
            "helsinki" ["flythrough:frames=512,visible=2%", "orbit:frames=512", "zoom:frames=512",
                "teleport:frames=512"];
            "us-counties" ["flythrough:frames=512", "orbit:frames=512", "outside:frames=512"];
        },
        effort: Effort {
            processes: 12,
            rounds: [3, 60],
            task_ns: 60e6,
            ..LONG
        },
        structures: "all",
    },
    Suite {
        name: "full",
        summary: "the crossover surface: worlds from a thousand to a million items, 0.1 % to all \
                  of them visible, and the real ones, warm and cold; about an hour with the \
                  structures of other crates",
        plan: scenes! { cold: true;
            "uniform:n=1000" surface!(512);
            "uniform:n=10000" surface!(512, "flythrough:frames=512,visible=500");
            "uniform:n=100000" surface!(256, "flythrough:frames=256,visible=500");
            "uniform:n=1000000" surface!(64, "flythrough:frames=64,visible=500");
            "city:n=10000" surface!(512);
            "city:n=100000" surface!(256);
            "city:n=1000000" surface!(64);
            "clustered:n=100000" surface!(256);
            "freedm-map12" ["places", "flythrough:frames=512,visible=2%", "outside:frames=512"];
            "freedm-map20" ["places", "flythrough:frames=512,visible=2%", "outside:frames=512"];
            "helsinki" ["flythrough:frames=512,visible=2%", "orbit:frames=512"];
            "us-counties" ["orbit:frames=512", "outside:frames=512"];
        },
        effort: LONG,
        structures: "default",
    },
    Suite {
        name: REAL,
        summary: "the real scenes: four that come with the program and those that scripts/fetch.py \
                  has fetched; a minute or two",
        plan: scenes! { cold: false;
            "freedm-map12" ["places", "walk:frames=128"];
            "freedm-map20" ["places", "walk:frames=128"];
            "helsinki" ["flythrough:frames=128,visible=2%", "street:frames=128"];
            "us-counties" ["flythrough:frames=128,visible=2%", "outside:frames=128"];
        },
        effort: SHORT,
        structures: "default",
    },
    Suite {
        name: "compare",
        summary: "for `compare --against`: a real scene and two generated ones, frustum queries \
                  only; a minute and a half by itself",
        plan: scenes! { cold: false;
            "helsinki" ["flythrough:frames=128,visible=2%"];
            "city:n=20000" ["flythrough:frames=128,visible=2%"];
            "uniform:n=100000" ["flythrough:frames=64,visible=2%"];
        },
        effort: Effort {
            rounds: [12, 80],
            task_ns: 80e6,
            pass_ns: 40e6,
            extras: Extras::Nothing,
            ..LONG
        },
        structures: "default",
    },
    Suite {
        name: "growth",
        summary: "a fixed number of visible items among ten thousand to ten million; choose structures, all of them need tens of gigabytes",
        plan: scenes! { cold: false;
            "uniform:n=10000" [FIXED_COUNT];
            "uniform:n=100000" [FIXED_COUNT];
            "uniform:n=1000000" [FIXED_COUNT];
            "uniform:n=10000000" [FIXED_COUNT];
        },
        effort: Effort {
            task_ns: 60e6,
            pass_ns: 200e6,
            ..LONG
        },
        structures: "default",
    },
];

/// The suite that fetched scenes join.
pub const REAL: &str = "real";

/// The ways through a fetched scene in that suite.
pub const REAL_PATHS: &[&str] = &["flythrough:frames=128", "outside:frames=64"];

/// The way through a scene when none is named.
pub const DEFAULT_PATH: &str = "flythrough";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::PATHS;
    use crate::scene::{FAMILIES, SAMPLES};
    use crate::spec::Spec;

    #[test]
    fn every_suite_names_what_exists_and_those_that_rank_have_the_real_scenes() {
        // One is about growth, one about a change between two programs.
        let ranks = |name: &str| !["growth", "compare"].contains(&name);
        for suite in SUITES {
            for row in suite.plan {
                let scene = Spec::parse(row.scene).unwrap();
                let families = FAMILIES.iter().map(|f| f.name);
                assert!(
                    families
                        .chain(SAMPLES.iter().map(|s| s.name))
                        .any(|n| n == scene.name())
                );
                for path in row.paths {
                    let path = Spec::parse(path).unwrap();
                    assert!(PATHS.iter().any(|p| p.name == path.name()));
                }
            }
            for sample in SAMPLES.iter().filter(|_| ranks(suite.name)) {
                assert!(
                    suite.plan.iter().any(|row| row.scene == sample.name),
                    "{}",
                    suite.name
                );
            }
        }
    }
}
