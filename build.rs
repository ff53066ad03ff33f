//! Tells the program what it was built from and with, so that every report
//! can say so: compiler, flags, profile, features, commit. Everything is
//! optional; a build without git or from a package still works.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

fn main() {
    let rustc = env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let features: Vec<String> = env::vars()
        .filter_map(|(key, _)| key.strip_prefix("CARGO_FEATURE_").map(str::to_lowercase))
        .filter(|feature| feature != "default")
        .collect();
    let flags = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    // A packed crate may lie in another repository: then that one's commit is not ours.
    let git = |args: &[&str]| Path::new(".git").exists().then(|| output("git", args))?;
    let commit = packed_commit().or_else(|| git(&["rev-parse", "HEAD"]));
    let changes = git(&[
        // A refreshed index would make the next build compile all anew.
        "--no-optional-locks",
        "status",
        "--porcelain",
        "--",
        "src",
        "Cargo.toml",
        "Cargo.lock",
    ]);
    let facts = [
        ("RUSTC", output(&rustc, &["--version"])),
        ("RUSTFLAGS", Some(flags.replace('\u{1f}', " "))),
        ("PROFILE", env::var("PROFILE").ok()),
        ("OPT_LEVEL", env::var("OPT_LEVEL").ok()),
        ("TARGET", env::var("TARGET").ok()),
        ("FEATURES", Some(features.join(","))),
        (
            "DIRTY",
            commit
                .as_ref()
                .and(changes)
                .map(|c| (!c.is_empty()).to_string()),
        ),
        ("COMMIT", commit),
    ];
    for (name, value) in facts {
        println!(
            "cargo::rustc-env=CULLBENCH_{name}={}",
            value.unwrap_or_default()
        );
    }
    // Plain arrays for vectors, as other architectures have them: no dependency is
    // compiled anew for it, as it would be for a flag of the compiler.
    println!("cargo::rerun-if-env-changed=CULLBENCH_PLAIN_VECTORS");
    if env::var_os("CULLBENCH_PLAIN_VECTORS").is_some() {
        println!("cargo::rustc-cfg=plain_vectors");
    }
    // What a commit or an edit touches; missing paths are skipped,
    // because cargo would otherwise rerun this script every time.
    for path in [
        ".git/HEAD",
        ".git/refs/heads",
        "src",
        "Cargo.toml",
        "Cargo.lock",
    ] {
        if Path::new(path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
}

/// The commit that a crate was packed from, by the file that cargo puts into it.
fn packed_commit() -> Option<String> {
    let info = fs::read_to_string(".cargo_vcs_info.json").ok()?;
    let (_, from) = info.split_once("\"sha1\": \"")?;
    Some(from.split('"').next()?.to_owned())
}

fn output(program: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output
        .status
        .success()
        .then(|| text.trim().replace('\n', "; "))
}
