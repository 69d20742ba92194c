#!/usr/bin/env python3
"""Makes manual pages and bash completion from what the programs say of themselves.

Usage: packaging/manual.py --version VERSION --output FOLDER PROGRAM...

Each program's --help, and that of its verbs, is the one source: it is printed by CLI11 from the options' declarations. FOLDER gets
NAME.1 (NAME.8 for a daemon, whose name ends in d) and NAME.bash for each. Ends with 1 where a program has no help that can be read.
"""
import argparse
import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

COLUMN = 30  # where CLI11 begins descriptions
HEADINGS = ("Positionals:", "Options:", "Subcommands:")
SEE_ALSO = {"geoflow": "geoflowd(8)", "geoflowd": "geoflow(1), systemd.service(5)"}
SECTION = {"geoflow": 1, "geoflowd": 8}


@dataclass
class Command:
    """A program or a verb: its help in parts. Entries are (left column, description)."""

    words: list
    summary: str = ""
    usage: str = ""
    entries: dict = field(default_factory=lambda: {heading: [] for heading in HEADINGS})
    footer: list = field(default_factory=list)
    verbs: list = field(default_factory=list)

    def options(self):
        """Every option's spellings."""
        return [name for left, _ in self.entries["Options:"] for name in left.split()[0].split(",")]


def parse(words, text):
    """The help text of one command."""
    command = Command(words)
    lines = iter(text.rstrip().splitlines())
    command.summary = next(lines, "").rstrip(".")
    heading = None
    for line in lines:
        if line.startswith("Usage: "):
            command.usage = line.removeprefix("Usage: ")
        elif line in HEADINGS and not command.footer:
            heading = line
        elif not line:
            heading = None
            if command.footer:
                command.footer.append(line)
        elif heading and line.startswith(" " * COLUMN):
            left, description = command.entries[heading][-1]
            command.entries[heading][-1] = (left, f"{description} {line.strip()}".strip())
        elif heading and line.startswith("  "):
            fits = line[COLUMN - 1:COLUMN] in ("", " ")
            command.entries[heading].append((line[:COLUMN].strip(), line[COLUMN:].strip()) if fits else (line.strip(), ""))
        else:
            command.footer.append(line)
    if not command.summary or not command.usage or not command.entries["Options:"]:
        sys.exit(f"manual.py: the help of {' '.join(words)} cannot be read")
    return command


def ask(program, words):
    """A command and its verbs, as the program describes them."""
    done = subprocess.run([program, *words[1:], "--help"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"manual.py: {' '.join(words)} --help ends with {done.returncode}: {done.stderr.strip()}")
    command = parse(words, done.stdout)
    command.verbs = [ask(program, [*words, name]) for name, _ in command.entries["Subcommands:"]]
    return command


def escape(text):
    """Text for troff: no escapes, no control lines, and its minus as it is typed."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^(?=[.'])", r"\\&", text)


def entry(left, description):
    return f".TP\n\\fB{escape(left)}\\fR\n{escape(description)}\n"


def footer(command, heading):
    if not command.footer:
        return ""
    lines = "\n".join(escape(line) for line in command.footer)
    return f"{heading}\n.nf\n{lines}\n.fi\n"


def verb_section(command):
    """A verb and the verbs below it."""
    text = f".SS {escape(' '.join(command.words))}\n{escape(command.summary)}.\n.PP\n\\fB{escape(command.usage)}\\fR\n"
    for heading in ("Positionals:", "Options:"):
        text += "".join(entry(*item) for item in command.entries[heading] if item[0] != "-h,--help")
    text += footer(command, ".PP")
    return text + "".join(verb_section(verb) for verb in command.verbs)


def manual_page(command, version, date):
    name = command.words[0]
    text = f'.TH {name.upper()} {SECTION[name]} "{date}" "geoflow {version}" "GeoFlow"\n'
    summary = command.summary
    if summary.split()[0].istitle():  # no name of its own
        summary = summary[0].lower() + summary[1:]
    text += f".SH NAME\n{name} \\- {escape(summary)}\n"
    text += f".SH SYNOPSIS\n\\fB{escape(command.usage)}\\fR\n"
    text += ".SH OPTIONS\n" + "".join(entry(*item) for item in command.entries["Options:"])
    if command.verbs:
        text += ".SH VERBS\n" + "".join(verb_section(verb) for verb in command.verbs)
    text += footer(command, ".SH NOTES")
    text += ".SH FILES\n" + "".join(entry(*item) for item in (
        ("/etc/geoflow/geoflow.toml", "the service's configuration"),
        ("/run/geoflow/pose.sock, /run/geoflow/ctl.sock", "the service's sockets"),
        ("/var/lib/geoflow", "its maps"),
        ("/usr/share/doc/geoflow", "protocol, formats, configuration with every key")))
    return text + f".SH SEE ALSO\n{escape(SEE_ALSO[name])}\n"


def completion(command):
    """A bash completion: verbs, then options; the value of an option, and what else there is, is a file."""
    name = command.words[0]
    cases = ""

    def add(node):
        nonlocal cases
        words = " ".join([verb.words[-1] for verb in node.verbs] + node.options())
        cases += f'    "{" ".join(node.words[1:])}") words="{words}" ;;\n'
        for verb in node.verbs:
            add(verb)

    add(command)
    return f"""# bash completion for {name}, made from its --help.
_{name}() {{
  local word path= words= i
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${{COMP_WORDS[i]}}
    case "${{path:+$path }}$word" in
{verb_pattern(command)}    esac
  done
  case "$path" in
{cases}  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}")
}}
complete -o bashdefault -o default -F _{name} {name}
"""


def verb_pattern(command):
    """The case that follows the verbs on a line; a program without verbs has none."""
    paths = []

    def add(node):
        for verb in node.verbs:
            paths.append(" ".join(verb.words[1:]))
            add(verb)

    add(command)
    return f"      {' | '.join(f'{chr(34)}{path}{chr(34)}' for path in paths)}) path=\"${{path:+$path }}$word\" ;;\n" if paths else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--version", required=True)
    parser.add_argument("--output", required=True, type=Path)
    parser.add_argument("programs", nargs="+", metavar="PROGRAM")
    options = parser.parse_args()
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    date = datetime.fromtimestamp(seconds, timezone.utc).strftime("%Y-%m-%d")
    for program in options.programs:
        name = Path(program).name
        if name not in SECTION:
            parser.error(f"{program} is none of {', '.join(SECTION)}")
        command = ask(str(Path(program).resolve()), [name])
        (options.output / f"{name}.{SECTION[name]}").write_text(manual_page(command, options.version, date))
        (options.output / f"{name}.bash").write_text(completion(command))


if __name__ == "__main__":
    main()
