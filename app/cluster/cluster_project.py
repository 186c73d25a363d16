"""A project of the command line and, where there is a scheduler, the cluster that draws and computes it."""

from __future__ import annotations

import contextlib
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from app.document.node_layers import channel_images
from app.document.scene_state import scene_state
from app.messages.worker_messages import OpenScene, SetCamera
from app.project.project import Project, ProjectSpec
from app.stills.stills import StillProgress
from engine.core.errors import InsituError
from engine.core.safe_files import record_files
from engine.material.layer_maps import Images

if TYPE_CHECKING:
    from app.cluster.cluster_jobs import ClusterExecutor
    from app.cluster.dask import Cluster
    from app.cluster.scene_bundle import SceneBundle
    from app.document.document import Document
    from app.stills.frame_sequence import Frames, Picture, Report


class ClusterProject:
    """A project whose files a cluster has."""

    def __init__(self, cluster: Cluster, words: ProjectSpec, bundle: SceneBundle) -> None:
        from app.cluster.program import program_digest

        self.cluster, self.words = cluster, words
        self.named = uuid.uuid4().hex, bundle, program_digest()

    def draw(
        self, project: Project, frames: Frames, numbers: Sequence[int], report: Report
    ) -> Iterator[tuple[int, Picture]]:
        """The frames of these numbers, as they come. Raises InsituError."""
        from app.cluster.cluster_jobs import FrameJob, draw_frame

        job = FrameJob(*self.named, self.words, frames)
        tasks = {i: self.cluster.submit(draw_frame, job, i) for i in numbers}
        n_done = 0
        for found in self.cluster.results(tasks):
            n_done += found is not None
            text = f"{n_done} of {len(tasks)} frames, {self.cluster.n_workers} workers"
            report(StillProgress(n_done / len(tasks), text))
            if found is not None:
                yield found

    def executor(self, scene: OpenScene, view: SetCamera, document: Document) -> ClusterExecutor:
        """The executor of the long work on this view of a document's scene; its requests have no numbers yet."""
        from app.cluster.cluster_jobs import ClusterExecutor, ViewJob

        scene, view = replace(scene, id=1), replace(view, scene=1, id=2)
        return ClusterExecutor(self.cluster, ViewJob(*self.named, scene, view, scene_state(document)))


@contextlib.contextmanager
def open_on_cluster(words: ProjectSpec, scheduler: str | None) -> Iterator[tuple[Project, ClusterProject | None]]:
    """The project, opened here; and on the cluster of that address, None where none is named. Raises InsituError."""
    if scheduler is None:
        yield words.open(), None
        return
    try:
        from app.cluster.dask import Cluster
    except ImportError as error:
        raise InsituError(
            f"--scheduler {scheduler}: dask.distributed is not installed; `pip install 'insitu[cluster]'` does it"
        ) from error
    with Cluster(scheduler) as cluster:
        words = words.with_absolute_paths()
        with record_files() as files:
            project = words.open()
            read_inputs(project)
        yield project, ClusterProject(cluster, words, cluster.send(files))


def read_inputs(project: Project) -> None:
    """Read the other files that a picture may need, so that they are noted."""
    document = project.document
    images = [layer.maps.images for _, layer in document.layers()]
    images += [Images(weight=name) for _, surface in document.new_surfaces for _, name in surface.files]
    project.scene.textures.load(
        images, [bumps for _, bumps in document.new_bumps], [own for _, own in document.new_opacities],
        channel_images(document),
    )  # fmt: skip
    assert project.sky  # which reads its environment
