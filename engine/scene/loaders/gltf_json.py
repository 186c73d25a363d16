"""Typed access to the untrusted JSON of a glTF file, which records what is read.

`JsonObject` returns integers, numbers and lists only if they conform to glTF 2.0 (Khronos). Where a value has a
default, that replaces one that does not conform, and the property is listed as not shown; otherwise the place of the
error is named, and who asks decides what can be shown without it (`attempt`). Errors that can be repaired (a factor of
1.0000001) are repaired, with a note. Whoever asks for a key has read it: what no reader asks for is listed at the end
as not shown (`gltf_unshown`), so that nothing is dropped without a word, whatever a file contains.
"""

from __future__ import annotations

import json
import math
import re
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from engine.core.errors import LoadError, describe_value

Read = TypeVar("Read")

MAX_ITEMS = 1_000_000
_INDEX = re.compile(r" \d+(?=: |$)")


@dataclass(frozen=True)
class ReadLog:
    """What reading leaves behind; all objects of a file share it.

    notes: repairs and omissions, each line once, in order. read: the keys that were read, by the identity of their
    object, which lives as long as the tree. left_out: the identities of objects that are not shown as a whole; faults:
    keys whose value does not conform, with those. unshown: the number of places of each property that is not shown, or
    in part, by its name and the effect.
    """

    notes: dict[str, None] = field(default_factory=dict)
    read: defaultdict[int, set[str]] = field(default_factory=lambda: defaultdict(set))
    left_out: set[int] = field(default_factory=set)
    faults: set[tuple[int, str]] = field(default_factory=set)
    unshown: dict[tuple[str, str], int] = field(default_factory=dict)


