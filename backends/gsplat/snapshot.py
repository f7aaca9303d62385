"""Snapshots of a training run, so that one that was killed goes on where it was; on a CPU to the same bytes."""

import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...common.files import whole
from .densification import Densification
from .gaussians import Optimizers, Parameters

FILE = "snapshot.npz"
PLAIN = ("step", "seconds", "peak_gpu_bytes", "order", "curve")


@dataclass
class State:
    """What a step changes besides the parameters, their optimizers and the strategy's state."""

    rng: np.random.Generator
    step: int = 0
    seconds: float = 0.0
    peak_gpu_bytes: int = 0  # of the parts of the run that were killed
    order: list[int] = field(default_factory=list)  # views left of this round
    curve: list[dict[str, float | None]] = field(default_factory=list)

    def next_view(self, count: int) -> int:
        """Endless passes over the views, each in a new random order."""
        if not self.order:
            self.order = self.rng.permutation(count).tolist()
        return self.order.pop(0)

    def save(self, folder: Path, params: Parameters, optims: Optimizers, densification: Densification) -> None:
        """Writes everything, whole or not at all."""
        arrays = {f"params.{name}": value.detach() for name, value in params.items()}
        for name, optimizer in optims.items():
            for key, value in optimizer.state[params[name]].items():
                arrays[f"optims.{name}.{key}"] = value
        arrays |= {f"strategy.{key}": v for key, v in densification.state.items() if isinstance(v, torch.Tensor)}
        arrays["torch.cpu"] = torch.get_rng_state()
        if torch.cuda.is_initialized():
            self.peak_gpu_bytes = max(self.peak_gpu_bytes, torch.cuda.max_memory_allocated())
            arrays["torch.cuda"] = torch.cuda.get_rng_state()
        plain: dict[str, Any] = {
            name: getattr(self, name) for name in ("step", "seconds", "peak_gpu_bytes", "order", "curve")
        }
        plain |= {"rng": self.rng.bit_generator.state, "rate": optims["means"].param_groups[0]["lr"]}
        stored: dict[str, Any] = {name: value.cpu().numpy() for name, value in arrays.items()}
        with whole(folder / FILE) as temporary, open(temporary, "wb") as file:
            np.savez(file, plain=json.dumps(plain), **stored)

    def load(self, folder: Path, params: Parameters, optims: Optimizers, densification: Densification) -> bool:
        """Changes all of them to what the folder's snapshot says; False where there is none that can be read."""
        try:
            with np.load(folder / FILE, allow_pickle=False) as file:
                stored = {name: file[name] for name in file.files}
            plain = json.loads(str(stored.pop("plain")))
            rate, rng = plain.pop("rate"), plain.pop("rng")
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
            return False
        device = params["means"].device
        tensors = {name: torch.from_numpy(value) for name, value in stored.items()}
        torch.set_rng_state(tensors.pop("torch.cpu"))
        if "torch.cuda" in tensors:
            torch.cuda.set_rng_state(tensors.pop("torch.cuda"))
        for name, optimizer in optims.items():
            params[name] = torch.nn.Parameter(tensors[f"params.{name}"].to(device))
            optimizer.param_groups[0]["params"] = [params[name]]
            optimizer.state.clear()
            keys = [key for key in tensors if key.startswith(f"optims.{name}.")]
            # Adam keeps its number of steps on the CPU.
            moments = {key.rsplit(".", 1)[1]: tensors[key] for key in keys}
            optimizer.state[params[name]] = {k: v if k == "step" else v.to(device) for k, v in moments.items()}
        optims["means"].param_groups[0]["lr"] = rate
        for name, value in tensors.items():
            if name.startswith("strategy."):
                densification.state[name.removeprefix("strategy.")] = value.to(device)
        self.rng.bit_generator.state = rng
        for name, value in plain.items():
            setattr(self, name, value)
        return True

    @staticmethod
    def forget(folder: Path) -> None:
        """Removes the snapshot of a run that is finished."""
        (folder / FILE).unlink(missing_ok=True)
