#!/usr/bin/env python3
"""Reproduces published figures with cullbench and writes docs/EXTERNAL.md.

usage: scripts/external.py CULLBENCH [--only WORD]

CULLBENCH is an optimised program. Takes about five minutes and 4 GB; rows on Sponza need
`scripts/fetch.py sponza`. --only prints the rows whose function below contains WORD and writes nothing.
"""

import csv
import io
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "EXTERNAL.md"
SPONZA = "datasets/fetched/sponza.obj"
FOLDER = Path(tempfile.mkdtemp())
ROWS = []
LENS = "eye_x,eye_y,eye_z,look_x,look_y,look_z,up_x,up_y,up_z,fovy_deg,aspect,near,far\n"


def row(function):
    ROWS.append(function)
    return function


def cullbench(*arguments):
    done = subprocess.run([sys.argv[1], *arguments], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"external.py: `{' '.join(arguments)}`: {done.stderr.strip()}")
    return done.stdout


def run(scene, path, structures, *more):
    """Metrics of each structure: {name: {metric: value}}."""
    out = FOLDER / f"run{len(list(FOLDER.iterdir()))}"
    cullbench("run", "--scene", scene, "--path", path, "--structure", structures, "--no-bounds",
              "--processes", "5", "--out", str(out), *more)
    cells = json.loads((out / "report.json").read_text())["cells"]
    bad = [c for c in cells if c["status"] != "ok"]
    if bad:
        sys.exit(f"external.py: {scene}: {bad[0]['structure']} is {bad[0]['status']}")
    return {c["structure"]: {k: m["value"] for k, m in c["metrics"].items()} for c in cells}


def cameras(name, rows):
    path = FOLDER / name
    path.write_text(LENS + "".join(",".join(map(str, r)) + "\n" for r in rows))
    return str(path)


def times(value):
    return f"{value:,.0f} x" if value >= 100 else f"{value:.3g} x"


GRID = {}


def grid():
    """The grid of sseculling, in rows and shuffled, seen from its middle."""
    if not GRID:
        path = cameras("sse.csv", [(0, 0, 0, 0, 0, -1, 0, 1, 0, 75, 1.333, 0.5, 100)])
        for shuffled in [0, 1]:
            scene = f"grid3:n=512000,shuffled={shuffled}"
            GRID[shuffled] = run(scene, path, "linear-scalar,linear")
    return GRID


@row
def shuffled_scalar():
    ours = grid()[1]["linear-scalar"]["query_ns"] / grid()[0]["linear-scalar"]["query_ns"]
    return ("sseculling: 512,000 spheres shuffled / in rows, scalar test", "2.4 to 4.1 x", times(ours),
            ours / 4.05, "Ours tests boxes.")


@row
def shuffled_simd():
    ours = grid()[1]["linear"]["query_ns"] / grid()[0]["linear"]["query_ns"]
    return ("the same, SIMD test", "1.0 x", times(ours), ours,
            "Theirs writes a bit per sphere, ours ids: in rows most blocks of sixteen have none, "
            "shuffled 92 % have some.")


@row
def simd_time():
    ours = grid()[1]["linear"]["query_ns"] / 1e6
    return ("the same, SIMD time of a shuffled scan", "1.21 to 2.35 ms", f"{ours:.2f} ms", ours / 1.21,
            "Four planes of one sphere at once (SSE) against sixteen boxes of one plane (AVX-512).")


TREES = {}


def trees():
    if not TREES:
        path = "flythrough:frames=64,fovy=59,visible=20000"
        structures = "linear-scalar,linear,quadtree-textbook,quadtree,uniform-grid,wide"
        TREES.update(run("forest:n=4M", path, structures))
    return TREES


@row
def trees_scalar():
    ours = trees()["linear-scalar"]["query_ns"] / 4e6
    return ("4 million trees, 20,000 visible: scan, per tree", "12.5 ns", f"{ours:.2f} ns", ours / 12.5,
            "A processor of 2013; theirs tells inside from partial.")


def tree_row(name, structure, theirs):
    def made():
        ours = trees()["linear-scalar"]["query_ns"] / trees()[structure]["query_ns"]
        return (f"4 million trees: scan / {name} (`{structure}`)", f"{theirs} x", times(ours),
                ours / theirs, WHY_TREES[structure])
    return made


