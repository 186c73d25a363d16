"""The window: panels and their actions, the renderers, and the shell that draws a frame of both."""
