#!/usr/bin/env python3
"""Applies rename tables (TSV) to a worktree, precisely: names are resolved, not searched for.

    .venv/bin/python apply.py [--root DIR] [--dry-run] [--fill] [--commit] [--no-types] TABLE.tsv ...

A row is: kind, old, new, scope, reason (tab separated; '#' begins a comment).

    module    app.jobs.bench                    app.jobs.worker_context     a file or a package (a folder); 'new' may be in another folder
    class     app.jobs.bench:Bench              WorkerContext               also function, constant: anything at a module's level
    method    app.jobs.bench:Bench.noted        take_notes                  also field: members; overrides and protocols go along
    method    *.looked_away                     view_changed                members of every class of the scope (prefixes, 'app,ui')
    local     engine.indirect._x:f.poles        axes                        a parameter or variable; keywords at calls go along
    local     engine.indirect.*:*.poles         axes                        in all functions of these modules
    place     tests/x.py:.sent                  outgoing_radiance           attributes of unknown type of this name in this file
    string    told                              uploaded                    a whole word in string literals and docstrings of the scope

A kind may end in '+doc': then whole words in the docstrings and comments of the scope's modules (default: of the defining module, for members
and locals) are replaced as well.  'scope' is ignored for qualified rows; --fill writes there where each row applies.

How it resolves: module-level names, imports and locals by Python's own scoping (ast); attributes and keywords by mypy's types (one build of
everything, tests included, without its cache: one to two minutes); what mypy does not know (numba kernels) by the classes that the file sees,
and only where all candidates agree. The rest is reported as AMBIGUOUS and left alone.
Text: dotted paths (`app.x.y`, `app.x:y`, `app/x.py`) everywhere, identifiers in backticks in docstrings, comments and Markdown.
With --commit each table becomes one commit, all computed from one analysis.
"""
from __future__ import annotations

import argparse
import ast
import builtins
import fnmatch
import io
import os
import pickle
import re
import subprocess
import sys
import time
import tokenize
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

TOP = ("engine", "app", "ui", "tests", "assets", "scripts", "benchmarks", "examples", "insitu")
TEXT = re.compile(r".*(\.md|\.toml|Makefile|\.sh|\.glsl|\.ya?ml|\.cfg|\.txt|\.ci/run|\.rst)$")
SKIP_TEXT = ("assets/scenes/", "assets/materials/", "CHANGELOG.md", "LICENSE", "constraints.txt")
WORD = re.compile(r"[A-Za-z_]\w*")


@dataclass(frozen=True)
class Row:
    kind: str
    old: str
    new: str
    scope: str
    reason: str
    table: str
    doc: bool

    @property
    def module(self) -> str:
        return self.old.partition(":")[0]

    @property
    def name(self) -> str:
        return self.old.rpartition(":")[2].rpartition(".")[2] if self.kind not in ("module", "place") else self.old.rpartition(":.")[2] if self.kind == "place" else self.old


def read_rows(paths):
    rows = []
    for path in paths:
        for number, line in enumerate(Path(path).read_text().splitlines(), 1):
            if not line.strip() or line.startswith("#") or line.startswith("kind\t"):
                continue
            parts = line.split("\t") + [""] * 5
            kind, old, new, scope, reason = (p.strip() for p in parts[:5])
            doc = kind.endswith("+doc")
            kind = kind.removesuffix("+doc")
            if kind not in {"module", "class", "method", "field", "constant", "function", "local", "string", "place"}:
                sys.exit(f"{path}:{number}: no such kind: {kind}")
            if kind == "module" and not re.fullmatch(r"[\w.]+", new) or kind not in ("module", "string") and not new.isidentifier():
                sys.exit(f"{path}:{number}: new name {new!r}")
            rows.append(Row(kind, old, new, scope, reason, str(path), doc))
    return rows


# ---------------------------------------------------------------- the code base

@dataclass
class Ref:
    """A name in a file: its place (line, byte column), what it means. target: 'sym m:n', 'mod m', 'loc m:q.n', 'mem m:C.n', 'any .n'."""
    file: str
    line: int
    col: int
    name: str
    kind: str
    targets: frozenset[str]
    where: str = ""
    note: str = ""


