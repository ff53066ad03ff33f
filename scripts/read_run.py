"""Reads a run into pandas and draws its times with 95 % intervals.

usage: python3 scripts/read_run.py RUN [PICTURE.svg]

Prints the time per query (of items that move, per frame) of each structure by scene, path, cache
and test, once as report.json has it and once computed here from samples.csv (or samples.csv.gz) by
the same estimator, and draws the former. Needs pandas, and matplotlib for the picture. `python3 -i scripts/read_run.py RUN` leaves `summary` and `samples`
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
    tables = []
    if not Path(run).is_dir():
        sys.exit(f"read_run.py: {run}: no such folder; expected that of a run")
    for name in ("summary", "samples"):
        files = [Path(run) / f"{name}.csv", Path(run) / f"{name}.csv.gz"]
        kept = [file for file in files if file.is_file()]
        if not kept:
            sys.exit(f"read_run.py: {run}: {name}.csv was not kept; expected the folder of a whole run")
        tables.append(pd.read_csv(kept[0]))
    summary, samples = tables
    moves = summary.motion.notna()
    summary.loc[moves, "path"] += " + " + summary.motion[moves].astype(str)  # as in the samples
    return summary, samples


def task_of(summary):
    """What structures are ranked by: the frame of items that move, otherwise the query."""
    return "frame" if summary.motion.notna().any() else "query"


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
        # A value that a quartile falls into counts by the share of it that lies inside.
        values, low, high = values.sort_values(), len(values) / 4, len(values) * 3 / 4
        shares = [max(0, min(high, i + 1) - max(low, i)) for i in range(len(values))]
        return (values * shares).sum() / (high - low)

    return logs.groupby([*CELL, "process"]).agg(interquartile).unstack("process").map(math.exp)


def over_processes(times):
    """The time of each cell in ns, by the estimator of report.json (docs/METHODOLOGY.md, "Estimates").

    The 20 % trimmed mean of the logarithms of linear, and of the differences to it in each process;
    without linear the first by name stands for it (in the report the first that was entered).
    """
    def trimmed(values):
        values = values.dropna().sort_values()
        cut = len(values) // 5
        return values[cut:len(values) - cut].mean()

    def of_group(logs):
        labels = logs.index.get_level_values("structure")
        base = logs[labels == "linear"] if "linear" in labels else logs[:1]
        return (logs - base.iloc[0]).apply(trimmed, axis=1) + trimmed(base.iloc[0])

    groups = times.map(math.log).groupby(CELL[:-1])
    return pd.concat([of_group(logs) for _, logs in groups]).map(math.exp)


def draw(summary, file):
    """A panel for each scene, path, cache and test; a dot and an interval per structure."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    time = f"{task_of(summary)}_ns"
    ok = summary[(summary.status == "ok") & summary[time].notna()]
    groups = list(ok.groupby(CELL[:-1], sort=False))
    figure, panels = plt.subplots(len(groups), squeeze=False, layout="constrained",
                                  figsize=(7, sum(1.2 + 0.22 * len(rows) for _, rows in groups)),
                                  height_ratios=[4 + len(rows) for _, rows in groups], sharex=True)
    for panel, (names, rows) in zip(panels[:, 0], groups):
        rows = rows.sort_values(time, ascending=False)
        middle = rows[time]
        low, high = (rows.get(f"{time}_{end}", middle).fillna(middle) for end in ("lower", "upper"))
        panel.errorbar(middle, rows.structure, fmt="o", capsize=3, xerr=[middle - low, high - middle])
        panel.set(xscale="log", title=", ".join(names))
    panels[-1, 0].set_xlabel(f"time per {task_of(summary)}, ns (CPU time; 95 % interval)")
    figure.savefig(file)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    summary, samples = read(sys.argv[1])
    task = task_of(summary)
    if not (samples.task == task).any():
        sys.exit(f"read_run.py: {sys.argv[1]}: nothing was timed; expected a run with times")
    times = [f"{task}_ns", f"{task}_ns_lower", f"{task}_ns_upper"]
    table = summary.set_index(CELL).reindex(columns=times)
    table["from samples"] = over_processes(times_of(samples, task))
    print(table.to_string())
    if len(sys.argv) == 3:
        draw(summary, sys.argv[2])
