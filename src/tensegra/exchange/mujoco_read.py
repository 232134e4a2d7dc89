"""Models of MuJoCo: capsules are struts, spatial tendons are cables.

MuJoCo itself compiles the model, so that defaults, frames and nested bodies are where it has them. A
tendon has the stiffness and rest length of its spring. A tendon of the group that our own models give to
struts, with a spring that pushes, too, is a strut.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import ModelError
from tensegra.exchange.files import library, require_file
from tensegra.exchange.mujoco_write import STRUT_GROUP
from tensegra.exchange.said import Content, Said

__all__ = ["read"]

REFUSED = ("include", "attach", "replicate", "composite", "flexcomp", "plugin")
"""Elements that bring in other files, or a million bodies in a line."""

_AXES = np.eye(3)


def read(path: Path, said: Said) -> Content:  # noqa: ARG001 — what is said fills in later
    """Read a model in its initial position."""
    mujoco = library("mujoco", "MuJoCo XML")
    require_file(path)
    _require_plain(path)
    # It writes its warnings into a file of the working folder, unless somebody listens.
    mujoco.set_mju_user_warning(lambda _warning: None)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"{path.name}: MuJoCo refuses it ({' '.join(str(error).split())[:300]})") from None
    finally:
        mujoco.set_mju_user_warning(None)
    return _Reader(mujoco, model, data, path.name).content()


def _require_plain(path: Path) -> None:
    """Refuse what is no XML, has entities of its own, or is more than it shows."""
    defused = library("defusedxml.ElementTree", "MuJoCo XML")
    exceptions = library("defusedxml", "MuJoCo XML")
    try:
        root = defused.parse(path, forbid_dtd=True).getroot()
    except exceptions.DefusedXmlException:
        raise ModelError.at(path.name, "a document type with entities of its own", "plain XML") from None
    except (defused.ParseError, ValueError, LookupError) as error:
        raise ModelError(f"{path.name}: this is not XML ({' '.join(str(error).split())})") from None
    if root.tag != "mujoco":
        raise ModelError.at(path.name, f"<{root.tag}>", "a model of MuJoCo, <mujoco>")
    for element in root.iter():
        if element.tag in REFUSED:
            expected = "a model whose bodies all stand in the file, as mj_saveLastXML writes it"
            raise ModelError.at(path.name, f"<{element.tag}>", expected)


class _Reader:
    """Gathers the nodes, one by one, of the struts and then of the tendons."""

    def __init__(self, mujoco: Any, model: Any, data: Any, source: str) -> None:  # noqa: ANN401 — MuJoCo's
        self._mujoco, self._model, self._data, self._source = mujoco, model, data, source
        self._points: list[NDArray[np.float64]] = []
        self._bodies: list[int] = []
        self._names: list[str | None] = []
        # Ends of struts, by body, with the distance within which a site is at them.
        self._ends: dict[int, list[tuple[int, float]]] = {}
        self._node_of_site: dict[int, int] = {}

    def content(self) -> Content:
        found = [self._strut(geom) for geom in self._capsules()]
        found += [self._tendon(t) for t in range(self._model.ntendon) if self._is_spatial(t)]
        if not found:
            raise ModelError.at(
                self._source, "neither capsules nor spatial tendons", "some of them: the members"
            )
        ids = self._ids()
        members: dict[str, Content] = {}
        counts = {"strut": 0, "cable": 0}
        for name, member in found:
            counts[member["kind"]] += 1
            key = name or f"{member['kind'][0]}{counts[member['kind']]}"
            if key in members:
                raise ModelError.at(self._source, key, "different names of capsules and tendons")
            members[key] = {**member, "nodes": [ids[n] for n in member["nodes"]]}
        held = {ids[n]: self._held(body) for n, body in enumerate(self._bodies)}
        return {
            "nodes": {ids[n]: point.tolist() for n, point in enumerate(self._points)},
            "members": members,
            "supports": {node: axes for node, axes in held.items() if axes},
            "stages": self._stages(ids),
        }

    def _capsules(self) -> list[int]:
        return np.flatnonzero(self._model.geom_type == self._mujoco.mjtGeom.mjGEOM_CAPSULE).tolist()

    def _name(self, kind: str, index: int) -> str | None:
        name = self._mujoco.mj_id2name(self._model, getattr(self._mujoco.mjtObj, f"mjOBJ_{kind}"), index)
        return str(name) if name else None

    def _node(self, point: NDArray[np.float64], body: int, name: str | None = None) -> int:
        self._points.append(np.array(point, dtype=np.float64))
        self._bodies.append(body)
        self._names.append(name)
        return len(self._points) - 1

    def _strut(self, geom: int) -> tuple[str | None, Content]:
        radius, half = (float(size) for size in self._model.geom_size[geom, :2])
        along = half * self._data.geom_xmat[geom].reshape(3, 3)[:, 2]
        body = int(self._model.geom_bodyid[geom])
        nodes = [self._node(self._data.geom_xpos[geom] + sign * along, body) for sign in (1.0, -1.0)]
        self._ends.setdefault(body, []).extend((node, radius) for node in nodes)
        return self._name("GEOM", geom), {"kind": "strut", "nodes": nodes, "rest_length": 2.0 * half}

    def _is_spatial(self, tendon: int) -> bool:
        return self._wraps(tendon)[0][0] != int(self._mujoco.mjtWrap.mjWRAP_JOINT)

    def _wraps(self, tendon: int) -> list[tuple[int, int]]:
        start, number = int(self._model.tendon_adr[tendon]), int(self._model.tendon_num[tendon])
        return [
            (int(self._model.wrap_type[i]), int(self._model.wrap_objid[i]))
            for i in range(start, start + number)
        ]

    def _tendon(self, tendon: int) -> tuple[str | None, Content]:
        name = self._name("TENDON", tendon)
        nodes = []
        for kind, site in self._wraps(tendon):
            if kind != self._mujoco.mjtWrap.mjWRAP_SITE:
                found = "a pulley or a body that it wraps"
                raise ModelError.at(
                    f"{self._source}: tendon {name or tendon}", found, "sites, one after the other"
                )
            nodes.append(self._at_site(site, name or str(tendon)))
        low, high = (float(length) for length in self._model.tendon_lengthspring[tendon])
        pushes = low == high and int(self._model.tendon_group[tendon]) == STRUT_GROUP
        member: Content = {"kind": "strut" if pushes and len(nodes) == 2 else "cable", "nodes": nodes}
        if high > 0.0:
            member["rest_length"] = high
            spring = float(np.ravel(self._model.tendon_stiffness[tendon])[0])
            if spring > 0.0:
                member["stiffness"] = spring * high
        return name, member

    def _at_site(self, site: int, tendon: str) -> int:
        """Return the node of a site: an end of a strut of its body, or a point of its own."""
        if site in self._node_of_site:
            return self._node_of_site[site]
        body, point, name = (
            int(self._model.site_bodyid[site]),
            self._data.site_xpos[site],
            self._name("SITE", site),
        )
        if self._ends.get(body):
            apart = [
                (float(np.linalg.norm(self._points[node] - point)) - reach, node)
                for node, reach in self._ends[body]
            ]
            distance, node = min(apart)
            if distance > 1e-9:
                place = f"{self._source}: tendon {tendon}, site {name or site}"
                raise ModelError.at(place, "a point within a capsule's length", "a point at one of its ends")
            if self._names[node] is None:
                self._names[node] = name
        else:
            node = self._node(point, body, name)
        self._node_of_site[site] = node
        return node

    def _ids(self) -> list[str]:
        taken = {name for name in self._names if name is not None}
        numbers = (str(n) for n in range(1, 2 * len(self._names) + 1) if str(n) not in taken)
        return [next(numbers) if name is None else name for name in self._names]

    def _held(self, body: int) -> str:
        """Return the axes along which a body cannot move; none where it hangs on another or turns."""
        if self._model.body_weldid[body] == 0:
            return "xyz"
        start, number = int(self._model.body_jntadr[body]), int(self._model.body_jntnum[body])
        joints = range(start, start + number)
        slides = [self._model.jnt_type[j] == self._mujoco.mjtJoint.mjJNT_SLIDE for j in joints]
        if not number or not all(slides) or self._model.body_parentid[body] != 0:
            return ""
        moves = np.abs([self._data.xaxis[j] for j in joints])
        free = [axis for axis, unit in zip("xyz", _AXES, strict=True) if np.any(moves @ unit > 1e-9)]
        along = np.all(np.isclose(moves.max(axis=1), 1.0))
        return "".join(axis for axis in "xyz" if axis not in free) if along else ""

    def _stages(self, ids: list[str]) -> list[Content]:
        """Return the forces of actuators without control, which are loads, as a stage."""
        loads: dict[str, list[float]] = {}
        for n, body in enumerate(self._bodies):
            start, number = int(self._model.body_jntadr[body]), int(self._model.body_jntnum[body])
            for j in range(start, start + number):
                force = float(self._data.qfrc_actuator[self._model.jnt_dofadr[j]])
                if self._model.jnt_type[j] == self._mujoco.mjtJoint.mjJNT_SLIDE and force != 0.0:
                    load = loads.setdefault(ids[n], [0.0, 0.0, 0.0])
                    for i, part in enumerate(self._data.xaxis[j]):
                        load[i] += force * float(part)
        return [{"name": "loads", "loads": loads}] if loads else []
