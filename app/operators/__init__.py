"""What the user can do, by keys, menus and scripts, each declared once."""
