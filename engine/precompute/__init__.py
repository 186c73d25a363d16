"""Precomputed transport for editing in final placement: direct light and indirect light [BenArtzi07]."""
