"""Structures without any order to them, and ways to actuate them: made to go slack, fold, snap and collapse.

Every function takes a generator of random numbers and returns a `Case`. Nothing in a case is symmetric:
where a symmetric path forks, which way it goes is nobody's to say.
"""

from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np

from tensegra.structure import Actuator, Material, Member, Stage, Structure, library
from tensegra.structure.structure import path_length

SIX_ACTUATORS = ("A1", "A2", "A3", "A4", "A14", "A23")
"""Of the library's beam: each of its clustered cables, and both pairs."""


@dataclass(frozen=True)
class Case:
    """A structure and several runs of it.

    Attributes
    ----------
    structure
        The structure.
    actuation
        By actuator, its values, ``(n_runs,)``.
    loads
        By (node, axis), forces added along the actuation, ``(n_runs,)``.
    """

    structure: Structure
    actuation: dict[str, np.ndarray]
    loads: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)

    @property
    def n_runs(self):
        """Number of runs."""
        return len(next(iter(self.actuation.values())))

    @property
    def size(self):
        """Largest extent of the structure along an axis."""
        return np.ptp(self.structure.coordinates, axis=0).max()

    def inputs(self, run):
        """Return the inputs of one run, as `solve_path` takes them."""
        return {
            "actuation": {name: float(values[run]) for name, values in self.actuation.items()},
            "loads": {name: float(values[run]) for name, values in self.loads.items()},
        }

    def batch(self, runs):
        """Return the inputs of some runs, as `solve_batch` takes them."""
        return {
            "actuation": {name: values[runs] for name, values in self.actuation.items()},
            "loads": {name: values[runs] for name, values in self.loads.items()},
        }


def beam(rng, n_runs=4, largest=0.35):
    """Return the library's beam with its six actuators anywhere up to `largest`."""
    return Case(library.paper_beam(), {name: rng.uniform(0.0, largest, n_runs) for name in SIX_ACTUATORS})


def x_frame(rng, n_runs=4):
    """Return a planar frame: four struts around two cables that cross, or two struts that cross in four."""
    return (_frame_of_struts if rng.random() < 0.5 else _crossed_cell)(rng, n_runs)


def _frame_of_struts(rng, n_runs):
    h = rng.uniform(0.3, 1.0)
    nodes = _shaken(rng, {"a": (-1, 0, 0), "b": (1, 0, 0), "c": (0, 0, h), "d": (0, 0, -h)}, 0.02)
    sides = {"s1": ("a", "c"), "s2": ("c", "b"), "s3": ("b", "d"), "s4": ("d", "a")}
    members = {name: _member(rng, "strut", nodes, path, 0.01) for name, path in sides.items()}
    for name, path in {"h": ("a", "b"), "v": ("c", "d")}.items():
        members[name] = _member(rng, "cable", nodes, path, 0.02, stretch=0.01)
    load = Stage("load", loads={node: _force_in_plane(rng, 2.0) for node in ("b", "d")})
    structure = Structure(
        name="frame",
        nodes=nodes,
        members=members,
        supports={"a": "xyz", "b": "yz", "c": "y", "d": "y"},
        stages=[load],
        actuators={"A": Actuator(("h",), "shorten"), "B": Actuator(("v",), "lengthen")},
    )
    actuation = {"A": rng.uniform(-0.1, 0.1, n_runs), "B": rng.uniform(-0.1, 0.3, n_runs)}
    return Case(structure, actuation, {("c", axis): rng.normal(0.0, 40.0, n_runs) for axis in "xz"})


def _crossed_cell(rng, n_runs):
    nodes = _shaken(rng, {"a": (-1, 0, 0), "b": (0, 0, -1), "c": (1, 0, 0), "d": (0, 0, 1)}, 0.1)
    members = {name: _member(rng, "strut", nodes, path, 0.0) for name, path in {"s": "ac", "t": "bd"}.items()}
    for first, second in ("ab", "bc", "cd", "da"):
        members[first + second] = _member(rng, "cable", nodes, first + second, 0.01, stretch=0.02)
    structure = Structure(
        name="crossed cell",
        nodes=nodes,
        members=members,
        supports={"a": "xyz", "b": "y", "c": "yz", "d": "y"},
        actuators={name: Actuator((name,), "shorten") for name in members if name not in "st"},
    )
    actuation = {name: rng.uniform(-0.15, 0.5, n_runs) for name in structure.actuators}
    return Case(structure, actuation, {("d", axis): rng.normal(0.0, 5.0, n_runs) for axis in "xz"})


