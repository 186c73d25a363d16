"""docs/peers.md from what was measured."""

from __future__ import annotations

import math
import os
import platform
import statistics
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from benchmarks.peers.edits import REST_SECONDS, STEP_SECONDS, Edit, Kind
from benchmarks.peers.measurement import PEERS, TRUTH_SAMPLES, Found, Program
from benchmarks.peers.timelines import Watched

OURS = "Insitu"
WIDTH = 120
KINDS: tuple[Kind, ...] = ("drag", "release", "jump", "undo")
# Of edits, in which the area is to be lower.
AIM = 0.9


@dataclass(frozen=True)
class Loss:
    """An edit after which a peer's area by processor time is not larger than ours."""

    scene: str
    number: int
    edit: Edit
    peer: str
    ours: Watched
    theirs: Watched

    @property
    def reason(self) -> str:
        """What our area is larger by, in words."""
        horizon = self.edit.horizon_s
        mine, other = self.ours.last(horizon, cpu=True), self.theirs.last(horizon, cpu=True)
        changed, first = self.ours.changed_after(), self.theirs.cpu_seconds[:1]
        if first and changed > 2 * first[0]:
            return f"our picture stays as it was for {time_text(changed)}, theirs for {time_text(first[0])}"
        if mine > other:
            return f"an error of {percent(mine)} at the end, theirs {percent(other)}"
        if self.ours.first > self.theirs.first:
            return f"an error of {percent(self.ours.first)} at first, theirs {percent(self.theirs.first)}"
        return "our pictures come later"


def page(found: Sequence[Found]) -> str:
    """The page, in Markdown."""
    lost = losses(found)
    missing = [
        f"- {name} in *{each.case.name}* is **not measured**: {peer}.\n"
        for each in found
        for name, peer in each.peers.items()
        if isinstance(peer, str)
    ]
    text = PAGE.format(
        n_edits=sum(len(each.case.script.edits) for each in found),
        verdict=verdict(found),
        missing="\n" + "".join(missing) if missing else "",
        wins=table(("scene", "edits", "number", *(name for name, *_ in PEERS)), win_rows(found)),
        rests=table(REST_COLUMNS, rest_rows(found)),
        ends=ends_text(found),
        drags=table(DRAG_COLUMNS, drag_rows(found)),
        losses=loss_text(lost),
        raws=table(RAW_COLUMNS, raw_rows(found)),
        models=model_text(found),
        opening=opening_text(found),
        selecting=spread([seconds for each in found for seconds in each.ours.selecting]),
        sizes=", ".join(f"*{each.case.name}* {' × '.join(map(str, each.case.resolution))}" for each in found),
        bounces=" and ".join(dict.fromkeys(str(each.n_bounces) for each in found)),
        step=STEP_SECONDS,
        rest=REST_SECONDS,
        truth=2 * TRUTH_SAMPLES,
        states=" and ".join(str(len(each.case.script.states)) for each in found),
        machine=machine(),
        made_with="; ".join(made_with(found)),
    )
    return "\n".join(wrapped(line) for line in text.split("\n"))


