#!/usr/bin/env python3
"""Checks who includes and links whom against the table in layers_table.py.  Usage: tools/check/layers.py

- A part includes and links only the parts that the table gives it; rooms of one part see each other.
- A third-party library is included only in its rooms, and linked only by a part that has such a room.
- Threads and locks stand only in the files named for them, <iostream> only in tools and tests.
- slam, calibration and timesync read no clock: time is an argument.
"""
import os
import re
import sys

import layers_table as table
import source

INCLUDE = re.compile(r'^\s*#\s*include\s*(?P<kind>[<"])(?P<name>[^>"]+)[>"]')
CLOCK = re.compile(r"\b(HostClock|steady_clock|system_clock|high_resolution_clock)\s*::\s*now\b|\bclock_gettime\s*\(")
COMMAND = re.compile(r"\b(?P<name>\w+)\s*\((?P<arguments>[^()]*(?:\([^()]*\)[^()]*)*)\)")
LINKING = {"geoflow_part", "geoflow_verb", "geoflow_test", "geoflow_fuzz", "target_link_libraries"}
KEYWORDS = {"SOURCES", "DEPENDS", "PRIVATE_DEPENDS", "PRECOMPILE", "LABELS", "PRIVATE_OF", "PUBLIC", "PRIVATE",
            "INTERFACE"}


def part_of(path):
    return path.split("/", 1)[0]


def inside(path, rooms):
    """Is the path one of these files or below one of these folders?"""
    return any(path == room or path.startswith(room.rstrip("/") + "/") for room in rooms)


def library_of(include):
    """The row of the third-party table for `<include>`, or None for the standard and system headers."""
    for library in table.LIBRARIES:
        if re.match(library.headers, include):
            return library
    return None


def check_own_include(project, path, number, name):
    part = part_of(path)
    match = re.match(r"geoflow/(\w+)/", name)
    if match:
        if match[1] not in table.PARTS[part]:
            yield source.Finding(path, number, f"{part} may not include {match[1]}")
    elif name.startswith("tests/"):
        if part != "tests":
            yield source.Finding(path, number, f"{part} may not include tests")
    elif part != "tests" and not inside(path, table.MEASURING_ROOMS):
        folders = path.split("/")[:-1]
        found = [os.path.normpath("/".join([*folders[:depth], name])) for depth in range(1, len(folders) + 1)]
        if any(file in project.files and part_of(file) == part for file in found):
            return
        yield source.Finding(path, number, f'"{name}" is no private header of {part}; others are its private matter')


def check_system_include(path, number, name):
    part = part_of(path)
    library = library_of(name)
    if library is None:
        if not re.match(table.STANDARD, name):
            yield source.Finding(path, number, f"<{name}> is of no library in layers_table.py")
    elif part != "tests" and not inside(path, library.rooms):
        yield source.Finding(path, number, f"{library.name} belongs to {', '.join(library.rooms) or 'tests'}")
    if name in table.THREAD_HEADERS and part != "tests" and not inside(path, table.THREAD_FILES):
        yield source.Finding(path, number, f"<{name}> only in the files that layers_table.py names")
    if name == "iostream" and part not in ("tools", "tests"):
        yield source.Finding(path, number, "<iostream> only in tools; log through geoflow::log")


def check_source(project, path, text):
    part = part_of(path)
    if part not in table.PARTS:
        yield source.Finding(path, 1, f"{part} is no part")
        return
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if match and match["kind"] == '"':
            yield from check_own_include(project, path, number, match["name"])
        elif match:
            yield from check_system_include(path, number, match["name"])
    if part in table.CLOCKLESS:
        for number, line in enumerate(source.strip_code(text).splitlines(), 1):
            if CLOCK.search(line):
                yield source.Finding(path, number, f"{part} reads no clock: time is an argument")


def check_edge(path, number, part, target):
    """One name that a target of `part` links."""
    match = re.match(r"geoflow(?:::|_)(\w+)$", target)
    own = match and match[1] in table.PARTS
    if own and match[1] not in table.PARTS[part]:
        yield source.Finding(path, number, f"{part} may not link {match[1]}")
    elif not own and not match:
        library = next((row for row in table.LIBRARIES if target in row.targets), None)
        if library is None:
            yield source.Finding(path, number, f"{target} is of no library in layers_table.py")
        elif part != "tests" and not any(part_of(room) == part for room in library.rooms):
            yield source.Finding(path, number, f"{part} may not link {library.name}")


def check_cmake(path, text):
    part = part_of(path)
    if part not in table.PARTS:
        return
    text = re.sub(r"#[^\n]*", "", text)
    for command in COMMAND.finditer(text):
        if command["name"] not in LINKING:
            continue
        linking = command["name"] == "target_link_libraries"
        for word in list(re.finditer(r"[^\s()]+", command["arguments"]))[1:]:
            if word[0] in KEYWORDS:
                linking = word[0] in ("DEPENDS", "PRIVATE_DEPENDS", "PUBLIC", "PRIVATE", "INTERFACE")
            elif linking and not re.search(r"[$<\"]|^-", word[0]):
                number = text.count("\n", 0, command.start("arguments") + word.start()) + 1
                yield from check_edge(path, number, part, word[0])


def check(project):
    findings = [finding for path, text in project.cpp() for finding in check_source(project, path, text)]
    for path, text in project.files.items():
        if os.path.basename(path) == "CMakeLists.txt" and "/" in path:
            findings += check_cmake(path, text)
    return findings


if __name__ == "__main__":
    sys.exit(source.main("layers", check, __file__))
