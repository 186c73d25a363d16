"""Placement's requests to the worker and their responses (see `app.messages.worker_messages`).

Shapes: P pixels that see a reflecting object, p those of one layer, J bands. Images have row 0 at the top.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.messages.worker_messages import Request, Response, SetCamera

if TYPE_CHECKING:
    from app.document.scene_state import LayerState, SceneState
    from engine.material.layer import Layer
    from engine.material.layer_maps import Images, MapMeans
    from engine.precompute.indirect.frozen_light import FrozenLight
    from engine.render.picture_error import ErrorEstimate
    from engine.settings import Precision, RenderSettings


# ------------------------------------------------------------------------------------------------------------- requests


@dataclass(frozen=True)
class PlanBands(Request):
    """Plan how many bands the curves of these layers need; answered by `BandsPlanned`."""

    priority = 1
    answered_once = True
    is_stopped_by_user = False

    layers: tuple[Layer, ...]


@dataclass(frozen=True, eq=False)
class ComputeTransport(Request):
    """Compute the transport of a scene's layers, coarse to fine; earlier contractions are cancelled.

    selected, factor: the curve whose transport is handed out as well, in the layer of that key and in `followers`.
    n_lights_preview: the number of lights that the sky is first divided into. is_drag: stop after one quick picture.
    With more than one bounce the indirect light is computed as well; `BouncesPlanned` tells how many. Tables of
    measured layers are read first where a worker does not have them.

    held_layers: keys of layers whose picture the window has already, and `held_curves` of those whose transport it has:
    what has not changed is not sent again. is_fine: what is on screen is of the last stage under this light, so that a
    preview would not be shown.
    """

    built_on = (SetCamera,)

    scene: SceneState
    selected: str | None
    factor: str | None
    n_lights_preview: int
    settings: RenderSettings
    precision: Precision = "half"
    followers: tuple[str, ...] = ()
    is_drag: bool = False
    held_layers: tuple[str, ...] = ()
    held_curves: tuple[str, ...] = ()
    is_fine: bool = False

    @property
    def lit(self) -> RenderSettings:
        """The settings of direct light; a picture of a dragged light has its own."""
        return replace(self.settings.of_direct_light, n_lights=0) if self.is_drag else self.settings.of_direct_light


@dataclass(frozen=True, eq=False)
class ContractTransport(Request):
    """Hand out one layer's transport over the bands of `factor`, its other factors contracted with the layer's curves.

    `factor` None requests the layer's picture alone, `picture` False the transport alone. `beside`: transport handed
    out before stays of interest, because the layers follow one curve; coming stages bring all of it.
    """

    built_on = (ComputeTransport,)
    priority = 3

    layer: LayerState
    factor: str | None
    precision: Precision = "half"
    picture: bool = True
    beside: bool = False


@dataclass(frozen=True, eq=False)
class FreezeIndirect(Request):
    """Contract the indirect light for edits of one object, with all others as they are ("object freezing", [BenArtzi07,
    sect. 6.1]); answered again whenever it becomes finer.

    key, factor: the layer and the curve whose bands are desired; None: only what every layer reflects. The object that
    is edited is that of `key`. edited: layers of it that share this curve, by key, and which of theirs it is.
    second_bands: the most that the second bounce has, None for as many as a curve has; with one it depends on albedo
    alone, as all later bounces do. serial comes back with the responses.
    """

    built_on = (ComputeTransport,)
    priority = 4

    scene: SceneState
    key: str | None = None
    factor: int | None = None
    second_bands: int | None = None
    serial: int = 0
    edited: tuple[tuple[str, int], ...] = ()

    @property
    def curves(self) -> dict[str, int]:
        """The curves whose bands are desired, by the key of their layer."""
        return {} if self.key is None or self.factor is None else {self.key: self.factor, **dict(self.edited)}


@dataclass(frozen=True, eq=False)
class EstimateError(Request):
    """Estimate the error of this scene's picture under the transport requested last, `second_bands` as in
    `FreezeIndirect`; answered by `ErrorEstimated`, once that picture is there. has_map: with an error map."""

    built_on = (ComputeTransport,)
    answered_once = True
    is_foreground = False

    scene: SceneState
    second_bands: int | None = None
    has_map: bool = False


@dataclass(frozen=True, eq=False)
class PrepareRelighting(Request):
    """Prepare the scene so that another sky, or another mix of its lights, can light it at once, where the picture of
    the transport requested last is there; what is ready stays. Answered by `LightsReady` and `RelightingPrepared`."""

    built_on = (ComputeTransport,)
    answered_once = True
    is_foreground = False

    scene: SceneState


@dataclass(frozen=True, eq=False)
class SampleEdited(Request):
    """Add rays to the indirect light of the transport requested last, where it is noisy under the materials of this
    scene. Each round is answered by `IndirectImproved` where a freezing was requested, the whole by `EditedSampled`."""

    built_on = (ComputeTransport,)
    answered_once = True
    is_foreground = False

    scene: SceneState


@dataclass(frozen=True)
class SampleMaps(Request):
    """Sample the images of some layers, by key, where the camera sees them; each is answered on its own."""

    built_on = (SetCamera,)
    priority = 2
    is_stopped_by_user = False

    layers: tuple[tuple[str, Images], ...]


# ------------------------------------------------------------------------------------------------------------ responses


@dataclass(frozen=True)
class BandsPlanned(Response):
    """J by factor of the layers of a `PlanBands`, in their order."""

    bands: tuple[dict[str, int], ...]


@dataclass(frozen=True, eq=False)
class StageFootprint(Response):
    """Which computed samples stand for each pixel in the coarse pictures of a stage: rows (P,4) i32, weights (P,4) f32.

    Belongs to the view, not to the request during which it is sent: pictures of that stage follow under any. In a stage
    without one, every pixel has its own sample.
    """

    rows: NDArray[np.integer]
    weights: NDArray[np.floating]
    stage: str


@dataclass(frozen=True, eq=False)
class LayerPicture(Response):
    """One layer's radiance (p,3), contracted with the `coefficients` of its request."""

    key: str
    stage: str
    radiance: NDArray[np.floating]
    coefficients: tuple[NDArray[np.floating], ...]


