"""Views of OpenColorIO configurations for the window: the worker reads the configurations, the window gets shaders.

Once a frame the view that is wanted is compared with those that have come. The configuration of the environment
variable ``OCIO`` is read once a scene is open, so that menus can offer it. A configuration that cannot be read is said
once, and the view that was shown before stays.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from app.document.view_state import SetView, ViewCommand, ViewState
from app.messages.file_messages import ColourViewRead, ReadColourView
from app.messages.worker_messages import Request, RequestFailed
from engine.core.colour import AnyView, ConfigView
from engine.core.colour_config import ConfigCatalogue, ViewShader, config_name

VARIABLE = "OCIO"


class ColourHost(Protocol):
    """What it needs of the editor."""

    view: ViewState

    @property
    def scene_is_open(self) -> bool: ...

    def do(self, command: ViewCommand) -> str | None: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...


class ColourController:
    """The views of one editor. ``send`` sends a request and returns its number."""

    def __init__(self, host: ColourHost, send: Callable[[Request], int]) -> None:
        self._host, self._send = host, send
        self._shaders: dict[ConfigView, ViewShader] = {}
        self._catalogues: dict[str, ConfigCatalogue] = {}
        self._refused: set[ConfigView] = set()
        self._requested: tuple[int, ConfigView] | None = None

    @property
    def catalogues(self) -> tuple[ConfigCatalogue, ...]:
        """Those that are known, in the order in which they came."""
        return tuple(self._catalogues.values())

    def shader(self, view: ConfigView) -> ViewShader | None:
        """A view as the window draws it; None while it has not come."""
        return self._shaders.get(view)

    def is_coming(self, view: AnyView) -> bool:
        """Whether a view is still to be read."""
        return isinstance(view, ConfigView) and view not in self._shaders and view not in self._refused

    def open(self, view: ConfigView) -> None:
        """Show a view of a configuration, which is read again."""
        view = replace(view, config=config_name(view.config))
        self._shaders = {known: each for known, each in self._shaders.items() if known.config != view.config}
        self._refused = {each for each in self._refused if each.config != view.config}
        self._host.do(SetView.of(tone_mapping=view))

    def follow(self) -> None:
        """Once a frame: request what is missing, one after the other."""
        if self._requested is not None:
            return
        wanted, own = self._host.view.tone_mapping, os.environ.get(VARIABLE, "")
        if isinstance(wanted, ConfigView) and self.is_coming(wanted):
            self._request(wanted)
        elif own and self._host.scene_is_open:
            default = ConfigView(config_name(own))
            if default.config not in self._catalogues and default not in self._refused:
                self._request(default)

    def _request(self, view: ConfigView) -> None:
        self._requested = self._send(ReadColourView(view)), view

    def receive(self, response: ColourViewRead) -> None:
        """A view has come; where the one that is wanted left names open, it has them now."""
        if self._requested is None or self._requested[0] != response.id:
            return
        (_, requested), self._requested = self._requested, None
        is_new = response.catalogue.config not in self._catalogues
        self._catalogues[response.catalogue.config] = response.catalogue
        self._shaders[requested] = self._shaders[response.shader.view] = response.shader
        if self._host.view.tone_mapping == requested:
            self._host.do(SetView.of(tone_mapping=response.shader.view))
            if is_new and response.catalogue.note:
                self._host.notify(response.catalogue.note)

    def receive_failure(self, response: RequestFailed) -> bool:
        """A request failed; returns whether it was for a view."""
        if self._requested is None or self._requested[0] != response.id:
            return False
        self._refused.add(self._requested[1])
        self._requested = None
        self._host.notify(f"{response.line}; the view before stays", True)
        return True

    def worker_restarted(self) -> None:
        """Nothing is under way any more."""
        self._requested = None
