"""Deform: transfer fitted by zonal harmonics that rotate with a deforming surface [Sloan05]."""