class Base:
    def __init__(self, root: Path):
        self.root = root
        listed = subprocess.check_output(["git", "ls-files"], cwd=root, text=True).split("\n")
        self.py = [f for f in listed if f.endswith(".py") and f.split("/")[0].removesuffix(".py") in TOP and (root / f).exists()]
        self.text = [f for f in listed if TEXT.match(f) and not f.startswith(SKIP_TEXT) and (root / f).exists()]
        self.source = {f: (root / f).read_text() for f in self.py + self.text}
        self.module_of = {f: f[:-3].replace("/", ".").removesuffix(".__init__") for f in self.py}
        self.file_of = {m: f for f, m in self.module_of.items()}
        self.packages = set(self.file_of)
        for m in list(self.file_of):
            while "." in m:
                m = m.rpartition(".")[0]
                self.packages.add(m)
        self.trees = {f: ast.parse(self.source[f]) for f in self.py}
        self.bytes_ = {f: self.source[f].encode().split(b"\n") for f in self.py}
        self.bindings: dict[str, dict[str, str]] = {}
        self.defs: dict[str, dict[str, str]] = {}
        self.classes: dict[str, dict] = {}
        self.functions: dict[str, ast.AST] = {}
        for f in self.py:
            self._collect(f)
        self._bases()

    def _collect(self, f):
        module, tree = self.module_of[f], self.trees[f]
        names, defs = {}, {}
        is_package = f.endswith("__init__.py")

        def absolute(node):
            if not node.level:
                return node.module or ""
            parts = module.split(".") if is_package else module.split(".")[:-1]
            parts = parts[: len(parts) - (node.level - 1)]
            return ".".join(parts + ([node.module] if node.module else []))

        self_absolute = self.__dict__.setdefault("absolute", {})
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                self_absolute[id(node)] = absolute(node)

        def body(nodes):
            for n in nodes:
                if isinstance(n, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                    defs[n.name] = "class" if isinstance(n, ast.ClassDef) else "function"
                elif isinstance(n, ast.ImportFrom):
                    for a in n.names:
                        names[a.asname or a.name] = self._imported(absolute(n), a.name)
                elif isinstance(n, ast.Import):
                    for a in n.names:
                        names[a.asname or a.name.split(".")[0]] = f"mod {a.name if a.asname else a.name.split('.')[0]}"
                else:
                    for t in ast.walk(n):
                        if isinstance(t, ast.Name) and isinstance(t.ctx, ast.Store):
                            defs.setdefault(t.id, "constant")
                    for part in ("body", "orelse", "finalbody"):
                        body(getattr(n, part, []))
                    for h in getattr(n, "handlers", []):
                        body(h.body)

        body(tree.body)
        self.bindings[module], self.defs[module] = names, defs

        def classes(nodes, prefix):
            for n in nodes:
                if isinstance(n, ast.ClassDef):
                    members = {}
                    for s in n.body:
                        for t in ([s] if isinstance(s, (ast.FunctionDef, ast.AsyncFunctionDef)) else []):
                            members.setdefault(t.name, "method")
                        if isinstance(s, ast.AnnAssign) and isinstance(s.target, ast.Name):
                            members.setdefault(s.target.id, "field")
                        if isinstance(s, ast.Assign):
                            for t in s.targets:
                                for x in ast.walk(t):
                                    if isinstance(x, ast.Name):
                                        members.setdefault(x.id, "field")
                        if isinstance(s, (ast.FunctionDef, ast.AsyncFunctionDef)) and s.args.args:
                            me = s.args.args[0].arg
                            for x in ast.walk(s):
                                if isinstance(x, ast.Attribute) and isinstance(x.ctx, ast.Store) and isinstance(x.value, ast.Name) and x.value.id == me:
                                    members.setdefault(x.attr, "field")
                    self.classes[f"{module}:{prefix}{n.name}"] = {"node": n, "members": members, "bases": [], "file": f}
                    classes(n.body, prefix + n.name + ".")
                elif isinstance(n, (ast.FunctionDef, ast.AsyncFunctionDef)):
                    self.functions[f"{module}:{prefix}{n.name}"] = n
                    classes(n.body, prefix + n.name + ".")
                elif isinstance(n, (ast.If, ast.Try, ast.With)):
                    classes(n.body, prefix)
                    classes(getattr(n, "orelse", []), prefix)

        classes(tree.body, "")

    def _imported(self, module, name):
        if f"{module}.{name}" in self.packages and name not in self.defs.get(module, {}):
            return f"mod {module}.{name}"
        return f"sym {module}:{name}"

    def canonical(self, target, depth=0):
        """Follows re-exports."""
        if depth > 9 or not target.startswith("sym "):
            return target
        module, name = target[4:].split(":", 1)
        if name in self.defs.get(module, {}):
            return target
        if name in self.bindings.get(module, {}):
            return self.canonical(self.bindings[module][name], depth + 1)
        if f"{module}.{name}" in self.packages:
            return f"mod {module}.{name}"
        return target

    def resolve(self, module, name):
        if name in self.defs.get(module, {}):
            return f"sym {module}:{name}"
        if name in self.bindings.get(module, {}):
            return self.canonical(self.bindings[module][name])
        return None

    def static(self, module, node, lookup):
        """What an expression of names and dots means, without types."""
        if isinstance(node, ast.Name):
            return lookup(node.id)
        if isinstance(node, ast.Attribute):
            inner = self.static(module, node.value, lookup)
            if inner and inner.startswith("mod "):
                m = inner[4:]
                if node.attr in self.defs.get(m, {}) or node.attr in self.bindings.get(m, {}):
                    return self.canonical(f"sym {m}:{node.attr}")
                if f"{m}.{node.attr}" in self.packages:
                    return f"mod {m}.{node.attr}"
                return f"sym {m}:{node.attr}" if m.split(".")[0] in TOP else None
            if inner and inner.startswith("sym ") and inner[4:] in self.classes:
                return f"mem {self.owner(inner[4:], node.attr)}.{node.attr}"
        if isinstance(node, ast.Subscript):
            return self.static(module, node.value, lookup)
        return None

    def _bases(self):
        for key, c in self.classes.items():
            module = key.split(":")[0]
            for b in c["node"].bases:
                t = self.static(module, b, lambda n: self.resolve(module, n))
                if t and t.startswith("sym ") and t[4:] in self.classes:
                    c["bases"].append(t[4:])
            c["protocol"] = any("Protocol" in ast.unparse(b) for b in c["node"].bases)
        for key in self.classes:
            self.classes[key]["mro"] = self._mro(key, set())

    def _mro(self, key, seen):
        if key in seen:
            return []
        seen.add(key)
        result = [key]
        for b in self.classes[key]["bases"]:
            result += self._mro(b, seen)
        return result

    def owner(self, key, name):
        for c in self.classes[key]["mro"]:
            if name in self.classes[c]["members"]:
                return c
        return key


# ---------------------------------------------------------------- types, by mypy

def types_of(base: Base, cache: Path):
    stamp = hash_of(base)
    if cache.exists():
        kept = pickle.loads(cache.read_bytes())
        if kept[0] == stamp:
            return kept[1], kept[2]
    from mypy import build
    from mypy.modulefinder import BuildSource
    from mypy.nodes import CallExpr, Decorator, FuncDef, MemberExpr, Node, OverloadedFuncDef, RefExpr, TypeInfo, Var
    from mypy.options import Options
    from mypy.types import (AnyType, CallableType, Instance, LiteralType, Overloaded, TupleType, TypedDictType, TypeType, TypeVarType,
                            UnionType, get_proper_type)

    os.chdir(base.root)
    options = Options()
    options.incremental, options.cache_dir = False, os.devnull
    options.export_types = options.preserve_asts = True
    options.check_untyped_defs = True
    options.ignore_missing_imports = True
    options.python_version = sys.version_info[:2]
    options.python_executable = sys.executable
    options.show_traceback = True
    options.namespace_packages = options.explicit_package_bases = True
    sources = [BuildSource(f, base.module_of[f], None) for f in base.py if f.split("/")[0] in TOP]
    options.mypy_path = [str(base.root)]
    began = time.process_time()
    result = build.build(sources, options)
    print(f"mypy: {time.process_time() - began:.0f} s of the processor, {len(result.errors)} lines of errors", file=sys.stderr)
    table = result.types

    def key_of(info: TypeInfo):
        return f"{info.module_name}:{info.fullname[len(info.module_name) + 1:]}"

    def infos(t):
        t = get_proper_type(t) if t is not None else None
        if t is None:
            return None
        if isinstance(t, Instance):
            return {t.type}
        if isinstance(t, UnionType):
            found = set()
            for item in t.items:
                found |= infos(item) or set()
            return found
        if isinstance(t, TypeVarType):
            return infos(t.upper_bound)
        if isinstance(t, TupleType):
            return {t.partial_fallback.type}
        if isinstance(t, TypedDictType):
            return {t.fallback.type}
        if isinstance(t, LiteralType):
            return {t.fallback.type}
        if isinstance(t, TypeType):
            return infos(t.item)
        if isinstance(t, (CallableType, Overloaded)) and t.is_type_obj():
            return {t.type_object()}
        if isinstance(t, AnyType):
            return None
        return set()

    def owners(t, name):
        found = infos(t)
        if found is None:
            return None
        result = set()
        for info in found:
            for c in info.mro:
                if name in c.names:
                    result.add(f"{key_of(c)}")
                    break
            else:
                result.add(key_of(info))
        return result

    members: dict[str, dict] = defaultdict(dict)
    calls: dict[str, dict] = defaultdict(dict)

    def on_member(path, o):
        t = table.get(o.expr)
        if t is None and isinstance(o.expr, RefExpr) and isinstance(o.expr.node, TypeInfo):
            members[path][o.end_line, o.end_column, o.name] = {key_of(o.expr.node)}
            return
        members[path][o.end_line, o.end_column, o.name] = owners(t, o.name) if t is not None else None

    def on_call(path, o):
        if not any(o.arg_names):
            return
        found = set()
        node = o.callee.node if isinstance(o.callee, RefExpr) else None
        if isinstance(node, TypeInfo):
            found.add("class " + key_of(node))
        elif isinstance(node, (FuncDef, OverloadedFuncDef, Decorator)) and not isinstance(o.callee, MemberExpr):
            found.add("func " + node.fullname)
        if isinstance(o.callee, MemberExpr) and o.callee.name == "_replace":
            for info in infos(table.get(o.callee.expr)) or ():
                found.add("class " + key_of(info))
        if node is not None and getattr(node, "fullname", "") == "dataclasses.replace" and o.args:
            for info in infos(table.get(o.args[0])) or ():
                found.add("class " + key_of(info))
        t = get_proper_type(table.get(o.callee)) if table.get(o.callee) is not None else None
        if isinstance(t, CallableType):
            if t.is_type_obj():
                found.add("class " + key_of(t.type_object()))
            elif isinstance(t.definition, (FuncDef, Decorator)):
                d = t.definition
                if isinstance(d, Decorator):
                    d = d.func
                found.add("func " + d.fullname)
        calls[path][o.line, o.column, o.end_line, o.end_column] = found

    # mypy's own visitors are compiled and cannot be derived from: children are found by attribute, once for each class of nodes
    skipped = {"node", "info", "type", "analyzed", "names", "original_def", "expanded", "unanalyzed_type", "def_info", "alias_type",
               "defn_info", "special_alias", "type_guard", "deco_line", "method_types", "right_always", "old_type", "new_type", "path",
               "is_stub", "ignored_lines", "future_import_flags", "imports", "plugin_deps", "metaclass_expr_info", "type_annotation",
               "arg_names", "arg_kinds", "unanalyzed_items", "definition", "var", "func_def", "original_first_arg"}
    fields: dict = {}

    def children(o):
        kind = o.__class__
        if kind not in fields:
            fields[kind] = [n for n in dir(kind) if not n.startswith("_") and n not in skipped and not callable(getattr(kind, n, None))]
        for n in fields[kind]:
            try:
                yield getattr(o, n)
            except AttributeError:
                continue

    def walk(path, root):
        stack, seen = [root], set()
        while stack:
            o = stack.pop()
            if isinstance(o, (list, tuple)):
                stack.extend(o)
            elif isinstance(o, Node) and not isinstance(o, (TypeInfo, Var)) and id(o) not in seen:
                seen.add(id(o))
                if isinstance(o, MemberExpr):
                    on_member(path, o)
                elif isinstance(o, CallExpr):
                    on_call(path, o)
                stack.extend(children(o))

    for f in base.py:
        tree = result.files.get(base.module_of[f])
        if tree is not None:
            walk(f, tree.defs)
    kept = (stamp, {k: dict(v) for k, v in members.items()}, {k: dict(v) for k, v in calls.items()})
    cache.write_bytes(pickle.dumps(kept))
    return kept[1], kept[2]


def hash_of(base):
    import hashlib
    h = hashlib.blake2b()
    for f in sorted(base.py):
        h.update(f.encode() + b"\0" + base.source[f].encode() + b"\0")
    return h.hexdigest()


# ---------------------------------------------------------------- references

class Finder(ast.NodeVisitor):
    """All references of one file."""

    def __init__(self, base: Base, f: str, members, calls, refs):
        self.base, self.f, self.module = base, f, base.module_of[f]
        self.members, self.calls, self.refs = members.get(f, {}), calls.get(f, {}), refs
        self.scopes: list[tuple[str, str, dict]] = []  # (kind, qualname, names -> target)
        self.lines = base.bytes_[f]

    def run(self):
        self.visit(self.base.trees[self.f])

    # scoping
    def qual(self):
        return self.scopes[-1][1] if self.scopes else ""

    def lookup(self, name, from_class=True):
        for i, (kind, qual, names) in enumerate(reversed(self.scopes)):
            if kind == "class" and i > 0:
                continue
            if name in names:
                return names[name]
        return self.base.resolve(self.module, name)

    def add(self, line, col, name, kind, targets, note=""):
        if isinstance(targets, str):
            targets = [targets]
        self.refs.append(Ref(self.f, line, col, name, kind, frozenset(targets), self.qual(), note))

    def local_names(self, node, qual):
        """Names bound in a function, not in those within it."""
        names = {}
        declared = set()

        def bind(n):
            names.setdefault(n, f"loc {self.module}:{qual}.{n}")

        a = node.args
        for x in a.posonlyargs + a.args + a.kwonlyargs + ([a.vararg] if a.vararg else []) + ([a.kwarg] if a.kwarg else []):
            bind(x.arg)

        def walk(n):
            if isinstance(n, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                bind(n.name)
                return
            if isinstance(n, ast.Lambda):
                return
            if isinstance(n, (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)):
                for g in n.generators[:1]:
                    walk(g.iter)
                for x in ast.walk(n):
                    if isinstance(x, ast.NamedExpr):
                        bind(x.target.id)
                return
            if isinstance(n, (ast.Global, ast.Nonlocal)):
                declared.update(n.names)
            if isinstance(n, ast.Name) and isinstance(n.ctx, (ast.Store, ast.Del)):
                bind(n.id)
            if isinstance(n, ast.ExceptHandler) and n.name:
                bind(n.name)
            if isinstance(n, (ast.MatchAs, ast.MatchStar)) and n.name:
                bind(n.name)
            if isinstance(n, ast.ImportFrom):
                for x in n.names:
                    names[x.asname or x.name] = self.base.canonical(self.base._imported(self.base.absolute[id(n)], x.name))
            if isinstance(n, ast.Import):
                for x in n.names:
                    names[x.asname or x.name.split(".")[0]] = f"mod {x.name if x.asname else x.name.split('.')[0]}"
            for child in ast.iter_child_nodes(n):
                walk(child)

        for s in (node.body if isinstance(node.body, list) else [node.body]):
            walk(s)
        for n in declared:
            names.pop(n, None)
        return names

    def visit_FunctionDef(self, node):
        for d in node.decorator_list:
            self.visit(d)
        in_class = self.scopes and self.scopes[-1][0] == "class"
        qual = (self.qual() + "." if self.qual() else "") + node.name
        col = self.name_after(node, b"def")
        if in_class:
            self.add(*col, node.name, "def", f"mem {self.module}:{self.qual()}.{node.name}")
        elif self.scopes:
            self.add(*col, node.name, "def", f"loc {self.module}:{self.qual()}.{node.name}")
        else:
            self.add(*col, node.name, "def", f"sym {self.module}:{node.name}")
        a = node.args
        for d in a.defaults + [k for k in a.kw_defaults if k]:
            self.visit(d)
        for x in a.posonlyargs + a.args + a.kwonlyargs + ([a.vararg] if a.vararg else []) + ([a.kwarg] if a.kwarg else []):
            if x.annotation:
                self.visit(x.annotation)
        if node.returns:
            self.visit(node.returns)
        self.scopes.append(("func", qual, self.local_names(node, qual)))
        for x in a.posonlyargs + a.args + a.kwonlyargs + ([a.vararg] if a.vararg else []) + ([a.kwarg] if a.kwarg else []):
            self.add(x.lineno, x.col_offset, x.arg, "param", f"loc {self.module}:{qual}.{x.arg}")
        for s in node.body:
            self.visit(s)
        self.scopes.pop()

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_Lambda(self, node):
        qual = (self.qual() + "." if self.qual() else "") + "<lambda>"
        for d in node.args.defaults + [k for k in node.args.kw_defaults if k]:
            self.visit(d)
        a = node.args
        self.scopes.append(("func", qual, self.local_names(node, qual)))
        for x in a.posonlyargs + a.args + a.kwonlyargs + ([a.vararg] if a.vararg else []) + ([a.kwarg] if a.kwarg else []):
            self.add(x.lineno, x.col_offset, x.arg, "param", f"loc {self.module}:{qual}.{x.arg}")
        self.visit(node.body)
        self.scopes.pop()

    def visit_comprehension_scope(self, node, results):
        first = node.generators[0]
        self.visit(first.iter)
        enclosing = self.qual()
        names = {}
        for g in node.generators:
            for x in ast.walk(g.target):
                if isinstance(x, ast.Name):
                    names[x.id] = f"loc {self.module}:{enclosing}.{x.id}"
        self.scopes.append(("func", enclosing, names))
        for i, g in enumerate(node.generators):
            if i:
                self.visit(g.iter)
            self.visit(g.target)
            for c in g.ifs:
                self.visit(c)
        for r in results:
            self.visit(r)
        self.scopes.pop()

    def visit_ListComp(self, node):
        self.visit_comprehension_scope(node, [node.elt])

    visit_SetComp = visit_GeneratorExp = visit_ListComp

    def visit_DictComp(self, node):
        self.visit_comprehension_scope(node, [node.key, node.value])

    def visit_ClassDef(self, node):
        for d in node.decorator_list:
            self.visit(d)
        for b in node.bases:
            self.visit(b)
        for k in node.keywords:
            self.visit(k.value)
        qual = (self.qual() + "." if self.qual() else "") + node.name
        col = self.name_after(node, b"class")
        if self.scopes and self.scopes[-1][0] == "func":
            self.add(*col, node.name, "def", f"loc {self.module}:{self.qual()}.{node.name}")
        else:
            self.add(*col, node.name, "def", f"sym {self.module}:{qual}" if not self.scopes else f"mem {self.module}:{qual}")
        key = f"{self.module}:{qual}"
        members = self.base.classes.get(key, {"members": {}})["members"]
        bound = set()
        for s in node.body:
            if isinstance(s, (ast.FunctionDef, ast.ClassDef)):
                bound.add(s.name)
            for x in ast.walk(s) if not isinstance(s, (ast.FunctionDef, ast.ClassDef)) else ():
                if isinstance(x, ast.Name) and isinstance(x.ctx, ast.Store):
                    bound.add(x.id)
        self.scopes.append(("class", qual, {n: f"mem {key}.{n}" for n in bound if n in members or True}))
        for s in node.body:
            self.visit(s)
        self.scopes.pop()

    def name_after(self, node, word):
        """Line and byte column of the name after `def` or `class`."""
        for line in range(node.lineno, node.lineno + 3):
            text = self.lines[line - 1]
            found = re.search(rb"\b" + word + rb"\s+(" + node.name.encode() + rb")\b", text)
            if found:
                return line, found.start(1)
        raise ValueError((self.f, node.name))

    def visit_Name(self, node):
        target = self.lookup(node.id)
        if target:
            self.add(node.lineno, node.col_offset, node.id, "name", target)

    def visit_Global(self, node):
        pass

    def visit_Attribute(self, node):
        self.visit(node.value)
        col = node.end_col_offset - len(node.attr.encode())
        target = self.base.static(self.module, node, self.lookup)
        if target and target.startswith(("mod ", "sym ")):
            self.add(node.end_lineno, col, node.attr, "attr", target)
            return
        inner = self.base.static(self.module, node.value, self.lookup)
        if inner and inner.startswith("mod ") and inner[4:].split(".")[0] not in TOP:
            return  # of a library
        owners = {target[4:].rpartition(".")[0]} if target else None
        if owners is None and isinstance(node.value, ast.Name) and self.scopes:
            owners = self.self_owner(node)
        if owners is None and isinstance(node.value, ast.Call) and isinstance(node.value.func, ast.Name) and node.value.func.id == "super":
            owners = self.super_owner(node)
        if owners is None:
            owners = self.members.get((node.end_lineno, node.end_col_offset, node.attr))
        if owners is None:
            self.add(node.end_lineno, col, node.attr, "attr", f"any .{node.attr}")
        else:
            targets = {f"mem {self.base.owner(o, node.attr) if o in self.base.classes else o}.{node.attr}" for o in owners}
            if targets:
                self.add(node.end_lineno, col, node.attr, "attr", targets)

    def self_owner(self, node):
        """`self.x` within a class."""
        for kind, qual, names in reversed(self.scopes):
            if kind == "class":
                key = f"{self.module}:{qual}"
                function = next((s for s in reversed(self.scopes) if s[0] == "func"), None)
                if function and node.value.id == "self" and key in self.base.classes and self.lookup("self"):
                    return {self.base.owner(key, node.attr)}
                return None
        return None

    def super_owner(self, node):
        """`super().x` within a class."""
        qual = next((q for kind, q, _ in reversed(self.scopes) if kind == "class"), None)
        for c in self.base.classes.get(f"{self.module}:{qual}", {"mro": []})["mro"][1:]:
            if node.attr in self.base.classes[c]["members"]:
                return {c}
        return None

    def visit_Call(self, node):
        self.visit(node.func)
        for x in node.args:
            self.visit(x)
        named = [k for k in node.keywords if k.arg]
        if named:
            targets = self.callees(node)
            for k in named:
                found = set()
                for t in targets or ():
                    found |= self.keyword_targets(t, k.arg)
                if targets is None:
                    found = {f"any ={k.arg}"}
                if found:
                    self.add(k.lineno, k.col_offset, k.arg, "keyword", found)
        for k in node.keywords:
            self.visit(k.value)
        self.patched(node)

    def callees(self, node):
        if isinstance(node.func, (ast.Name, ast.Attribute)) and ast.unparse(node.func) in ("partial", "functools.partial") and node.args:
            made = ast.Call(func=node.args[0], args=[], keywords=node.keywords)
            return self.callees(ast.copy_location(made, node))
        static = self.base.static(self.module, node.func, self.lookup)
        if static and static.startswith("sym "):
            if static[4:] in self.base.classes:
                return {"class " + static[4:]}
            if static[4:] in self.base.functions:
                return {"func " + static[4:].replace(":", ".")}
        found = self.calls.get((node.lineno, node.col_offset, node.end_lineno, node.end_col_offset))
        if found:
            return found
        if static and static.startswith("mem "):
            return {"func " + static[4:].replace(":", ".")}
        return None if found is None or not static else set()

    def keyword_targets(self, callee, name):
        kind, _, full = callee.partition(" ")
        if kind == "class":
            if full not in self.base.classes:
                return set()
            for c in self.base.classes[full]["mro"]:
                init = self.base.functions.get(f"{c.replace(':', ':')}.__init__")
                if init is not None:
                    return {f"loc {c}.__init__.{name}"}
                if name in self.base.classes[c]["members"]:
                    return {f"mem {c}.{name}"}
            return {f"mem {full}.{name}"}
        parts = full.split(".")
        for i in range(len(parts) - 1, 0, -1):
            if ".".join(parts[:i]) in self.base.file_of:
                return {f"loc {'.'.join(parts[:i])}:{'.'.join(parts[i:])}.{name}"}
        return set()

    def patched(self, node):
        """monkeypatch.setattr(thing, "name", ...), getattr(thing, "name"): strings that are names."""
        f = node.func
        last = f.attr if isinstance(f, ast.Attribute) else f.id if isinstance(f, ast.Name) else ""
        if last in {"setattr", "getattr", "delattr", "hasattr", "object"} and len(node.args) >= 2 and isinstance(node.args[1], ast.Constant) \
                and isinstance(node.args[1].value, str) and node.args[1].value.isidentifier():
            name, at = node.args[1].value, node.args[1]
            made = ast.Attribute(value=node.args[0], attr=name, ctx=ast.Load())
            target = self.base.static(self.module, made, self.lookup)
            if target is None:
                owner = self.members.get((node.args[0].end_lineno, node.args[0].end_col_offset, ""))
                target = f"any .{name}" if owner is None else None
            if target:
                self.add(at.lineno, at.col_offset + 1, name, "string", target)

    def visit_Constant(self, node):
        if isinstance(node.value, str) and node.end_lineno == node.lineno and re.fullmatch(r"[\w .|\[\],]+", node.value) and \
                re.search(r"\b[A-Z]\w+", node.value):
            for m in re.finditer(r"(?<![\w.])[A-Z]\w*", node.value):  # a forward reference
                target = self.base.resolve(self.module, m.group())
                if target and target.startswith("sym ") and target[4:] in self.base.classes:
                    self.add(node.lineno, node.col_offset + 1 + m.start(), m.group(), "forward", target)

    def visit_Assign(self, node):
        if any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets):
            for x in ast.walk(node.value):
                if isinstance(x, ast.Constant) and isinstance(x.value, str):
                    target = self.base.resolve(self.module, x.value)
                    if target:
                        self.add(x.lineno, x.col_offset + 1, x.value, "string", target)
            return
        if isinstance(node.value, ast.Call) and node.value.args and isinstance(node.value.args[0], ast.Constant) and \
                isinstance(node.targets[0], ast.Name) and node.value.args[0].value == node.targets[0].id:  # a TypeVar
            target = self.base.resolve(self.module, node.targets[0].id)
            if target:
                x = node.value.args[0]
                self.add(x.lineno, x.col_offset + 1, x.value, "string", target)
        self.generic_visit(node)

    def visit_ImportFrom(self, node):
        module = self.base.absolute[id(node)]
        line = self.lines[node.lineno - 1]
        if not node.level:
            self.add(node.lineno, line.index(b"from ", node.col_offset) + 5, module, "frommodule", f"mod {module}")
        for a in node.names:
            if a.name != "*":
                self.add(a.lineno, a.col_offset, a.name, "import" if not a.asname else "importas",
                         self.base.canonical(self.base._imported(module, a.name)))

    def visit_Import(self, node):
        for a in node.names:
            self.add(a.lineno, a.col_offset, a.name, "importmodule", f"mod {a.name}")


# ---------------------------------------------------------------- renaming

class Renamer:
    def __init__(self, base: Base, refs, rows):
        self.base, self.refs, self.rows = base, refs, rows
        self.problems: list[str] = []
        self.by_row: Counter = Counter()
        self.files_of_row: dict[Row, set] = defaultdict(set)
        self.families()
        self.by_member = defaultdict(set)
        for key, c in base.classes.items():
            for m in c["members"]:
                self.by_member[m].add(f"{key}.{m}")
        self.all_names = Counter(r.name for r in refs)

    def families(self):
        """Members that are one: overrides, and what implements a protocol."""
        parent: dict[str, str] = {}

        def find(x):
            parent.setdefault(x, x)
            while parent[x] != x:
                parent[x] = parent[parent[x]]
                x = parent[x]
            return x

        for key, c in self.base.classes.items():
            for b in c["mro"][1:]:
                for m in c["members"]:
                    if m in self.base.classes[b]["members"]:
                        parent[find(f"{key}.{m}")] = find(f"{b}.{m}")
        for key, c in self.base.classes.items():
            if not c["protocol"] or key.startswith("tests"):
                continue
            wanted = {m for m in c["members"] if not m.startswith("__")}
            if len(wanted) < 2:
                continue
            for other, o in self.base.classes.items():
                has = set().union(*(self.base.classes[x]["members"] for x in o["mro"]))
                if other != key and wanted <= has:
                    for m in wanted:
                        parent[find(f"{self.base.owner(other, m)}.{m}")] = find(f"{key}.{m}")
        self.find = find

    def plan(self, rows):
        self.places = {}
        self.modules, self.symbols, self.members, self.locals_, self.wild, self.wild_locals, self.strings = {}, {}, {}, {}, [], [], []
        for row in rows:
            if row.kind == "module":
                if row.old not in self.base.packages:
                    self.problems.append(f"NO SUCH MODULE {row.old} ({row.table})")
                self.modules[row.old] = row
            elif row.kind == "string":
                self.strings.append(row)
            elif row.kind == "place":
                file, _, name = row.old.partition(":.")
                self.places[file, name] = row
            elif row.old.startswith("*."):
                self.wild.append(row)
            elif row.kind in ("method", "field"):
                module, _, qual = row.old.partition(":")
                owner = f"{module}:{qual.rpartition('.')[0]}"
                if owner not in self.base.classes or row.name not in self.base.classes[owner]["members"]:
                    self.problems.append(f"NO SUCH MEMBER {row.old} ({row.table})")
                    continue
                f = self.find(f"{owner}.{row.name}")
                if f in self.members and self.members[f].new != row.new:
                    self.problems.append(f"FAMILY TWO NAMES {row.old}: {row.new} and {self.members[f].new} ({self.members[f].old})")
                self.members[f] = row
            elif row.kind == "local":
                if "*" in row.old:
                    self.wild_locals.append(row)
                else:
                    self.locals_[row.old] = row
            else:
                module, _, name = row.old.partition(":")
                if name not in self.base.defs.get(module, {}):
                    self.problems.append(f"NO SUCH NAME {row.old} ({row.table})")
                self.symbols[row.old] = row

    def new_module(self, module):
        """The module's new dotted name, the row."""
        parts = module.split(".")
        for i in range(len(parts), 0, -1):
            head = ".".join(parts[:i])
            if head in self.modules:
                row = self.modules[head]
                return ".".join([row.new, *parts[i:]]), row
        return module, None

    def in_scope(self, row, module):
        return not row.scope or row.scope in ("-", "global") or any(
            module == s or module.startswith(s + ".") or fnmatch.fnmatch(module, s) for s in re.split(r"[,\s]+", row.scope))

    def row_of(self, target, file):
        kind, _, full = target.partition(" ")
        if kind == "sym":
            row = self.symbols.get(full)
            if row is None:  # a member of an imported class's name, or a class within one
                return None
            return row
        if kind == "mem":
            module, name = full.split(":")[0], full.rpartition(".")[2]
            row = self.members.get(self.find(full))
            if row:
                return row
            for row in self.wild:
                if row.name == name and self.in_scope(row, module) and name in self.by_member and full in self.by_member[name]:
                    return row
            return None
        if kind == "loc":
            row = self.locals_.get(full)
            if row:
                return row
            module, _, qual = full.partition(":")
            name = qual.rpartition(".")[2]
            for row in self.wild_locals:
                pattern, _, inner = row.old.partition(":")
                if row.name == name and fnmatch.fnmatch(module, pattern) and fnmatch.fnmatch(qual, inner):
                    return row
            return None
        return None

    def guess(self, ref):
        """An attribute or keyword of unknown type: by the candidates that the file sees, where they agree."""
        name = ref.name
        if (ref.file, name) in self.places:
            return self.places[ref.file, name]
        candidates = self.by_member.get(name, set()) if ref.kind != "keyword" else {
            *self.by_member.get(name, set()), *self.params.get(name, set())}
        if not candidates:
            return None
        rows = {c: self.row_of(("loc " if c in self.params.get(name, ()) and c not in self.by_member.get(name, ()) else "mem ") + c, ref.file)
                for c in candidates}
        if not any(rows.values()):
            return None
        module = self.base.module_of[ref.file]
        seen = {v[4:] for v in self.base.bindings[module].values() if v.startswith("sym ")}
        seen = {self.base.canonical("sym " + s)[4:] for s in seen}
        imported = {v[4:].split(":")[0] for v in self.base.bindings[module].values() if v.startswith("sym ")} | {
            v[4:] for v in self.base.bindings[module].values() if v.startswith("mod ")} | {module}
        package = module.rpartition(".")[0]

        def near(test):
            return {c: r for c, r in rows.items() if test(c)}

        for level, test in enumerate((lambda c: c.rpartition(".")[0] in seen or c.startswith(module + ":"),
                     lambda c: c.split(":")[0] in imported,
                     lambda c: c.split(":")[0].rpartition(".")[0] == package,
                     lambda c: module.startswith('tests'))):
            chosen = near(test) if level < 2 or ref.kind != "string" else {}
            if chosen:
                new = {r.new if r else None for r in chosen.values()}
                if len(new) == 1:
                    return next(iter(chosen.values()))
                self.problems.append(f"AMBIGUOUS {ref.file}:{ref.line} .{name}: " + ", ".join(sorted(
                    f"{c}->{r.new if r else 'stays'}" for c, r in chosen.items()))[:300])
                return None
        return None

    def edits(self, rows, quiet=False):
        """file -> list of (line, bytecol, old, new, row)."""
        self.problems = []
        self.plan(rows)
        self.params = defaultdict(set)
        for r in self.refs:
            if r.kind == "param":
                for t in r.targets:
                    self.params[r.name].add(t[4:])
        edits = defaultdict(dict)
        loose = []
        for ref in self.refs:
            new, row = self.new_of(ref)
            if row is None or new == ref.name:
                continue
            text = self.base.bytes_[ref.file][ref.line - 1]
            if text[ref.col:ref.col + len(ref.name.encode())] == ref.name.encode():
                edits[ref.file][ref.line, ref.col] = (ref.name, new, row)
            elif ref.kind not in ("string", "forward"):
                loose.append((ref, new, row))
            self.by_row[row] += 1
            self.files_of_row[row].add(self.base.module_of[ref.file])
        self.loose(loose, edits)
        if not quiet:
            self.collisions(rows)
        return edits

    def new_of(self, ref):
        if ref.kind in ("frommodule", "importmodule"):
            new, row = self.new_module(ref.name)
            return new, row
        rows = set()
        for t in ref.targets:
            if "__mypy-replace" in t:
                continue
            if t.startswith("any "):
                r = self.guess(ref)
                rows.add(r)
            elif t.startswith("mod "):
                new, row = self.new_module(t[4:])
                if row and t[4:].rpartition(".")[2] == ref.name and new.rpartition(".")[2] != ref.name:
                    return new.rpartition(".")[2], row
                rows.add(None)
            else:
                rows.add(self.row_of(t, ref.file))
        if not any(rows):
            return ref.name, None
        if len({r.new if r else None for r in rows}) > 1:
            self.problems.append(f"UNION {ref.file}:{ref.line} {ref.name}: {sorted(ref.targets)}"[:300])
            return ref.name, None
        row = next(iter(rows))
        return row.new, row

    def loose(self, items, edits):
        """References within f-strings, whose places Python 3.11 does not know: found by their text."""
        by_file = defaultdict(list)
        for ref, new, row in items:
            by_file[ref.file].append((ref, new, row))
        for file, found in by_file.items():
            tokens = [t for t in tokenize.generate_tokens(io.StringIO(self.base.source[file]).readline)
                      if t.type == tokenize.STRING and re.match(r"(?i)(f|rf|fr)['\"]", t.string)]
            for ref, new, row in found:
                done = False
                for t in tokens:
                    if not t.start[0] <= ref.line <= t.end[0]:
                        continue
                    for line, col, text in braces(t):
                        pattern = r"(?<=\.)" + ref.name + r"\b" if ref.kind == "attr" else r"(?<![\w.])" + ref.name + r"\b"
                        for m in re.finditer(pattern, text):
                            at = len(self.base.source[file].split("\n")[line - 1][: col + m.start()].encode())
                            edits[file][line, at] = (ref.name, new, row)
                            done = True
                if not done:
                    self.problems.append(f"NOT FOUND {file}:{ref.line} {ref.kind} {ref.name} -> {new}")

    def collisions(self, rows):
        base = self.base
        active = {f"{r.old}" for r in rows}
        for row in rows:
            if row.kind in ("class", "function", "constant"):
                module, _, old = row.old.partition(":")
                for m in {module} | self.files_of_row.get(row, set()):
                    taken = self.base.resolve(m, row.new)
                    if taken and not any(taken[4:] == a for a in active) and taken != f"sym {row.old}":
                        self.problems.append(f"COLLISION {row.old} -> {row.new}: {m} has {taken}")
            elif row.kind in ("method", "field") and not row.old.startswith("*."):
                owner = row.old.rpartition(".")[0]
                f = self.find(f"{owner}.{row.name}")
                related = {m.rpartition(".")[0] for m in self.by_member[row.name] if self.find(m) == f}
                for c in related:
                    near = set(base.classes[c]["mro"]) | {k for k, v in base.classes.items() if c in v["mro"]}
                    for n in near:
                        if row.new in base.classes[n]["members"] and not self.row_of(f"mem {n}.{row.new}", ""):
                            self.problems.append(f"COLLISION {row.old} -> {row.new}: {n} has it")
            elif row.kind in ("method", "field"):
                for m in self.by_member.get(row.name, ()):
                    c = m.rpartition(".")[0]
                    if self.in_scope(row, c.split(":")[0]) and row.new in base.classes[c]["members"] and not self.row_of(f"mem {c}.{row.new}", ""):
                        self.problems.append(f"COLLISION {row.old} -> {row.new}: {c} has it")
            elif row.kind == "module":
                new = row.new
                if new in base.packages and new not in self.modules:
                    self.problems.append(f"COLLISION module {row.old} -> {new}: there already")
        # two things of one new name in a module or a function
        meant = defaultdict(set)
        for r in self.refs:
            if r.kind in ("name", "param", "def", "import") and len(r.targets) == 1:
                target = next(iter(r.targets))
                if target.startswith(("loc ", "sym ", "mod ")):
                    new = self.new_of(r)[0]
                    home = target[4:].rpartition(".")[0] if target.startswith("loc ") else ""
                    where = home.partition(":")[2] if home else ""
                    if r.kind in ("def", "import") and not target.startswith("loc "):
                        meant[r.file, "", new].add(target)
                    else:
                        meant[r.file, where or r.where, new].add((target, r.name))
        for (file, where, new), what in meant.items():
            kinds = {w if isinstance(w, str) else w[0] for w in what}
            names_ = {w[1] for w in what if not isinstance(w, str)}
            if len(kinds) > 1 and (not where or len(names_) > 1):
                self.problems.append(f"COLLISION {file} {where}: {new} would be " + " and ".join(sorted(kinds)))
        # a new local, or a new global used where a local of that name is
        bound = defaultdict(set)
        for r in self.refs:
            for t in r.targets:
                if t.startswith("loc "):
                    bound[r.file, t[4:].rpartition(".")[0]].add(r.name)
        said = set()
        names_used = {(x.file, x.where, x.name) for x in self.refs if x.kind == "name"}
        for r in self.refs:
            if r.kind in ("name", "param"):
                new, row = self.new_of(r)
                if row is None or new == r.name:
                    continue
                module = base.module_of[r.file]
                quals = [r.where[:i] for i in range(len(r.where), 0, -1) if i == len(r.where) or r.where[i] == "."]
                for q in quals:
                    key = f"{module}:{q}"
                    if new in bound[r.file, key] and not self.row_of(f"loc {key}.{new}", r.file):
                        s = f"COLLISION {r.file}: {r.name} -> {new} in {q}: a local has that name"
                        if s not in said:
                            said.add(s)
                            self.problems.append(s)
                if any(t.startswith("loc ") for t in r.targets) and (base.resolve(module, new) or hasattr(builtins, new)):
                    used = (r.file, r.where, new) in names_used
                    s = f"SHADOWS {r.file}: local {r.name} -> {new} in {r.where}" + (" AND IS USED THERE" if used else "")
                    if s not in said and used:
                        said.add(s)
                        self.problems.append(s)


def braces(token):
    """(line, column, text) of the expressions of an f-string token, line by line."""
    text, (line, col) = token.string, token.start
    depth, i, n = 0, 0, len(text)
    start = None
    position = [line, col]
    out, current, begin = [], "", None
    while i < n:
        c = text[i]
        if c == "{" and depth == 0 and text[i + 1: i + 2] == "{":
            i += 2
            position[1] += 2
            continue
        if c == "{":
            depth += 1
            if depth == 1:
                begin, current = (position[0], position[1] + 1), ""
                i += 1
                position[1] += 1
                continue
        elif c == "}" and depth:
            depth -= 1
            if depth == 0:
                out.append((*begin, current))
        if c == "\n":
            if depth:
                out.append((*begin, current))
                begin, current = (position[0] + 1, 0), ""
            position = [position[0] + 1, 0]
            i += 1
            continue
        if depth:
            current += c
        i += 1
        position[1] += 1
    return out


# ---------------------------------------------------------------- text: docstrings, comments, Markdown

class Texts:
    """Dotted paths and identifiers in backticks."""

    def __init__(self, renamer: Renamer, rows):
        self.r, self.base = renamer, renamer.base
        self.rows = rows
        names = defaultdict(set)
        for row in rows:
            if row.kind not in ("module", "string"):
                names[row.name].add(row.new)
        self.unique = {}
        for name, new in names.items():
            if len(new) > 1:
                continue
            targets = set()
            for m, d in self.base.defs.items():
                if name in d:
                    targets.add(f"sym {m}:{name}")
            for m in self.r.by_member.get(name, ()):
                targets.add(f"mem {m}")
            for p in self.r.params.get(name, ()):
                targets.add(f"loc {p}")
            if targets and all(self.r.row_of(t, "") for t in targets if not t[4:].startswith("tests")):
                self.unique[name] = next(iter(new))
        self.short = {}
        for row in rows:
            if row.kind == "module":
                a, b = row.old.rpartition(".")[2], row.new.rpartition(".")[2]
                if a != b:
                    self.short.setdefault(row.old.rpartition(".")[0], {})[a] = b
        self.dotted = re.compile(r"(?<![\w./-])(?:engine|app|ui|tests|assets)(?:\.[A-Za-z_]\w*)+(?::[A-Za-z_]\w*)?")
        self.paths = re.compile(r"(?<![\w.-])(?:engine|app|ui|tests|assets)/[\w/]+(?:\.py)?(?![\w/])")

    def path(self, text):
        def dotted(m):
            whole = m.group()
            head, colon, symbol = whole.partition(":")
            parts = head.split(".")
            for i in range(len(parts), 0, -1):
                module = ".".join(parts[:i])
                if module in self.base.packages:
                    rest = parts[i:] + ([symbol] if colon else [])
                    target = None
                    out = []
                    for k, name in enumerate(rest):
                        if k == 0:
                            target = self.base.canonical(f"sym {module}:{name}")
                        else:
                            target = f"mem {self.base.owner(target[4:], name)}.{name}" if target and target[4:] in self.base.classes else None
                        row = self.r.row_of(target, "") if target else None
                        out.append(row.new if row else name)
                    new, _ = self.r.new_module(module)
                    tail = out[:-1] if colon else out
                    return ".".join([new, *tail]) + (":" + out[-1] if colon else "")
            return whole

        def slashed(m):
            whole = m.group()
            module = whole.removesuffix(".py").rstrip("/").replace("/", ".")
            if module not in self.base.packages:
                return whole
            new, row = self.r.new_module(module)
            return whole if row is None else new.replace(".", "/") + (".py" if whole.endswith(".py") else "")

        return self.paths.sub(slashed, self.dotted.sub(dotted, text))

    def ticked(self, text, module=None, owner=None):
        def one(m):
            inner = m.group(2)
            parts = inner.split(".")
            if not all(p.isidentifier() for p in parts) or parts[0] in TOP and len(parts) > 1:
                return m.group()
            out, target = list(parts), None
            if module is not None:
                package = module.rpartition(".")[0]
                first = parts[0]
                if owner and first in self.base.classes.get(owner, {"members": ()})["members"]:
                    target = f"mem {self.base.owner(owner, first)}.{first}"
                else:
                    target = self.base.resolve(module, first)
                    if target is None and f"{package}.{first}" in self.base.packages:
                        target = f"mod {package}.{first}"
                if target:
                    for k, name in enumerate(parts):
                        if k and target:
                            if target.startswith("mod "):
                                target = self.base.canonical(f"sym {target[4:]}:{name}")
                            elif target[4:] in self.base.classes:
                                target = f"mem {self.base.owner(target[4:], name)}.{name}"
                            else:
                                target = None
                        if target and target.startswith("mod "):
                            new, row = self.r.new_module(target[4:])
                            out[k] = new.rpartition(".")[2] if row and target[4:].rpartition(".")[2] == name else name
                        else:
                            row = self.r.row_of(target, "") if target else None
                            out[k] = row.new if row else self.unique.get(name, name) if not target else name
                    return m.group(1) + ".".join(out) + m.group(3)
            for k, name in enumerate(parts):
                out[k] = self.unique.get(name, name)
            return m.group(1) + ".".join(out) + m.group(3)

        return re.sub(r"(`{1,2})([A-Za-z_][\w.]*)((?:\([^`]*\))?`)", one, text)

    def bare(self, text, module=None):
        """Identifiers of several words in prose: ModeTalk, decided_view."""
        def one(m):
            target = self.base.resolve(module, m.group()) if module else None
            row = self.r.row_of(target, "") if target else None
            return row.new if row else m.group() if target else self.unique.get(m.group(), m.group())

        return re.sub(r"(?<![\w`./\"'-])(?:[A-Z][a-z0-9]+(?:[A-Z][a-z0-9]*)+|_?[a-z]+(?:_[a-z0-9]+)+)(?![\w`\"'/])", one, text)

    def words(self, text, pairs):
        for old, new in pairs:
            text = re.sub(rf"(?<![\w]){re.escape(old)}(?![\w])", new, text)
        return text

    def python_edits(self, file, edits):
        """Edits of string and comment tokens; places that code edits have taken are left to those."""
        base = self.base
        module = base.module_of[file]
        taken = set(edits.get(file, {}))
        source = base.source[file]
        owners = []
        for key, c in base.classes.items():
            if c["file"] == file:
                owners.append((c["node"].lineno, c["node"].end_lineno, key))
        strings = [(r.name, r.new) for r in self.rows if r.kind == "string" and self.r.in_scope(r, module)]
        docs = [(r.name, r.new) for r in self.rows if r.doc and (
            fnmatch.fnmatch(module, r.old.partition(":")[0]) if r.kind == "local" or not r.scope else self.r.in_scope(r, module))]
        out = []
        lines = source.split("\n")
        places = set()
        for n in ast.walk(base.trees[file]):
            if isinstance(n, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and n.body and isinstance(n.body[0], ast.Expr) \
                    and isinstance(n.body[0].value, ast.Constant) and isinstance(n.body[0].value.value, str):
                places.add(n.body[0].value.lineno)
        for t in tokenize.generate_tokens(io.StringIO(source).readline):
            if t.type not in (tokenize.STRING, tokenize.COMMENT):
                continue
            inside = [k for a, b, k in owners if a <= t.start[0] <= b]
            is_doc = t.type == tokenize.COMMENT or t.start[0] in places
            new = self.path(t.string)
            if is_doc:
                new = self.bare(self.ticked(new, module, inside[-1] if inside else None), module)
                new = self.words(new, docs)
            elif not re.match(r"(?i)[rb]*f", t.string):
                new = self.code_string(new, module)
            if strings and t.type == tokenize.STRING:
                new = self.words(new, strings)
            if new != t.string:
                at = len(lines[t.start[0] - 1][: t.start[1]].encode())
                end = (t.end[0], len(lines[t.end[0] - 1][: t.end[1]].encode()))
                if not any((t.start[0], at) <= k < end for k in taken):
                    out.append((t.start[0], at, t.string, new))
                else:
                    self.r.problems.append(f"STRING AND CODE {file}:{t.start[0]}: {t.string[:60]}")
        return out

    def code_string(self, text, module):
        """Code that a test sends to a window as a string: 'editor.talk.x'."""
        if not module.startswith("tests") or "." not in text:
            return text
        return re.sub(r"(?<=[\w)\]]\.)([A-Za-z_]\w*)", lambda m: self.unique.get(m.group(1), m.group(1)), text)


# ---------------------------------------------------------------- writing

def apply_edits(source: str, edits):
    lines = source.encode().split(b"\n")
    whole = b"\n".join(lines)
    starts, at = [], 0
    for line in lines:
        starts.append(at)
        at += len(line) + 1
    found = []
    for line, col, old, new in edits:
        a = starts[line - 1] + col
        assert whole[a:a + len(old.encode())] == old.encode(), (line, col, old, whole[a:a + 40])
        found.append((a, a + len(old.encode()), new.encode()))
    found.sort()
    out, at = [], 0
    for a, b, new in found:
        if a < at:
            raise ValueError(f"edits overlap at byte {a}: {whole[a:b]!r}")
        out += [whole[at:a], new]
        at = b
    out.append(whole[at:])
    return b"".join(out).decode()


def split_imports(base, renamer, file, text):
    """`from a import b, c` where b and c have gone to different packages: as several lines. text: after all edits, under old module paths."""
    moved = {r.old: r for r in renamer.modules.values() if r.old.rpartition(".")[0] != r.new.rpartition(".")[0]}
    if not moved:
        return text
    tree = ast.parse(text)
    lines = text.split("\n")
    for node in sorted((n for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and not n.level), key=lambda n: -n.lineno):
        groups = defaultdict(list)
        original = {renamer.new_module(m)[0]: m for m in base.packages}
        source_module = original.get(node.module, node.module)
        changed = False
        for a in node.names:
            old = next((m for m in moved if m.rpartition(".")[0] == source_module and (
                moved[m].new.rpartition(".")[2] == a.name)), None)
            home = moved[old].new.rpartition(".")[0] if old else node.module
            changed |= home != node.module
            groups[home].append(a.name + (f" as {a.asname}" if a.asname else ""))
        if changed:
            indent = " " * node.col_offset
            lines[node.lineno - 1: node.end_lineno] = [f"{indent}from {m} import {', '.join(names)}" for m, names in groups.items()]
    return "\n".join(lines)


def render(base, renamer, rows):
    """New text by file, under old paths."""
    edits = renamer.edits(rows)
    texts = Texts(renamer, rows)
    out = {}
    for f in base.py:
        found = [(line, col, old, new) for (line, col), (old, new, _) in edits.get(f, {}).items()]
        found += texts.python_edits(f, edits)
        text = apply_edits(base.source[f], found) if found else base.source[f]
        if found:
            text = split_imports(base, renamer, f, text)
        if text != base.source[f]:
            ast.parse(text)
            out[f] = text
    for f in base.text:
        text = texts.path(base.source[f])
        if f.endswith(".md"):
            text = texts.bare(texts.ticked(text))
        if text != base.source[f]:
            out[f] = text
    moves = {}
    for f in base.py:
        new, row = renamer.new_module(base.module_of[f])
        if row:
            target = new.replace(".", "/") + ("/__init__.py" if f.endswith("__init__.py") else ".py")
            if target != f:
                moves[f] = target
    return out, moves


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+")
    parser.add_argument("--root", default=".")
    parser.add_argument("--dry-run", action="store_true")
    parser.add_argument("--fill", action="store_true", help="write where each row applies into the tables")
    parser.add_argument("--commit", action="store_true", help="one commit a table")
    parser.add_argument("--no-types", action="store_true", help="without mypy: attributes by candidates alone")
    parser.add_argument("--cache", default="/tmp/names-types.pickle")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    root = Path(given.root).resolve()
    tables = [str(Path(t).resolve()) for t in given.tables]
    rows = read_rows(tables)
    seen = {}
    for r in rows:
        if (r.kind, r.old, r.scope if r.old.startswith("*") or r.kind == "string" else "") in seen:
            print("TWICE", r.old)
        seen[r.kind, r.old, r.scope if r.old.startswith("*") or r.kind == "string" else ""] = r
    base = Base(root)
    members, calls = ({}, {}) if given.no_types else types_of(base, Path(given.cache))
    refs: list[Ref] = []
    for f in base.py:
        Finder(base, f, members, calls, refs).run()
    print(f"{len(base.py)} files, {len(refs)} references, {len(rows)} rows", file=sys.stderr)
    steps = [[r for r in rows if r.table in tables[: i + 1]] for i in range(len(tables))] if given.commit else [rows]
    for i, active in enumerate(steps):
        renamer = Renamer(base, refs, active)
        out, moves = render(base, renamer, active)
        if given.dry_run or i == len(steps) - 1:
            kinds = Counter(p.split(" ")[0] for p in renamer.problems)
            print(f"{len(out)} files change, {len(moves)} move, {sum(renamer.by_row.values())} references; problems: {dict(kinds)}")
            for p in sorted(set(renamer.problems)):
                print(" ", p)
            for r in active:
                if r.kind not in ("module", "string") and not renamer.by_row[r]:
                    print("  UNUSED", r.kind, r.old, Path(r.table).name)
            if given.verbose:
                for r, n in renamer.by_row.most_common():
                    print(f"  {n:5d} {r.old} -> {r.new}")
        if given.dry_run:
            if given.fill:
                fill(tables, renamer, base)
            return
        write(root, base, out, moves, previous if i else {})
        previous = moves
        if given.commit:
            name = Path(tables[i]).stem.replace("_", " ")
            subprocess.check_call(["git", "add", "-A", "--", *TOP_PRESENT(root), *base.text], cwd=root)
            subprocess.run(["git", "commit", "-q", "-m", f"Name {name} in the field's words"], cwd=root, check=False)


def TOP_PRESENT(root):
    return [t for t in TOP if (root / t).exists()]


def write(root, base, out, moves, previous):
    """The tree as `out` and `moves` have it, whatever step it is in; `previous`: the moves that are done."""
    for f in base.py + base.text:
        now = previous.get(f, f)
        to = moves.get(f, f)
        if now != to:
            (root / to).parent.mkdir(parents=True, exist_ok=True)
            subprocess.check_call(["git", "mv", "-k", now, to], cwd=root)
            if not (root / to).exists():
                (root / now).rename(root / to)
        text = out.get(f, base.source[f])
        if (root / to).read_text() != text:
            (root / to).write_text(text)


def fill(tables, renamer, base):
    for table in tables:
        lines = []
        for line in Path(table).read_text().splitlines():
            parts = line.split("\t")
            if line.startswith("#") or line.startswith("kind") or len(parts) < 3:
                lines.append(line)
                continue
            parts += [""] * (5 - len(parts))
            row = next((r for r in renamer.rows if r.table == table and r.old == parts[1] and r.kind == parts[0].removesuffix("+doc")), None)
            if row and not row.old.startswith("*") and row.kind != "string":
                if row.kind == "module":
                    parts[3] = "imports"
                else:
                    total = renamer.all_names[row.name]
                    if renamer.by_row[row] == total:
                        parts[3] = "global"
                    else:
                        parts[3] = ",".join(sorted(renamer.files_of_row[row]))
            lines.append("\t".join(parts[:5]))
        Path(table).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
