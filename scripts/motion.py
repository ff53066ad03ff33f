#!/usr/bin/env python3
"""Writes the section "What moves" of docs/MOTION.md from results/motion.

usage: scripts/motion.py [CULLBENCH]

With an optimised CULLBENCH of the feature `peers` the runs are measured first (some minutes)
and stored in results/motion.
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "results" / "motion"
PAGE = ROOT / "docs" / "MOTION.md"

SCENES = ["uniform:n=100000", "city:n=100000"]
MOTIONS = [f"{motion},frames=100" for motion in
           ["drift:share=0.1%", "drift:share=1%", "drift:share=10%", "drift:share=100%",
            "drift:share=1%,same=false", "shuffle:share=1%", "shuffle:share=10%"]]
VIEWS = [1, 16]
COLUMNS = ["scene", "motion", "views_per_frame", "structure", "status", "rank", "frame_ns",
           "update_ns", "query_ns", "worst_frame_ns", "ageing_10", "ageing_100",
           "memory_after_bytes_per_item"]
OTHERS = ["wide", "moving", "peer-obvhs"]


def measure(program):
    RESULTS.mkdir(exist_ok=True)
    found = []
    for views in VIEWS:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "run"
            command = [program, "run", "--structure", "linear," + ",".join(OTHERS), "--no-bounds",
                       "--path", "flythrough:frames=24,visible=2%", "--views", str(views),
                       "--processes", "3", "--out", str(out)]
            for scene in SCENES:
                command += ["--scene", scene]
            for motion in MOTIONS:
                command += ["--motion", motion]
            if subprocess.run(command, stdout=subprocess.DEVNULL).returncode:
                sys.exit("motion.py: `run` failed; expected exit code 0")
            with open(out / "summary.csv", newline="") as table:
                found += [{key: row[key] for key in COLUMNS} for row in csv.DictReader(table)]
            report = json.loads((out / "report.json").read_text())
    with open(RESULTS / "frames.csv", "w", newline="") as table:
        writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)
    about = {"cpu": report["machine"]["cpu"], "date": report["run"]["started_at"][:10]}
    (RESULTS / "about.json").write_text(json.dumps(about) + "\n")


def number(value):
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def ratio(text):
    return number(float(text)) if text else "–"


def fastest(cells):
    """The fastest structures with frame and worst frame in us."""
    cells = sorted((c for c in cells if c["status"] == "ok"), key=lambda c: float(c["frame_ns"]))
    first = cells[0]
    tied = [c["structure"] for c in cells if float(c["frame_ns"]) < 1.05 * float(first["frame_ns"])]
    return (f"{', '.join(tied)} {number(float(first['frame_ns']) / 1000)} "
            f"({number(float(first['worst_frame_ns']) / 1000)})")


def lines():
    with open(RESULTS / "frames.csv", newline="") as table:
        cells = list(csv.DictReader(table))
    for motion in MOTIONS:
        law, _, rest = motion.partition(":")
        share = rest.split(",")[0].removeprefix("share=").replace("%", " %")
        changing = ", others in every frame" if "same=false" in motion else ""
        for scene in SCENES:
            own = [c for c in cells if c["motion"] == motion and c["scene"] == scene]
            shown = [f"{law} {share}{changing}", scene.split(":")[0]]
            shown += [fastest([c for c in own if c["views_per_frame"] == str(n)]) for n in VIEWS]
            one = {c["structure"]: c for c in own if c["views_per_frame"] == "1"}
            aged = [ratio(one[name]["ageing_100"]) for name in OTHERS]
            yield "| " + " | ".join([*shown, ", ".join(aged)]) + " |"


def cost_of_jumps(name):
    """Least and most us that a jump adds to an update."""
    with open(RESULTS / "frames.csv", newline="") as table:
        cells = list(csv.DictReader(table))
    costs = []
    for share in [0.01, 0.1]:
        motion = f"shuffle:share={share:.0%},"
        own = [c for c in cells if c["structure"] == name and c["motion"].startswith(motion)]
        costs += [float(c["update_ns"]) / (share * 100_000) / 1000 for c in own]
    return f"{min(costs):#.2g} to {max(costs):#.2g}"


HEAD = """## What moves

Written by `scripts/motion.py` from [results/motion](../results/motion) ({cpu}, {date}):
100,000 items, views of 2 %, 100 frames. The fastest structures by frame (ties within 5 %), with the
us of the first (its worst frame). *Ageing*: query time after 100 frames / that of a fresh build:
{others}.

| moved per frame | scene | one view | sixteen views | ageing |
|---|---|---|---|---|
"""
JUMPS = """
Update per jumping item (shuffle), us: `moving` {moving}, `wide` {wide}.
"""
NOTES = "\n### What follows\n"


def main():
    if len(sys.argv) > 1:
        measure(sys.argv[1])
    about = json.loads((RESULTS / "about.json").read_text())
    before, _, section = PAGE.read_text().partition("## What moves\n")
    notes = section.partition(NOTES)[2]
    head = HEAD.format(**about, others=", ".join(OTHERS))
    jumps = JUMPS.format(moving=cost_of_jumps("moving"), wide=cost_of_jumps("wide"))
    table = "\n".join(lines()) + "\n"
    PAGE.write_text(before.rstrip() + "\n\n" + head + table + jumps + NOTES + notes)


if __name__ == "__main__":
    main()
