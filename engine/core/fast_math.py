"""What compilers may do with sums and products in kernels where the last bit does not matter.

Not `fastmath=True`: that also takes every number for finite, and tests for NaN or infinity may be left out.
"""

# Multiply and add at once, in another order, without regard for the sign of 0, by reciprocals and quick functions.
FAST = {"contract", "reassoc", "nsz", "arcp", "afn"}
