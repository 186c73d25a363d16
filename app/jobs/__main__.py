"""`python -m app.jobs`: the worker process. It steps back first, before it imports anything that takes time."""

from app.jobs.background import step_back

if __name__ == "__main__":
    step_back()
    from app.jobs.worker import main

    main()
