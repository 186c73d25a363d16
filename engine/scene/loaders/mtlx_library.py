"""Completes documents of MaterialX by the `materialx` library, which is native: it runs where the program decides
(`engine.core.native_decoders`).

The library brings documents of older versions up to date and has the definitions of nodes: their inputs, defaults, and
for many the network that a node stands for. What comes back is plain: for each material the nodes that its surface
depends on, each with all of its inputs, and networks in place of nodes that `engine.scene.loaders.graph_nodes` does not
evaluate itself.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from engine.core.errors import LoadError
from engine.core.native_decoders import Arrays, DecoderError, decode_natively
from engine.scene.loaders.graph_nodes import EVALUATED
from engine.scene.loaders.shader_graph import Link, NetworkNode, ShaderInput, ShaderNode, parse_value

if TYPE_CHECKING:
    import MaterialX as mx

PACKAGE = "MaterialX"
MISSING = "the package materialx, which is not installed: pip install 'insitu[materialx]'"
MOST_NODES = 20_000
_DEEPEST = 100
_NETWORK_SURFACE = "surface"
_DEFINED = "node"  # the category of a node of which only the definition is known
# Surface shaders that become layers.
SURFACES = frozenset({"standard_surface", "open_pbr_surface", "gltf_pbr", "UsdPreviewSurface"})


class MtlxMaterial(NamedTuple):
    """A material by its name, with the node of its surface and whether it displaces it."""

    name: str
    surface: ShaderNode
    is_displaced: bool = False


def complete_document(xml: bytes, file: object) -> tuple[MtlxMaterial, ...]:
    """The materials of a document, in its order. Raises LoadError that names `file`."""
    if importlib.util.find_spec(PACKAGE) is None:
        raise LoadError(str(file), "MaterialX", "not readable here", MISSING)
    try:
        tree = json.loads(np.asarray(decode_natively(decode_document, xml)["json"], np.uint8).tobytes())
        return _materials(tree)
    except DecoderError as error:
        raise LoadError(str(file), "MaterialX", str(error), "a document that the materialx library reads") from None
    except (KeyError, IndexError, TypeError, ValueError, RecursionError):  # of a process that the data has corrupted
        raise LoadError(str(file), "MaterialX", "no answer that makes sense", "a sound document") from None


def complete_network(nodes: Sequence[NetworkNode], surface: str, file: object) -> ShaderNode:
    """The node `surface` of a network as USD has it, completed. Raises LoadError that names `file`."""
    names = {node.name: f"n{k}" for k, node in enumerate(nodes)}
    parts = ['<materialx version="1.39">']
    for node in nodes:
        parts.append(f'<{_DEFINED} name="{names[node.name]}" nodedef={quoteattr(node.definition)}>')
        for name, value in node.inputs.items():
            if isinstance(value, Link):
                given = f'nodename="{names.get(value.node, "")}" output={quoteattr(value.output)}'
            else:
                given = f"value={quoteattr(value)}"
            space = node.spaces.get(name)
            given += f" colorspace={quoteattr(space)}" if space else ""
            parts.append(f"<input name={quoteattr(name)} {given}/>")
        parts.append(f"</{_DEFINED}>")
    parts.append(f'<surfacematerial name="{_NETWORK_SURFACE}" type="material">')
    parts.append(f'<input name="surfaceshader" type="surfaceshader" nodename="{names.get(surface, "")}"/>')
    parts.append("</surfacematerial></materialx>")
    found = complete_document("".join(parts).encode(), file)
    if not found:
        raise LoadError(str(file), "surface", surface, "a network with a surface shader that is known")
    return found[0].surface


def _materials(tree: dict[str, Any]) -> tuple[MtlxMaterial, ...]:
    """The materials of what `decode_document` found; nodes come after those that they depend on."""
    nodes: list[ShaderNode] = []
    for category, kind, name, inputs in tree["nodes"]:
        read = {}
        for key, (its_kind, text, link, is_set, space, geometry) in inputs.items():
            value = None if text is None else parse_value(its_kind, text)
            node, output = (None, "out") if link is None else (nodes[link[0]], link[1])
            read[key] = ShaderInput(its_kind, value, node, output, is_set, space, geometry)
        nodes.append(ShaderNode(category, kind, read, name))
    return tuple(MtlxMaterial(name, nodes[k], is_displaced) for name, k, is_displaced in tree["materials"])


# ------------------------------------------------------------------------------------- in the process of the decoder


def decode_document(data: bytes) -> Arrays:
    """The materials of a document and their nodes, as JSON; for `decode_natively`."""
    import MaterialX as mx

    document = mx.createDocument()
    mx.readFromXmlString(document, data.decode())
    document.setDataLibrary(_definitions())
    for node in document.getNodes():
        _complete_types(node)
    walk = _Walk(document)
    found = []
    for material in document.getMaterialNodes():
        shaders = mx.getShaderNodes(material, mx.SURFACE_SHADER_TYPE_STRING)
        link = next((link for shader in shaders if (link := walk.node(shader, {})) is not None), None)
        if link is not None:
            displaced = bool(mx.getShaderNodes(material, mx.DISPLACEMENT_SHADER_TYPE_STRING))
            found.append((material.getName(), link[0], displaced))
    if not found:  # shaders without a material
        for node in document.getNodes():
            if node.getType() == mx.SURFACE_SHADER_TYPE_STRING and (link := walk.node(node, {})) is not None:
                found.append((node.getName(), link[0], False))
    tree = {"materials": found, "nodes": walk.nodes}
    return {"json": np.frombuffer(json.dumps(tree).encode(), np.uint8)}


def _complete_types(node: mx.Node) -> None:
    """Give a node that names only its definition the definition's category and types, as nodes of USD need it."""
    definition = _definitions().getNodeDef(node.getNodeDefString()) if node.getCategory() == _DEFINED else None
    if definition is None:
        return
    node.setCategory(definition.getNodeString())
    node.setType(definition.getType())
    for given in node.getInputs():
        own = definition.getActiveInput(given.getName())
        if own is not None:
            given.setType(own.getType())


