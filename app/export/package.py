"""A scene with everything it needs, in a folder or in one `.insitu.zip`: it opens to the same picture elsewhere.

    cup.insitu       the session: the document and the view, in TOML
    scene/...        the scene's file and all that it names, which is inside its folder
    scene/files/...  what edits name from elsewhere: images, measured BRDFs, the environment

Files are copied, not written anew, so that the picture is the same bit for bit. Built-in environments go by their
names. A folder or an archive with a session at its top opens as that session (`app.document.scene_files`). An archive
is read back before it replaces another: not every name and size that a folder has can be opened from an archive.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Container, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from app.document.document import Document, ObjectState
from app.document.looks import absent_of_looks, in_all_looks, lights_of_looks, objects_of_looks
from app.document.named_files import names_of_object, with_file_names
from app.document.scene_files import renamed, scene_file
from app.document.sources import SESSION_ENDING
from app.document.view_state import ViewState
from app.export import PACKAGE_ENDING, is_archive_name
from app.files.session import dump_session
from app.system.atomic import replacing_folder, saving_file
from engine.core.errors import InsituError, LoadError, describe_value
from engine.core.safe_files import named_in, read_regular_file, resolved
from engine.core.zip_files import ZipArchive
from engine.scene.mesh import MAX_MESH_BYTES

SCENE_FOLDER, FILES_FOLDER = "scene", "files"
_COMPRESSED = (".zip", ".png", ".jpg", ".jpeg", ".webp", ".ktx2", ".exr", ".glb", ".usdz")

Put = Callable[[str, bytes], None]


@dataclass(frozen=True)
class Package:
    """What is written. copies: the file that each name in the package is a copy of; document: with the names that it
    has there; notes: what is left out, for the user."""

    document: Document
    copies: dict[str, Path]
    notes: tuple[str, ...] = ()


Steps = Generator[tuple[float, str], None, Package]


def package_steps(document: Document, view: ViewState, scene_files: Iterable[Path], target: Path) -> Steps:
    """Write a document's package, which is returned; yields the fraction done, and the file that comes next.

    scene_files: all files that its scene was read from; target: see `require_package_place`. Raises InsituError; what
    was there stays then as it was.
    """
    target = resolved(target)
    package = packed(document, scene_files, target)
    text = dump_session(package.document, view, target)
    with _opened(target) as put:
        put(_session_name(target), text.encode())
        for n, (inside, file) in enumerate(package.copies.items()):
            yield n / len(package.copies), file.name
            put(inside, file.read_bytes())
    return package


def _session_name(target: Path) -> str:
    """The name of the session in a package: that of the package, without what opens nowhere or is hidden."""
    name = target.name.removesuffix(PACKAGE_ENDING).removesuffix(SESSION_ENDING)
    return (_plain(name).lstrip(".") or "scene") + SESSION_ENDING


def _plain(name: str) -> str:
    """The name of a file that every system and archive takes."""
    return "".join(each if each.isprintable() and each not in ':\\"*?<>|' else "_" for each in name)


def _portable(name: str, taken: Container[str]) -> str:
    """The name that a file has in the package, where the scene calls it so: a backslash in it is one between folders,
    as every system and archive reads it (`named_in`), unless that is another file or leads elsewhere."""
    parts = name.replace("\\", "/").split("/")
    other = "/".join(parts)
    return name if other in taken or any(part in ("", ".", "..") for part in parts) else other


def packed(document: Document, scene_files: Iterable[Path], target: Path) -> Package:
    """The package of a document at a place, and nothing written yet. Raises InsituError."""
    source = resolved(scene_file(document.source))
    own, folder = source.parent, target / SCENE_FOLDER
    # What a scene or an added mesh names is in its folder; other files were read from the program's, or from the cache.
    files = {source, *map(resolved, scene_files)}
    document, notes = _without_incomplete(document, own)
    inside = sorted(file.relative_to(own).as_posix() for file in files if file.is_relative_to(own))
    states = (*objects_of_looks(document), *absent_of_looks(document))
    named_files = {name for state in states for name in names_of_object(state)}
    named_files |= {light.environment for light in lights_of_looks(document)}
    named_files |= {each.file for light in lights_of_looks(document) for each in light.painted if each.file}
    named = {resolved(named_in(own, name)) for name in named_files}
    own_names = {*inside, *(file.relative_to(own).as_posix() for file in named if file.is_relative_to(own))}
    copies = {f"{SCENE_FOLDER}/{_portable(name, own_names)}": own / name for name in inside}
    elsewhere = _free(FILES_FOLDER, own_names, is_folder=True)
    taken = {own: ""}  # folders and files, and their names from the folder of the scene

    def placed(file: str) -> str:
        """The name of a file in the package, from the folder of its scene."""
        path = resolved(named_in(own, file))
        parent = next((each for each in path.parents if each in taken), None)
        if parent is not None:
            name = (PurePosixPath(taken[parent]) / path.relative_to(parent).as_posix()).as_posix()
            name = _portable(name, (*own_names, *taken.values()))
        else:
            known = (*own_names, *taken.values())
            name = taken[path] = taken.get(path) or _free(f"{elsewhere}/{_plain(path.name)}", known)
        copies[f"{SCENE_FOLDER}/{name}"] = path
        return name

    def image_placed(file: str) -> str:
        """The same of an image; as the scene's file has it where that is the same place."""
        name = placed(file)
        return file if name == file.replace("\\", "/") else name

    for mesh in (Path(each.mesh) for each in document.added_sources if each.mesh is not None):
        parent = resolved(mesh).parent
        if not any(each in taken for each in (parent, *parent.parents)):
            taken[parent] = _free(f"{elsewhere}/{_plain(mesh.stem)}", (*own_names, *taken.values()))
        for each in (file for file in files if file.is_relative_to(parent)):
            placed(str(each))

    def objects(states: Iterable[ObjectState]) -> tuple[ObjectState, ...]:
        """Objects with other names of their files; measured BRDFs and added meshes have absolute ones."""
        return tuple(with_file_names(each, image_placed, lambda file: str(folder / placed(file))) for each in states)

    def with_names(look: Document) -> Document:
        light = look.light
        if light.is_file:
            light = replace(light, environment=str(folder / placed(light.environment)))
        files = (replace(each, file=str(folder / placed(each.file))) if each.file else each for each in light.painted)
        light = replace(light, painted=tuple(files))
        return replace(look, objects=objects(look.objects), absent=objects(look.absent), light=light)

    document = replace(
        in_all_looks(document, with_names), source=renamed(document.source, str(folder / source.name))
    )  # fmt: skip
    missing = next((file for file in copies.values() if not file.is_file()), None)
    if missing is not None:
        raise InsituError(f"{missing}: no such file, expected what the scene names; nothing was written")
    return Package(document, copies, notes)


