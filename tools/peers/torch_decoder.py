"""The 500 latent steps of benches/editor.rs in PyTorch, on the CPU, through the same decoder.

`python torch_decoder.py FOLDER --channels N --steps N`, the folder holding the decoder's layers, a z and its X as raw
float32, as the bench writes them. The output is compared before anything is timed. The loss is a plain sum of squares
on X: our time has forward kinematics in it, this one has none.
"""

import argparse
import itertools
import time
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

KERNEL, FEATURES, WINDOW, LATENT_FRAMES = 25, 138, 120, 15
LEAK, KNEE = 0.2, 2.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--channels", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    options = parser.parse_args()

    def read(name: str) -> torch.Tensor:
        return torch.from_numpy(np.fromfile(options.folder / name, np.float32))

    sizes = [options.channels] * 3 + [FEATURES]
    layers = []
    for i, (inputs, outputs) in enumerate(itertools.pairwise(sizes)):
        numbers = read(f"layer{i}.f32")
        weights = numbers[:-outputs].reshape(KERNEL, inputs, outputs).permute(1, 2, 0).contiguous()
        layers.append((weights, numbers[-outputs:].contiguous()))

    def decode(z: torch.Tensor) -> torch.Tensor:
        for i, (weights, bias) in enumerate(layers):
            if i:
                z = functional.leaky_relu(z + KNEE, LEAK) - KNEE
            z = functional.conv_transpose1d(z, weights, bias, stride=2, padding=KERNEL // 2, output_padding=1)
        return z

    z = read("z.f32").reshape(1, LATENT_FRAMES, options.channels).permute(0, 2, 1).contiguous()
    wanted = read("x.f32").reshape(1, WINDOW, FEATURES).permute(0, 2, 1)
    with torch.no_grad():
        error = (decode(z) - wanted).abs().max().item()
    if error > 1e-3 * wanted.abs().max().item():
        raise SystemExit(f"PyTorch's decoder gives another X: {error}")

    z.requires_grad_(True)
    adam = torch.optim.Adam([z], lr=0.005)
    start = time.perf_counter()
    for _ in range(options.steps):
        adam.zero_grad()
        loss = (decode(z) - 1.0).square().sum()
        loss.backward()
        adam.step()
    seconds = time.perf_counter() - start
    print(f"PyTorch {torch.__version__}, {torch.get_num_threads()} threads: {seconds:.2f} s (X differs by {error:.0e})")


if __name__ == "__main__":
    main()
