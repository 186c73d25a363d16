"""The worker process and its client: requests are scheduled, computed and answered here, and transport, kernels and
measurements are cached on disk."""
