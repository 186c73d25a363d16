"""`python -m app.worker`: the worker process. First it leaves to the window what is the window's."""

from app.worker.background import yield_to_window

if __name__ == "__main__":
    yield_to_window()
    from app.worker.worker import main

    main()
