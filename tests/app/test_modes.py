"""The seam between the editor and the modes: what is the modes' own is named nowhere else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from app.messages.file_messages import ReadCurveTable, ReadMeasured
from app.messages.worker_messages import CancelRequests, FetchTable, OpenScene, Request, SetCamera
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    FreezeIndirect,
    PlanBands,
    SampleMaps,
)
from app.modes.registry import MODES
from app.system.lazy_import import import_named

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    "file", ["app/editor/editor.py", "app/messages/editor_status.py", "ui/shell.py", "app/worker/tasks.py"]
)
def test_what_every_mode_shares_has_no_word_of_placement_s(file: str) -> None:
    found = re.findall(r"\b\w*(?:bands|bounces|transport)\w*\b", (ROOT / file).read_text(), re.IGNORECASE)
    assert found == []


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_what_a_mode_names_is_there(mode) -> None:
    assert all(callable(import_named(name)) for name in (mode.controller, mode.worker, mode.picture, mode.accuracy))


def needed_by(kind: type[Request]) -> set[type[Request]]:
    kinds = {
        OpenScene,
        SetCamera,
        ComputeTransport,
        ContractTransport,
        FreezeIndirect,
        PlanBands,
        ReadCurveTable,
        ReadMeasured,
        FetchTable,
        SampleMaps,
    }
    return {each for each in kinds if (kind().cancels(each) if kind is CancelRequests else each.needs(kind))}


def test_a_request_is_void_with_what_it_is_built_on() -> None:
    # Contractions are of a transport, which is of a view, which is of a scene; what is read or handed out for the
    # window is of none of them.
    assert needed_by(ComputeTransport) == {ComputeTransport, ContractTransport, FreezeIndirect}
    assert needed_by(SetCamera) == {SetCamera, ComputeTransport, ContractTransport, FreezeIndirect, SampleMaps}
    assert needed_by(OpenScene) == needed_by(SetCamera) | {OpenScene, ReadCurveTable, ReadMeasured}
    assert needed_by(ContractTransport) == {ContractTransport}


def test_a_stop_by_the_user_includes_views_in_passing() -> None:
    assert needed_by(CancelRequests) == {
        OpenScene,
        SetCamera,
        ComputeTransport,
        ContractTransport,
        FreezeIndirect,
        ReadCurveTable,
        ReadMeasured,
    }


def test_a_mode_that_is_left_takes_its_own_requests_alone() -> None:
    gone = CancelRequests(of=(ComputeTransport,))
    assert gone.cancels(ComputeTransport) and gone.cancels(FreezeIndirect)
    assert not gone.cancels(OpenScene) and not gone.cancels(ReadMeasured) and not gone.cancels(SampleMaps)
