"""A scene with everything it needs, in a folder or in one `.insitu.zip`: it opens to the same picture elsewhere.

    cup.insitu       the session: the document and the view, in TOML
    scene/...        the scene's file and all that it names, which is inside its folder
    scene/files/...  what edits name from elsewhere: images, measured BRDFs, the environment

Files are copied, not written anew, so that the picture is the same bit for bit. Built-in environments go by their
names. A folder or an archive with a session at its top opens as that session (`app.document.scene_files`).
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from app.document.document import Document, ObjectState
from app.document.named_files import with_file_names
from app.document.scene_files import renamed, scene_file
from app.document.sources import SESSION_ENDING
from app.document.view_state import ViewState
from app.export import PACKAGE_ENDING, is_archive_name
from app.files.session import dump_session
from app.system.atomic import replacing, replacing_folder
from engine.core.errors import InsituError
from engine.core.safe_files import resolved

SCENE_FOLDER, FILES_FOLDER = "scene", "files"
_COMPRESSED = (".zip", ".png", ".jpg", ".jpeg", ".webp", ".ktx2", ".exr", ".glb", ".usdz")

Steps = Generator[tuple[float, str], None, None]
Put = Callable[[str, bytes], None]


@dataclass(frozen=True)
class Package:
    """What is written. copies: the file that each name in the package is a copy of; document: with the names that it
    has there."""

    document: Document
    copies: dict[str, Path]


def package_steps(document: Document, view: ViewState, scene_files: Iterable[Path], target: Path) -> Steps:
    """Write a document's package; yields the fraction done, and the file that comes next.

    scene_files: all files that its scene was read from; target: see `require_package_place`. Raises InsituError; what
    was there stays then as it was.
    """
    target = resolved(target)
    name = target.name.removesuffix(PACKAGE_ENDING).removesuffix(SESSION_ENDING)
    package = packed(document, scene_files, target)
    text = dump_session(package.document, view, target)
    with _opened(target) as put:
        put(f"{name}{SESSION_ENDING}", text.encode())
        for n, (inside, file) in enumerate(package.copies.items()):
            yield n / len(package.copies), file.name
            put(inside, file.read_bytes())


def packed(document: Document, scene_files: Iterable[Path], target: Path) -> Package:
    """The package of a document at a place, and nothing written yet. Raises InsituError."""
    source = resolved(scene_file(document.source))
    own, folder = source.parent, target / SCENE_FOLDER
    # What a scene or an added mesh names is in its folder; other files were read from the program's, or from the cache.
    files = {source, *map(resolved, scene_files)}
    inside = sorted(file.relative_to(own).as_posix() for file in files if file.is_relative_to(own))
    copies = {f"{SCENE_FOLDER}/{name}": own / name for name in inside}
    taken = {own: ""}  # folders and files, and their names from the folder of the scene

    def placed(file: str) -> str:
        """The name of a file in the package, from the folder of its scene."""
        path = resolved(own / file)
        parent = next((each for each in path.parents if each in taken), None)
        if parent is not None:
            name = (PurePosixPath(taken[parent]) / path.relative_to(parent).as_posix()).as_posix()
        else:
            name = taken[path] = taken.get(path) or _free(f"{FILES_FOLDER}/{path.name}", (*inside, *taken.values()))
        copies[f"{SCENE_FOLDER}/{name}"] = path
        return name

    for mesh in (Path(each.mesh) for each in document.added_sources if each.mesh is not None):
        parent = resolved(mesh).parent
        if not any(each in taken for each in (parent, *parent.parents)):
            taken[parent] = _free(f"{FILES_FOLDER}/{mesh.stem}", (*inside, *taken.values()))
        for each in (file for file in files if file.is_relative_to(parent)):
            placed(str(each))

    def objects(states: Iterable[ObjectState]) -> tuple[ObjectState, ...]:
        """Objects with other names of their files; measured BRDFs and added meshes have absolute ones."""
        return tuple(with_file_names(each, placed, lambda file: str(folder / placed(file))) for each in states)

    light = document.light
    if light.is_file:
        light = replace(light, environment=str(folder / placed(light.environment)))
    document = replace(
        document, source=renamed(document.source, str(folder / source.name)),
        objects=objects(document.objects), absent=objects(document.absent), light=light,
    )  # fmt: skip
    missing = next((file for file in copies.values() if not file.is_file()), None)
    if missing is not None:
        raise InsituError(f"{missing}: no such file, expected what the scene names; nothing was written")
    return Package(document, copies)


def _free(name: str, taken: Iterable[str]) -> str:
    """The name, with a number where it is taken, in either case of letters."""
    known, path, n = {each.lower() for each in taken}, PurePosixPath(name), 2
    while name.lower() in known:
        name, n = str(path.with_stem(f"{path.stem}-{n}")), n + 1
    return name


@contextmanager
def _opened(target: Path) -> Iterator[Put]:
    """What puts files into a package by name; it is there once all are. Raises InsituError."""
    if is_archive_name(target):
        with replacing(target) as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:

            def put(name: str, data: bytes) -> None:
                is_small = name.lower().endswith(_COMPRESSED)
                archive.writestr(name, data, zipfile.ZIP_STORED if is_small else zipfile.ZIP_DEFLATED)

            yield put
        return
    with replacing_folder(target) as part:

        def write(name: str, data: bytes) -> None:
            path = part / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

        yield write
