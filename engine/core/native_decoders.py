"""Decoders of strangers' data in libraries of native code, which damaged data may end or corrupt.

A decoder is a function at the top of a module, from bytes to named arrays. `decode_natively` calls it through the
runner that the program has chosen: the application's runs it in a process of its own, with limits of memory and time
(`app.system.decoder_process`). Without one it runs here, as in tests of what it returns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[np.generic]]
Decoder = Callable[[bytes], Arrays]
Runner = Callable[[Decoder, bytes], Arrays]


class DecoderError(Exception):
    """Data that a decoder cannot read, or that ended it; the message says which."""


def run_here(decoder: Decoder, data: bytes) -> Arrays:
    """Call a decoder in this process; raises DecoderError for whatever goes wrong in it."""
    try:
        return decoder(data)
    except MemoryError:
        raise DecoderError("needs too much memory") from None
    except Exception as error:  # libraries raise all kinds
        raise DecoderError(str(error) or type(error).__name__) from None


_runners: list[Runner] = [run_here]


def use_runner(runner: Runner) -> None:
    """Choose how decoders are run, for the whole process."""
    _runners[0] = runner


def decode_natively(decoder: Decoder, data: bytes) -> Arrays:
    """The arrays that a decoder makes of data; raises DecoderError. They are as unchecked as the data."""
    return _runners[0](decoder, data)