WHY_TREES = {
    "quadtree-textbook": "Child pointers and one box at a time, as theirs; 3-D boxes on terrain.",
    "quadtree": "Ours copies a node inside the view as one range of ids and tests items by sixteen.",
    "uniform-grid": "Theirs is a 2-D grid with the best cell size by hand; ours is 3-D and chooses it.",
}
ROWS.append(tree_row("quadtree", "quadtree-textbook", 71))
ROWS.append(tree_row("quadtree", "quadtree", 71))
ROWS.append(tree_row("grid", "uniform-grid", 63))


@row
def trees_tests():
    cell = trees()["quadtree-textbook"]
    ours = cell["nodes_tested"] + cell["items_tested"]
    return ("4 million trees: tests per query of the quadtree", "8,000", f"{ours:,.0f}", ours / 8000,
            "Of nodes and items: theirs ends at leaves that are wholly inside, ours tests the items at "
            "the border one by one.")


@row
def one_box():
    cells = run("uniform:n=1000", "outside:frames=64", "linear-scalar")
    ours = cells["linear-scalar"]["query_ns"] / 1000
    return ("Bevy: one box against a frustum that it is in (identity)", "6.82 ns", f"{ours:.2f} ns",
            ours / 6.82, "Theirs repeats one box; ours loops over 1,000 boxes and writes ids.")


@row
def one_sphere():
    cells = run("uniform:n=1000", "outside:frames=64", "linear-scalar", "--test", "sphere")
    ours = cells["linear-scalar"]["query_ns"] / 1000
    return ("the same, one sphere", "6.60 ns", f"{ours:.2f} ns", ours / 6.60,
            "Ours tests the corner of the sphere's cube as well, so that trees over cubes return the "
            "same set, and adds a margin for rounding.")


def overlaps(side, what, why):
    def made():
        boxes, counts = FOLDER / "bepu.csv", []
        for seed in range(1, 9):
            spec = f"bepu:n=65536,seed={seed}{side}"
            boxes.write_text(cullbench("scene", "generate", spec))
            found = cullbench("locate", "--scene", str(boxes), "--boxes", str(boxes),
                              "--structure", "wide", "--format", "csv")
            found = sum(int(r["region_count"]) for r in csv.DictReader(io.StringIO(found)))
            counts.append((found - 65536) / 2)
        ours = statistics.mean(counts)
        return (what, "65,600 to 66,300",
                f"{ours:,.0f} ± {statistics.stdev(counts):,.0f} (8 seeds)", ours / 65950, why)
    return made


ROWS.append(overlaps("", "bepuphysics: overlapping pairs of 65,536 leaves",
                     "A box is no pair with itself; contacts are too rare to matter. The article does "
                     "not state the cube: centres in one of 629.96, the side in its test program."))
ROWS.append(overlaps(",side=624", "the same, centres in a cube of 624 (`bepu:n=65536,side=624`)",
                     "The side that gives theirs. Boxes wholly inside the cube of 629.96 give 70,100."))


@row
def bepu_frames():
    cells = run("bepu:n=65536", "orbit:frames=200,visible=2%", "wide,moving", "--motion",
                "bepu:frames=200")
    worst, mean = (cells["wide"][f"{kind}frame_ns"] / 1e6 for kind in ["worst_", ""])
    other = cells["moving"]
    return ("the same in the cube of 629.96, all moving: worst frame", "108 ms (the tree before)",
            f"{worst:.2g} ms, mean {mean:.2g} ms (`moving` {other['worst_frame_ns'] / 1e6:.2g}, mean "
            f"{other['frame_ns'] / 1e6:.2g})", worst / 108, "Theirs rebuilds parts without a limit and "
            "tests all pairs, on 8 threads; ours refits `wide` and answers one view, on one.")


@row
def many_cubes():
    half = math.radians(22.5)
    wide = math.atan(16 / 9 * math.tan(half))
    share = 4 * math.asin(math.sin(half) * math.sin(wide)) / (4 * math.pi)
    turns = [(math.cos(a) * math.cos(b), math.sin(a) * math.cos(b), math.sin(b))
             for a, b in ((i * 2.399963, math.asin(1 - (2 * i + 1) / 256)) for i in range(256))]
    rows = [(0, 0, 0, x, y, z, -y, x, 0, 45, 16 / 9, 0.1, 1000) for x, y, z in turns]
    found = cullbench("query", "--scene", "shell:n=160000", "--cameras", cameras("shell.csv", rows),
                      "--structure", "wide")
    counts = [int(r["visible_count"]) for r in csv.DictReader(io.StringIO(found))]
    mean, low, high = sum(counts) / len(counts), min(counts), max(counts)
    theirs = share * 160_000
    return ("Bevy's many_cubes: visible of 160,000 from the centre, any direction",
            f"\"roughly the same\"; {theirs:,.0f} by solid angle", f"{mean:,.0f} ({low:,} to {high:,})",
            mean / theirs, "Cubes that straddle the border count as well.")


