"""The worker process and the client that talks to it: requests are scheduled, computed and answered here, and
transport, kernels and measurements are cached on disk.
"""
