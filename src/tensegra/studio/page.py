"""What a page says and what it is answered; one object a page, nothing shared."""

import json
import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tensegra.errors import ModelError, SolverError, StudyError, TensegraError
from tensegra.mechanics.stability import tangent_at
from tensegra.structure import Structure
from tensegra.studio import edit, export, forecast
from tensegra.studio.desk import Answer, Desk
from tensegra.studio.knobs import knobs_of_structure
from tensegra.studio.source import Source
from tensegra.viewer.scene import equilibrium_scene, scene

__all__ = ["Page", "packed"]

Json = dict[str, Any]

MODES = 6
"""Modes that are shown on demand."""


class Page:
    """One page of the studio.

    Parameters
    ----------
    source
        What the server was started with.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self.structure: Structure = source.structure
        self.desk: Desk | None = None
        self.fault = ""
        self.watched: tuple[list[str], str] = ([source.structure.node_ids[-1]], "z")
        self._edits: list[Structure] = []
        self._answers: dict[str, Callable[[Json], bytes]] = {
            "open": self._open,
            "move": self._move,
            "undo": lambda _: self._state(self._standing().undo()),
            "reset": lambda _: self._state(self._standing().reset()),
            "load": self._load,
            "watch": self._watch,
            "modes": self._modes,
            "export": self._export,
            "file": self._file,
            "spread": self._spread,
            "optimise": self._optimise,
            "edit": self._edit,
            "unedit": self._unedit,
            "verdict": lambda _: packed({"type": "verdict", **edit.verdict(self.structure)}),
        }
        self._settle()

    def answer(self, message: object) -> bytes:
        """Answer a message; a fault is an answer, too.

        Parameters
        ----------
        message
            A mapping with ``type``, and what that asks for.
        """
        asked = message.get("type") if isinstance(message, dict) else None
        if not isinstance(message, dict) or not isinstance(asked, str) or asked not in self._answers:
            return packed({"type": "fault", "text": "the page said something that means nothing here"})
        try:
            return self._answers[asked](message)
        except TensegraError as error:
            return packed({"type": "fault", "text": str(error), "to": asked})

    def _settle(self) -> None:
        """Put the structure on the desk, if it stands."""
        own = self.structure is self.source.structure
        knobs = self.source.knobs() if own else {k.key: k for k in knobs_of_structure(self.structure)}
        self.desk, self.fault = None, ""
        try:
            self.desk = Desk(self.structure, knobs)
        except (SolverError, ModelError) as error:
            self.fault = str(error)

    def _standing(self) -> Desk:
        if self.desk is None:
            raise ModelError(f"the structure does not stand: {self.fault}")
        return self.desk

    def _open(self, _: Json) -> bytes:
        """Return all that the page shows at first, and again after the structure was changed."""
        study, desk = self.source.study, self.desk
        content: Json = {
            "type": "opened",
            "source": self.source.reference,
            "structure": repr(self.structure),
            "units": {
                "length": self.structure.units.length,
                "force": self.structure.units.force,
                "temperature": self.structure.units.temperature,
            },
            "scene": scene(self.structure) if desk is None else equilibrium_scene(desk.found, desk.reference),
            "knobs": [] if desk is None else [knob.to_dict() for knob in desk.knobs.values()],
            "watched": [list(self.watched[0]), self.watched[1]],
            "fault": self.fault,
            "outputs": {output.name: output.unit for output in study.outputs} if study else {},
            "surrogates": list(self.source.surrogates) if self._is_campaign else [],
            "edited": len(self._edits),
            "members": {
                name: {"area": member.area, "rest_length": member.rest_length, "stiffness": member.stiffness}
                for name, member in self.structure.members.items()
            },
            "drawing": {node: list(place) for node, place in self.structure.nodes.items()},
        }
        if desk is not None:
            answer = Answer(desk.found, moved=True, before=None, seconds=0.0)
            content["state"] = self._told(desk, answer)
        return packed(content)

    @property
    def _is_campaign(self) -> bool:
        """Whether surrogates speak of the structure at hand: not of one that was edited."""
        return self.source.study is not None and self.structure is self.source.structure

    def _move(self, message: Json) -> bytes:
        desk = self._standing()
        return self._state(desk.move(message.get("values"), message.get("gesture")))

    def _state(self, answer: Answer) -> bytes:
        """Return where the structure stands, as numbers and as arrays."""
        desk = self._standing()
        shown = desk.found
        arrays = {"positions": shown.nodes, "tensions": shown.tensions, "forces": shown.forces}
        if answer.before is not None:
            arrays["before"] = answer.before
        return packed({"type": "state", "state": self._told(desk, answer)}, arrays)

    def _told(self, desk: Desk, answer: Answer) -> Json:
        told = desk.told(answer)
        nodes, axis = self.watched
        told["displacement"] = desk.displacement(nodes, axis)
        if self._is_campaign and self.source.study is not None:
            told["truth"] = forecast.true_outputs(self.source.study, desk.found, desk.reference)
            told["predictions"] = forecast.predictions(self.source, desk.values)
        return told

    def _watch(self, message: Json) -> bytes:
        desk = self._standing()
        nodes, axis = message.get("nodes"), str(message.get("axis"))
        if not isinstance(nodes, list):
            raise ModelError.at("watch", nodes, "a list of nodes")
        names = [str(node) for node in nodes]
        desk.displacement(names, axis)  # refuses what is unknown before it is kept
        self.watched = names, axis
        return self._state(Answer(desk.found, moved=True, before=None, seconds=0.0))

    def _load(self, message: Json) -> bytes:
        knob = self._standing().add_load(message.get("node"), message.get("axis"))
        return packed({"type": "knob", "knob": knob.to_dict()})

    def _modes(self, _: Json) -> bytes:
        spectrum = tangent_at(self._standing().session.path()).spectrum(MODES)
        units = self.structure.units
        unit = f"{units.force}/{units.length}"
        shapes = spectrum.vectors / np.linalg.norm(spectrum.vectors, axis=2).max(axis=1)[:, None, None]
        names = [f"mode {i}: {value:.4g} {unit}" for i, value in enumerate(spectrum.values, 1)]
        return packed({"type": "modes", "names": names}, {"shapes": shapes})

    def _export(self, _: Json) -> bytes:
        desk, source = self._standing(), self.source.reference
        return packed(
            {
                "type": "export",
                "command": export.as_command(desk, source),
                "python": export.as_python(desk, source),
                "json": export.as_json(desk, source),
            }
        )

    def _file(self, message: Json) -> bytes:
        """Return the structure's file: as it is given, or with a stage that takes it to where it stands."""
        standing = bool(message.get("standing"))
        structure = export.standing_structure(self._standing()) if standing else self.structure
        return packed({"type": "file", "standing": standing, "text": export.structure_text(structure)})

    def _spread(self, message: Json) -> bytes:
        desk = self._standing()
        free, limits = message.get("free"), message.get("limits")
        if not isinstance(free, list) or not isinstance(limits, Mapping):
            raise StudyError.at("spread", message.get("free"), "a list of variables, and limits by output")
        bounds = {str(name): float(value) for name, value in limits.items() if isinstance(value, int | float)}
        found = forecast.spread(
            self.source, str(message.get("surrogate")), desk.values, [str(name) for name in free], bounds
        )
        return packed({"type": "spread", "outputs": found})

    def _optimise(self, message: Json) -> bytes:
        search = message.get("search")
        if not isinstance(search, list) or not search:
            raise StudyError.at("optimise", search, "a list of variables to search")
        found = forecast.best(
            self.source,
            str(message.get("surrogate")),
            str(message.get("output")),
            maximise=bool(message.get("maximise")),
            search=[str(name) for name in search],
            values=self._standing().values,
        )
        return packed({"type": "optimum", **found})

    def _edit(self, message: Json) -> bytes:
        new = edit.changed(self.structure, message.get("change"), message.get("given"))
        self._edits.append(self.structure)
        return self._changed(new)

    def _unedit(self, _: Json) -> bytes:
        if not self._edits:
            raise ModelError("undo: the structure is as the server was started with")
        return self._changed(self._edits.pop())

    def _changed(self, structure: Structure) -> bytes:
        self.structure = structure
        known = [node for node in self.watched[0] if node in structure.nodes]
        self.watched = (known or [structure.node_ids[-1]]), self.watched[1]
        self._settle()
        return self._open({})


def packed(header: Json, arrays: Mapping[str, np.ndarray] | None = None) -> bytes:
    """Return a message to a page: four bytes with the header's length, the header as JSON, then the arrays.

    The header names them with their lengths; it is filled up with blanks to a multiple of four bytes, and
    the arrays are little-endian, four bytes a number.
    """
    arrays = arrays or {}
    named = {**header, "arrays": [[name, int(array.size)] for name, array in arrays.items()]}
    text = json.dumps(named, ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    data = [np.ascontiguousarray(array, dtype="<f4").tobytes() for array in arrays.values()]
    return b"".join([struct.pack("<I", len(text)), text, *data])