def sponza():
    if not (ROOT / SPONZA).exists():
        return None
    if "sponza" not in GRID:
        text = cullbench("funnel", "--scene", SPONZA, "--up", "y", "--path",
                         "flythrough:frames=16", "--frames", "16", "--samples", "64x36",
                         "--processes", "2", "--all", "--format", "json")
        GRID["sponza"] = json.loads(text)
    return GRID["sponza"]


def picked(name):
    return next(p["ns_per_ray"] for p in sponza()["picks"]
                if p["name"] == name and p["question"] == "first item")


@row
def ray_time():
    if not sponza():
        return None
    ours = picked("wide-ray")
    return ("crate bvh: time of a ray in the tree of Sponza's 66,450 triangles", "845 ns",
            f"{ours:.0f} ns", ours / 845,
            "Theirs tests all candidates along a random ray, ours the first hit, exact, of rays of one "
            "image.")


@row
def tree_build():
    if not sponza():
        return None
    cells = run(SPONZA, "orbit:frames=16", "bvh,wide", "--items", "triangles")
    ours, wide = cells["bvh"]["build_ms"], cells["wide"]["build_ms"]
    return ("the same, build of the tree on one thread", "11.5 ms", f"{ours:.1f} ms (wide {wide:.1f} ms)",
            ours / 11.53, "Theirs bins by surface area, on a processor of 2025; ours clusters by Morton "
            "order (PLOC) and packs leaves; `wide` sorts and cuts.")


@row
def cones():
    if not sponza():
        return None
    stage = [s for s in sponza()["stages"] if s["stage"] == "triangle"]
    found = next(s for s in stage if s["name"] == "cone-f32-safe")
    ours = 100 * (1 - found["output_count"] / found["input_count"])
    return ("zeux: back faces of Sponza rejected by one cone per cluster (`cone-f32-safe`)", "7.7 %",
            f"{ours:.1f} %", ours / 7.7, "Another export and other clusters; ours "
            "rejects only what is proven to face away.")


HEAD = """# Published figures, reproduced

Written by `scripts/external.py` on a shared {machine}. Times are CPU time per query on one
thread, if not said otherwise. Where theirs is a range, the
ratio is to the figure of the newest processor if processors are named, otherwise to the middle.

| figure | theirs | ours | ours / theirs | why it differs |
|---|---|---|---|---|
"""
TAIL = """
Sources: [sseculling](https://github.com/nsf/sseculling), README, three processors of 2012 to 2020;
[4 million trees](https://dtosoftware.wordpress.com/2013/01/18/fast-frustum-culling/), 2013; Bevy,
`benches/bevy_camera/primitives.rs` and `examples/stress_tests/many_cubes.rs`; [bepuphysics
"Blazing Fast Trees"](https://www.bepuentertainment.com/blog/tag/bepuphysics+v2.0.0); crate bvh
0.13, README; [fine-grained backface culling](https://zeux.io/2023/04/28/triangle-backface-culling/).
"""


def main():
    only = sys.argv[sys.argv.index("--only") + 1] if "--only" in sys.argv else None
    machine = json.loads(cullbench("env", "--format", "json"))["machine"]
    lines = []
    for made in ROWS:
        found = None if only and only not in made.__qualname__ else made()
        if found:
            what, theirs, ours, ratio, why = found
            load = os.getloadavg()[0]
            if load > os.cpu_count() and (" ns" in ours or " ms" in ours):
                why += f" Measured at a load average of {load:.0f}."
            lines.append(f"| {what} | {theirs} | {ours} | {ratio:.2f} | {why} |")
            print(lines[-1], flush=True)
    if not only:
        PAGE.write_text(HEAD.format(machine=machine["cpu"]) + "\n".join(lines) + "\n" + TAIL)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main()
