#!/usr/bin/env python3
"""The mechanical part of the rules for prose: how doc comments begin, and phrases for which there
is a plainer one. Reads comments and strings of src and examples, docs, README and CHANGELOG.
scripts/prose.allowed has a count per rule that may only fall. Standard library only.

usage: scripts/check-prose.py [--list] [--record]
  --list     print every occurrence, allowed or not
  --record   write today's counts, none of which may be above the recorded one
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ALLOWED = ROOT / "scripts" / "prose.allowed"
LONGEST_SUMMARY = 80

# Rule -> what to write. A space in a phrase is any white space, a line break of a comment or of
# a string included.
PHRASES = {
    r"hand(s|ed|ing)? (on|over|out)": "pass, return, copy",
    r"(held|holds?|holding) against": "compare with, check against",
    r"(no|every|some|any)body": "name who or what it is",
    r"who(so)?ever": "name who or what it is",
    r"own business": "say what depends on what",
    r"so many": "name the number: n",
    r"here are:": "available:",
    r"times linear": "speed-up vs linear",
    r"forced (on|off)": "with the rule, without the rule",
    r"asked (of|through)": "queried",
    r"(is|are|was|were|be|been) asked": "is queried, is tested, is requested",
    r"(is|are|was|were|be|been) told(?! apart)": "is given, is named",
    r"noise floor": "differences below X % are not significant",
    r"fore(seen|told)": "predicted",
    r"(parted|relaid)": "partitioned, split; reordered",
    r"promises? nothing": "has no guarantee",
    r"knows? (of|nothing)": "has, contains, depends on",
    r"(makes?|made) ready": "prepare",
    r"go(es)? on": "continue",
    r"anew": "again, newly",
    r"at any rate": "at least",
    r"in vain": "name what it cost",
    r"put(s)? right": "correct",
    r"out of the question": "excluded",
    r"used to be": "say what is, not what was",
    r"since then": "say what is, not what was",
}
OPENER = re.compile(r"(What|Whether|Of|As|By|That|Where)\b")
DOC = re.compile(r"\s*(///|//!)(?!/)\s?(.*)")
GAP = r"\s*\\?\s+(?://[/!]?\s*)?"


def compiled(phrase):
    words = re.sub(r"(?<!\\) ", lambda _: GAP, phrase)
    return re.compile(r"(?<![\w`-])(?:" + words + r")(?![\w`-])", re.IGNORECASE)


def files():
    for folder, pattern in [("src", "*.rs"), ("examples", "*.rs"), ("docs", "*.md")]:
        yield from sorted((ROOT / folder).rglob(pattern))
    yield from (ROOT / name for name in ["README.md", "CHANGELOG.md"])


def summaries(lines):
    """First lines of doc comments, as (line number, text)."""
    before = None
    for number, line in enumerate(lines, 1):
        found = DOC.match(line)
        if found and found[1] != before:
            yield number, found[2]
        before = found and found[1]


def prose(path, text):
    """The text with Rust code blanked: comments and strings are left, offsets stay."""
    if path.suffix != ".rs":
        return text
    kept = r"""//[^\n]*|"(?:\\.|[^"\\])*"|r(?P<h>\#+)".*?"(?P=h)"""
    piece = re.compile(rf"""(?P<kept>{kept})|'(?:\\.|[^'\\\n])'|[^r"'/\n]+|[^\n]""", re.S)
    return piece.sub(lambda m: m[0] if m["kept"] else " " * len(m[0]), text)


def occurrences():
    phrases = {phrase: compiled(phrase) for phrase in PHRASES}
    for path in files():
        text = path.read_text(encoding="utf-8")
        name = path.relative_to(ROOT)
        if path.suffix == ".rs":
            for number, first in summaries(text.split("\n")):
                if OPENER.match(first):
                    yield "doc-opener", name, number, first
                if len(first) > LONGEST_SUMMARY:
                    yield "doc-length", name, number, first
        text = prose(path, text)
        for phrase, expression in phrases.items():
            for found in expression.finditer(text):
                number = text.count("\n", 0, found.start()) + 1
                yield phrase, name, number, " ".join(found[0].split())


def advice(rule):
    return {
        "doc-opener": "begin with a noun phrase or a verb; not What, Whether, Of, As, By, ..",
        "doc-length": f"the first line has at most {LONGEST_SUMMARY} characters",
    }.get(rule) or f"write: {PHRASES[rule]}"


def main(arguments):
    found = {rule: [] for rule in ["doc-opener", "doc-length", *PHRASES]}
    for rule, *where in occurrences():
        found[rule].append(where)
    rows = ALLOWED.read_text().splitlines() if ALLOWED.exists() else []
    counts = dict(row.split("\t") for row in rows if row and not row.startswith("#"))
    allowed = {rule: int(counts.get(rule, 0 if counts else len(found[rule]))) for rule in found}
    over = [rule for rule in found if len(found[rule]) > allowed[rule]]
    for rule in found if "--list" in arguments else over:
        for name, number, text in found[rule]:
            print(f"{name}:{number}: {text} ({advice(rule)})")
    for rule in over:
        expected = f"{len(found[rule])} found; expected at most {allowed[rule]}"
        print(f"check-prose: {rule}: {expected}", file=sys.stderr)
    if "--record" in arguments and not over:
        head = "# Rule and how often it is still broken; may only fall: check-prose.py --record\n"
        rows = (f"{rule}\t{len(where)}\n" for rule, where in found.items() if where)
        ALLOWED.write_text(head + "".join(rows))
    fewer = sum(allowed[rule] - len(found[rule]) for rule in found if rule not in over)
    if fewer and "--record" not in arguments:
        print(f"check-prose: {fewer} fewer than allowed; record that with --record")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
