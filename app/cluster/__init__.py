"""Work on a Dask cluster: frames of `insitu render`, and the transport of `insitu precompute`.

    this process                      scheduler                   workers (Insitu is installed on all)
    cluster_project.py  open, note files
    scene_bundle.py  their digests ─► file_cache.py: pieces ────► file_cache.py: whole files, under the same names
    dask.py     tasks ──────────────► assigns them ─────────────► cluster_jobs.py: open the same project, compute
    dask.py     ◄──────────────────── results ◄───────────────── arrays
    frames, cache                                                 their own caches only save time

A task is a function of what it is sent, so that a lost worker only costs time: Dask gives its tasks to another one. The
result is the same to the last bit as without a cluster, because the same code computes it. Dask is an extra, imported
only in `dask.py` and by workers. Rejected: to pickle what was loaded, which ties the protocol to every class of the
engine; and a folder that all machines share, which a laptop and a rented cluster do not have.
"""
