"""Matrices as MATLAB's tensegrity programs have them, from and to .mat and .npz.

N is 3 × n_nodes; each row of C_b (bars) and C_s (strings) has −1 where its member begins and +1 where it
ends, and C is C_b over C_s; a row of S is a clustered member, with 1 at each row of C that is a segment of
it. Without S each row of C is a member. Sources: the manuals and examples of TsgFEM and CTSFEM (S. Ma,
M. Chen, R. E. Skelton: *JOSS* 7 (2022) 3390; *Eng. Struct.* 296 (2023) 116925) and MOTES (R. Goyal, M. Chen,
M. Majji, R. E. Skelton: *JOSS* 4 (2019) 1613).
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import ModelError
from tensegra.exchange.clusters import path_of
from tensegra.exchange.files import replacing
from tensegra.exchange.matrixfile import load_mat, load_npz
from tensegra.exchange.said import Content, Said
from tensegra.exchange.scene import Scene

__all__ = ["WANTED", "read_mat", "read_npz", "write_mat", "write_npz"]

FloatArray = NDArray[np.float64]
Values = Mapping[str, Any]

OTHER_NAMES = {"C_b": ("Cb", "Bars"), "C_s": ("Cs", "Strings"), "C_b_in": ("Cb_in",), "C_s_in": ("Cs_in",)}
"""The same matrices as some of the examples name them."""

WANTED = (
    *("N", "C", "C_b", "C_s", "C_b_in", "C_s_in", "index_b", "S"),
    *("E", "A", "EA", "l0", "t", "E_c", "A_c", "l0_c", "t_c"),
    *("pinned_X", "pinned_Y", "pinned_Z", "node_ids", "member_ids"),
    *(name for names in OTHER_NAMES.values() for name in names),
)
"""Names of matrices that are looked at; a file may hold any others."""

_PINNED = {"x": "pinned_X", "y": "pinned_Y", "z": "pinned_Z"}


def read_mat(path: Path, said: Said) -> Content:  # noqa: ARG001 — what is said fills in later
    """Read the matrices of a MATLAB file (up to version 7), alone or as the fields of a struct."""
    return content_of(load_mat(path, WANTED), path.name)


def read_npz(path: Path, said: Said) -> Content:  # noqa: ARG001 — idem
    """Read the matrices of a NumPy archive."""
    return content_of(load_npz(path, WANTED), path.name)


def content_of(values: Values, source: str) -> Content:
    """Return the structure that matrices describe.

    Raises
    ------
    ModelError
        A matrix is missing, or has another shape or other numbers than it can have.
    """
    values = dict(values)
    for name, others in OTHER_NAMES.items():
        for other in others:
            if other in values:
                values.setdefault(name, values[other])
    if "N" not in values:
        raise ModelError.at(source, ", ".join(values) or "no matrix", "the matrix N of the nodes, 3 × n")
    pairs, is_bar, n_columns = _connectivity(values, source)
    nodes = _nodes(values["N"], n_columns, source)
    ids = _texts(values, "node_ids", len(nodes), [str(n + 1) for n in range(len(nodes))], source)
    if len(pairs) == 0 or pairs.max() >= len(nodes):
        found = f"{len(pairs)} rows of C" if len(pairs) == 0 else f"node {pairs.max() + 1}"
        raise ModelError.at(f"{source}: C", found, f"members that join some of the {len(nodes)} nodes of N")
    clusters = _clusters(values, len(pairs), source)
    members, materials = _members(values, pairs, is_bar, clusters, ids, source)
    # A program may have nodes to draw by, which no member of C touches.
    touched = {node for member in members.values() for node in member["nodes"]}
    supports = _supports(values, ids, source)
    return {
        "nodes": {node: place for node, place in zip(ids, nodes.tolist(), strict=True) if node in touched},
        "members": members,
        "materials": materials,
        "supports": {node: axes for node, axes in supports.items() if node in touched},
    }


def _connectivity(values: Values, source: str) -> tuple[NDArray[np.int64], NDArray[np.bool_], int | None]:
    """Return the nodes of all segments, which of them are bars, and for how many nodes C is made.

    Where C is more than C_b over C_s, it has the order of all vectors, or is the part that is computed
    with, the rest being drawn only.
    """
    parts: dict[str, NDArray[np.int64]] = {}
    n_columns = None
    for name in ("C", "C_b", "C_s"):
        given = name if name in values else f"{name}_in"
        if given in values and np.size(values[given]):
            parts[name], columns = _pairs(values[given], f"{source}: {given}")
            n_columns = columns or n_columns
    none = np.zeros((0, 2), dtype=np.int64)
    bars, strings = parts.get("C_b", none), parts.get("C_s", none)
    both = np.concatenate([bars, strings])
    C = parts.get("C", both)
    if len(both) and np.array_equal(C, both):
        return both, np.arange(len(both)) < len(bars), n_columns
    ends = [{tuple(sorted(pair)) for pair in part.tolist()} for part in (bars, strings)]
    if len(both) and not ends[0] & ends[1]:
        return C, np.array([tuple(sorted(pair)) in ends[0] for pair in C.tolist()]), n_columns
    if len(C) and "index_b" in values:
        is_bar = np.zeros(len(C), dtype=np.bool_)
        is_bar[_indices(values["index_b"], len(C), f"{source}: index_b")] = True
        return C, is_bar, n_columns
    expected = "C_b and C_s, or C with index_b: which members are bars and which strings"
    raise ModelError.at(source, ", ".join(values), expected)


def _pairs(value: Any, place: str) -> tuple[NDArray[np.int64], int | None]:  # noqa: ANN401 — dense or sparse
    """Return the two nodes of each row of a connectivity matrix, or of a list of pairs that count from 1."""
    from scipy.sparse import coo_array, issparse

    if not issparse(value):
        value = np.atleast_2d(_numbers(value, place))
    matrix = coo_array(value)
    matrix.eliminate_zeros()
    data = np.asarray(matrix.data, dtype=np.float64)
    if not np.all(np.isin(data, (-1.0, 1.0))) or (matrix.shape[1] == 2 and not np.any(data < 0.0)):
        dense = matrix.toarray() if matrix.shape[1] == 2 else np.zeros((0, 0))
        if matrix.shape[1] != 2 or np.any(dense != np.round(dense)) or np.any(dense < 1):
            raise ModelError.at(place, f"a matrix of {matrix.shape}", "rows with one −1 and one +1, else 0")
        return np.asarray(dense, dtype=np.int64) - 1, None
    starts = np.asarray(matrix.row)[data < 0], np.asarray(matrix.col)[data < 0]
    ends = np.asarray(matrix.row)[data > 0], np.asarray(matrix.col)[data > 0]
    rows = np.arange(matrix.shape[0])
    if not (np.array_equal(np.sort(starts[0]), rows) and np.array_equal(np.sort(ends[0]), rows)):
        raise ModelError.at(place, "another number of them", "one −1 and one +1 in each row")
    pairs = np.empty((len(rows), 2), dtype=np.int64)
    pairs[starts[0], 0], pairs[ends[0], 1] = starts[1], ends[1]
    return pairs, int(matrix.shape[1])


def _nodes(value: Any, n_columns: int | None, source: str) -> FloatArray:  # noqa: ANN401 — whatever the file has
    """Return coordinates, ``(n_nodes, 3)``: from N, or from its transpose if only that fits C."""
    N = np.atleast_2d(_numbers(value, f"{source}: N"))
    if N.ndim != 2 or 3 not in N.shape:
        raise ModelError.at(f"{source}: N", f"a matrix of {N.shape}", "coordinates, a matrix of 3 × n")
    if N.shape[0] != 3 or (n_columns is not None and N.shape[1] != n_columns and N.shape[0] == n_columns):
        N = N.T
    if n_columns is not None and N.shape[1] != n_columns:
        raise ModelError.at(
            f"{source}: C", f"{n_columns} columns", f"one for each of the {N.shape[1]} nodes of N"
        )
    return N.T


def _clusters(values: Values, n_segments: int, source: str) -> list[NDArray[np.int64]]:
    """Return the rows of C that make each member, in the order of the rows of S."""
    from scipy.sparse import issparse

    if not _clusters_members(values.get("S")):
        return [np.array([row]) for row in range(n_segments)]
    S = values["S"]
    if issparse(S):
        S = np.asarray(S.todense())  # type: ignore[attr-defined]
    S = np.atleast_2d(_numbers(S, f"{source}: S"))
    if S.ndim != 2 or S.shape[1] != n_segments:
        raise ModelError.at(
            f"{source}: S", f"a matrix of {S.shape}", f"{n_segments} columns, one for each row of C"
        )
    if not (np.isin(S, (0.0, 1.0)).all() and (S.sum(axis=0) == 1.0).all() and (S.sum(axis=1) > 0.0).all()):
        raise ModelError.at(
            f"{source}: S", "another matrix", "a single 1 in each column, and some 1 in each row"
        )
    return [np.flatnonzero(row) for row in S]


def _clusters_members(S: Any) -> bool:  # noqa: ANN401 — whatever the file has
    """Tell whether a matrix S is of zeros and ones; the same programs call singular values S, too."""
    from scipy.sparse import issparse

    if S is None or not np.size(S):
        return False
    numbers = np.asarray(S.data if issparse(S) else S)  # type: ignore[attr-defined]
    return numbers.dtype.kind in "biuf" and bool(np.isin(numbers, (0.0, 1.0)).all())


def _members(
    values: Values,
    pairs: NDArray[np.int64],
    is_bar: NDArray[np.bool_],
    clusters: list[NDArray[np.int64]],
    ids: list[str],
    source: str,
) -> tuple[dict[str, Content], dict[str, Content]]:
    """Return the members and the materials that they are made of."""
    E, A, EA, tension = (
        _by_member(values, name, clusters, len(pairs), source) for name in ("E", "A", "EA", "t")
    )
    rest_length = _by_member(values, "l0", clusters, len(pairs), source, np.sum)
    counts = {"strut": 0, "cable": 0}
    members: dict[str, Content] = {}
    materials: dict[float, str] = {}
    kinds = ["strut" if is_bar[rows].any() else "cable" for rows in clusters]
    names = []
    for kind in kinds:
        counts[kind] += 1
        names.append(f"{kind[0]}{counts[kind]}")
    names = _texts(values, "member_ids", len(clusters), names, source)
    for k, rows in enumerate(clusters):
        if len(rows) > 1 and is_bar[rows].any():
            raise ModelError.at(
                f"{source}: S, row {k + 1}", "a bar among several", "bars alone in their rows"
            )
        path = path_of(pairs[rows], f"{source}: S, row {k + 1}")
        member: Content = {"kind": kinds[k], "nodes": [ids[node] for node in path]}
        if EA is not None:
            member["stiffness"] = float(EA[k])
        elif E is not None and A is not None:
            material = materials.setdefault(float(E[k]), f"material{len(materials) + 1}")
            member |= {"material": material, "area": float(A[k])}
        if rest_length is not None:
            member["rest_length"] = float(rest_length[k])
        elif tension is not None:
            member["tension"] = float(tension[k])
        members[names[k]] = member
    return members, {name: {"youngs_modulus": modulus} for modulus, name in materials.items()}


def _by_member(
    values: Values,
    name: str,
    clusters: list[NDArray[np.int64]],
    n_segments: int,
    source: str,
    gather: Callable[[FloatArray], Any] | None = None,
) -> FloatArray | None:
    """Return a vector over members, given over them or over the rows of C; None where there is none."""
    given = next((key for key in (f"{name}_c", name) if key in values and np.size(values[key])), None)
    if given is None:
        return None
    place = f"{source}: {given}"
    vector = _numbers(values[given], place).ravel()
    if len(vector) == 1:
        vector = np.full(n_segments, vector[0])
    if len(vector) == len(clusters) and (given != name or n_segments != len(clusters)):
        return vector
    if len(vector) != n_segments:
        expected = f"{n_segments} numbers, one for each row of C, or {len(clusters)}, one for each row of S"
        raise ModelError.at(place, f"{len(vector)} numbers", expected)
    if gather is not None:
        return np.array([gather(vector[rows]) for rows in clusters])
    for k, rows in enumerate(clusters):
        if not np.allclose(vector[rows], vector[rows[0]], rtol=1e-9, atol=0.0):
            raise ModelError.at(
                f"{place}, row {k + 1} of S", vector[rows].tolist(), "one number for all segments"
            )
    return np.array([vector[rows[0]] for rows in clusters])


def _supports(values: Values, ids: list[str], source: str) -> dict[str, str]:
    supports: dict[str, str] = {}
    for axis, name in _PINNED.items():
        for node in _indices(values.get(name, ()), len(ids), f"{source}: {name}"):
            supports[ids[node]] = supports.get(ids[node], "") + axis
    return supports


def _indices(value: Any, most: int, place: str) -> NDArray[np.int64]:  # noqa: ANN401 — whatever the file has
    """Return whole numbers that count from 1 as ones that count from 0."""
    if not np.size(value):
        return np.zeros(0, dtype=np.int64)
    numbers = _numbers(value, place).ravel()
    if np.any(numbers != np.round(numbers)) or np.any(numbers < 1) or np.any(numbers > most):
        raise ModelError.at(place, numbers.tolist(), f"whole numbers from 1 to {most}")
    return np.asarray(numbers, dtype=np.int64) - 1


def _numbers(value: Any, place: str) -> FloatArray:  # noqa: ANN401 — whatever the file has
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":
        raise ModelError.at(place, f"an array of {array.dtype}", "real numbers")
    numbers = array.astype(np.float64)
    if not np.isfinite(numbers).all():
        raise ModelError.at(place, "a number that is not finite", "finite numbers")
    return numbers


def _texts(values: Values, name: str, n: int, otherwise: list[str], source: str) -> list[str]:
    """Return the names that a file gives, which those of our own making do."""
    if name not in values:
        return otherwise
    # MATLAB's cells are arrays within an array.
    cells = (np.ravel(cell) for cell in np.ravel(np.asarray(values[name])))
    texts = [str(cell[0]).strip() if len(cell) else "" for cell in cells]
    if len(texts) != n or len(set(texts)) != n:
        raise ModelError.at(f"{source}: {name}", f"{len(set(texts))} different names", f"{n}")
    return texts


def write_mat(scene: Scene, path: Path) -> None:
    """Write the matrices of a structure, and its positions and tensions in all frames."""
    from scipy.io import savemat

    with replacing(path) as draft:
        # In column vectors, as MATLAB's programs have theirs; names as a cell array.
        savemat(str(draft), {name: _for_matlab(value) for name, value in matrices_of(scene).items()})


def write_npz(scene: Scene, path: Path) -> None:
    """Write the same as NumPy's arrays."""
    with replacing(path) as draft, draft.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **matrices_of(scene))


