"""The document and the view as immutable values, the commands that edit them, and their history."""
