"""What the partition brings and what the layout brings, from one run that has the
textbook forms (`cullbench run --structure all`): geometric means over its cells, as
Markdown. Standard library only.

usage: python3 scripts/partition-layout.py RUN/summary.csv
"""

import csv
import math
import sys
from collections import defaultdict

# Each partition with the structure that holds it by child pointers, one box at a
# time, and the one that holds it by blocks of sixteen.
PARTITIONS = [
    ("none", "linear-scalar", "linear"),
    ("planes of any orientation", "bsp-textbook", "bsp"),
    ("octants", "octree-textbook", "octree"),
    ("quadrants", "quadtree-textbook", "quadtree"),
    ("surface area (obvhs)", "bvh-textbook", "bvh"),
]

times = defaultdict(dict)
with open(sys.argv[1], newline="") as file:
    for row in csv.DictReader(file):
        if row["status"] == "ok" and row["query_ns"]:
            times[row["structure"]][row["scene"], row["path"], row["cache"]] = float(row["query_ns"])

cells = set.intersection(*(set(times[name]) for pair in PARTITIONS for name in pair[1:]))
if not cells:
    sys.exit("no cell has all structures: expected a run with --structure all")


def over(base, name):
    """Geometric mean of time of base / time of name."""
    logs = [math.log(times[base][cell] / times[name][cell]) for cell in cells]
    return math.exp(sum(logs) / len(logs))


print("| partition | as in the lecture | in blocks of sixteen | the layout brings |")
print("|---|---:|---:|---:|")
for partition, lecture, packed in PARTITIONS:
    first, second, layout = over("linear-scalar", lecture), over("linear-scalar", packed), over(lecture, packed)
    print(f"| {partition} | {first:.3g} × (`{lecture}`) | {second:.3g} × (`{packed}`) | {layout:.3g} × |")
print(f"\nTimes as fast as `linear-scalar`, geometric means over {len(cells)} cells.")
