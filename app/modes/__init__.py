"""The modes: ways to make a picture of one document. Each has a folder; `mode` defines the interface, `registry` lists
them.
"""
