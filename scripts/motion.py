#!/usr/bin/env python3
"""Writes the section "What moves" of docs/MOTION.md from results/motion.

usage: scripts/motion.py [CULLBENCH [STEP ..]]

With an optimised CULLBENCH of the feature `peers` the steps (all of them, or those named) are
measured first and stored in results/motion: about 20 minutes on one core.
"""

import csv
import gzip
import io
import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "results" / "motion"
CELLS = RESULTS / "summary.csv.gz"
PAGE = ROOT / "docs" / "MOTION.md"

SCENES = ["uniform:n=100000", "city:n=100000", "helsinki"]
MILLION = ["uniform:n=1000000"]
STEPS_OF = [f"drift:share={share}" for share in ["0.1%", "1%", "1%,same=false", "10%", "100%"]]
JUMPS = ["shuffle:share=1%", "shuffle:share=1%,same=false", "shuffle:share=10%"]
OURS = ["linear", "wide", "moving", "auto"]
PEERS = ["peer-obvhs", "peer-parry3d"]
OF_HELSINKI = ["frames", "views", "spawn"]
ALL = [*PEERS, "peer-bvh", "peer-rstar", "peer-bevy-style"]
# Scenes, motions, frames, views per frame, structures, policies.
STEPS = {
    "frames": (SCENES, STEPS_OF + JUMPS, 100, 1, OURS + PEERS, "refit"),
    "views": (SCENES, STEPS_OF[1:2] + STEPS_OF[3:] + JUMPS, 100, 16, OURS + PEERS[:1], "refit"),
    "million": (MILLION, STEPS_OF[1:4] + JUMPS[:1], 30, 1, OURS + PEERS, "refit"),
    "updates": (SCENES + MILLION, [STEPS_OF[1], *STEPS_OF[3:], JUMPS[2]], 40, 1, ["wide"],
                "refit,every=20,rebuild"),
    "peers": (["uniform:n=100000", "helsinki"], [STEPS_OF[1], JUMPS[0]], 100, 1, ["wide", *ALL],
              "refit"),
    "spawn": (SCENES, ["spawn:share=1%"], 100, 1, OURS + ALL, "refit"),
    "thousand": (["uniform:n=20000", "city:n=20000", "helsinki"],
                 [STEPS_OF[1], STEPS_OF[3], *JUMPS], 1000, 1, OURS[1:], "refit"),
}


def measured(program, step):
    """The rows of summary.csv of a step, and what is known of the machine."""
    scenes, motions, frames, views, structures, policies = STEPS[step]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        command = [program, "run", "--structure", ",".join(structures), "--no-bounds",
                   "--path", "flythrough:frames=24,visible=2%", "--views", str(views),
                   "--update", policies, "--processes", "3", "--out", str(out)]
        for scene in scenes:
            command += ["--scene", scene]
        for motion in motions:
            command += ["--motion", f"{motion},frames={frames}"]
        if subprocess.run(command, stdout=subprocess.DEVNULL).returncode:
            sys.exit(f"motion.py: `run` of step {step} failed; expected exit code 0")
        with open(out / "summary.csv", newline="") as table:
            rows = [{"step": step, **row} for row in csv.DictReader(table)]
        report = json.loads((out / "report.json").read_text())
    return rows, {"cpu": report["machine"]["cpu"], "date": report["run"]["started_at"][:10]}


def cells():
    with gzip.open(CELLS, "rt", newline="") as table:
        return list(csv.DictReader(table))


def measure(program, steps):
    RESULTS.mkdir(exist_ok=True)
    found = [row for row in (cells() if CELLS.exists() else []) if row["step"] not in steps]
    for step in steps:
        rows, about = measured(program, step)
        found += rows
        # After each step, so that one that fails does not cost the others.
        found.sort(key=lambda row: list(STEPS).index(row["step"]))
        columns = list(dict.fromkeys(key for row in found for key in row if row[key]))
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, lineterminator="\n", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(found)
        CELLS.write_bytes(gzip.compress(text.getvalue().encode(), mtime=0))
        (RESULTS / "about.json").write_text(json.dumps(about) + "\n")


