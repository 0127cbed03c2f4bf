#!/usr/bin/env python3
"""Checks that docs/options.md names every option of the program, and docs/reports.md every JSON key and CSV column.

usage: check_reference.py PROGRAM
"""

import json
import os
import re
import subprocess
import sys
import tempfile

DOCS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "docs")
COMMANDS = ("run", "replay", "record", "convert", "scale", "profile", "node")
RUN = "--objects 300 --users 20 --frames 6 --warmup 2 --quiet"
SCALE = "--objects 300 --users 20 --nodes 1,2 --frames 3 --warmup 1 --repeats 1 --quiet"
REPORTS = (f"run {RUN} --nodes 2 --resize 1:3 --rays 5 --check --json FILE", f"profile {RUN} --json FILE",
           f"scale {SCALE} --model 2004 --json FILE",
           f"run {RUN} --status FILE")
TABLES = (f"run {RUN} --frames-csv FILE", f"scale {SCALE} --csv FILE")
# Keys whose names are values: names of statuses, costs and parts.
OPEN = {"costs", "parts_ms", "refused"}


def read(page):
    with open(os.path.join(DOCS, page), encoding="utf-8") as file:
        return file.read()


def names_of(page):
    """The names in backticks, with the ranges such as `m1_bytes` to `m5_bytes` written out."""
    text = re.sub(r"```.*?```", "", read(page), flags=re.DOTALL)
    names = {name for quoted in re.findall(r"`([^`\n]+)`", text) for name in re.findall(r"[a-z0-9_]+", quoted)}
    if "`move_ms` to `notify_ms`" in text:
        names |= {f"{stage}_ms" for stage in ("ingest", "broad_phase", "dispatch", "narrow_phase", "collect")}
    return names | {f"m{i}{of}" for i in range(1, 6) for of in ("", "_bytes")}


def keys_of(value):
    if isinstance(value, list):
        return set().union(*map(keys_of, value))
    if not isinstance(value, dict):
        return set()
    return set(value) | set().union(*(keys_of(child) for key, child in value.items() if key not in OPEN))


def output_of(program, arguments, file):
    done = subprocess.run([program, *arguments.replace("FILE", file).split()], stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise SystemExit(f"ringfence {arguments}: exit code {done.returncode}")
    return done.stdout


def main():
    program = sys.argv[1]
    missing = []
    options = set(re.findall(r"--[a-z][a-z-]*", read("options.md")))
    for command in COMMANDS:
        found = set(re.findall(r"^ +(?:-h,)?(--[a-z][a-z-]*)", output_of(program, f"{command} --help", ""), re.M))
        missing += [f"docs/options.md does not name {option} of {command}" for option in sorted(found - options)]
    names = names_of("reports.md")
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "report")
        for arguments in REPORTS:
            output_of(program, arguments, file)
            with open(file, encoding="utf-8") as report:
                found = keys_of(json.load(report))
            missing += [f"docs/reports.md does not name {key} of {arguments}" for key in sorted(found - names)]
        for arguments in TABLES:
            output_of(program, arguments, file)
            with open(file, encoding="utf-8") as table:
                found = set(table.readline().strip().split(","))
            missing += [f"docs/reports.md does not name {column} of {arguments}" for column in sorted(found - names)]
    print("\n".join(missing) or "every option, key and column is named")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
