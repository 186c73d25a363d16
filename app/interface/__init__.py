"""The Python interface: what `import insitu` offers.

    import insitu

    scene = insitu.open("teatray")
    scene["teapot"]["copper"]["gamma_alpha"].amplify(y=1.5)
    picture = scene.image()

A scene is edited through its objects, layers and curves; each edit is one of the editor's commands, which
`scene.undo()` takes back. Pictures are made by the engine itself, in this process and without a window, and keep what
they are made of from call to call.
"""

from app.interface.nodes import CameraNode, Curve, LayerNode, LightNode, ObjectNode
from app.interface.scene import Scene
from app.interface.scene import open_scene as open
from engine.core.errors import InsituError as Error
from engine.curve.operators import Operator

__all__ = ["CameraNode", "Curve", "Error", "LayerNode", "LightNode", "ObjectNode", "Operator", "Scene", "open"]