def number(value):
    """Two significant digits, without an exponent."""
    return f"{value:,.0f}" if value >= 99.5 else f"{value:.2g}"


def us(cell, metric="frame_ns"):
    return number(float(cell[metric]) / 1000) if cell and cell[metric] else "–"


def ratio(cell, metric):
    return number(float(cell[metric])) if cell and cell.get(metric) else "–"


def worst(cell):
    """The slowest frame / the mean."""
    slowest = cell["worst_frame_ns"]
    return number(float(slowest) / time_of(cell)) if slowest else "–"


def named(motion):
    """"drift:share=1%,same=false,frames=100" as "drift 1 %, others"."""
    law, _, rest = motion.partition(":")
    share = rest.split(",")[0].removeprefix("share=").replace("%", " %")
    return f"{law} {share}" + (", others" if "same=false" in motion else "")


def short(scene):
    name, _, count = scene.partition(":n=")
    short = {"1000000": " 1M", "100000": " 100k", "20000": " 20k"}
    return name + short.get(count, "")


def is_shown(step, scene):
    """Leaves out rows that show what those of `uniform` show."""
    return not scene.startswith("city") and (scene != "helsinki" or step in OF_HELSINKI)


def groups(step):
    """Motion, scene and the cells by structure, in the order of the step."""
    scenes, motions, frames = STEPS[step][:3]
    own = [cell for cell in cells() if cell["step"] == step]
    for motion in motions:
        for scene in [scene for scene in scenes if is_shown(step, scene)]:
            here = {c["structure"]: c for c in own if c["status"] == "ok"
                    and c["motion"] == f"{motion},frames={frames}" and c["scene"] == scene}
            if here:
                yield named(motion), short(scene), here


def time_of(cell):
    return float(cell["frame_ns"])


def best(here, names):
    """The fastest of some structures."""
    return min((here[name] for name in names if name in here), key=time_of, default=None)


def row(*columns):
    return "| " + " | ".join(columns) + " |"


def frames(step):
    """Frame in us of each structure, the fastest bold, and of the fastest peer."""
    for motion, scene, here in groups(step):
        least = time_of(best(here, OURS))
        shown = [us(here.get(name)) for name in OURS]
        shown = [f"**{text}**" if name in here and time_of(here[name]) < 1.05 * least else text
                 for name, text in zip(OURS, shown)]
        peer = best(here, ALL)
        name = peer["structure"].removeprefix("peer-")
        # Queries age as with one view, so the table of views leaves that out.
        last = {"million": worst, "views": None}.get(step, lambda c: ratio(c, "ageing_100"))
        shown += [f"{name} {us(peer)}"]
        yield row(motion, scene, *shown, *[last(here[n]) for n in ["wide", "moving"] if last])


def updates():
    """Frame and worst frame by policy (a rebuild in each takes about the same), and from how many views on a rebuild pays."""
    for motion, scene, here in groups("updates"):
        names = ["wide", "wide@every=20"]
        shown = [f"{us(here[name])} ({us(here[name], 'worst_frame_ns')})" for name in names]
        shown += [us(here["wide@rebuild"])]
        refit, rebuild = here["wide"], here["wide@rebuild"]
        update = [float(c["update_ns"]) for c in (rebuild, refit)]
        query = [float(c["query_ns"]) for c in (refit, rebuild)]
        gain = query[0] - query[1]
        # Of mean times, over a motion of 40 frames.
        views = number((update[0] - update[1]) / gain) if gain > 0.1 * query[1] else "–"
        yield row(motion, scene, *shown, views)


def peers():
    for step in ["peers", "spawn"]:
        for motion, scene, here in groups(step):
            if scene.startswith("uniform"):
                yield row(motion, *[us(here.get(name)) for name in ["wide", *ALL]])


