"""The names that files, scripts and command lines of earlier versions use, and what replaced them.

This is the only module that knows old names. Readers pass what they have parsed through it before they check it, so
that everything behind them knows the present names alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

# Sessions of version 1: tables of the file, and keys of [view].
_SESSION_KEYS = {"overrule": "overrides"}
_VIEW_KEYS = {"n_fan_rays": "n_hemisphere_rays"}

# Scripts have no version: an old key is accepted in any script.
_STEP_KEYS = {"overrule": "override", "keep": "save_view"}
_AWAITED_PICTURES = {"judged": "error"}

_OPTIONS = {"--overrule": "--override"}
_MEASURED_PARTS = {"knobs": "settings"}


def upgrade_session(tree: Mapping[str, Any]) -> dict[str, Any]:
    """The tree of a session file of any version so far, as one of version 2."""
    if tree.get("version") != 1 or isinstance(tree["version"], bool):
        return dict(tree)
    upgraded = _renamed(tree, _SESSION_KEYS)
    if isinstance(view := upgraded.get("view"), dict):
        upgraded["view"] = _renamed(view, _VIEW_KEYS)
    return {**upgraded, "version": 2}


def upgrade_script(tree: Mapping[str, Any]) -> dict[str, Any]:
    """The tree of a script with the present keys in its steps."""
    steps = tree.get("step")
    if not isinstance(steps, list):
        return dict(tree)
    return {**tree, "step": [_upgrade_step(step) if isinstance(step, dict) else step for step in steps]}


def upgrade_arguments(arguments: Sequence[str]) -> list[str]:
    """The words of a command line with the present names of options; those after "--" are no options."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    options = [word.partition("=") for word in arguments[:end]]
    return [_OPTIONS.get(name, name) + sign + value for name, sign, value in options] + list(arguments[end:])


def upgrade_part(name: str) -> str:
    """A part of `insitu measure` by its present name."""
    return _MEASURED_PARTS.get(name, name)


def _upgrade_step(step: Mapping[str, Any]) -> dict[str, Any]:
    upgraded = _renamed(step, _STEP_KEYS)
    if isinstance(picture := upgraded.get("wait"), str):
        upgraded["wait"] = _AWAITED_PICTURES.get(picture, picture)
    return upgraded


def _renamed(table: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """The table with each old key under its new name; one beside its new name stays, to be refused."""
    return {key if names.get(key, key) in table else names.get(key, key): value for key, value in table.items()}
