#!/usr/bin/env python3
"""Runs clang-tidy-19 over the project's sources.  Usage: tools/check/tidy.py [--all] [--jobs N] [FILE...]

Without FILE: the sources that changed against main (with those that include a changed header); --all: every source. Needs
build/clang configured (cmake --preset clang). A source that passed is not looked at again until it, a header of the
project that it includes, its compile command or a .clang-tidy changes.
"""
import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import source

TOP = Path(source.top_of(__file__))
BUILD = TOP / "build/clang"
PASSED = BUILD / "tidy-passed"


def run(*command):
    return subprocess.run(command, cwd=TOP, capture_output=True, text=True, check=False)


def own_headers(entry):
    """The project's own files that one compile command reads, itself included."""
    command = re.sub(r"\s-o\s+\S+", "", entry["command"])
    made = subprocess.run(f"{command} -MM -MF -", shell=True, cwd=entry["directory"], capture_output=True, text=True,
                          check=False)
    names = made.stdout.replace("\\\n", " ").split()[1:]
    paths = {(Path(entry["directory"]) / name).resolve() for name in names} | {Path(entry["file"])}
    return sorted(path for path in paths if path.is_relative_to(TOP))


def digest(entry, files):
    """Of all that decides what clang-tidy says of this source."""
    state = hashlib.sha256(entry["command"].encode())
    for path in [*files, *sorted(TOP.glob("**/.clang-tidy"))]:
        state.update(path.read_bytes())
    return state.hexdigest()


def changed_files():
    """Files that differ from main or are new."""
    base = run("git", "merge-base", "HEAD", "main").stdout.strip() or "HEAD"
    names = run("git", "diff", "--name-only", base).stdout.splitlines()
    names += run("git", "ls-files", "--others", "--exclude-standard").stdout.splitlines()
    return {TOP / name for name in names}


def tidy(entry, wanted):
    """(file, output) where clang-tidy complains; None where it passes or the source is not wanted."""
    files = own_headers(entry)
    if wanted is not None and not wanted.intersection(files):
        return None
    mark = PASSED / digest(entry, files)
    if mark.exists():
        return None
    done = run("clang-tidy-19", "--quiet", "-p", str(BUILD), entry["file"])
    if done.returncode == 0:
        mark.touch()
        return None
    return os.path.relpath(entry["file"], TOP), done.stdout + done.stderr


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="every source, not only the changed ones")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("files", nargs="*", metavar="FILE")
    arguments = parser.parse_args()
    database = BUILD / "compile_commands.json"
    if not database.is_file():
        sys.exit(f"{database}: missing; run cmake --preset clang")
    PASSED.mkdir(exist_ok=True)
    sources = [entry for entry in json.loads(database.read_text())
               if Path(entry["file"]).is_relative_to(TOP) and not Path(entry["file"]).is_relative_to(TOP / "build")]
    wanted = None if arguments.all else changed_files()
    if arguments.files:
        wanted = {Path(name).resolve() for name in arguments.files}
    with ThreadPoolExecutor(arguments.jobs) as pool:
        complaints = []
        for found in pool.map(lambda entry: tidy(entry, wanted), sources):
            if found:
                complaints.append(found)
                print(found[1], flush=True)
    for file, _ in complaints:
        print(f"failed: {file}")
    print(f"tidy: {len(sources)} sources, {len(complaints)} with findings")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
