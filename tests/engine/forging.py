"""What somebody, or a program of another version, may have put under a right key and a right checksum."""

from collections.abc import Iterator, Mapping

import numpy as np

Arrays = Mapping[str, np.ndarray]
DTYPES = {"f": np.int64, "i": np.float32, "u": np.float64, "b": np.uint8}


def forged_shapes(arrays: Arrays) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """The arrays with one of them missing, of another type or another shape; and which, in words."""
    for name, array in arrays.items():
        others = {other: values for other, values in arrays.items() if other != name}
        yield f"{name} missing", others
        yield f"{name} of another type", others | {name: array.astype(DTYPES[array.dtype.kind])}
        yield f"{name} with an axis more", others | {name: array[None]}
        yield f"{name} with a row more", others | {name: np.concatenate([array, array[-1:]])}
        if array.size:
            yield f"{name} with a row less", others | {name: array[:-1]}
            yield f"{name} in one", others | {name: array.sum()}
        if array.ndim > 1 and array.size:
            yield f"{name} flat", others | {name: array.ravel()}
            yield f"{name} with a column less", others | {name: np.ascontiguousarray(array[:, :-1])}


def forged_numbers(arrays: Arrays) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """The arrays with one number in one of them that it cannot have."""
    for name, array in arrays.items():
        if not array.size:
            continue
        kind = array.dtype.kind
        odd = [np.nan, np.inf] if kind == "f" else [np.iinfo(array.dtype).max - 1]
        odd += [-1] if kind == "i" else []
        for value in odd:
            for place in (0, array.size - 1):
                forged = array.copy()
                forged.reshape(-1)[place] = value
                yield f"{name}[{place}] = {value}", {**arrays, name: forged}
