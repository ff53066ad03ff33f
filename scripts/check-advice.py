#!/usr/bin/env python3
"""Repeats `advise` and counts the questions that it answers alike: at least 95 % must be.

usage: check-advice.py PROGRAM [REPETITIONS] [--processes N] [CELL..]
A cell is the options of `advise` in one word; default: CELLS. The questions of a cell are structure,
test, update policy and every rule. The answers to one agree if all that are firm are the same, and
every tie holds it. Exit 1 below 95 %."""
import json, subprocess, sys

CELLS = [
    "--scene uniform:n=20000 --path flythrough:frames=64,visible=2%",
    "--scene city:n=20000 --path street:frames=32",
    "--scene city:n=20000 --path outside:frames=32",
    "--scene freedm-map12 --path places",
    "--scene us-counties --path orbit:frames=32",
    "--scene uniform:n=500 --path orbit:frames=32",
    "--scene city:n=10000 --path orbit:frames=32 --motion drift:share=1%,frames=40",
    "--scene uniform:n=10000 --path orbit:frames=32 --motion swarm:frames=40",
]

args = sys.argv[2:]
processes = "10"
if "--processes" in args:
    at = args.index("--processes")
    processes = args[at + 1]
    del args[at:at + 2]
repetitions = int(args.pop(0)) if args and args[0].isdigit() else 10


def answers(advice):
    """Answers by question: the firm one, or the set of those that tie."""
    structure, test, motion = (advice[name] for name in ("structure", "test", "motion"))
    yield "structure", {structure["name"], *structure["ties"]}
    yield "test", {test["name"], *(tie.split(" on ")[0] for tie in test["ties"])}
    if motion:
        yield "policy", {motion["policy"], *motion["policy_ties"]}
    for rule in advice["omissions"]:
        both = {"keep", "leave_out"}
        yield rule["rule"], both if rule["tie"] else {rule["decision"]}


alike = asked = 0
for cell in args or CELLS:
    found = {}
    for _ in range(repetitions):
        command = [sys.argv[1], "advise", *cell.split(), "--processes", processes, "--format", "json"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        for question, answer in answers(json.loads(done.stdout)):
            found.setdefault(question, []).append(answer)
    # One answer that every repetition gives or ties with.
    flipped = {question: own for question, own in found.items() if not set.intersection(*own)}
    alike += len(found) - len(flipped)
    asked += len(found)
    print(f"{cell}: {len(found) - len(flipped)} of {len(found)} alike", flush=True)
    for question, own in flipped.items():
        print(f"  {question}: " + "; ".join("/".join(sorted(map(str, answer))) for answer in own), flush=True)
print(f"{alike} of {asked} questions ({100 * alike / asked:.1f} %) have the same answer or a tie in {repetitions} repetitions")
sys.exit(alike < 0.95 * asked)
