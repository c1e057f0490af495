"""Reports of verifications."""

from __future__ import annotations

from typing import Any


class Report:
    """Report of a verification; true if `ok`."""

    def __init__(self, told: dict[str, Any]) -> None:
        self._told = told

    @property
    def ok(self) -> bool:
        """True if every check was made and passed."""
        return bool(self._told["passed"] and self._told["judged"])

    @property
    def max_error(self) -> float | None:
        """The largest vertical distance of a sample (or point) from the mesh."""
        error: float | None = self._told.get("max_error")
        return error

    @property
    def surface_error(self) -> float | None:
        """The largest distance of the lines between neighbouring samples; None for point clouds."""
        error: float | None = self._told.get("surface_error")
        return error

    @property
    def failures(self) -> list[str]:
        """Failed checks, with positions."""
        return list(self._told["failures"])

    @property
    def not_judged(self) -> list[str]:
        """Checks that could not be made."""
        return list(self._told["not_judged"])

    def as_dict(self) -> dict[str, Any]:
        """The report as from `terrane verify --json`."""
        return dict(self._told)

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        error = "" if self.max_error is None else f"max_error {self.max_error:.6g}"
        told = ["ok" if self.ok else "not ok", "; ".join(self.failures or self.not_judged) or error]
        return f"<terrane.Report: {', '.join(filter(None, told))}>"