def von_mises(rng, n_runs=4):
    """Return one to four shallow trusses one above the other, with cables between their tops."""
    n = rng.integers(1, 5)
    nodes, members, supports = {}, {}, {}
    for i in range(n):
        nodes |= {
            f"l{i}": (-1.0, 0.0, 2.0 * i),
            f"r{i}": (1.0, 0.0, 2.0 * i),
            f"t{i}": (rng.uniform(-0.2, 0.2), 0.0, 2.0 * i + rng.uniform(0.1, 0.5)),
        }
        supports |= {f"l{i}": "xyz", f"r{i}": "xyz", f"t{i}": "y"}
        for name, path in {f"a{i}": (f"l{i}", f"t{i}"), f"b{i}": (f"t{i}", f"r{i}")}.items():
            members[name] = _member(rng, "strut", nodes, path, 0.01)
        if i:
            members[f"c{i}"] = _member(rng, "cable", nodes, (f"t{i - 1}", f"t{i}"), 0.02)
    structure = Structure(
        name="von Mises trusses",
        nodes=nodes,
        members=members,
        supports=supports,
        actuators={name: Actuator((name,), "shorten") for name in members},
        stages=[Stage("load", loads={f"t{n - 1}": _force_in_plane(rng, 1.0)})],
    )
    spread = {name: 0.2 if member.is_cable else 0.05 for name, member in members.items()}
    actuation = {name: rng.uniform(-s, s, n_runs) for name, s in spread.items()}
    loads = {(f"t{i}", "z"): rng.uniform(-20.0, 5.0, n_runs) for i in range(n)}
    return Case(structure, actuation, loads)


def net(rng, n_runs=4):
    """Return a net of cables hung by its rim, with weights at its knots and cables that go slack and taut."""
    nx, ny = rng.integers(3, 6, 2)
    nodes, supports, members = {}, {}, {}
    for i, j in product(range(nx), range(ny)):
        if i in (0, nx - 1) and j in (0, ny - 1):
            continue  # no cable runs to a corner
        rim = i in (0, nx - 1) or j in (0, ny - 1)
        x, y, z = i + rng.uniform(-0.1, 0.1), j + rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)
        nodes[f"{i}_{j}"] = (x, y, z if rim else z - 0.3)
        supports |= {f"{i}_{j}": "xyz"} if rim else {}
    for i, j, along in product(range(nx), range(ny), (0, 1)):
        path = (f"{i}_{j}", f"{i + 1 - along}_{j + along}")
        if nodes.keys() >= set(path) and not supports.keys() >= set(path):
            members["-".join(path)] = _member(rng, "cable", nodes, path, 0.05, area=0.1)
    structure = Structure(
        name="net",
        nodes=nodes,
        members=members,
        materials={"rope": Material(youngs_modulus=1e4, weight=1.0)},
        supports=supports,
        gravity=(0.0, 0.0, -1.0),
        stages=[
            Stage("hang", loads={n: (0.0, 0.0, -rng.uniform(0.5, 5.0)) for n in nodes if n not in supports})
        ],
        actuators={name: Actuator((name,), "shorten") for name in members},
    )
    actuation = {name: rng.uniform(-0.1, 0.2, n_runs) for name in rng.permutation(list(members))[:6]}
    pulled = rng.permutation([node for node in nodes if node not in supports])[:2]
    return Case(structure, actuation, {(n, a): rng.normal(0.0, 5.0, n_runs) for n in pulled for a in "xy"})


def prism(rng, n_runs=4):
    """Return a prism of three to six struts, classical or with a closed loop for its top.

    Every cable is an actuator. With more than three struts and a loop it is flat: a high one topples.
    """
    n, clustered = int(rng.integers(3, 7)), bool(rng.random() < 0.5)
    height = rng.uniform(0.3, 0.55) if clustered and n > 3 else rng.uniform(0.4, 2.0)
    prestress = 10.0 ** rng.uniform(2.5, 3.5)
    given = library.prism(
        n,
        height=height,
        top_radius=rng.uniform(0.6, 1.3),
        prestress=prestress,
        strut_stiffness=1e7,
        cable_stiffness=10.0 ** rng.uniform(4.0, 6.0),
        clustered=clustered,
    )
    cables = [name for name, member in given.members.items() if member.is_cable]
    structure = given.replace(actuators={name: Actuator((name,), "shorten") for name in cables})
    spread, push = rng.choice([0.05, 0.2, 0.4]), prestress * rng.choice([0.05, 0.5, 1.0])
    actuation = {name: rng.uniform(-spread, spread, n_runs) for name in cables}
    return Case(
        structure, actuation, {(f"t{i}", a): rng.normal(0.0, push, n_runs) for i in (0, 1) for a in "xyz"}
    )