def wrapped(line: str) -> str:
    """A paragraph or a point of a list in lines that fit; tables and headings stay."""
    if line.startswith(("|", "#")):
        return line
    indent = "  " if line.startswith("- ") else ""
    return textwrap.fill(line, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def measured(each: Found) -> list[tuple[str, Program]]:
    """The peers that were measured."""
    return [(name, peer) for name, peer in each.peers.items() if not isinstance(peer, str)]


def wins(each: Found, peer: Program, cpu: bool, kinds: Sequence[Kind] = KINDS) -> tuple[int, int]:
    """(edits with a lower area of ours, edits)."""
    pairs = [
        (ours.area(edit.horizon_s, cpu), theirs.area(edit.horizon_s, cpu))
        for edit, ours, theirs in zip(each.case.script.edits, each.ours.edits, peer.edits, strict=True)
        if edit.kind in kinds
    ]
    return sum(ours < theirs for ours, theirs in pairs), len(pairs)


def losses(found: Sequence[Found]) -> list[Loss]:
    """By processor time, in the script's order."""
    lost = [
        Loss(each.case.name, number, edit, name, ours, theirs)
        for each in found
        for name, peer in measured(each)
        for number, (edit, ours, theirs) in enumerate(
            zip(each.case.script.edits, each.ours.edits, peer.edits, strict=True), start=1
        )
        if ours.area(edit.horizon_s, cpu=True) >= theirs.area(edit.horizon_s, cpu=True)
    ]
    return sorted(lost, key=lambda loss: (loss.scene, loss.number))


def verdict(found: Sequence[Found]) -> str:
    """Of all edits, against each peer."""
    said = []
    for name, *_ in PEERS:
        counts = [
            (*wins(each, peer, cpu=True), wins(each, peer, cpu=False)[0])
            for each in found
            for other, peer in measured(each)
            if other == name
        ]
        if counts:
            lower, number, by_seconds = (sum(column) for column in zip(*counts, strict=True))
            aim = "" if lower >= AIM * number else f", short of the aim of {100 * AIM:.0f} %"
            said.append(f"against {name} in {lower} of {number} edits by processor time{aim} ({by_seconds} by seconds)")
    return "Ours has the lower area " + ", ".join(said) + "." if said else "No peer was measured."


def win_rows(found: Sequence[Found]) -> Iterable[Sequence[str]]:
    for each in found:
        for kind in KINDS:
            number = sum(edit.kind == kind for edit in each.case.script.edits)
            cells = []
            for name, *_ in PEERS:
                peer = each.peers[name]
                if isinstance(peer, str):
                    cells.append("not measured")
                    continue
                used, seconds = (wins(each, peer, cpu, (kind,))[0] for cpu in (True, False))
                cells.append(f"{used} ({seconds})")
            yield each.case.name if kind == KINDS[0] else "", kind, str(number), *cells


def rest_rows(found: Sequence[Found]) -> Iterable[Sequence[str]]:
    """A row for each scene and program: what comes after edits that rest."""
    for each in found:
        for name, program in ((OURS, each.ours), *measured(each)):
            rests = [pair for pair in paired(each, program) if pair[0].kind != "drag"]
            came = [watch for _, watch in rests if watch.errors]
            yield (
                each.case.name if name == OURS else "",
                name,
                spread([watch.seconds[0] for watch in came]),
                spread([watch.cpu_seconds[0] for watch in came]),
                spread([changed for _, watch in rests if (changed := watch.changed_after()) < math.inf]),
                percents([watch.first for _, watch in rests]),
                percents([watch.last(edit.horizon_s, True) for edit, watch in rests]),
                percents([watch.area(edit.horizon_s, True) for edit, watch in rests], " s"),
                percents([watch.area(edit.horizon_s, False) for edit, watch in rests], " s"),
                still([watch.change for _, watch in rests]),
                still(program.again),
            )


def ends_text(found: Sequence[Found]) -> str:
    """After how many edits a peer ends with the lower error."""
    said = []
    for each in found:
        for name, peer in measured(each):
            rests = [
                (ours.last(edit.horizon_s, True), theirs.last(edit.horizon_s, True))
                for (edit, ours), theirs in zip(paired(each, each.ours), peer.edits, strict=True)
                if edit.kind != "drag"
            ]
            lower = sum(theirs < ours for ours, theirs in rests)
            said.append(f"{name} after {lower} of {len(rests)} in *{each.case.name}*")
    return ", ".join(said) if said else "none was measured"


def drag_rows(found: Sequence[Found]) -> Iterable[Sequence[str]]:
    """A row for each scene and program: the steps of drags."""
    for each in found:
        for name, program in ((OURS, each.ours), *measured(each)):
            steps = [pair for pair in paired(each, program) if pair[0].kind == "drag"]
            came = [watch for _, watch in steps if watch.errors]
            in_time = [watch for watch in came if watch.seconds[0] < STEP_SECONDS]
            yield (
                each.case.name if name == OURS else "",
                name,
                spread([watch.seconds[0] for watch in came]),
                spread([watch.cpu_seconds[0] for watch in came]),
                f"{len(in_time)} of {len(steps)}",
                percents([watch.before for _, watch in steps]),
                percents([watch.first for _, watch in steps]),
                percents([watch.area(edit.horizon_s, True) for edit, watch in steps], " s"),
            )


def raw_rows(found: Sequence[Found]) -> Iterable[Sequence[str]]:
    """What a peer without denoiser needs to our errors: noise goes by one over the root of its samples."""
    for each in found:
        for name, peer in measured(each):
            firsts: list[tuple[float, float, float]] = []
            lasts: list[tuple[float, float, float]] = []
            for (edit, ours), theirs in zip(paired(each, each.ours), peer.edits, strict=True):
                if edit.kind == "drag" or not ours.errors or theirs.raw is None:
                    continue
                noise, used = theirs.raw
                for rows, place in ((firsts, 0), (lasts, ours.errors.index(ours.errors[-1]))):
                    error = max(ours.errors[place], 1e-9)
                    rows.append((error, ours.cpu_seconds[place], used * (noise / error) ** 2))
            for what, rows in (("first", firsts), ("last", lasts)):
                errors, ours_s, theirs_s = (statistics.median(column) for column in zip(*rows, strict=True))
                heads = (each.case.name, name.partition(" ")[0]) if what == "first" else ("", "")
                yield *heads, what, percent(errors), time_text(ours_s), time_text(theirs_s), short(theirs_s / ours_s)


def paired(each: Found, program: Program) -> list[tuple[Edit, Watched]]:
    """Each edit with what a program showed."""
    return list(zip(each.case.script.edits, program.edits, strict=True))


def loss_text(lost: Sequence[Loss]) -> str:
    """A table, or a sentence."""
    if not lost:
        return "None: after every edit our area by processor time is the lower one."
    rows = []
    for loss in lost:
        edit, horizon = loss.edit, loss.edit.horizon_s
        areas = (f"{100 * watch.area(horizon, cpu=True):.2g} % s" for watch in (loss.ours, loss.theirs))
        name = f"{loss.number}, {edit.kind}: `{edit.parameter.path}={edit.value}`"
        rows.append((loss.scene, name, loss.peer, *areas, loss.reason))
    return table(LOSS_COLUMNS, rows)


def model_text(found: Sequence[Found]) -> str:
    """How far the peers' long pictures are from the truth."""
    parts = [
        f"{percent(peer.model_error)} in *{each.case.name}*"
        for each in found
        for _, peer in measured(each)
        if peer.model_error > 0.0
    ]
    return " and ".join(parts) if parts else "not measured"


def opening_text(found: Sequence[Found]) -> str:
    return "; ".join(
        f"{time_text(each.ours.opening[1])} of processor time in *{each.case.name}*, and "
        f"{time_text(sum(each.ours.selecting))} for selecting objects during the script"
        for each in found
        if each.ours.opening is not None
    )


def made_with(found: Sequence[Found]) -> Iterable[str]:
    """Each program's words, once."""
    words = {OURS: found[0].ours.made_with}
    for each in found:
        words |= {name.partition(" ")[0]: peer.made_with for name, peer in measured(each)}
    return [f"{name}: {said}" for name, said in words.items()]


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def ranged(values: Sequence[float], text: Callable[[float], str], end: str = "") -> str:
    """Median and range."""
    if not values:
        return "never"
    return f"{text(statistics.median(values))}{end} ({text(min(values))} to {text(max(values))})"


def percent(value: float) -> str:
    return f"{100 * value:.1f} %"


def percents(values: Sequence[float], end: str = "") -> str:
    return ranged(values, lambda value: short(100 * value), f" %{end}")


def still(changes: Sequence[float]) -> str:
    """0 only where every change is."""
    return "0" if not any(changes) else ranged(changes, lambda value: f"{100 * value:.2g}", " %")


def spread(seconds: Sequence[float]) -> str:
    """In a unit that reads well."""
    factor, unit = (1e3, " ms") if seconds and statistics.median(seconds) < 0.5 else (1.0, " s")
    return ranged(seconds, lambda value: short(factor * value), unit)


def time_text(seconds: float) -> str:
    return f"{short(1e3 * seconds)} ms" if seconds < 0.5 else f"{short(seconds)} s"


def short(value: float) -> str:
    """Two figures, or as many as stand before the point."""
    return f"{value:,.0f}" if value >= 10 else f"{value:.2g}"


def machine() -> str:
    models = [line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    name = models[0].partition(": ")[2] if models else platform.processor()
    load = psutil.getloadavg()[0]
    return f"{len(models) or os.cpu_count()} cores of an {name}, {platform.system()}, load {load:.1f} at the end"


REST_COLUMNS = (
    "scene", "program", "first picture after", "its processor time", "processor time to a visible change",
    "first picture's error", "error at the end",
    "area by processor time", "area by seconds", "change at rest", "the same state again",
)  # fmt: skip
DRAG_COLUMNS = (
    "scene", "program", "first picture after", "its processor time", "within the step", "error without it",
    "its error", "area by processor time",
)  # fmt: skip
RAW_COLUMNS = (
    "scene", "peer", "our picture", "its error", "its processor time", "the peer's to that error", "ratio",
)  # fmt: skip
LOSS_COLUMNS = ("scene", "edit", "peer", "our area", "theirs", "why")
PAGE = """# An edit here, and in path tracers with a denoiser

Written by `python -m benchmarks.peers`, which makes it anew where `INSITU_PEER_PYTHON` names an interpreter that has \
Mitsuba 3 and pyoidn, and `INSITU_CYCLES_PYTHON` one that has bpy, pyoidn and OpenEXR. It asks: the user edits a \
material; how wrong is what is on screen, and for how long? A script of {n_edits} edits (slow drags, jumps, undo) \
runs in each program. The peers render 1, 2, 4, 8 and so on samples a pixel, keep them, and denoise each picture with \
Intel Open Image Denoise, guided by albedo and normals.

{verdict}
{missing}
*Area* is that under the error on screen over time: the picture from before an edit counts until the first one after \
it is there. It is taken up to {step:g} s after a step of a drag and {rest:g} s after other edits, by seconds of \
processor time, and by seconds. Edits in which our area is the lower one, by processor time (by seconds):

{wins}

A *drag* is a step of one, a *release* its last step.

## Edits that rest

{rests}

Median and range. A change is *visible* when the error is another one by a tenth. *The end* is the horizon, by \
processor time. *Change at rest* is the relative RMS difference of the last two pictures, in ours of two successive \
frames; *the same state again*, of the last pictures of a state that the script comes back to, which the peers render \
with another seed: this is how much a denoised picture flickers between edits that change nothing.

At the end a peer's error is the lower one so often: {ends}. With more time it would be so more \
often, since ours stays once it is finished.

## Steps of drags

{drags}

*Error without it* is that of the picture from before the step: a picture is worth its time where its error is lower.

## Losses

Edits after which a peer's area by processor time is not larger than ours, by number in the scene's script:

{losses}

## Without a denoiser

To equal error, medians over edits that rest; how many of our pictures there are in the processor time of one of \
theirs:

{raws}

*First* is the frame that the window draws in answer to the edit, with as many increments as its budget allows; \
*last* is the picture when nothing more comes, or at the end. A peer's time is that of its last picture before it is \
denoised, without the denoiser's, scaled by 1/error².

## How it was measured

- {machine}. {made_with}.
- The scenes have only materials that all three have: `lambert` and `rough_conductor`. *cornell* is the built-in \
scene; *teatray* is too, but its pot's copper is `rough_conductor` here. Light is reflected up to {bounces} times. \
Pictures: {sizes}.
- The script is fixed (`benchmarks/peers/edits.py`). Steps of a drag come {step:g} s apart; a peer's pass that has \
begun is ended. Ours selects the object before its edit, while the hand goes to the curve, outside the times, until \
the picture is finished or for three seconds on both clocks; it takes {selecting} of processor time. An \
edit that comes before that ends may be seen only after it.
- Errors are relative RMS errors, linear, clamped at the 99.9 percentile, over pixels two off silhouettes and \
creases. The truth of each of the {states} states is a picture of {truth} samples a pixel by Mitsuba, in two halves, \
whose noises are independent, so that they do not count (`benchmarks/peer.py`).
- Others worked on the machine: seconds are stretched by that, ranges are wide. Processor time, of all threads, and \
of ours of window and worker together, is stretched far less. Reading our picture back counts as ours.
- A peer's kernels are compiled, its scene is built and its denoiser is ready before the first edit. Of Cycles, \
clamping, filtered gloss, adaptive sampling and light thresholds are off; its scene persists between passes.
- Each pass of Cycles is a render of its own and goes through a file in memory, since `bpy` has no window: some 30 ms \
of processor time a pass, which its viewport may not need.
- First and last pictures of each edit are kept as OpenEXR in the output folder, all others as NumPy files.

## What is not equal

- Ours had precomputed, for this camera and this light: {opening}. The peers start from nothing, and may turn the \
camera at no cost. What precomputation takes stands in [benchmarks](benchmarks.md).
- Ours is wrong by what its bands, lights and records leave out, smoothly, and does not get better with time; a \
peer's noise and its denoiser's guess do.
- Cycles' metal has another masking term (correlated, ours and Mitsuba's is separable). With many samples and without \
denoiser its picture is {models} away from the truth where the drag ends; its errors have that in them.
- A roughness that is set in one step, and not dragged, is shown when transport for it is there, so that a picture is \
always of one document; a drag shows its curve at once. Undo of it waits as well, for less.
- The peers average each pixel over its area, ours looks through its centre but at edges, which are left out here.
- Mitsuba reads rows of an environment half a texel off; it was given a map that it reads as it was meant.
- All run on the processor here; on a graphics card all would be other numbers.
"""
