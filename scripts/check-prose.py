#!/usr/bin/env python3
"""The mechanical part of the rules for prose: how doc comments begin, phrases for which there is a
plainer one, and links to files that are not in the repository. Reads comments and strings of all
Rust code, docs, README and CHANGELOG. Prints every occurrence and fails if there is any. Standard
library only.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONGEST_SUMMARY = 80
RUST = ["src", "tests", "benches", "examples", "scripts", "fuzz/src"]
FOLDERS = [*((folder, "*.rs") for folder in RUST), ("docs", "*.md"), ("src/cli/assets", "*.txt")]

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
LINK = re.compile(r"\]\((?![a-z]+:|#)([^)#\s]+)")
GAP = r"\s*\\?\s+(?://[/!]?\s*)?"


def compiled(phrase):
    words = re.sub(r"(?<!\\) ", lambda _: GAP, phrase)
    return re.compile(r"(?<![\w`-])(?:" + words + r")(?![\w`-])", re.IGNORECASE)


def files():
    for folder, pattern in FOLDERS:
        yield from sorted((ROOT / folder).rglob(pattern))
    yield from (ROOT / name for name in ["README.md", "CHANGELOG.md", "results/README.md"])


def paragraphs(lines):
    """First lines of the paragraphs of doc comments, as (line number, text, is the summary)."""
    before = None
    for number, line in enumerate(lines, 1):
        found = DOC.match(line)
        is_summary = found and (not before or found[1] != before[1])
        if is_summary or found and not before[2]:
            yield number, found[2], is_summary
        before = found


def prose(path, text):
    """The text with Rust code blanked: comments and strings are left, offsets stay."""
    if path.suffix != ".rs":
        return text
    kept = r"""//[^\n]*|"(?:\\.|[^"\\])*"|r(?P<h>\#+)".*?"(?P=h)"""
    piece = re.compile(rf"""(?P<kept>{kept})|'(?:\\.|[^'\\\n])'|[^r"'/\n]+|[^\n]""", re.S)
    return piece.sub(lambda m: m[0] if m["kept"] else " " * len(m[0]), text)


def occurrences():
    phrases = {phrase: compiled(phrase) for phrase in PHRASES}
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    committed = [ROOT / file for file in listed.stdout.decode().split("\0") if file]
    for path in files():
        text = path.read_text(encoding="utf-8")
        name = path.relative_to(ROOT)
        if path.suffix == ".rs":
            for number, first, is_summary in paragraphs(text.split("\n")):
                if OPENER.match(first):
                    yield "doc-opener", name, number, first
                if is_summary and len(first) > LONGEST_SUMMARY:
                    yield "doc-length", name, number, first
        elif path.suffix == ".md":
            for link in LINK.finditer(text):
                target = (path.parent / link[1]).resolve()
                if not any(target == file or target in file.parents for file in committed):
                    yield "link", name, text.count("\n", 0, link.start()) + 1, link[1]
        text = prose(path, text)
        for phrase, expression in phrases.items():
            for found in expression.finditer(text):
                number = text.count("\n", 0, found.start()) + 1
                yield phrase, name, number, " ".join(found[0].split())


def advice(rule):
    return {
        "doc-opener": "begin with a noun phrase or a verb; not What, Whether, Of, As, By, ..",
        "link": "link to a file that git has",
        "doc-length": f"the first line has at most {LONGEST_SUMMARY} characters",
    }.get(rule) or f"write: {PHRASES[rule]}"


def main():
    count = 0
    for count, (rule, name, number, text) in enumerate(occurrences(), 1):
        print(f"{name}:{number}: {text} ({advice(rule)})")
    if count:
        print(f"check-prose: {count} found; expected none", file=sys.stderr)
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
