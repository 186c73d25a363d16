"""What the worker says of the images of parameter maps: each of them is a ramp."""

from __future__ import annotations

import numpy as np

from app.document.node_layers import channel_images, with_node_layers
from app.messages.file_messages import ChannelsRead, ReadChannels
from engine.material.parameter_maps import channel_statistics
from engine.material.parameter_nodes import known_nodes

RAMP = channel_statistics(np.linspace(0.0, 1.0, 1000))


def channels_read(request: ReadChannels, id: int) -> ChannelsRead:
    """The statistics of the images, and the nodes of the documents' maps."""
    of_documents = (image for document in request.documents for image in channel_images(document))
    needed = dict.fromkeys((*request.images, *of_documents), RAMP)
    for document in request.documents:
        with_node_layers(document, needed)
    return ChannelsRead(needed, {}, known_nodes(needed), id=id)
