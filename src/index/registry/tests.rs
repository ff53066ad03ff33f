//! Tests of the registry, with structures as authors of other crates write them.

use super::*;
use crate::geometry::Aabb;
use glam::Vec3;

#[test]
fn structures_are_found_with_their_parameters() {
    let registry = Registry::builtin();
    let all = registry.structures("all").unwrap();
    assert_eq!(all.len(), registry.rows().len());
    let named = registry.structures("default,octree-textbook").unwrap();
    assert_eq!(named.iter().filter(|s| s.info().on_request).count(), 1);
    assert_eq!(named.len(), all.len() - 5);
    let two = registry
        .structures("bvh:leaf=4,preset=medium,linear")
        .unwrap();
    assert_eq!(two[0].params["leaf"], 4);
    assert_eq!(two[0].params["preset"], "medium");
    assert_eq!(two[1].label, "linear");
}

#[test]
fn mistakes_are_named() {
    for (text, wanted) in [
        ("bhv", "did you mean 'bvh'"),
        ("bvh:leav=4", "a field 'leav'; expected 'preset' or 'leaf'"),
        (
            "bvh:leaf=many",
            "leaf=\"many\"; expected a whole number from 0 to 4294967295",
        ),
        ("bvh:leaf=0", "leaf=0; expected 1 to 255"),
        ("bvh:preset=best", "preset=\"best\"; expected one of 'fast"),
        ("bvh,bvh", "named twice"),
        ("", "no structure"),
        ("linear-scalar:leaf=3", "a field 'leaf'; expected none"),
    ] {
        let error = Registry::builtin()
            .structures(text)
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default();
        assert!(error.contains(wanted), "{text}: {error}");
    }
}

#[test]
fn items_that_cannot_be_indexed_are_named() {
    let sound = Aabb::around(Vec3::ZERO, Vec3::ONE);
    let nan = Aabb::new(Vec3::splat(f32::NAN), Vec3::ONE);
    for spec in Registry::builtin().structures("all").unwrap() {
        let error = spec.build(&[sound, nan]).err();
        assert!(matches!(
            error,
            Some(BuildError::NonFiniteItem { item: 1, .. })
        ));
    }
}

/// Structures of other crates as their authors naturally write them.
mod foreign {
    use super::*;
    use crate::index::{Kind, MemoryUsage, Origin};
    use crate::query::{Context, QueryVolume};
    use serde::{Deserialize, Serialize};
    use std::ops::ControlFlow;

    /// Without `#[serde(default)]`.
    #[derive(Serialize, Deserialize)]
    pub struct Derived {
        level: u32,
        scale: f32,
    }

    #[derive(Serialize, Deserialize, Default)]
    #[serde(default)]
    pub struct Aliased {
        #[serde(alias = "size")]
        leaf: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        most: Option<u32>,
        least: Option<u32>,
    }

    impl Default for Derived {
        fn default() -> Derived {
            let (level, scale) = (3, 0.1);
            Derived { level, scale }
        }
    }

