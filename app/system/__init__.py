"""The operating system and the machine: atomic files, folders, memory, processes, compiled kernels."""
