"""How much is measured, and how scenes are opened for it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from app.measure.study import QUICK as QUICK_STUDY
from app.measure.study import StudyEffort
from app.measure.subject import Subject, at_most, open_subject
from benchmarks.api_edit import ApiEditEffort
from benchmarks.brute_force_ratio import RAW_RAYS
from benchmarks.deform import DeformEffort
from benchmarks.deform_lamps import DeformLampEffort
from benchmarks.dragged_light import DragEffort
from benchmarks.edges import EdgeEffort
from benchmarks.gloss import GlossEffort
from benchmarks.indirect import QUICK as QUICK_INDIRECT
from benchmarks.indirect import IndirectEffort
from benchmarks.inverse import InverseEffort
from benchmarks.light_mix import MixEffort
from benchmarks.moves import MoveEffort
from benchmarks.orbit import OrbitEffort
from benchmarks.orbit_moves import OrbitMoveEffort
from benchmarks.photos import PhotoEffort
from benchmarks.plan_costs import PlanEffort
from benchmarks.relighting import RelightEffort
from benchmarks.rooms import RoomEffort
from benchmarks.sweep import QUICK as QUICK_GRID
from benchmarks.sweep import Grid
from benchmarks.turning_sky import TurningEffort
from benchmarks.variants import QUICK as QUICK_VARIANTS
from benchmarks.variants import VariantEffort
from benchmarks.visibility_methods import QUICK as QUICK_VISIBILITY
from benchmarks.visibility_methods import VisibilityEffort
from benchmarks.visibility_textures import TextureEffort


@dataclass(frozen=True)
class Effort:
    """How much is measured: repetitions of what takes minutes, of launches and of frames; pictures' longest side.

    n_wrong: points at which visibility is checked; None: left out.
    """

    name: str
    repetitions: int = 3
    launches: int = 5
    cold_launches: int = 2
    frames: int = 60
    side: int = 4096
    n_rays: int = RAW_RAYS
    n_wrong: int = 3000
    references: bool = True
    timeout_s: float = 1800.0
    grid: Grid = field(default_factory=Grid)
    indirect: IndirectEffort = field(default_factory=IndirectEffort)
    edges: EdgeEffort | None = field(default_factory=EdgeEffort)
    rooms: RoomEffort | None = field(default_factory=RoomEffort)
    gloss: GlossEffort | None = field(default_factory=GlossEffort)
    orbit: OrbitEffort | None = field(default_factory=OrbitEffort)
    deform: DeformEffort | None = field(default_factory=DeformEffort)
    deform_lamps: DeformLampEffort | None = field(default_factory=DeformLampEffort)
    relight: RelightEffort | None = field(default_factory=RelightEffort)
    drags: DragEffort | None = field(default_factory=DragEffort)
    mixes: MixEffort | None = field(default_factory=MixEffort)
    moves: MoveEffort | None = field(default_factory=MoveEffort)
    inverse: InverseEffort | None = field(default_factory=InverseEffort)
    photos: PhotoEffort | None = field(default_factory=PhotoEffort)
    orbit_moves: OrbitMoveEffort | None = field(default_factory=OrbitMoveEffort)
    turning: TurningEffort | None = field(default_factory=TurningEffort)
    api_edits: ApiEditEffort | None = field(default_factory=ApiEditEffort)
    planning: PlanEffort | None = field(default_factory=PlanEffort)
    visibility: VisibilityEffort = field(default_factory=VisibilityEffort)
    textures: TextureEffort | None = field(default_factory=TextureEffort)
    settings: StudyEffort = field(default_factory=StudyEffort)
    variants: VariantEffort = field(default_factory=VariantEffort)


FULL = Effort("full")
QUICK = Effort(
    "quick", 1, 1, 0, 10, 64, 200_000, 300, False, 300.0, QUICK_GRID, QUICK_INDIRECT, edges=None, rooms=None,
    gloss=None, orbit=None, deform=None, relight=None, drags=None, mixes=None, moves=None, orbit_moves=None,
    deform_lamps=None, turning=None, api_edits=None, inverse=None, photos=None,
    visibility=QUICK_VISIBILITY, textures=None,
    settings=QUICK_STUDY, variants=QUICK_VARIANTS, planning=None,
)  # fmt: skip


def open_at_most(source: str, side: int, resolution: tuple[int, int] | None = None) -> Subject:
    """A scene in this resolution or its own, scaled down to `side` pixels."""
    subject = open_subject(source, resolution)
    return replace(subject, scene=replace(subject.scene, resolution=at_most(subject.scene.resolution, side)))


def size_text(subject: Subject) -> str:
    """Of its picture."""
    return "{} × {}".format(*subject.scene.resolution)
