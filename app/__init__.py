"""The program without its window: documents and edits, modes, the worker, files and the command line."""