@lru_cache(maxsize=1)
def _definitions() -> mx.Document:
    """The definitions of the library."""
    import MaterialX as mx

    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    return library


# The number of a node and its output; an input, as in `_Walk.nodes`; the inputs of a network, by name.
_Link = tuple[int, str]
_Given = tuple[str, str | None, _Link | None, bool, str, str]
_Frame = dict[str, _Given]


class _Walk:
    """The nodes that materials depend on, each after those that it depends on: category, type, name, and inputs by
    name: type, text of a value, number and output of a node, whether the file sets it, colour space, property of the
    geometry."""

    def __init__(self, document: mx.Document) -> None:
        self._document = document
        self._numbers: dict[tuple[str, str, int], _Link | None] = {}
        self._frames: list[_Frame] = []  # alive, so that their identities stay distinct
        self._depth = self._n_visited = 0
        self.nodes: list[tuple[str, str, str, _Frame]] = []

    def node(self, node: mx.Node, frame: _Frame, output: str = "") -> _Link | None:
        """A node within a network, of which `frame` has the inputs; None for one that cannot be read."""
        key = node.getNamePath(), output, id(frame)
        if key in self._numbers:
            return self._numbers[key]
        self._n_visited += 1
        self._depth += 1
        if self._n_visited > MOST_NODES or self._depth > _DEEPEST:
            raise ValueError(f"more than {MOST_NODES} nodes, or {_DEEPEST} that depend on each other, in a network")
        self._numbers[key] = None  # for a node that depends on itself
        self._numbers[key] = link = self._read(node, frame, output)
        self._depth -= 1
        return link

    def _read(self, node: mx.Node, frame: _Frame, output: str) -> _Link | None:
        import MaterialX as mx

        definition = node.getNodeDef()
        if definition is None and node.getCategory() in SURFACES:  # of a version that is not known
            versions = self._document.getMatchingNodeDefs(node.getCategory())
            definition = next((each for each in versions if each.getDefaultVersion()), versions[0])
        category = node.getCategory() if definition is None else definition.getNodeString()
        inputs = self._inputs(node, definition, frame)
        if category not in EVALUATED and category not in SURFACES and definition is not None:
            graph = definition.getImplementation()
            if isinstance(graph, mx.NodeGraph):
                self._frames.append(inputs)
                return self._output(graph, output, inputs)
        self.nodes.append((category, node.getType(), node.getNamePath(), inputs))
        return len(self.nodes) - 1, output or "out"

    def _output(self, graph: mx.NodeGraph, output: str, frame: _Frame) -> _Link | None:
        """The node that an output of a network is connected to."""
        found = graph.getOutput(output) if output else None
        outputs = graph.getOutputs()
        found = found or (outputs[0] if outputs else None)
        inner = None if found is None else found.getConnectedNode()
        if found is None or inner is None:
            return None
        return self.node(inner, frame, found.getOutputString())

    def _inputs(self, node: mx.Node, definition: mx.NodeDef | None, frame: _Frame) -> _Frame:
        """All inputs of a node: as the file sets them, else as defined."""
        found: _Frame = {}
        for given in [] if definition is None else definition.getActiveInputs():
            found[given.getName()] = _default(given)
        for given in node.getActiveInputs():
            kind = found[given.getName()][0] if given.getName() in found else given.getType()
            read = self._given(given, kind, frame)
            if read is not None:
                found[given.getName()] = read
        return found

    def _given(self, given: mx.Input, kind: str, frame: _Frame) -> _Given | None:
        """An input that the file sets; None where it has nothing."""
        name = given.getInterfaceName()
        if name and name in frame:
            return frame[name]
        if name:
            outer = given.getInterfaceInput()
            return None if outer is None or outer.getInterfaceName() else self._given(outer, kind, frame)
        node, output = given.getConnectedNode(), given.getOutputString()
        through = given.getConnectedOutput() if given.getNodeGraphString() else None
        if through is not None:
            node, output = through.getConnectedNode(), through.getOutputString()
        if node is not None:
            link = self.node(node, frame, output)
            return None if link is None else (kind, None, link, True, "", "")
        if not given.hasValueString():
            return None
        text = given.getResolvedValueString() if kind == "filename" else given.getValueString()
        return kind, text, None, True, given.getActiveColorSpace(), ""


def _default(given: mx.Input) -> _Given:
    """An input as it is defined."""
    text = given.getValueString() if given.hasValueString() else None
    return given.getType(), text, None, False, "", given.getDefaultGeomPropString()
