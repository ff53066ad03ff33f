//! Structures under the update policies of `--update`.

use anyhow::ensure;

use crate::index::{StructureSpec, UpdatePolicy};

/// The structures under each policy of a comma-separated list, `wide@every=10`.
///
/// Labels stay as they are under [`UpdatePolicy::Refit`]. A structure that does not
/// refit is built again in any case: it appears once beside fat bounds.
pub fn under_policies(list: &str, specs: &[StructureSpec]) -> anyhow::Result<Vec<StructureSpec>> {
    let mut policies: Vec<UpdatePolicy> = Vec::new();
    for text in list.split(',').map(str::trim) {
        let policy = text.parse()?;
        let is_new = !policies.contains(&policy);
        ensure!(
            is_new,
            "--update '{text}' is named twice; expected each once"
        );
        policies.push(policy);
    }
    let mut all = Vec::new();
    for spec in specs {
        let refits = spec.info().capabilities.refits;
        let mut has_rebuilt = false;
        for &policy in &policies {
            let mut own = spec.clone();
            own.policy = policy;
            match policy {
                UpdatePolicy::Fat(_) => own.label += &format!("@{policy}"),
                _ if !refits && has_rebuilt => continue,
                _ if !refits => (own.policy, has_rebuilt) = (UpdatePolicy::Refit, true),
                UpdatePolicy::Refit => (),
                _ => own.label += &format!("@{policy}"),
            }
            all.push(own);
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Registry;

    #[test]
    fn policies_make_rows_and_mistakes_are_named() {
        let specs = Registry::builtin()
            .structures("wide,octree-textbook")
            .unwrap();
        let labels = |list: &str| -> Result<Vec<String>, String> {
            let all = under_policies(list, &specs).map_err(|e| e.to_string())?;
            Ok(all.into_iter().map(|spec| spec.label).collect())
        };
        let all = "wide,wide@rebuild,wide@every=10,wide@fat=0.1,octree-textbook,\
                   octree-textbook@fat=0.1";
        let found = labels("refit,rebuild,every=10,fat=10%").unwrap();
        assert_eq!(found.join(","), all);
        assert_eq!(
            labels("rebuild").unwrap(),
            ["wide@rebuild", "octree-textbook"]
        );
        for bad in ["", "often", "every", "every=1", "fat=0", "fat=x", "refit=1"] {
            let error = labels(bad).unwrap_err();
            assert!(error.contains("expected refit, rebuild"), "{bad}: {error}");
        }
        assert!(labels("refit,refit").unwrap_err().contains("named twice"));
    }
}
