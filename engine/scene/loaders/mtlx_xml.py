"""Documents of MaterialX as trees of elements: .mtlx files and what they include.

XML is read here, by expat, and not by the materialx library, which would open files by itself: it follows includes to
any place, and knows no limits. A document type, in which entities would be declared, is refused; elements, depth, bytes
and includes are bounded; an include is read where it is in the file's folder or below it, each file once. The library,
which knows the definitions of nodes and older versions of the format, gets one document without includes
(`engine.scene.loaders.mtlx_library`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from engine.core.errors import LoadError, printable_name
from engine.core.safe_files import find_inside, read_regular_file
from engine.scene.loaders.model import UnshownProperty

MAX_DOCUMENT_BYTES = 16 * 2**20
_MOST_ELEMENTS = 50_000
_MOST_ATTRIBUTES = 400_000
_DEEPEST = 64
_MOST_INCLUDES = 64
_INCLUDE = "xi:include"
# Attributes that a document hands down to its elements.
_INHERITED = ("colorspace", "namespace", "fileprefix")


@dataclass
class Element:
    """An element: its category, attributes and children."""

    category: str
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)

    def text(self) -> Iterator[str]:
        """The element as parts of XML."""
        attributes = "".join(f" {name}={quoteattr(value)}" for name, value in self.attributes.items())
        yield f"<{self.category}{attributes}>"
        for child in self.children:
            yield from child.text()
        yield f"</{self.category}>"


@dataclass(frozen=True)
class MtlxDocument:
    """A document without includes, as XML, and what of it could not be included."""

    xml: bytes
    unshown: tuple[UnshownProperty, ...]


def read_document(file: Path) -> MtlxDocument:
    """Read a .mtlx file with its includes. Raises LoadError."""
    reader = _Reader(file)
    root = reader.read(file, PurePosixPath())
    if root.category != "materialx":
        raise LoadError(file, "document", root.category, "a document of MaterialX, <materialx>")
    return MtlxDocument("".join(root.text()).encode(), tuple(reader.unshown))


class _Reader:
    """Reads a file and its includes within limits of all together."""

    def __init__(self, file: Path) -> None:
        self._file, self._folder = file, file.parent
        self._n_elements = self._n_attributes = self._n_bytes = 0
        self._read: set[Path] = set()
        self.unshown: list[UnshownProperty] = []

    def read(self, file: Path, folder: PurePosixPath) -> Element:
        """The tree of a file, which is in this folder of the first one's, with its includes replaced. Elements of an
        included file get what its root hands down to them, and name files from the first one's folder."""
        self._read.add(file.resolve())
        if len(self._read) > _MOST_INCLUDES:
            raise LoadError(self._file, "included files", f"more than {_MOST_INCLUDES}", f"at most {_MOST_INCLUDES}")
        data = read_regular_file(file, MAX_DOCUMENT_BYTES)
        self._n_bytes += len(data)
        if self._n_bytes > MAX_DOCUMENT_BYTES:
            raise LoadError(file, "bytes with includes", self._n_bytes, f"at most {MAX_DOCUMENT_BYTES}")
        root = self._parse(data, file)
        own = (
            {}
            if len(self._read) == 1
            else {name: root.attributes[name] for name in _INHERITED if name in root.attributes}
        )
        prefix = "" if folder == PurePosixPath() else f"{folder}/"
        children: list[Element] = []
        for child in root.children:
            if child.category == _INCLUDE:
                children += self._included(child, folder)
                continue
            child.attributes = own | child.attributes
            if prefix:
                child.attributes.setdefault("fileprefix", "")
                _prepend(child, prefix)
            children.append(child)
        root.children = children
        return root

    def _included(self, include: Element, folder: PurePosixPath) -> list[Element]:
        """The elements of a file that one in this folder includes; none where it is not in the first file's folder, or
        was included before."""
        name = include.attributes.get("href", "")
        path = find_inside(self._folder, self._folder / folder, name) if name.strip("./") else None
        if path is None:
            listed = f"{_INCLUDE} {printable_name(name, 80)}".strip()
            self.unshown.append(UnshownProperty(listed, 1, "not in the file's folder: what it defines is missing"))
            return []
        if path in self._read:
            return []
        return self.read(path, PurePosixPath(path.parent.relative_to(self._folder.resolve()).as_posix())).children

    def _parse(self, data: bytes, file: Path) -> Element:
        """The tree of a file's bytes. Raises LoadError."""
        parser = expat.ParserCreate()
        open_elements: list[Element] = []
        roots: list[Element] = []

        def start(category: str, attributes: dict[str, str]) -> None:
            self._n_elements += 1
            self._n_attributes += len(attributes)
            if self._n_elements > _MOST_ELEMENTS or self._n_attributes > _MOST_ATTRIBUTES:
                raise LoadError(file, "elements", f"more than {_MOST_ELEMENTS}", f"at most {_MOST_ELEMENTS}")
            if len(open_elements) >= _DEEPEST:
                raise LoadError(file, f"line {parser.CurrentLineNumber}: depth", _DEEPEST + 1, f"at most {_DEEPEST}")
            element = Element(category, attributes)
            (open_elements[-1].children if open_elements else roots).append(element)
            open_elements.append(element)

        def refuse_document_type(*_: object) -> None:
            expected = "a document without a document type"
            raise LoadError(file, f"line {parser.CurrentLineNumber}", "a document type", expected)

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda _: open_elements.pop()
        parser.StartDoctypeDeclHandler = refuse_document_type
        try:
            parser.Parse(data, True)
        except expat.ExpatError as error:
            raise LoadError(file, f"line {parser.CurrentLineNumber}", str(error), "well-formed XML") from None
        except ValueError as error:  # an encoding that is not known
            raise LoadError(file, "encoding", str(error), "UTF-8") from None
        return roots[0]


def _prepend(element: Element, prefix: str) -> None:
    """Put a folder before all prefixes of files in an element."""
    if "fileprefix" in element.attributes:
        element.attributes["fileprefix"] = prefix + element.attributes["fileprefix"]
    for child in element.children:
        _prepend(child, prefix)
