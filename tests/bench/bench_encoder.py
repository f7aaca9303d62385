"""Speed of the image encoder on one thread: EfficientNet-Lite0 in numpy beside the same network in torch.

    python tests/bench/bench_encoder.py [--quick]

Both embed the same pictures in turn, in batches of 4 as `environment.toml` has it. Milliseconds a picture, of the
processor's time, which other programs lengthen less than the clock's.
"""

import argparse
import os
import time

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402
import torch  # noqa: E402
from torch_efficientnet import torch_encoder  # noqa: E402

from viewbench.scenes.encoders import efficientnet_lite0  # noqa: E402

BATCH = 4


def main() -> None:
    """Prints one line."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a few seconds")
    turns = 8 if parser.parse_args().quick else 60
    torch.set_num_threads(1)
    size, ours = efficientnet_lite0.encoder("", "cpu")
    theirs = torch_encoder()
    images = np.random.default_rng(0).random((BATCH, size, size, 3), dtype=np.float32)
    spent: dict[str, list[float]] = {"numpy": [], "torch": []}
    for turn in range(turns + 1):  # the first of each is not counted
        for name, encode in (("numpy", ours), ("torch", theirs)):
            began = time.process_time()
            encode(images)
            if turn:
                spent[name].append(1e3 * (time.process_time() - began) / BATCH)
    numpy_ms, torch_ms = (float(np.median(values)) for values in spent.values())
    print(f"EfficientNet-Lite0, ms a picture: numpy {numpy_ms:.1f}, torch {torch_ms:.1f}, {numpy_ms / torch_ms:.2f} ×")


if __name__ == "__main__":
    main()
