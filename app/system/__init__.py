"""What the machine and its system give: files whole or not there, folders, memory, processes, compiled kernels."""
