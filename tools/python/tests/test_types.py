"""The types that are stated are those that are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent


@pytest.mark.parametrize(
    "command",
    [
        ["mypy", "python/terrane"],
        ["mypy.stubtest", "terrane._terrane", "--mypy-config-file", "pyproject.toml"],
    ],
    ids=lambda command: command[0],
)
def test_types(command: list[str]) -> None:
    told = subprocess.run(
        [sys.executable, "-m", *command], cwd=PACKAGE, capture_output=True, text=True, check=False
    )
    assert told.returncode == 0, told.stdout + told.stderr