def ball(rng, n_runs=4):
    """Return a ball of six struts and 24 cables, held by six coordinates, with eight cables as actuators.

    Struts lie side by side, half as far apart as they are long: the equilibrium is that of symmetry, and a
    second stage takes the symmetry away.
    """
    nodes = {}
    for axis, (side, end) in product(range(3), product((1.0, -1.0), (1.0, -1.0))):
        at = np.zeros(3)
        at[axis], at[(axis + 1) % 3] = end, 0.5 * side
        nodes[f"{'xyz'[axis]}{'+-'[side < 0]}{'+-'[end < 0]}"] = tuple(at.tolist())
    members = {
        name: Member("strut", (f"{name}+", f"{name}-"), 2.0, stiffness=1e6)
        for name in ("x+", "x-", "y+", "y-", "z+", "z-")
    }
    stiffness = 10.0 ** rng.uniform(3.5, 5.0)
    for path in combinations(nodes, 2):
        length = path_length(nodes, path)
        if length < 1.3 and path[0][0] != path[1][0]:
            members["".join(path)] = Member("cable", path, length / 1.02, stiffness=stiffness)
    cables = [name for name, member in members.items() if member.is_cable]
    structure = Structure(
        name="ball",
        nodes=nodes,
        members=members,
        # The last support is square to its arm: while the ball shrinks it stays one, and carries nothing.
        supports={"z++": "xyz", "z+-": "xy", "z-+": "y"},
        stages=[
            Stage("symmetric"),
            Stage("built", rest_length_changes={name: rng.uniform(-0.01, 0.005) for name in cables}),
        ],
        actuators={name: Actuator((name,), "shorten") for name in cables},
    )
    spread = rng.choice([0.05, 0.2, 0.4])
    return Case(structure, {c: rng.uniform(-spread, spread, n_runs) for c in rng.permutation(cables)[:8]})


def kite(rng, n_runs=4, *, balanced=True):
    """Return two struts that cross in a ring of four cables, flat in space and held by six coordinates.

    Where it is not balanced the coordinates given are not an equilibrium, but near one.
    """
    nodes = {"a": (-1.0, 0.0, 0.0), "b": (0.0, -1.0, 0.0), "c": (1.0, 0.0, 0.0), "d": (0.0, 1.0, 0.0)}
    if not balanced:
        nodes |= {
            name: (rng.uniform(-0.15, 0.15), nodes[name][1] + rng.uniform(-0.15, 0.15), 0.0) for name in "bd"
        }
    members = {
        name: Member("strut", path, path_length(nodes, path), stiffness=1e6)
        for name, path in {"ac": ("a", "c"), "bd": ("b", "d")}.items()
    }
    stiffness = 10.0 ** rng.uniform(4.0, 5.0)
    for path in (("a", "b"), ("b", "c"), ("c", "d"), ("d", "a")):
        members["".join(path)] = Member("cable", path, path_length(nodes, path) / 1.01, stiffness=stiffness)
    cables = ("ab", "bc", "cd", "da")
    structure = Structure(
        name="kite",
        nodes=nodes,
        members=members,
        supports={"a": "xyz", "c": "yz", "b": "z"},
        stages=[
            Stage("drawn"),
            Stage("built", rest_length_changes={name: rng.uniform(-0.02, 0.0) for name in cables}),
        ],
        actuators={name: Actuator((name,), "shorten") for name in cables},
    )
    return Case(structure, {name: rng.uniform(-0.02, rng.choice([0.1, 0.6]), n_runs) for name in cables})


def d_bar(rng, n_runs=4):
    """Return a D-bar with a clustered cable, or without one, in space and held by six coordinates."""
    upper, lower = rng.uniform(0.7, 1.3, 2)
    given = library.d_bar(
        half_width=np.sqrt(upper * lower) * rng.uniform(0.4, 0.9),
        upper=upper,
        lower=lower,
        prestress=10.0 ** rng.uniform(2.0, 3.5),
        cable_stiffness=10.0 ** rng.uniform(4.5, 6.0),
        clustered=bool(rng.random() < 0.5),
    )
    cables = [name for name, member in given.members.items() if member.is_cable]
    structure = given.replace(
        supports={"left": "xyz", "right": "yz", "top": "z"},
        stages=[Stage("symmetric")],
        actuators={name: Actuator((name,), "shorten") for name in cables},
    )
    return Case(structure, {name: rng.uniform(-0.01, 0.3, n_runs) for name in cables})


def _shaken(rng, nodes, by):
    """Move every node within the plane y = 0 by up to `by`; the first one and what it is level with stay."""
    first = next(iter(nodes))
    return {
        name: (x, y, z)
        if name == first
        else (x + rng.uniform(-by, by), y, z + (rng.uniform(-by, by) if z else 0.0))
        for name, (x, y, z) in nodes.items()
    }


def _member(rng, kind, nodes, path, spread, stretch=0.0, area=None):
    """Return a member whose rest length is that of its path less `stretch`, give or take `spread`."""
    path = tuple(path)
    rest_length = path_length(nodes, path) * (1.0 + rng.uniform(-spread, spread)) / (1.0 + stretch)
    if area is not None:
        return Member(kind, path, rest_length, material="rope", area=area)
    lowest, highest = (2.5, 4.5) if kind == "strut" else (1.5, 2.5)
    return Member(kind, path, rest_length, stiffness=10.0 ** rng.uniform(lowest, highest))


def _force_in_plane(rng, scale):
    return (rng.normal(0.0, scale), 0.0, rng.normal(0.0, scale))