def matrices_of(scene: Scene) -> dict[str, Any]:
    """Return the matrices of a structure at its last frame, and all its frames.

    Segments are ordered bars first. E is the modulus and A the area where a member has both; where it has
    EA alone, E is EA and A is 1.
    """
    structure = scene.structure
    rest_length, stiffness = scene.members
    order = sorted(range(structure.n_members), key=lambda e: list(structure.members.values())[e].is_cable)
    ids = [structure.member_ids[e] for e in order]
    pairs, owners = scene.segments()
    rows = np.concatenate([np.flatnonzero(owners == e) for e in order])
    owner_row = {e: k for k, e in enumerate(order)}
    C = np.zeros((len(rows), structure.n_nodes))
    C[np.arange(len(rows)), pairs[rows, 0]] = -1.0
    C[np.arange(len(rows)), pairs[rows, 1]] = 1.0
    S = np.zeros((len(order), len(rows)))
    S[[owner_row[e] for e in owners[rows]], np.arange(len(rows))] = 1.0
    areas = np.array([structure.members[name].area or 1.0 for name in ids])
    n_bars = sum(not structure.members[name].is_cable for name in ids)
    matrices: dict[str, Any] = {
        "N": scene.last.nodes.T,
        "C": C,
        "C_b": C[:n_bars],
        "C_s": C[n_bars:],
        "S": S,
        "E_c": stiffness[order] / areas,
        "A_c": areas,
        "l0_c": rest_length[order],
        "t_c": scene.last.tensions[order],
        "index_b": np.arange(1.0, n_bars + 1),
        "N_frames": np.stack([frame.nodes.T for frame in scene.frames], axis=-1),
        "t_frames": np.stack([frame.tensions[order] for frame in scene.frames], axis=-1),
        "time_frames": np.array([frame.time for frame in scene.frames]),
        "label_frames": np.array([frame.label for frame in scene.frames]),
        "status_frames": np.array([frame.status for frame in scene.frames]),
        "node_ids": np.array(structure.node_ids),
        "member_ids": np.array(ids),
        "units": np.array([structure.units.length, structure.units.force]),
    }
    for axis, name in _PINNED.items():
        held = [
            n + 1.0 for n, node in enumerate(structure.node_ids) if axis in structure.supports.get(node, "")
        ]
        matrices[name] = np.array(held)
    return matrices


def _for_matlab(value: Any) -> Any:  # noqa: ANN401 — an array of numbers or of texts
    if value.dtype.kind == "U":
        return value.astype(object).reshape(-1, 1)
    return value.reshape(-1, 1) if value.ndim == 1 else value