def _without_incomplete(document: Document, own: Path) -> tuple[Document, tuple[str, ...]]:
    """The document without the edits that wait for an object (`Document.absent`) and name a file that is gone: no
    picture needs them; and a note of each."""
    lost = dict[str, str]()
    for state in absent_of_looks(document):
        gone = next((name for name in names_of_object(state) if not named_in(own, name).is_file()), None)
        if gone is not None:
            lost[state.name] = gone

    def complete(look: Document) -> Document:
        return replace(look, absent=tuple(state for state in look.absent if state.name not in lost))

    notes = (
        f"the edits of {name}, which the scene does not have now, are left out: {gone} is gone"
        for name, gone in lost.items()
    )
    return in_all_looks(document, complete), tuple(notes)


def _free(name: str, taken: Iterable[str], is_folder: bool = False) -> str:
    """The name, with a number where a file or a folder has it, in either case of letters; of a folder that others
    share, where a file has it."""
    files = {PurePosixPath(each.lower()) for each in taken}
    known = {str(each) for file in files for each in ((file,) if is_folder else (file, *file.parents))}
    path, n = PurePosixPath(name), 2
    while name.lower() in known:
        name, n = str(path.with_stem(f"{path.stem}-{n}")), n + 1
    return name


def _require_readable(written: Path, names: Sequence[str], target: Path) -> None:
    """Raise InsituError where an archive with files of these names could not be opened again."""
    try:
        found = ZipArchive(read_regular_file(written, MAX_MESH_BYTES), target).names
        if other := next((name for name in names if name not in found), None):
            raise LoadError(target, "name in the archive", other, "one that an archive can have")
    except LoadError as error:
        why = f"{error.what} = {describe_value(error.value)}, expected {error.expected}"
        raise InsituError(f"{target}: not written, no archive can be opened with this: {why}; save a folder") from None


@contextmanager
def _opened(target: Path) -> Iterator[Put]:
    """What puts files into a package by name; it is there once all are. Raises InsituError."""
    if is_archive_name(target):
        with saving_file(target) as stream:
            with zipfile.ZipFile(stream, "w") as archive:

                def put(name: str, data: bytes) -> None:
                    is_small = name.lower().endswith(_COMPRESSED)
                    archive.writestr(name, data, zipfile.ZIP_STORED if is_small else zipfile.ZIP_DEFLATED)

                yield put
            stream.flush()
            _require_readable(Path(stream.name), archive.namelist(), target)
        return
    with replacing_folder(target) as part:

        def write(name: str, data: bytes) -> None:
            path = part / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

        yield write