@dataclass(frozen=True, eq=False)
class LayerTransport(Response):
    """One layer's transport, one plane a Daubechies-4 coefficient: `coefficients_first` (J,p,3), `norms` (J,3).

    True values are coefficients_first · scale; they are float16 or float32 by the requested precision.
    """

    key: str
    factor: str
    stage: str
    coefficients_first: NDArray[np.floating]
    norms: NDArray[np.floating]
    scale: NDArray[np.floating]

    @property
    def precision(self) -> Precision:
        return "half" if self.coefficients_first.dtype == np.float16 else "float"


@dataclass(frozen=True)
class LightPlanned(Response):
    """How many of the requested lights and patches the last stage has, and why, by line of the plan."""

    n_lights: int
    n_patches: int
    reasons: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class BouncesPlanned(Response):
    """How many bounces the scene requires, and why; at most the requested number. warning: what of the light is missing
    after them, empty where that is little."""

    n_bounces: int
    reason: str
    warning: str = ""


@dataclass(frozen=True, eq=False)
class IndirectFound(Response):
    """Where the indirect light of a stage was found: for each point four samples of its own object, by number, and
    their weights (P,4). `number` tells which `IndirectFrozen` belong to it. It belongs to the view, as `StageFootprint`
    does, and is sent again under each transport whose light it is. n_rays: as many as the hemisphere samples were found
    to need, 0 where that was not looked for, and why."""

    number: int
    stage: str
    rows: NDArray[np.integer]
    weights: NDArray[np.floating]
    n_rays: int = 0
    reason: str = ""


@dataclass(frozen=True)
class IndirectNoise(Response):
    """The noise of indirect light as it was frozen: RMS over the picture, relative to its own mean, and that mean
    radiance. Follows the `IndirectFrozen` of these numbers. is_sampled: whether its rays were traced where these
    materials require them, and not those of before an edit."""

    number: int
    serial: int
    noise: float
    mean: float
    is_sampled: bool = True


