"""Work on a Dask cluster: frames of `insitu render`, and the transport of `insitu precompute`.

    this process                      scheduler                   workers (Insitu is installed on all)
    opened.py   open, note files
    parcel.py   what they hold ─────► shelf.py: pieces ─────────► shelf.py: whole files, under the same names
    dask.py     tasks ──────────────► who is free ──────────────► errands.py: open the same project, draw or compute
    dask.py     ◄──────────────────── results ◄───────────────── arrays
    frames, Store                                                 their own caches save time alone

A task is a function of what it is sent, so that a worker that is lost costs time alone: Dask gives its tasks to another
one. What comes out is the same to the last bit as without a cluster, since it is the same code that makes it. Dask is
an extra, and imported in `dask.py` and by workers alone. Rejected: to pickle what was loaded, which ties the wire to
every class of the engine; and a folder that all machines share, which a laptop and a rented cluster do not have.
"""
