"""What the checks share: the tracked files, C++ text without comments and strings, and how findings are reported."""
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

CPP_SUFFIXES = (".cpp", ".hpp", ".c", ".h", ".cpp.in")

# Comments, raw strings, strings and characters; a digit separator is none of them.
_HIDDEN = re.compile(
    r"""//(?:\\\n|[^\n])*"""
    r"""|/\*.*?\*/"""
    r"""|R"(?P<delimiter>[^()\\\s]{0,16})\(.*?\)(?P=delimiter)\""""
    r"""|"(?:\\.|[^"\\\n])*\""""
    r"""|(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+'""",
    re.DOTALL | re.VERBOSE,
)

@dataclass(frozen=True, order=True)
class Finding:
    """One violation: a file below the top of the project, a line from 1, and a sentence."""

    path: str
    line: int
    message: str

    def __str__(self):
        return f"{self.path}:{self.line}: {self.message}"


def is_cpp(path):
    return path.endswith(CPP_SUFFIXES)


def strip_code(text):
    """C++ text with every comment blanked and every literal emptied; lines keep their numbers."""

    def blank(match):
        hidden = match.group(0)
        if hidden.startswith(("//", "/*")):
            return " " + "\n" * hidden.count("\n")
        quote = "'" if hidden.startswith("'") else '"'
        return quote + quote + "\n" * hidden.count("\n")

    return _HIDDEN.sub(blank, text)


class Project:
    """The files of one work tree as `{path: text}`; a test makes one from a dictionary."""

    def __init__(self, files):
        self.files = dict(files)

    @staticmethod
    def tracked(top):
        """All files that git tracks or would add below `top`, except deleted and binary ones."""
        listing = subprocess.run(
            ["git", "-C", top, "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            check=True, capture_output=True, text=True).stdout
        files = {}
        for path in sorted(set(filter(None, listing.split("\0")))):
            file = Path(top) / path
            if file.is_file():
                try:
                    files[path] = file.read_text(encoding="utf-8")
                except UnicodeDecodeError:
                    continue
        return Project(files)

    def cpp(self):
        """(path, text) of every C++ source."""
        return [(path, text) for path, text in self.files.items() if is_cpp(path)]


def top_of(script):
    """The top of the project that a script of tools/check belongs to."""
    return str(Path(script).resolve().parents[2])


def main(name, check, script):
    """Runs `check(project) -> findings` over the tracked files; prints them and the count; the exit code is 1 if any."""
    if len(sys.argv) > 1:
        print(sys.modules["__main__"].__doc__)
        return 0 if sys.argv[1] in ("-h", "--help") else 2
    project = Project.tracked(top_of(script))
    findings = sorted(check(project))
    for finding in findings:
        print(finding)
    print(f"{name}: {len(project.files)} files, {len(findings)} findings")
    return 1 if findings else 0
