"""Messages that all modes share: requests and responses of the worker, picture events, and the status."""
