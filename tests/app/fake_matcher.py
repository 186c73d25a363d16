"""A process that matches (`app.editor.background_match.Matcher`), and answers when the test lets it."""

from __future__ import annotations

from typing import Generic, TypeVar

from app.document.document import Document
from app.document.view_state import ViewState
from app.worker.session_process import TaskAnswer

Settings = TypeVar("Settings")
Answer = TypeVar("Answer")


class FakeMatcher(Generic[Settings, Answer]):
    """words: its progress."""

    def __init__(self, words: str = "matching cup.png 40%") -> None:
        self.settings: Settings | None = None
        self.document: Document | None = None
        self.ended: list[TaskAnswer[Answer]] = []
        self.n_begun = 0
        self.is_closed = False
        self.words = words

    @property
    def progress(self) -> str:
        return "" if self.settings is None else self.words

    def begin(self, document: Document, view: ViewState, settings: Settings) -> None:
        assert self.settings is None, "one at a time"
        self.document, self.settings, self.n_begun = document, settings, self.n_begun + 1

    def stop(self) -> None:
        self.settings = None

    def close(self) -> None:
        self.settings, self.is_closed = None, True

    def take_ended(self) -> list[TaskAnswer[Answer]]:
        ended, self.ended = self.ended, []
        return ended

    def end(self, answer: Answer | None, line: str = "") -> None:
        """Answer, or fail with a line, where something is being matched."""
        if self.settings is not None:
            self.settings = None
            self.ended.append(TaskAnswer(answer, line))
