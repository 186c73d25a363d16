"""Floating-point optimisations that compilers may apply in kernels where the last bit does not matter.

Not `fastmath=True`: that also assumes that every number is finite, so that tests for NaN or infinity may be removed.
"""

# Fused multiply-add, reassociation, ignored sign of 0, reciprocals and approximate functions.
FAST = {"contract", "reassoc", "nsz", "arcp", "afn"}