    macro_rules! structure {
        ($type:ident, $params:ty, $check:expr) => {
            pub struct $type;
            impl RegionIndex for $type {
                const INFO: Info =
                    Info::new(stringify!($type), "", Kind::Scan, Origin::Crate("foreign")).refits();
                type Params = $params;
                fn build(input: &Input<'_>, params: &$params) -> Result<Self, BuildError> {
                    let check: fn(&Input<'_>, &$params) -> Result<Self, BuildError> = $check;
                    check(input, params)
                }
                fn memory(&self) -> MemoryUsage {
                    MemoryUsage::default()
                }
                fn query<Q: QueryVolume, C: Context>(&self, _: &Q, _: &mut C) -> ControlFlow<()> {
                    ControlFlow::Continue(())
                }
                fn refit(&mut self, items: &[Aabb], _: &[ItemId]) -> bool {
                    assert!(items.len() < 3, "the refit fell over");
                    true
                }
            }
        };
    }
    structure!(Plain, Derived, |_, params| match params.level {
        0..=9 => Ok(Plain),
        _ => Err(BuildError::Params {
            structure: "Plain",
            reason: "level out of range".to_owned()
        }),
    });
    structure!(Alias, Aliased, |_, _| Ok(Alias));
    structure!(Number, u32, |_, _| Ok(Number));
    structure!(Unit, (), |_, _| Ok(Unit));
    structure!(NeedsItems, Derived, |input, _| {
        let _ = input.items[0];
        Ok(NeedsItems)
    });
    structure!(RefusesNone, Derived, |_, _| Err(BuildError::Refused {
        structure: "RefusesNone",
        reason: "no items".to_owned()
    }));
}

#[test]
fn parameters_need_no_serde_default_and_may_have_no_names() {
    use foreign::{Alias, Number, Plain, Unit};
    let aliased = Registry::empty().with::<Alias>();
    let aliased = aliased.structure("Alias:size=7,most=8,least=6");
    let params = aliased.unwrap().params;
    assert_eq!(params, json!({ "leaf": 7, "most": 8, "least": 6 }));
    let registry = Registry::empty()
        .with::<Plain>()
        .with::<Number>()
        .with::<Unit>();
    let has_more = registry.clone().with::<Alias>();
    let specs = registry
        .structures("all,Plain:level=5,Plain:scale=2")
        .unwrap();
    let params = specs.iter().map(|spec| spec.params.to_string());
    let tenth = f64::from(0.1f32);
    let plain = |level, scale| format!("{{\"level\":{level},\"scale\":{scale:?}}}");
    assert_eq!(
        params.collect::<Vec<_>>(),
        [
            plain(3, tenth),
            "0".to_owned(),
            "null".to_owned(),
            plain(5, tenth),
            plain(3, 2.0)
        ]
    );
    assert!(specs.iter().all(|spec| spec.build(&[]).is_ok()));
    for (text, wanted) in [
        // Without `deny_unknown_fields` serde ignores it.
        (
            "Plain:depth=5",
            "'Plain': a field 'depth'; expected level, scale",
        ),
        ("Alias:leaf=5,leav=5", "'Alias': a field 'leav'; expected"),
        ("Plain:level=10", "level out of range"),
        ("Plain:level=-1", "level=-1; expected a whole number"),
        ("Number:level=1", "an object; expected a whole number"),
        ("Unit:level=1", "an object; expected "),
    ] {
        let error = has_more.structure(text).unwrap_err().to_string();
        assert!(error.contains(wanted), "{text}: {error}");
    }
}

#[test]
fn a_structure_that_fails_on_no_items_is_found_all_the_same() {
    use foreign::{NeedsItems, RefusesNone};
    let registry = Registry::empty().with::<NeedsItems>().with::<RefusesNone>();
    for list in ["all", "NeedsItems:level=3,RefusesNone:level=3"] {
        let specs = registry.structures(list).unwrap();
        let failed = |n: usize| specs[n].build(&[]).err();
        assert!(matches!(failed(0), Some(BuildError::Panicked { .. })));
        assert!(matches!(failed(1), Some(BuildError::Refused { .. })));
    }
}

#[test]
fn updates_of_unknown_items_and_refits_that_panic_are_errors() {
    let items = [Aabb::around(Vec3::ZERO, Vec3::ONE); 3];
    for spec in Registry::builtin().structures("all").unwrap() {
        let mut index = spec.build(&items).unwrap();
        let error = spec
            .update(&mut index, Input::new(&items), &[1, 3])
            .unwrap_err();
        let error = error.to_string();
        assert!(
            error.ends_with("moved item 3 of 3; expected less"),
            "{error}"
        );
    }
    let spec = Registry::empty()
        .with::<foreign::Plain>()
        .structure("Plain")
        .unwrap();
    let mut index = spec.build(&items).unwrap();
    let error = spec.update(&mut index, Input::new(&items), &[0]);
    assert_eq!(
        error.unwrap_err().to_string(),
        "panicked: the refit fell over"
    );
}

#[test]
fn a_registry_has_what_was_added_and_nothing_else() {
    let registry = Registry::empty().with::<Wide>();
    assert_eq!(registry.structures("all").unwrap().len(), 1);
    let error = registry.structure("bvh").unwrap_err().to_string();
    assert!(error.contains("(known: wide)"), "{error}");
}

#[test]
#[should_panic(expected = "structure 'wide' is in the registry already")]
fn a_name_comes_once() {
    let _ = Registry::builtin().with::<Wide>();
}

#[test]
fn names_that_cannot_be_typed_are_refused() {
    for name in [
        "", "all", "default", "motion", "a:b", "a,b", "a b", "a=b", "-a",
    ] {
        let row = Row {
            info: Wide::INFO.named(name),
            ..Row::of::<Wide>()
        };
        let refused = caught(|| Registry::empty().with_row(row)).unwrap_err();
        assert!(refused.contains("cannot be typed"), "{name}: {refused}");
    }
}

/// The hint names exactly the structures of the feature.
#[test]
fn the_names_of_the_peers_are_those_of_their_rows() {
    let own = 14;
    let peers: Vec<_> = Registry::builtin().rows()[own..]
        .iter()
        .map(|row| row.info.name)
        .collect();
    assert_eq!(
        peers,
        if cfg!(feature = "peers") {
            &PEERS[..]
        } else {
            &[]
        }
    );
}
