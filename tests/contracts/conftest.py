"""Spawned workers inherit the path: with this folder on it they can import `worker_tasks`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
