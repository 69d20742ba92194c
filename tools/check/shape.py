#!/usr/bin/env python3
"""Checks the shape of the code.  Usage: tools/check/shape.py

- A source (C++, Python, shell, CMake) has at most 400 lines; a tracked file has at most 256 KiB.
- Every .cpp file is named in a CMakeLists.txt, so that no source or test lies unbuilt beside the built ones.
- No raw new or delete, and no sleep outside tests: ownership is a type, and a wait is for an event. A new that stands in
  a unique_ptr's own initialiser is owned: that is how a class with a private constructor is made.
- No run of 12 significant lines stands twice: it is a function that has no name yet.
- No note to come back later (to-do and the like) in a source.
Functions are clang-tidy's business (.clang-tidy).
"""
import os
import re
import sys
from collections import defaultdict
from fnmatch import fnmatch

import source

MAX_LINES = 400
MAX_BYTES = 256 * 1024
RUN_LINES = 12
MEASURED = (*source.CPP_SUFFIXES, ".py", ".sh", ".cmake", "CMakeLists.txt")

NEW = re.compile(r"(?<!operator )\bnew\b")
OWNED = re.compile(r"unique_ptr<[\w:<>, ]*>\s*\w*\s*[({]\s*$")
DELETE = re.compile(r"(?<!=)(?<!= )(?<!operator )\bdelete\b")
SLEEP = re.compile(r"\b(usleep|nanosleep|sleep_for|sleep_until)\s*\(|(?<![\w.>])sleep\s*\(")
LATER = re.compile(r"\b(TO" + r"DO|FIX" + r"ME|XX" + r"X|HA" + r"CK)\b")
CMAKE_FILE = re.compile(r"(?:\$\{CMAKE_CURRENT_SOURCE_DIR\}/)?([\w/.*-]+\.cpp)")
# Lines that many files must share say nothing about a run.
TRIVIAL = re.compile(r"^(#.*|using .*|namespace .*|[{}()\[\];,]*|(public|private|protected):|break;|default:)$")


def is_source(path, text):
    return path.endswith(MEASURED) or text.startswith("#!")


def check_size(path, text):
    if len(text.encode()) > MAX_BYTES:
        yield source.Finding(path, 1, f"{len(text.encode()) // 1024} KiB; a tracked file has at most {MAX_BYTES // 1024}")
    lines = text.count("\n")
    if is_source(path, text) and lines > MAX_LINES:
        yield source.Finding(path, MAX_LINES + 1, f"{lines} lines; a source has at most {MAX_LINES}")


def check_words(path, text):
    """Raw ownership, sleeps and notes to come back later."""
    if is_source(path, text):
        for number, line in enumerate(text.splitlines(), 1):
            if LATER.search(line):
                yield source.Finding(path, number, "a note to come back later; do it or open an issue")
    if not source.is_cpp(path):
        return
    code = re.sub(r"^\s*#.*", "", source.strip_code(text), flags=re.MULTILINE)
    for match in NEW.finditer(code):
        if not OWNED.search(code[:match.start()]):
            yield source.Finding(path, code.count("\n", 0, match.start()) + 1, "raw new; let a type own it")
    for number, line in enumerate(code.splitlines(), 1):
        if DELETE.search(line):
            yield source.Finding(path, number, "raw delete; let a type own it")
        if SLEEP.search(line) and not path.startswith("tests/"):
            yield source.Finding(path, number, "a sleep; wait for the event instead")


def check_built(project):
    """Every .cpp is named, or matched by a pattern, in the CMakeLists.txt of its folder or of one above."""
    for path, _ in project.cpp():
        if not path.endswith(".cpp"):
            continue
        folder, named = os.path.dirname(path), False
        while not named:
            lists = project.files.get(os.path.join(folder, "CMakeLists.txt"), "")
            name = os.path.relpath(path, folder or ".")
            named = any(fnmatch(name, word) for word in CMAKE_FILE.findall(lists))
            if not folder:
                break
            folder = os.path.dirname(folder)
        if not named:
            yield source.Finding(path, 1, "in no CMakeLists.txt, so never built")


def significant_lines(text):
    """(number, normalised text) of the lines that say something."""
    for number, line in enumerate(source.strip_code(text).splitlines(), 1):
        line = " ".join(line.split())
        if not TRIVIAL.match(line):
            yield number, line


def check_runs(project):
    """Runs of RUN_LINES significant lines that stand in two places, each run once and at full length."""
    lines_of = {path: list(significant_lines(text)) for path, text in project.cpp()}
    places = defaultdict(list)
    for path, lines in lines_of.items():
        for i in range(len(lines) - RUN_LINES + 1):
            places[tuple(line for _, line in lines[i:i + RUN_LINES])].append((path, i))
    seen = set()
    for found in places.values():
        path, i = found[0]
        for other, j in found[1:]:
            if (path, i - 1, other, j - 1) not in seen:
                a, b = lines_of[path], lines_of[other]
                length = RUN_LINES
                while i + length < len(a) and j + length < len(b) and a[i + length][1] == b[j + length][1]:
                    length += 1
                yield source.Finding(other, b[j][0], f"{length} lines that also stand at {path}:{a[i][0]}")
            seen.add((path, i, other, j))


def check(project):
    findings = [finding for path, text in project.files.items()
                for finding in (*check_size(path, text), *check_words(path, text))]
    return [*findings, *check_built(project), *check_runs(project)]


if __name__ == "__main__":
    sys.exit(source.main("shape", check, __file__))
