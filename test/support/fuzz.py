"""Spoilt inputs by the thousand: only documented errors may come out, soon, and without filling the memory.

`python test/fuzz.py [COUNT] [--seed N] [--only NUMBER]`, or `make fuzz`. Every input is drawn from the seed and its own
number, so that `--only` gives one again, with the traceback of what came out.
"""

from __future__ import annotations

import argparse
import faulthandler
import os
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

from support.fuzz_inputs import targets

COUNT = 100_000
LONGEST_S = 2.0
"""Processor time that one input may take."""
HANGS_S = 60.0
LARGEST_GROWTH_MB = 400
"""What the largest image or chunk that is sensible may need while it is unpacked."""
LIMIT_MB = 2048
"""Address space over what is taken at the start: what asks for more ends in a MemoryError."""
SHOWN = 10


def peak_mb() -> float:
    """The most memory this process has held so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def address_space_bytes() -> int:
    """What this process has mapped (Linux)."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0]) * resource.getpagesize()


def main() -> int:
    """Feed, print what came of it; returns the exit status: 1 where anything else than a clear error came out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=COUNT, help="inputs (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="another seed, other inputs (default %(default)s)")
    parser.add_argument("--only", type=int, metavar="NUMBER", help="one input again")
    args = parser.parse_args()
    warnings.simplefilter("ignore")  # numbers at the ends of their range overflow: the result is what counts
    said = os.fdopen(os.dup(2), "w")
    if args.only is None:  # what image libraries write there by themselves would bury the figures
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    fed: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    failures: list[str] = []
    slowest_s, slowest, peak, hungriest = 0.0, -1, 0.0, -1
    with tempfile.TemporaryDirectory(prefix="lasso_motion_fuzz_") as name:
        directory = Path(name)
        table = targets(directory)
        names = [name for name, target in table.items() for _ in range(target.share)]
        resource.setrlimit(resource.RLIMIT_AS, (address_space_bytes() + (LIMIT_MB << 20), resource.RLIM_INFINITY))
        began_s, before_mb = time.monotonic(), peak_mb()
        for number in range(args.count) if args.only is None else [args.only]:
            choice = random.Random(f"{args.seed} {number}")
            what = choice.choice(names)
            fed[what] += 1
            faulthandler.dump_traceback_later(HANGS_S, exit=True, file=said)
            begin_s = time.process_time()
            try:
                table[what].feed(choice, directory)
            except table[what].refuses_by as error:
                refused[what] += 1
                if not str(error).strip():
                    failures.append(f"input {number} ({what}): an error without a word")
            except Exception as error:
                failures.append(f"input {number} ({what}): {type(error).__name__}: {str(error)[:200]}")
                if args.only is not None:
                    traceback.print_exc()
            spent_s = time.process_time() - begin_s
            faulthandler.cancel_dump_traceback_later()
            if spent_s > slowest_s:
                slowest_s, slowest = spent_s, number
            if (now_mb := peak_mb()) > peak:
                peak, hungriest = now_mb, number
            if spent_s > LONGEST_S:
                failures.append(f"input {number} ({what}): took {spent_s:.1f} s")
        took_s, growth_mb = time.monotonic() - began_s, peak_mb() - before_mb
    if growth_mb > LARGEST_GROWTH_MB:
        failures.append(f"memory grew by {growth_mb:.0f} MB, more than {LARGEST_GROWTH_MB}")
    for what in table:
        sys.stdout.write(f"{what:<20}{fed[what]:8} fed, {refused[what]:8} refused with a clear error\n")
    sys.stdout.write(
        f"{sum(fed.values())} inputs in {took_s:.0f} s, seed {args.seed}: {len(failures)} failures; the slowest took"
        f" {slowest_s:.2f} s (input {slowest}), memory grew by {growth_mb:.0f} MB at its peak (input"
        f" {hungriest})\n"
    )
    for failure in failures[:SHOWN]:
        print(failure, file=said)
    said.flush()
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
