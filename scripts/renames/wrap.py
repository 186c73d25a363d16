#!/usr/bin/env python3
"""Wraps docstring and comment lines that renaming has made longer than 120 characters: `wrap.py FILE ...` (run after `ruff format`).

Words go to the next line of the same paragraph; lines of code, and code with a comment behind it, are left to `ruff format` and to you.
"""
import ast
import sys
from pathlib import Path

WIDTH = 120


def docstring_lines(text):
    lines = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and ast.get_docstring(node, clean=False) is not None:
            value = node.body[0].value
            lines.update(range(value.lineno, value.end_lineno + 1))
    return lines


def wrap(text):
    lines = text.split("\n")
    left = 0
    i = 0
    inside = docstring_lines(text)
    kinds = ["doc" if n in inside else "comment" if line.lstrip().startswith("#") else "code" for n, line in enumerate(lines, 1)]
    while i < len(lines):
        line, kind = lines[i], kinds[i]
        if len(line) <= WIDTH:
            i += 1
            continue
        indent = line[: len(line) - len(line.lstrip())]
        prefix = indent + ("# " if kind == "comment" else "")
        at = line.rfind(" ", len(prefix) + 20, WIDTH + 1)
        if kind == "code" or at < 0 or "  " in line.strip()[3:]:  # a table or a diagram
            left += 1
            i += 1
            continue
        head, tail = line[:at].rstrip(), line[at + 1:]
        lines[i] = head
        after = lines[i + 1] if i + 1 < len(lines) else ""
        body = after[len(prefix):]
        joins = (kinds[i + 1: i + 2] == [kind] and after.startswith(prefix) and body[:1] not in ("", " ", "-", "*", '"') and not line.endswith('"""')
                 and not (kind == "comment" and not body.strip()))
        if joins:
            lines[i + 1] = prefix + tail + " " + body
        else:
            lines.insert(i + 1, prefix + tail)
            kinds.insert(i + 1, kind)
        i += 1
    return "\n".join(lines), left


for name in sys.argv[1:]:
    before = Path(name).read_text()
    after, left = wrap(before)
    if after != before:
        ast.parse(after)
        Path(name).write_text(after)
    if left:
        print(name, left, "lines left")
