"""Programs that are started to be measured, so that OpenGL and the worker process begin fresh. `launches` starts them.

The editor, the worker process and the renderer are the real ones; only the window around them is missing.
"""
