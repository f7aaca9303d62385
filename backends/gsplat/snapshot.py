"""Snapshots of a training run, so that one that was killed goes on where it was; on a CPU to the same bytes."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch

from .. import _snapshot
from .densification import Densification
from .gaussians import Optimizers, Parameters

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
        plain = {name: getattr(self, name) for name in PLAIN}
        plain |= {"rng": self.rng.bit_generator.state, "rate": optims["means"].param_groups[0]["lr"]}
        _snapshot.write(folder, {name: value.cpu().numpy() for name, value in arrays.items()}, plain)

    def load(self, folder: Path, params: Parameters, optims: Optimizers, densification: Densification) -> bool:
        """Changes all of them to what the folder's snapshot says; False where there is none that can be read."""
        found = _snapshot.read(folder, lambda arrays, plain: (arrays, plain, plain.pop("rate"), plain.pop("rng")))
        if found is None:
            return False
        stored, plain, rate, rng = found
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
