"""Pictures in files, and sequences of them: what `insitu render` computes."""
