"""The modes' GL code is tested on the context of `tests/ui/gl`."""

from tests.ui.gl.conftest import context, renderer, shared_context

__all__ = ["context", "renderer", "shared_context"]
