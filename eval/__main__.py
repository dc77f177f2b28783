"""`python -m eval track` runs the tracker on a dataset and scores it, `pairs` on pairs of images, `scenarios` where it
gets lost; `calibrate` fits its confidence; `score` scores anybody's BOP result file; `plate` makes pictures."""

from __future__ import annotations

import sys

import tyro

from eval.commands.ablate import Ablate
from eval.commands.bench import Bench
from eval.commands.calibrate import Calibrate
from eval.commands.losses import Losses
from eval.commands.pairs import Pairs
from eval.commands.plate import Plate
from eval.commands.scenarios import Scenarios
from eval.commands.score import Score
from eval.commands.track import Track
from tracker.terminal import run


def main() -> None:
    run(
        tyro.extras.subcommand_cli_from_dict(
            {
                "track": Track,
                "score": Score,
                "pairs": Pairs,
                "losses": Losses,
                "scenarios": Scenarios,
                "calibrate": Calibrate,
                "ablate": Ablate,
                "bench": Bench,
                "plate": Plate,
            },
            prog="python -m eval",
            args=sys.argv[1:],
        )
    )


if __name__ == "__main__":
    main()
