#!/usr/bin/env python3
"""Hashes what the program answers, group by group: check-answers.sh says how. Standard library only."""

import collections
import csv
import hashlib
import json
import os
import subprocess
import sys
import tempfile

QUERIES = [
    ("city:n=2000", "orbit:frames=4"),
    ("city:n=1500,offset=1e6", "flythrough:frames=4,visible=5%"),
    ("uniform:n=1500", "teleport:frames=6"),
    ("clustered:n=1500", "spin:frames=4"),
    ("forest:n=1500", "street:frames=4"),
    ("rooms:n=1500", "flythrough:frames=4"),
    ("mesh:spheres:n=6000", "orbit:frames=4"),
    ("freedm-map12", "places:frames=6"),
    ("freedm-map20", "flythrough:frames=4"),
    ("helsinki", "street:frames=4"),
    ("us-counties", "zoom:frames=4"),
]
CULLINGS = [[], ["--arithmetic", "f64"], ["--arithmetic", "f32-relative"], ["--planes", "gh-gl-f64"],
            ["--planes", "frame-f32", "--epsilon", "0"]]
TESTS = ["sphere", "six-plane", "six-box", "exact"]
KERNELS = ["portable", "avx2", "avx512"]
FUNNELS = [
    ["--scene", "city:n=1500", "--path", "street:frames=4", "--cut-out", "fence:share=0.2"],
    ["--scene", "rooms:n=1500", "--path", "street:frames=4"],
    ["--scene", "mesh:forest:n=4000", "--path", "street:frames=3"],
    ["--scene", "freedm-map12", "--path", "places:frames=3"],
]
# Fields of time, or of what follows from times.
TIMED = {"dominated_by", "is_tie", "on_front", "twin", "as_fast", "reason", "ratio", "seconds",
         "conclusion", "conclusions", "memory_bytes_per_item", "summary", "expected"}
TIMED_ENDS = ("_ns", "_ns_lower", "_ns_upper", "ratio_lower", "ratio_upper", "us_per_second",
              "us_per_second_lower", "us_per_second_upper", "ns_per_step", "ns_per_step_lower",
              "ns_per_step_upper", "ns_per_item", "ns_per_ray", "ns_per_decided", "ns_per_removed")
program = ""


def output(*arguments, codes=(0,)):
    done = subprocess.run([program, *arguments], capture_output=True, text=True)
    if done.returncode not in codes:
        sys.exit(f"answers: {' '.join(arguments)}: exit code {done.returncode}: {done.stderr.strip()[-300:]}")
    return done.stdout


def untimed(value):
    if isinstance(value, dict):
        # A field without a value is no answer.
        return {name: untimed(inner) for name, inner in value.items()
                if inner is not None and name not in TIMED and not name.endswith(TIMED_ENDS)}
    return [untimed(inner) for inner in value] if isinstance(value, list) else value


def lines_by(text, *columns):
    groups = collections.defaultdict(list)
    for row in csv.DictReader(text.splitlines()):
        key = " ".join(row.pop(name) for name in columns)
        groups[key].append(json.dumps(row, sort_keys=True))
    return groups


def rows_by(rows, *names):
    groups = collections.defaultdict(list)
    for row in rows:
        key = " ".join(str(row.get(name)) for name in names)
        groups[key].append(json.dumps(untimed(row), sort_keys=True))
    return groups


