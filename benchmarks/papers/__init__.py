"""The figures and tables of the three papers that this project is built on, and ours beside them.

`python -m benchmarks.papers` carries out each entry and writes docs/papers/, a page a paper.

    entries (thesis, triple_product, zonal_harmonics) ─► carried out one by one ─► their text in a folder ─► pages

An entry measures or draws what its figure or table shows, with the project's own scenes where the paper's are not at
hand, and puts the paper's numbers beside ours. What has no counterpart says why in a sentence.
"""
