"""`python -m app.worker`: the worker process. Before anything else it gives way to the window's process."""

from app.worker.process import yield_to_window

if __name__ == "__main__":
    yield_to_window()
    from app.worker.worker import main

    main()