def answers():
    """Pairs of a group's name and its rows."""
    # What a machine lacks is refused with 2.
    kernels = [name for name in KERNELS if subprocess.run(
        [program, "query", "--scene", "city:n=10", "--cameras", "orbit:frames=1", "--kernel", name],
        capture_output=True).returncode != 2]
    for scene, path in QUERIES:
        for culling in CULLINGS:
            # Bounding spheres are tested in f32 alone.
            for test in TESTS if "--arithmetic" not in culling else TESTS[1:]:
                for kernel in kernels:
                    text = output("query", "--scene", scene, "--cameras", path, "--test", test, "--ids",
                                  "--kernel", kernel, *culling)
                    for name, rows in lines_by(text, "structure").items():
                        # One pin for all instruction sets: they answer and count alike.
                        yield " ".join(["query", scene, path, test, *culling, name]), rows
    with tempfile.TemporaryDirectory() as folder:
        points, boxes = os.path.join(folder, "points.csv"), os.path.join(folder, "boxes.csv")
        with open(points, "w") as file:
            file.write("x,y,z\n" + "".join(
                f"{i * 37 % 101 * 40 - 2000},{i * 53 % 97 * 40 - 2000},{i * 11 % 7 * 8}\n" for i in range(300)))
        with open(boxes, "w") as file:
            file.write("min_x,min_y,min_z,max_x,max_y,max_z\n" + "".join(
                f"{x},{y},{z},{x + i % 50},{y + i % 40},{z + i % 9}\n" for i in range(200)
                for x, y, z in [(i * 37 % 101 * 20 - 1000, i * 53 % 97 * 20 - 1000, i * 11 % 7 * 8)]))
        for scene in ("rooms:n=1500", "freedm-map12", "freedm-map20", "city:n=2000"):
            for kernel in kernels:
                for option, file in (("--points", points), ("--boxes", boxes)):
                    text = output("locate", "--scene", scene, option, file, "--kernel", kernel)
                    for name, rows in lines_by(text, "structure").items():
                        yield f"locate {scene} {option} {name}", rows
    stress = json.loads(output("stress", "--cases", "2", "--format", "json"))
    for row in stress:
        row["id"] = row["id"].split("/")[0]
    for name, rows in rows_by(stress, "id").items():
        yield f"stress {name}", rows
    for arguments in FUNNELS:
        text = output("funnel", *arguments, "--frames", "32", "--samples", "64x36", "--processes", "1", "--format", "json")
        found = json.loads(text)
        for section, names in (("stages", ("stage", "name", "structure")),
                               ("picks", ("question", "name")), ("gains", ("stage", "back_end"))):
            for name, rows in rows_by(found.pop(section), *names).items():
                yield f"funnel {' '.join(arguments)} {section} {name}", rows
        for section in ("level", "inner_boxes", "ground", "chain"):
            yield f"funnel {' '.join(arguments)} {section}", [json.dumps(untimed(found[section]), sort_keys=True)]
    for scene in ("city:n=300", "freedm-map12"):
        found = json.loads(output("precision", "--scene", scene, "--cubes", "4000", "--processes", "1",
                                  "--format", "json"))
        point = ("test", "arithmetic", "planes", "epsilon")
        for section, names in (("points", ("structure", *point)), ("sweeps", ("sweep", *point))):
            for name, rows in rows_by(found[section], *names).items():
                yield f"precision {scene} {section} {name}", rows
    found = json.loads(output("drift", "--steps", "1e3", "--processes", "1", "--format", "json"))
    for section in ("rotation", "arm_methods"):
        for name, rows in rows_by(found[section], "name").items():
            yield f"drift {section} {name}", rows
    for row in found["arm_points"]:
        key = " ".join(str(row[name]) for name in ("arm", "method", "stiffness", "substeps"))
        yield f"drift arm {key}", [str(row["position_error"])]
    for suite in ("quick", "standard", "full", "compare"):
        cells = output("run", "--suite", suite, "--structure", "linear,bvh", "--plan").splitlines()
        yield f"plan {suite}", cells


def main():
    global program
    arguments = [argument for argument in sys.argv[1:] if argument != "--record"]
    program, pins = os.path.abspath(arguments[0]), arguments[1]
    hashes, differing = {}, []
    for name, rows in answers():
        digest = hashlib.sha256("\n".join(rows).encode()).hexdigest()[:16]
        if hashes.setdefault(name, digest) != digest:
            differing.append(name)
    if differing:
        sys.exit("answers: instruction sets, or rows of one name, differ:\n  " + "\n  ".join(differing))
    if "--record" in sys.argv:
        with open(pins, "w") as file:
            file.writelines(f"{digest}  {name}\n" for name, digest in sorted(hashes.items()))
        print(f"answers: recorded {len(hashes)} pins")
        return
    with open(pins) as file:
        pinned = {name: digest for digest, name in (line.rstrip("\n").split("  ", 1) for line in file)}
    faults = [f"changed: {name}" for name in pinned if name in hashes and hashes[name] != pinned[name]]
    faults += [f"left: {name}" for name in pinned if name not in hashes]
    faults += [f"new: {name}" for name in hashes if name not in pinned]
    for fault in faults:
        print(fault)
    print(f"answers: {len(pinned)} pins, {len(faults)} differ")
    sys.exit(1 if faults else 0)


main()
