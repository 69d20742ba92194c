#!/usr/bin/env python3
"""Sums up ctest's JUnit files: every skipped test with its reason, every failed one with what it said last, and one line of counts.

Usage: test_summary.py FILE.xml...
Exits with 1 when a test failed, a file is missing or no test ran.
"""
import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

# GoogleTest prints "FILE:LINE: Skipped" and then the message, up to an empty line or its own next line.
GTEST_SKIP = re.compile(r"^.*: Skipped\n(?P<why>.*?)(?:\n\n|\n\[|\Z)", re.DOTALL | re.MULTILINE)


def skip_reason(output):
    """What a skipped test said: its GTEST_SKIP message, or its last line."""
    match = GTEST_SKIP.search(output)
    text = match["why"] if match else (output.strip().splitlines() or [""])[-1]
    return " ".join(text.split()) or "no reason given"


def complaint(output, most=12):
    """What a failed test said: its lines that say so, else its last ones."""
    lines = [line.rstrip() for line in output.splitlines() if line.strip()]
    told = [line for line in lines if re.search(r"\bFAIL\b|: Failure$|Error|error", line)] or lines
    return [f"    {line}" for line in told[-most:]]


def read_cases(path):
    """(name, status, output) of each test of one JUnit file; status is passed, failed or skipped."""
    for case in ElementTree.parse(path).getroot().iter("testcase"):
        output = case.findtext("system-out") or ""
        if case.find("failure") is not None or case.find("error") is not None:
            status = "failed"
        elif case.find("skipped") is not None or case.get("status") in ("notrun", "disabled"):
            status = "skipped"
        else:
            status = "passed"
        yield case.get("name"), status, output


def summarise(paths, out):
    """Prints the summary to `out`; returns the exit code."""
    count = {"passed": 0, "failed": 0, "skipped": 0}
    lines = []
    for path in paths:
        if not Path(path).is_file():
            lines.append(f"failed: {path} was not written")
            count["failed"] += 1
            continue
        for name, status, output in read_cases(path):
            count[status] += 1
            if status == "skipped":
                lines.append(f"skipped: {name}: {skip_reason(output)}")
            elif status == "failed":
                lines += [f"failed: {name}", *complaint(output)]
    for line in lines:
        print(line, file=out)
    total = sum(count.values())
    if total == 0:
        print("no test matched", file=out)
    print(f"{count['passed']} passed, {count['failed']} failed, {count['skipped']} skipped", file=out)
    return 1 if count["failed"] or total == 0 else 0


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sys.exit(summarise(sys.argv[1:], sys.stdout))
