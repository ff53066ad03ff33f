"""Sums up what check-compare.sh ran: false verdicts of a program beside itself,
and how often the slower octree was found. Standard library only."""

import glob
import json
import re
import sys

folder = sys.argv[1]
for side in ("same", "slowed"):
    # One that is still running has written nothing yet.
    texts = [open(name).read() for name in sorted(glob.glob(f"{folder}/{side}-*.json"))]
    runs = [json.loads(text) for text in texts if text]
    if not runs:
        continue
    rows = [[row for row in run["rows"] if row["judgement"]] for run in runs]
    seconds = sorted(float(re.search(r"in (\d+) s", run["head"]).group(1)) for run in runs)
    print(f"{side}: {len(runs)} comparisons of {len(rows[0])} cells, "
          f"median {seconds[len(seconds) // 2]:.0f} s, longest {seconds[-1]:.0f} s")

    def count(verdicts, of=lambda row: True):
        hits = [[row for row in run if of(row) and row["verdict"] in verdicts] for run in rows]
        return sum(map(len, hits)), sum(map(bool, hits))

    cells = sum(map(len, rows))
    if side == "same":
        wrong, _ = count(("slower", "faster"))
        _, exits = count(("slower",))
        print(f"  false verdicts: {wrong} of {cells} cells; exit 3: {exits} of {len(runs)}")
        print(f"  inconclusive: {count(('inconclusive',))[0]} cells")
    else:
        octree = lambda row: row["structure"] == "octree"
        cells = sum(1 for run in rows for row in run if octree(row))
        found, runs_found = count(("slower",), octree)
        changes = sorted(row["judgement"]["ratio"] - 1 for run in rows for row in run if octree(row))
        print(f"  octree slower: {found} of {cells} cells, in {runs_found} of {len(runs)} comparisons; "
              f"median change {100 * changes[len(changes) // 2]:+.1f} %")
