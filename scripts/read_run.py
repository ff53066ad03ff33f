"""Reads a run into pandas and draws its times with 95 % intervals.

usage: python3 scripts/read_run.py RUN [PICTURE.svg]

Prints the time per query of each structure by scene, path, cache and test, once as report.json
has it and once computed here from samples.csv, and draws the former. Needs pandas, and
matplotlib for the picture. `python3 -i scripts/read_run.py RUN` leaves `summary` and `samples`
to work with; docs/METHODOLOGY.md describes the columns.
"""

import math
import sys
from pathlib import Path

try:
    import pandas as pd
except ImportError:
    sys.exit("read_run.py: no pandas; expected it in this Python (pip install pandas matplotlib)")

CELL = ["scene", "path", "cache", "test", "structure"]


def read(run):
    """The rows of summary.csv (one per cell) and of samples.csv (one per clock reading)."""
    return pd.read_csv(Path(run) / "summary.csv"), pd.read_csv(Path(run) / "samples.csv")


def times_of(samples, task="query"):
    """Mean time per query in ns of each process: a column per process, a row per cell.

    A round's time is the mean over its queries, a process's the interquartile mean of the
    logarithms over its rounds.
    """
    own = samples[samples.task == task].copy()
    own["ns"] = own.cpu_ns * own.queries
    rounds = own.groupby([*CELL, "process", "round"])[["ns", "queries"]].sum()
    logs = (rounds.ns / rounds.queries).map(math.log)

    def interquartile(values):
        values = values.sort_values()
        cut = len(values) // 4
        return values.iloc[cut:len(values) - cut].mean()

    return logs.groupby([*CELL, "process"]).agg(interquartile).unstack("process").map(math.exp)


def draw(summary, file):
    """A panel for each scene, path, cache and test; a dot and an interval per structure."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    ok = summary[(summary.status == "ok") & summary.query_ns.notna()]
    groups = list(ok.groupby(CELL[:-1], sort=False))
    figure, panels = plt.subplots(len(groups), squeeze=False, layout="constrained",
                                  figsize=(7, sum(1.2 + 0.22 * len(rows) for _, rows in groups)),
                                  height_ratios=[4 + len(rows) for _, rows in groups])
    for panel, (names, rows) in zip(panels[:, 0], groups):
        rows = rows.sort_values("query_ns", ascending=False)
        low = rows.query_ns_lower.fillna(rows.query_ns)
        high = rows.query_ns_upper.fillna(rows.query_ns)
        panel.errorbar(rows.query_ns, rows.structure, fmt="o", capsize=3,
                       xerr=[rows.query_ns - low, high - rows.query_ns])
        panel.set(xscale="log", title=", ".join(names))
    panels[-1, 0].set_xlabel("time per query, ns (CPU time; 95 % interval)")
    figure.savefig(file)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    summary, samples = read(sys.argv[1])
    table = summary.set_index(CELL)[["query_ns", "query_ns_lower", "query_ns_upper"]]
    table["from samples"] = times_of(samples).median(axis=1)
    print(table.to_string())
    if len(sys.argv) == 3:
        draw(summary, sys.argv[2])
