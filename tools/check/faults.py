#!/usr/bin/env python3
"""The table of faults: docs/faults.md from tests/faults.toml.

Usage: tools/check/faults.py [--write | --run BUILD]

Without an option it checks that every test that the table names is there and that the page is as the table says. --write writes
the page. --run runs the table's tests in a build folder and prints the page with what came of each row.
"""
import argparse
import fnmatch
import json
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as xml
from pathlib import Path

import source

TOP = Path(source.top_of(__file__))
TABLE = "tests/faults.toml"
PAGE = "docs/faults.md"
GOOGLE_TEST = re.compile(r"^(?:TEST(?:_F|_P)?|TYPED_TEST|RC_GTEST_PROP)\(\s*(\w+),\s*(\w+)\)", re.MULTILINE)

HEAD = """# Faults

What can go wrong, what the daemon then does, and the tests that make it go wrong. Written by `tools/check/faults.py --write` from
`tests/faults.toml`; `tools/check/faults.py --run build/release` runs the tests of every row and says what came of them. Tests on data or
devices that are not there are skipped by name.
"""


def tests_there(top):
    """Names of the tests in the sources: of GoogleTest, and of virtual machines and fuzz targets."""
    names = {f"{suite}.{test}" for file in sorted(top.glob("tests/**/*_test.cpp"))
             for suite, test in GOOGLE_TEST.findall(file.read_text())}
    names |= {f"hil.{file.name.removesuffix('_guest.py')}" for file in top.glob("tests/hil/*_guest.py")}
    names |= {f"fuzz.{file.name.removesuffix('_fuzz.cpp')}" for file in top.glob("tests/fuzz/*_fuzz.cpp")}
    return names


def problems(rows, names):
    """What of the rows is not as it should be, a sentence each."""
    for row in rows:
        if not row.get("tests") and not row.get("missing"):
            yield f"'{row['what']}' has neither tests nor says what is missing"
        for pattern in row.get("tests", []):
            if not fnmatch.filter(names, pattern):
                yield f"'{row['what']}' names {pattern}, which is no test"


def page(rows, outcomes=None):
    """The page; with `outcomes` (a word for each row) in a column of its own."""
    columns = ["fault", "what must happen", "injected by"] + (["outcome"] if outcomes else [])
    lines = [HEAD, f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for number, row in enumerate(rows):
        cell = ", ".join(f"`{test}`" for test in row.get("tests", []))
        if missing := row.get("missing"):
            cell += f"{'; ' if cell else ''}**not injected**: {missing}"
        cells = [row["what"], row["expected"], cell] + ([outcomes[number]] if outcomes else [])
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def expressions(row):
    """What ctest calls the row's tests: parametrised ones have their instance before the suite and behind the test."""
    return ["(^|/)" + (re.escape(pattern[:-1]) if pattern.endswith("*") else re.escape(pattern) + "(/|$)")
            for pattern in row.get("tests", [])]


def outcome(row, states):
    """A row's outcome in words, from ctest's states by name."""
    mine = [state for name, state in states.items() if any(re.search(one, name) for one in expressions(row))]
    failed = mine.count("fail")
    skipped = len(mine) - failed - mine.count("run")
    if failed:
        return f"**{failed} of {len(mine)} failed**"
    return f"{len(mine) - skipped} passed" + (f", {skipped} skipped" if skipped else "") if mine else "-"


def run(rows, build):
    """Runs every row's tests. Their outcomes, and whether none failed."""
    results = build.resolve() / "faults.xml"
    listed = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1"], stdout=subprocess.PIPE, check=True)
    every = re.compile("|".join(one for row in rows for one in expressions(row)))
    # By number: ctest's own expressions have room for nine groups.
    chosen = [str(number) for number, test in enumerate(json.loads(listed.stdout)["tests"], 1) if every.search(test["name"])]
    subprocess.run(["ctest", "--test-dir", build, "-I", ",".join(["0", "0", "0", *chosen]), "--output-junit", results],
                   stdout=sys.stderr, check=False)
    states = {case.get("name"): case.get("status") for case in xml.parse(results).getroot().iter("testcase")}
    return [outcome(row, states) for row in rows], "fail" not in states.values()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--run", metavar="BUILD", type=Path)
    options = parser.parse_args()
    rows = tomllib.loads((TOP / TABLE).read_text())["fault"]
    found = list(problems(rows, tests_there(TOP)))
    if options.run:
        words, passed = run(rows, options.run)
        print(page(rows, words), end="")
        return 0 if passed else 1
    if options.write:
        (TOP / PAGE).write_text(page(rows))
    elif not (TOP / PAGE).exists() or (TOP / PAGE).read_text() != page(rows):
        found.append(f"{PAGE} is not as {TABLE} says; tools/check/faults.py --write writes it")
    for sentence in found:
        print(f"{TABLE}: {sentence}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
