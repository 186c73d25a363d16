"""`python -m app.jobs`: the worker process. First it leaves to the window what is the window's."""

from app.jobs.background import yield_to_window

if __name__ == "__main__":
    yield_to_window()
    from app.jobs.worker import main

    main()