@dataclass(frozen=True, eq=False)
class IndirectFrozen(Response):
    """Indirect light at the samples of each layer, in units of `unit`.

    light: by the layers' numbers in `keys`; curves: those whose bands it has, by key of the layer; albedos: by key of
    the edited object's layers, e (V,J,K) or (3,V,J,K) [engine.precompute.indirect.albedo]. by_albedo: whether the
    second bounce off glossy surfaces, which depends on direction, is still to come; is_last: whether no second answer
    comes, until which the light that edited gloss sends on stays as it is.
    """

    number: int
    serial: int
    keys: tuple[str, ...]
    curves: dict[str, int]
    light: FrozenLight
    albedos: dict[str, NDArray[np.float64]]
    unit: float = 1.0
    by_albedo: bool = False
    is_last: bool = True


@dataclass(frozen=True)
class FreezingProgress(Response):
    """How far the freezing of that serial is, as a fraction; comes of those alone that take a while."""

    serial: int
    fraction: float


@dataclass(frozen=True, eq=False)
class IndirectImproved(Response):
    """Light with more rays, what was requested last frozen of it, and its noise, together: no picture is between
    them."""

    found: IndirectFound
    frozen: IndirectFrozen
    noise: IndirectNoise


@dataclass(frozen=True)
class SamplingProgress(Response):
    """How far a `SampleEdited` is, as a fraction of the sample sets that are needed or may be added."""

    fraction: float


@dataclass(frozen=True)
class EditedSampled(Response):
    """Indirect light has the rays that the materials of the request need: n_sets sample sets at n_points gather points,
    n_added by this request; 0 where none of it lacked any. n_noisy points have as many as they may have, and would need
    more. Its noise before and now, relative to its mean; transport_bytes: the memory held for the scene."""

    n_points: int = 0
    n_sets: int = 0
    n_added: int = 0
    n_noisy: int = 0
    noise_before: float = 0.0
    noise: float = 0.0
    transport_bytes: int = 0


@dataclass(frozen=True, eq=False)
class IndirectRelit(Response):
    """The frozen light of that number while lights change: at the p samples of each layer, by its key, (p,3), without
    f_q and f_o. now: under the light of the request, by albedo alone; resting: the same under the light that was
    frozen; gloss: how much of what glossy surfaces added to that they add now; mirrored: what they add besides
    [engine.precompute.indirect.relighting]."""

    number: int
    now: dict[str, NDArray[np.float32]]
    resting: dict[str, NDArray[np.float32]]
    gloss: dict[str, NDArray[np.float32]]
    mirrored: dict[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class MapsSampled(Response):
    """A layer's images as the camera sees them: `samples` (p,4) float16 at every pixel of its object, the texture's
    linear RGB and the weight; their means over the surface; `thumbnails` (h,w,3) uint8 sRGB, by "texture" and "weight".
    note: what the user should know of their mapping, or nothing."""

    key: str
    images: Images
    samples: NDArray[np.float16]
    means: MapMeans
    thumbnails: dict[str, NDArray[np.uint8]]
    note: str = ""


@dataclass(frozen=True)
class MapsRefused(Response):
    """A layer's images cannot be used; `line` is one sentence for the user."""

    key: str
    images: Images
    line: str


@dataclass(frozen=True, eq=False)
class ErrorEstimated(Response):
    """The error of the picture; colours (H, W, 4): its map, see `error_estimate`, None where not requested."""

    estimate: ErrorEstimate
    colours: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class LightsReady(Response):
    """The first answer to `PrepareRelighting`: lights may be mixed by coarse pictures. The fields are those of the
    last, `RelightingPrepared`."""

    is_partial = True

    transport_bytes: int
    n_lights: int = 0


@dataclass(frozen=True)
class RelightingPrepared(Response):
    """The sky may be rotated, and lights mixed; transport_bytes: the memory held for the scene, this included;
    n_lights: the lights whose pictures are there, 0 where these would take too much memory."""

    transport_bytes: int
    n_lights: int = 0


@dataclass(frozen=True)
class StageDone(Response):
    """A stage is complete; `exact` when no finer one follows. spent_seconds: of processor time, since the request."""

    stage: str
    exact: bool
    seconds: float
    transport_bytes: int = 0
    spent_seconds: float = 0.0
