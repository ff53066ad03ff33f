//! The suites of the main job: which scenes, which ways through them, how
//! long. A table and nothing else.

use std::time::Duration;

/// A named set of scenes and paths with the time to spend on them.
pub struct Suite {
    pub name: &'static str,
    pub summary: &'static str,
    /// Scene, then its paths.
    pub plan: &'static [(&'static str, &'static [&'static str])],
    pub min_rounds: usize,
    pub max_rounds: usize,
    /// Per scene, path and task; see `measure::Protocol`.
    pub budget: Duration,
    pub pass: Duration,
}

/// All suites. The first one is what `cullbench run` does by itself.
pub static SUITES: &[Suite] = &[
    Suite {
        name: "quick",
        summary: "five generated worlds of 50k to 100k items and the four real ones; under a minute",
        plan: &[
            (
                "uniform:n=100000",
                &["flythrough:visible=2%", "teleport:visible=0.1%"],
            ),
            ("clustered:n=100000", &["flythrough:visible=2%"]),
            ("city:n=100000", &["flythrough:visible=2%", "outside"]),
            ("forest:n=100000", &["orbit"]),
            ("rooms:n=50000", &["spin:frames=512"]),
            ("freedm-map12", &["places"]),
            ("freedm-map20", &["places", "flythrough:frames=512"]),
            (
                "helsinki",
                &["flythrough:frames=512,visible=2%", "zoom:frames=512"],
            ),
            ("us-counties", &["orbit:frames=512", "outside:frames=512"]),
        ],
        min_rounds: 7,
        max_rounds: 21,
        budget: Duration::from_millis(700),
        pass: Duration::from_millis(100),
    },
    Suite {
        name: "standard",
        summary: "as quick with a million items, more paths and more rounds; several minutes",
        plan: &[
            ("uniform:n=10000", &["flythrough:frames=512,visible=2%"]),
            (
                "uniform:n=1000000",
                &[
                    "flythrough:visible=0.1%",
                    "flythrough:visible=2%",
                    "orbit",
                    "outside",
                ],
            ),
            ("clustered:n=1000000", &["flythrough:visible=2%", "orbit"]),
            (
                "city:n=1000000",
                &["flythrough:visible=2%", "spin", "outside"],
            ),
            ("forest:n=1000000", &["flythrough:visible=2%", "orbit"]),
            ("rooms:n=1000000", &["flythrough:visible=0.1%", "teleport"]),
            ("freedm-map12", &["places", "teleport:frames=512"]),
            (
                "freedm-map20",
                &["places", "flythrough:frames=512", "teleport:frames=512"],
            ),
            (
                "helsinki",
                &[
                    "flythrough:frames=512,visible=2%",
                    "orbit:frames=512",
                    "zoom:frames=512",
                    "teleport:frames=512",
                ],
            ),
            (
                "us-counties",
                &[
                    "flythrough:frames=512",
                    "orbit:frames=512",
                    "outside:frames=512",
                ],
            ),
        ],
        min_rounds: 9,
        max_rounds: 31,
        budget: Duration::from_secs(3),
        pass: Duration::from_millis(400),
    },
    Suite {
        name: "full",
        summary: "as standard, from a thousand to ten million items; about an hour",
        plan: &[
            (
                "uniform:n=1000",
                &["flythrough:frames=512,visible=2%", "outside:frames=512"],
            ),
            (
                "uniform:n=10000",
                &["flythrough:frames=512,visible=2%", "outside:frames=512"],
            ),
            (
                "uniform:n=100000",
                &[
                    "flythrough:visible=0.1%",
                    "flythrough:visible=2%",
                    "orbit",
                    "outside",
                ],
            ),
            (
                "uniform:n=1000000",
                &[
                    "flythrough:visible=0.1%",
                    "flythrough:visible=2%",
                    "orbit",
                    "outside",
                ],
            ),
            (
                "uniform:n=10000000",
                &[
                    "flythrough:visible=0.1%",
                    "flythrough:visible=2%",
                    "outside:frames=32",
                ],
            ),
            (
                "clustered:n=1000000",
                &["flythrough:visible=2%", "orbit", "teleport"],
            ),
            (
                "city:n=1000000",
                &[
                    "flythrough:visible=0.1%",
                    "flythrough:visible=2%",
                    "spin",
                    "outside",
                ],
            ),
            ("city:n=10000000", &["flythrough:visible=2%"]),
            (
                "forest:n=1000000",
                &["flythrough:visible=2%", "orbit", "zoom"],
            ),
            (
                "rooms:n=1000000",
                &["flythrough:visible=0.1%", "teleport", "spin"],
            ),
            (
                "freedm-map12",
                &["places", "flythrough:frames=512", "teleport:frames=512"],
            ),
            (
                "freedm-map20",
                &["places", "flythrough:frames=512", "teleport:frames=512"],
            ),
            (
                "helsinki",
                &[
                    "flythrough:frames=512,visible=2%",
                    "orbit:frames=512",
                    "spin:frames=512",
                    "zoom:frames=512",
                    "teleport:frames=512",
                    "outside:frames=512",
                ],
            ),
            (
                "us-counties",
                &[
                    "flythrough:frames=512",
                    "orbit:frames=512",
                    "outside:frames=512",
                ],
            ),
        ],
        min_rounds: 11,
        max_rounds: 51,
        budget: Duration::from_secs(10),
        pass: Duration::from_secs(1),
    },
];

/// The way through a scene when none is named.
pub const DEFAULT_PATH: &str = "flythrough";

impl Suite {
    pub fn named(name: &str) -> Option<&'static Suite> {
        SUITES.iter().find(|s| s.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::PATHS;
    use crate::scene::{FAMILIES, SAMPLES};
    use crate::spec::Spec;

    #[test]
    fn every_suite_names_what_exists_and_has_the_real_scenes() {
        for suite in SUITES {
            for (scene, paths) in suite.plan {
                let scene = Spec::parse(scene).unwrap();
                let families = FAMILIES.iter().map(|f| f.name);
                assert!(
                    families
                        .chain(SAMPLES.iter().map(|s| s.name))
                        .any(|n| n == scene.name())
                );
                for path in *paths {
                    let path = Spec::parse(path).unwrap();
                    assert!(PATHS.iter().any(|p| p.name == path.name()));
                }
            }
            for sample in SAMPLES {
                assert!(
                    suite.plan.iter().any(|(scene, _)| *scene == sample.name),
                    "{}",
                    suite.name
                );
            }
        }
    }
}
