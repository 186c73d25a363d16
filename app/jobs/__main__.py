"""`python -m app.jobs`: the worker process. First it leaves to the window what is the window's."""

from app.jobs.background import step_back

if __name__ == "__main__":
    step_back()
    from app.jobs.worker import main

    main()
