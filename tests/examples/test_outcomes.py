import runpy
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "outcomes.py"


def test_the_path_follower_finds_what_the_stepped_procedure_loses(capsys):
    table = runpy.run_path(str(EXAMPLE))["main"](n_runs=24)
    assert len(table) == 8
    assert all(counts["failed"] == 0 for (*_, procedure), counts in table.items() if procedure == "path")
    assert any(counts["failed"] > 0 for (*_, procedure), counts in table.items() if procedure == "stepped")
    assert capsys.readouterr().out.count("paper_beam_slender") == 4
