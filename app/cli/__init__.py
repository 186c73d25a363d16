"""The command line: the arguments of each command, and the work that only the command line does.

Exit status: 0; 1, the work failed and one line on standard error says why and what to do; 2, usage (and no display to
open a window on); 130, Ctrl-C; 143, SIGTERM while measuring. This file imports nothing: a window that is opened by name
goes through `console` alone, without the library for commands.
"""
