"""`python -m modelgen` and the script `modelgen` are the command line."""

from __future__ import annotations

import os
import signal
import sys

from modelgen.cli.standard_streams import usable_streams

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def run() -> None:
    """Run the command line; Ctrl-C while it is still being imported ends it as it does later.

    Who ends it by SIGTERM (a job scheduler, `timeout`) leaves no temporary file or process of it either.
    """
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, terminated)
    with usable_streams():
        try:
            use_one_blas_thread()
            from modelgen.cli.main import main

            main()
        except KeyboardInterrupt:
            print("interrupted", file=sys.stderr)
            sys.exit(130)


def terminated(number: int, _: object) -> None:
    """End this process with the exit code that shells show for a signal, after cleaning up."""
    sys.exit(128 + number)


def use_one_blas_thread() -> None:
    """Let BLAS use one thread, unless the environment states a number.

    Chunks of records and simulations are spread over the cores already. The matrices are tall and narrow:
    more threads of BLAS only wait for each other.
    """
    if not any(name in os.environ for name in BLAS_THREADS):
        os.environ.update(dict.fromkeys(BLAS_THREADS[:2], "1"))


if __name__ == "__main__":
    run()
