"""The editor without a window: it joins document, history and view to the worker, runs scripts, and opens scenes."""