# As old after 100 frames as after 1,000.
JUMPS_AGE_AT_ONCE = ["shuffle 1 %", "shuffle 10 %"]


def thousand():
    for motion, scene, here in groups("thousand"):
        if motion in JUMPS_AGE_AT_ONCE:
            continue
        aged = [f"{ratio(here.get(n), 'ageing_100')}, {ratio(here.get(n), 'ageing_1000')}"
                for n in OURS[1:3]]
        spread = ", ".join(worst(here[name]) for name in OURS[1:])
        yield row(motion, *[us(here[name]) for name in OURS[1:]], *aged, spread)


def table(header, lines):
    columns = header.split(" | ")
    return row(*columns) + "\n|" + "---|" * len(columns) + "\n" + "\n".join(lines) + "\n"


HEAD = """## What moves

Written by `scripts/motion.py` from [results/motion](../results/motion) ({cpu}, {date}; one
core of a shared machine, views of 2 %, three processes). *Others*: other items move in every frame.
Helsinki has 11,065 boxes. Least times within 5 % are bold. The rows of the city are left out: in
18 of 20 it has a fastest structure in common with `uniform` (the other two: `auto`), frames of
`linear` and `wide` take 0.7 to 1.3 times as long, of `moving` 0.7 to 2.7 times, and `wide` ages up
to 2.4 times as much. So are those of Helsinki in the last two tables.

### Frame by structure

Time of a frame with one view in us, mean of 100 frames. *Peer*: the faster of obvhs and parry3d, by
its own update calls (`spawn`: the fastest of all peers). *Ageing*: query time after 100 frames /
on a fresh build.

"""


def section(about):
    head = "moved per frame | scene | linear | wide | moving | auto | peer"
    yield HEAD.format(**about)
    yield table(f"{head} | ageing of wide | of moving", [*frames("frames"), *frames("spawn")])
    yield "\nA million items, 30 frames; *worst*: the slowest frame / the mean:\n\n"
    yield table(f"{head} | worst of wide | of moving", frames("million"))
    yield ("\nSixteen views per frame; *peer*: obvhs. Queries age as with one view (within 15 %):"
           "\n\n")
    yield table(head, frames("views"))
    yield ("\nOther peers, `uniform:n=100000`, time of a frame with one view in us "
           "([PEERS](PEERS.md)):\n\n")
    yield table("moved per frame | wide | obvhs | parry3d | bvh | rstar | Bevy-style", peers())
    yield ("\n### Refit or rebuild\n\nFrame of `wide` in us (worst frame), one view, mean of 40 "
           "frames. *Views*: the number of\nqueries per frame from which on a rebuild in every "
           "frame pays.\n\n")
    yield table("moved per frame | scene | refit | every=20 | rebuild | views", updates())
    yield ("\n### After 1,000 frames\n\n`uniform:n=20000`: frame in us; ageing after 100 and 1,000 "
           "frames; worst frame / mean. Where the\nsame items jump, `wide` ages no further after 100 "
           "frames.\n\n")
    yield table("moved per frame | wide | moving | auto | ageing of wide | of moving | "
                "worst: wide, moving, auto", thousand())


NOTES = "\n### What follows\n"


def main():
    unknown = [step for step in sys.argv[2:] if step not in STEPS]
    if unknown:
        sys.exit(f"motion.py: {unknown[0]}; expected a step of {', '.join(STEPS)}")
    if len(sys.argv) > 1:
        measure(sys.argv[1], sys.argv[2:] or list(STEPS))
    about = json.loads((RESULTS / "about.json").read_text())
    before, _, text = PAGE.read_text().partition("## What moves\n")
    notes = text.partition(NOTES)[2]
    PAGE.write_text(before.rstrip() + "\n\n" + "".join(section(about)) + NOTES + notes)


if __name__ == "__main__":
    main()
