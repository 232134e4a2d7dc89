"""The widget in a notebook: both ways between its traits and the solver."""

import subprocess
import sys

import numpy as np
import pytest

from tensegra.mechanics import solve_batch, solve_path
from tensegra.structure import Actuator, library

pytest.importorskip("anywidget")


def test_setting_the_inputs_solves_again():
    view = library.paper_beam().view()
    before = view.scene
    view.inputs = {**view.inputs, "A14": 0.1, "A23": 0.1}
    assert view.told == "stable"
    assert view.scene is not before
    expected = solve_path(library.paper_beam(), {"A14": 0.1, "A23": 0.1}).final
    np.testing.assert_allclose(view.session.equilibrium.nodes, expected.nodes, atol=1e-6)


def test_inputs_that_cannot_be_are_told_and_nothing_moves():
    view = library.paper_beam().view()
    stands = view.session.equilibrium.nodes
    view.inputs = {"A14": 1.5}
    assert "rest length" in view.told
    np.testing.assert_array_equal(view.session.equilibrium.nodes, stands)


def test_a_path_s_view_goes_on_from_its_end():
    path = solve_path(library.paper_beam(), {"A14": 0.05})
    view = path.view()
    assert view.inputs["A14"] == 0.05
    np.testing.assert_allclose(view.session.equilibrium.nodes, path.final.nodes, atol=1e-6)
    assert view.frame == len(path.history) - 1


def test_what_does_not_stand_is_shown_and_said():
    tower = library.tower(n_stages=1, n_struts=4)
    fallen = tower.replace(
        members={name: m for name, m in tower.members.items() if name != "v0_0"}, actuators={}
    )
    assert fallen.view().session is None
    fallen = fallen.replace(actuators={"v": Actuator(("v0_1",), "shorten")})
    assert "cannot be moved" in fallen.view().told


def test_runs_are_frames():
    view = solve_batch(library.paper_beam(), actuation={"A14": [0.01, 0.02, 0.03]}).view()
    assert view.scene["labels"] == ["run 0", "run 1", "run 2"]
    assert view.session is None


def test_importing_the_package_imports_no_widget():
    code = "import sys, tensegra; print('anywidget' in sys.modules, 'tensegra.viewer' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.split() == ["False", "False"]
