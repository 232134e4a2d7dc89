"""The viewer in a notebook: a widget whose slider is a traitlet, both ways."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from tensegra.errors import ModelError, SolverError, TensegraError
from tensegra.mechanics import EquilibriumPath, Session
from tensegra.structure import Structure
from tensegra.viewer.scene import equilibrium_scene, scene
from tensegra.viewer.source import part, script, stylesheet

__all__ = ["view"]


@cache
def _widget_class() -> Any:  # noqa: ANN401 - a class of an optional library
    try:
        import anywidget
        import traitlets
    except ImportError:
        raise TensegraError(
            "a view needs anywidget, which is not installed: pip install tensegra[notebook]"
        ) from None

    class View(anywidget.AnyWidget):  # type: ignore[misc] # not annotated
        """A structure in space; `inputs` (by actuator) solves again, whoever sets it."""

        _esm = script() + part("widget")
        _css = stylesheet()
        scene = traitlets.Dict().tag(sync=True)
        frame = traitlets.Int(0).tag(sync=True)
        inputs = traitlets.Dict().tag(sync=True)
        selected = traitlets.Unicode("").tag(sync=True)
        told = traitlets.Unicode("").tag(sync=True)
        height = traitlets.Int(440).tag(sync=True)
        session: Session | None = None

        @traitlets.observe("inputs")
        def move(self, _: object = None) -> None:
            """Move the structure on from where it stands; where it cannot, it stays and says why."""
            if self.session is None:
                return
            try:
                found = self.session.move(self.inputs)
            except ModelError as error:
                self.told = str(error)
                return
            self.told = f"{found.status}{': ' if found.reason else ''}{found.reason}"
            if np.all(np.isfinite(found.nodes)):
                self.scene = equilibrium_scene(found, self.session.reference.nodes)
                self.frame = 0

    return View


def view(shown: object, inputs: Mapping[str, float] | None = None, *, height: int = 440) -> Any:  # noqa: ANN401 - a widget
    """Show a structure, a path or runs in a notebook.

    A structure that stands gets a slider for each of its actuators, as the trait `inputs`: a change, be it
    by the slider or by ``view.inputs = {"A14": 0.1}``, moves it on, certified. Of a path the sliders begin
    where it ends. The trait `frame` is the place along a path, or the run; `selected` the name that was
    clicked at.

    Parameters
    ----------
    shown
        A `Structure`, an `EquilibriumPath` or a `Batch`.
    inputs
        Values of actuators to begin with, of a structure.
    height
        Of the picture, in pixels.

    Raises
    ------
    TensegraError
        Where anywidget is not installed, or nothing is to be shown.
    """
    made = _widget_class()
    content = scene(shown)
    session, start = None, dict(inputs or {})
    fault = ""
    if isinstance(shown, Structure) and shown.actuators:
        try:
            session = Session(shown)
        except SolverError as error:  # what does not stand is shown as it is drawn
            fault = f"It cannot be moved: {error}"
    elif isinstance(shown, EquilibriumPath) and shown.structure.actuators and shown.final.succeeded:
        session = _standing_at(shown)
        start = {name: float(value) for name, value in shown.given.run.actuation.items()}
    values = {} if session is None else dict.fromkeys(session.structure.actuators, 0.0) | start
    widget = made(scene=content, frame=len(content["labels"]) - 1, height=height, inputs=values)
    widget.told = fault
    widget.session = session  # from now on a change of the inputs moves it
    if isinstance(shown, Structure) and start:
        widget.move()
    return widget


def _standing_at(path: EquilibriumPath) -> Session:
    """Return a session at the end of a path."""
    session, run = Session(path.structure), path.given.run
    if run.acts:
        session.move(run.actuation, run.temperature, loads=run.loads, positions=run.positions)  # type: ignore[arg-type]
    return session
