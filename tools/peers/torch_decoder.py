"""The latent steps of benches/editor.rs in PyTorch, on the CPU, through the same decoder.

The output is compared before anything is timed. The loss is a plain sum of squares on X: our time has forward
kinematics in it, this one has none.
"""

import itertools

import numpy as np
import torch
from torch.nn import functional
from work import Work, seconds, table

KERNEL, FEATURES, WINDOW, LATENT_FRAMES = 25, 138, 120, 15
LEAK, KNEE = 0.2, 2.0


def main() -> None:
    work = Work(__doc__)
    channels, steps = work.facts["channels"], work.facts["steps"]

    def read(name: str) -> torch.Tensor:
        return torch.from_numpy(np.array(work.floats(name)))

    sizes = [channels] * 3 + [FEATURES]
    layers = []
    for i, (inputs, outputs) in enumerate(itertools.pairwise(sizes)):
        numbers = read(f"layer{i}")
        weights = numbers[:-outputs].reshape(KERNEL, inputs, outputs).permute(1, 2, 0).contiguous()
        layers.append((weights, numbers[-outputs:].contiguous()))

    def decode(z: torch.Tensor) -> torch.Tensor:
        for i, (weights, bias) in enumerate(layers):
            if i:
                z = functional.leaky_relu(z + KNEE, LEAK) - KNEE
            z = functional.conv_transpose1d(z, weights, bias, stride=2, padding=KERNEL // 2, output_padding=1)
        return z

    z = read("z").reshape(1, LATENT_FRAMES, channels).permute(0, 2, 1).contiguous()
    wanted = read("x").reshape(1, WINDOW, FEATURES).permute(0, 2, 1)
    with torch.no_grad():
        error = (decode(z) - wanted).abs().max().item()
    if error > 1e-3 * wanted.abs().max().item():
        raise SystemExit(f"PyTorch's decoder gives another X: {error}")

    z.requires_grad_(True)
    adam = torch.optim.Adam([z], lr=0.005)

    def optimize() -> None:
        for _ in range(steps):
            adam.zero_grad()
            (decode(z) - 1.0).square().sum().backward()
            adam.step()

    threads = torch.get_num_threads()
    took = seconds(optimize)
    # On a busy machine threads that wait for one another can take longer than one.
    torch.set_num_threads(1)
    table(
        f"{steps} latent steps through {channels} channels",
        "s",
        [
            ("Oncue, one window on one thread", work.facts["seconds"]),
            (f"PyTorch {torch.__version__}, {threads} threads", took),
            (f"PyTorch {torch.__version__}, 1 thread", seconds(optimize)),
        ],
        [f"X differs by {error:.0e}"],
    )


if __name__ == "__main__":
    main()