@dataclass(frozen=True)
class JsonObject:
    """A JSON object of a file and its place in it ("meshes 3: primitives 0")."""

    values: dict[str, Any]
    place: str
    file: Path
    log: ReadLog = field(default_factory=ReadLog)

    @property
    def notes(self) -> dict[str, None]:
        """The notes on the whole file."""
        return self.log.notes

    def error(self, key: str, value: object, expected: str) -> LoadError:
        """An error about one key."""
        return LoadError(self.file, self._at(key), value, expected)

    def note(self, key: str, value: object, words: str) -> None:
        """Note how an invalid value was treated, without rejecting the file."""
        self.notes[f"{self._at(key)} = {describe_value(value)}, {words}"] = None

    def not_shown(self, key: str, effect: str, count: int = 1) -> None:
        """List a property that the picture does not show, or in part; effect: what the picture lacks."""
        self.mark_read(key)
        name = property_name(self._at(key)), effect
        self.log.unshown[name] = self.log.unshown.get(name, 0) + count

    def leave_out(self, key: str, effect: str) -> None:
        """List this whole object as not shown, under the key that is the reason."""
        self.not_shown(key, effect)
        self.log.left_out.add(id(self.values))

    def attempt(self, key: str, effect: str, read: Callable[[], Read]) -> Read | None:
        """What `read` returns; None where the file is wrong: the key is listed as not shown then, with what the picture
        lacks, and the reason becomes a note."""
        try:
            return read()
        except LoadError as error:
            other = "" if error.file == str(self.file) else f"{Path(error.file).name}: "
            self._list_fault(key, f"{other}{error.reason}: {effect}", effect)
            return None

    def mark_read(self, *keys: str) -> None:
        """Count keys as read: their values are known, or without effect here."""
        self.log.read[id(self.values)].update(keys)

    def read_like(self, other: JsonObject) -> None:
        """Count as read what was read of an equal object."""
        pairs: list[tuple[Any, Any]] = [(self.values, other.values)]
        while pairs:
            mine, theirs = pairs.pop()
            if isinstance(mine, dict) and isinstance(theirs, dict):
                self.log.read[id(mine)] |= self.log.read.get(id(theirs), set())
                pairs += [(mine[key], theirs[key]) for key in mine.keys() & theirs.keys()]
            elif isinstance(mine, list) and isinstance(theirs, list):
                pairs += zip(mine, theirs, strict=False)

    def aside(self) -> JsonObject:
        """The same object; what is read of it here does not count as read."""
        return JsonObject(self.values, self.place, self.file, ReadLog(self.notes))

    def clamped(self, value: float, key: str, low: float = 0.0, high: float = 1.0) -> float:
        """Clamp a value to its range, with a note: exporters round their numbers."""
        if low <= value <= high:
            return value
        end = min(max(value, low), high)
        self.note(key, value, f"taken as {end:g}")
        return end

    def has(self, key: str) -> bool:
        """Whether the key is present; it does not count as read."""
        return key in self.values

    def raw(self, key: str, default: object = None) -> Any:
        """The value as it is, unchecked."""
        self.log.read[id(self.values)].add(key)
        return self.values.get(key, default)

    def integer(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """An integer in [low, high]; required if there is no default."""
        value = self.raw(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            shown = "nothing" if key not in self.values else value
            raise self.error(key, shown, _integers(low, high))
        return value

    def numbers(self, key: str, count: int, default: tuple[float, ...]) -> tuple[float, ...]:
        """A list of finite numbers."""
        value = self.raw(key, list(default))
        if not isinstance(value, list) or len(value) != count or not all(_is_number(v) for v in value):
            return self._instead(key, f"{count} finite numbers", default)
        return tuple(float(v) for v in value)

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        value = self.raw(key, default)
        return float(value) if _is_number(value) else self._instead(key, "a finite number", default)

    def flag(self, key: str) -> bool:
        """True or false, the default."""
        value = self.raw(key, False)
        return value if isinstance(value, bool) else self._instead(key, "true or false", False)

    def text(self, key: str) -> str | None:
        """A string, or None if the key is missing."""
        value = self.raw(key)
        return value if value is None or isinstance(value, str) else self._instead(key, "a string", None)

    def texts(self, key: str) -> list[str]:
        """A list of strings, empty if the key is missing."""
        value = self.raw(key, [])
        is_valid = isinstance(value, list) and all(isinstance(each, str) for each in value)
        return value if is_valid else self._instead(key, "a list of strings", [])

    def child(self, key: str) -> JsonObject:
        """The object under a key, empty if it is missing."""
        value = self.raw(key, {})
        if not isinstance(value, dict):
            value = self._instead(key, "an object", {})
        return JsonObject(value, self._at(key), self.file, self.log)

    def children(self, key: str) -> list[JsonObject]:
        """The list of objects under a key, empty if it is missing; what is no object counts as an empty one."""
        value = self.raw(key, [])
        if not isinstance(value, list):
            value = self._instead(key, "a list of objects", [])
        if len(value) > MAX_ITEMS:
            raise self.error(key, len(value), f"a list of at most {MAX_ITEMS} objects")
        found = []
        for i, item in enumerate(value):
            if not isinstance(item, dict):
                item = self._instead(f"{key} {i}", "an object", {}, item)
            found.append(JsonObject(item, f"{self._at(key)} {i}", self.file, self.log))
        return found

    def item(self, key: str, index: int) -> JsonObject | None:
        """One object of a list, without checking the others; None past its end."""
        value = self.raw(key, [])
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value[index : index + 1]):
            raise self.error(f"{key} {index}", value, "an object")
        if index >= len(value):
            return None
        return JsonObject(value[index], f"{self._at(key)} {index}", self.file, self.log)

    def indices(self, key: str, count: int) -> list[int]:
        """A list of indices below count, without those that are none."""
        value = self.raw(key, [])
        given = value if isinstance(value, list) else []
        found = [v for v in given if isinstance(v, int) and not isinstance(v, bool) and 0 <= v < count]
        if given is not value or len(found) < len(given):
            return self._instead(key, f"a list of indices from 0 to {count - 1}", found)
        return found

    def _instead(self, key: str, expected: str, default: Read, value: object = ...) -> Read:
        """The default, where the file has something else than is expected: the property is listed."""
        found = self.values.get(key) if value is ... else value
        note = f"{self._at(key)} = {describe_value(found)}, expected {expected}"
        self._list_fault(key, note, f"as if it were not there: it is not {expected}")
        return default

    def _list_fault(self, key: str, note: str, effect: str) -> None:
        """List a property that does not conform, once for each of its places."""
        if (id(self.values), key) not in self.log.faults:
            self.log.faults.add((id(self.values), key))
            self.notes[note] = None
            self.not_shown(key, effect)

    def _at(self, key: str) -> str:
        return f"{self.place}: {key}" if self.place else key


def property_name(place: str) -> str:
    """The name of a property by its place: "materials.KHR_materials_ior.ior" for the place "materials 3: extensions:
    KHR_materials_ior: ior"."""
    return ".".join(part for part in _INDEX.sub("", place).split(": ") if part != "extensions")


def decode_json(text: bytes, file: Path) -> JsonObject:
    """The root object of a glTF 2 JSON text; raises LoadError."""
    try:
        # Some exporters begin with a byte order mark and pad with zeros.
        root = json.loads(text.decode("utf-8-sig").rstrip("\0"))
    except RecursionError:
        raise LoadError(file, "JSON", "too deep", "JSON with a few levels") from None
    except ValueError as error:
        raise LoadError(file, "JSON", str(error), "valid JSON") from None
    if not isinstance(root, dict):
        raise LoadError(file, "JSON root", type(root).__name__, "an object")
    fields = JsonObject(root, "", file)
    if not (fields.child("asset").text("version") or "").startswith("2."):
        raise fields.error("asset: version", fields.child("asset").values.get("version", "nothing"), "2.0")
    return fields


def _is_number(value: object) -> bool:
    """A finite JSON number that a float can represent."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _integers(low: int, high: int) -> str:
    """What an integer in [low, high] is called in a message: of indices, those that a list has."""
    if low <= 0 and high < 0:
        return "none: the file has nothing to point at"
    return f"an integer from {max(low, 0)} to {high}" if low <= high else f"at least {low} and at most {high}"
