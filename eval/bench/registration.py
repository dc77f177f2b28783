"""`python -m eval bench registration`: from correspondences to a pose, ours beside the libraries, in one run."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from eval.bench.measurement import Measurement
from tracker.terminal import progress

if TYPE_CHECKING:
    from eval.bench.methods import Method
    from eval.bench.problems import Problem

SUCCESS_DEG, SUCCESS_M = 5.0, 0.01
RATES = ("0.9", "0.95", "0.98")


@dataclass
class RegistrationBench(Measurement):
    """Correspondences of which most are wrong: time and success, ours beside open3d's RANSAC, FGR and what else is
    installed of the extra bench; and the time of a global pose and of its refinement."""

    correspondences: int = 5000
    """How many a problem has."""
    seeds: int = 100
    """Problems over which ours has to succeed."""
    open3d_seeds: int = 8
    """Problems over which the others have to, and over which times are medians."""

    def title(self) -> str:
        return f"registration, {self.correspondences} correspondences"

    def measured(self) -> dict[str, Any]:
        from eval.bench.methods import SAMPLES, THRESHOLD_M, open3d_ransac, ours, peers
        from eval.bench.whole_pose import whole_pose

        fixed = self._timed({"ours": ours(1.0), "open3d": open3d_ransac(1.0)}, 0.9)
        few = self._timed({"open3d": open3d_ransac(1.0, SAMPLES // 50, checkers=False)}, 0.9, repeat=1)
        early = {
            rate: self._timed({"ours": ours(0.999), "open3d": open3d_ransac(0.999)}, float(rate))
            for rate in ("0.5", "0.9", "0.95")
        }
        others = {name: self._timed({name: method}, 0.9)[name] for name, method in peers().items()}
        best, open3d = ours(0.999), open3d_ransac(0.999)
        return {
            "speedup_over_open3d_ransac": fixed["open3d"]["ms"] / fixed["ours"]["ms"],
            "fixed_iterations": fixed,
            "open3d_without_checkers_ms": few["open3d"]["ms"] * 50,  # of a fiftieth of the samples, scaled
            "early_stop": early,
            "early_stop_ratio": {rate: row["open3d"]["ms"] / row["ours"]["ms"] for rate, row in early.items()},
            "success": {rate: self._success(best, float(rate), self.seeds) for rate in RATES},
            "success_open3d": {rate: self._success(open3d, float(rate), self.open3d_seeds) for rate in RATES},
            "peers": others,
            **whole_pose(),
            "settings": {
                "correspondences": self.correspondences, "seeds": self.seeds, "open3d_seeds": self.open3d_seeds,
                "samples": SAMPLES, "threshold_m": THRESHOLD_M, "outliers": 0.9,
            },
        }  # fmt: skip

    def _timed(self, methods: dict[str, Method], outliers: float, repeat: int | None = None) -> dict[str, Any]:
        """Of every method the median time and errors over the same problems, interleaved."""
        from eval.bench.problems import problem

        spent: dict[str, list[float]] = {name: [] for name in methods}
        errors: dict[str, list[tuple[float, float]]] = {name: [] for name in methods}
        for name, method in methods.items():
            if name == "ours":
                method(problem(10_000, self.correspondences, outliers), 0)  # the first call also loads things
        for seed in range(repeat or self.open3d_seeds):
            given = problem(seed, self.correspondences, outliers)
            for name, method in methods.items():
                start = time.perf_counter()
                found = method(given, seed)
                spent[name].append(time.perf_counter() - start)
                errors[name].append(given.errors(found))
        return {
            name: {
                "ms": statistics.median(spent[name]) * 1e3,
                "degrees": _finite(statistics.median(e[0] for e in errors[name])),
                "mm": _finite(statistics.median(e[1] for e in errors[name]) * 1e3),
            }
            for name in methods
        }

    def _success(self, method: Method, outliers: float, seeds: int) -> float:
        from eval.bench.problems import problem

        def succeeds(seed: int) -> bool:
            given: Problem = problem(seed, self.correspondences, outliers)
            degrees, metres = given.errors(method(given, seed))
            return degrees < SUCCESS_DEG and metres < SUCCESS_M

        return sum(succeeds(seed) for seed in progress(range(seeds), seeds, f"{outliers:.0%} outliers")) / seeds


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None
