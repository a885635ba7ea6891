"""The learning of an update of benches/controller.rs in PyTorch, on the CPU: the same networks, tuples and batches.

Values of all states, advantages, then the epochs over batches in the order that we took them, with the same clipped
objective, gradient limits and Adam.

The gradients of the first step are compared with those of PyTorch in double precision, and nothing later: in single
precision two runs of PyTorch itself, begun a rounding apart, end up to 5 % from each other, or not at all (decision
35). tests/test_learning.py follows more steps, each from where ours began.
"""

import itertools
import math

import numpy as np
import torch
from work import Work, seconds, table

#: Returns are divided by this before the value network learns them.
VALUE_SCALE = 10.0
TYPES = 3
#: What our gradients may differ by, of their own length. Rounding leaves about a millionth; a unit of ReLU, or a ratio
#: at its clip, that rounding puts on the other side in one tuple of a batch of 512 moves a few ten-thousandths.
SAME = 1e-3


def network(sizes: list[int], parameters: np.ndarray, precision: torch.dtype) -> torch.nn.Sequential:
    """Dense layers with ReLU between them, from our flat parameters: W (out × in), then b, layer by layer."""
    layers: list[torch.nn.Module] = []
    at = 0
    for inputs, outputs in itertools.pairwise(sizes):
        layer = torch.nn.Linear(inputs, outputs)
        with torch.no_grad():
            weights = torch.from_numpy(parameters[at : at + inputs * outputs].copy())
            layer.weight.copy_(weights.reshape(outputs, inputs))
            at += inputs * outputs
            layer.bias.copy_(torch.from_numpy(parameters[at : at + outputs].copy()))
            at += outputs
        layers += [layer, torch.nn.ReLU()]
    return torch.nn.Sequential(*layers[:-1]).to(precision)


def advantages_of(work: Work, values: np.ndarray, last_values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Generalized advantages (Schulman et al. 2016) and returns; each environment's tuples lie one after the other."""
    ppo, steps = work.facts["ppo"], work.facts["per_environment"]
    rewards, live = work.floats("rewards").reshape(-1, steps), 1.0 - work.counts("ended").reshape(-1, steps)
    values = values.reshape(-1, steps)
    found = np.zeros_like(values)
    following, running = last_values, np.zeros_like(last_values)
    for t in reversed(range(steps)):
        delta = rewards[:, t] + ppo["discount"] * following * live[:, t] - values[:, t]
        running = delta + ppo["discount"] * ppo["lambda"] * live[:, t] * running
        found[:, t] = running
        following = values[:, t]
    returns = (found + values).ravel()
    found = found.ravel()
    return (found - found.mean()) / (found.std() + 1e-6), returns


class Update:
    """Networks, optimizers and tuples, as they are before the update."""

    def __init__(self, work: Work, precision: torch.dtype = torch.float32) -> None:
        self.work, self.facts = work, work.facts
        ppo = self.facts["ppo"]
        policy_sizes, value_sizes = self.facts["policy_sizes"], self.facts["value_sizes"]

        def read(name: str) -> torch.Tensor:
            return torch.from_numpy(work.floats(name)).to(precision)

        self.policy = network(policy_sizes, work.floats("policy"), precision)
        self.value = network(value_sizes, work.floats("value"), precision)
        self.log_std = torch.nn.Parameter(read("log_std"))
        self.policy_adam = torch.optim.Adam(self.policy.parameters(), lr=ppo["policy_rate"])
        self.value_adam = torch.optim.Adam(self.value.parameters(), lr=ppo["value_rate"])
        self.std_adam = torch.optim.Adam([self.log_std], lr=ppo["policy_rate"])
        size, width = policy_sizes[0], policy_sizes[-1]
        self.states = read("states").reshape(-1, size)
        self.last_states = read("last_states").reshape(-1, size)
        self.proposals = read("proposals").reshape(-1, width)
        self.vectors = read("vectors").reshape(-1, width - TYPES)
        self.old = read("log_probabilities")
        self.types = torch.from_numpy(work.counts("types").astype(np.int64))
        self.closed = torch.from_numpy(work.counts("allowed").reshape(-1, TYPES) == 0)
        self.order = torch.from_numpy(work.counts("order").astype(np.int64)).reshape(ppo["epochs"], -1)

    def outputs(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Means and values of all states."""
        with torch.no_grad():
            return self.policy(self.states), self.value(self.states)[:, 0]

    def targets(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Advantages and returns, as the networks learn them."""
        with torch.no_grad():
            values = self.value(self.states)[:, 0].numpy() * VALUE_SCALE
            last_values = self.value(self.last_states)[:, 0].numpy() * VALUE_SCALE
        advantages, returns = map(torch.from_numpy, advantages_of(self.work, values, last_values))
        return advantages.to(self.old.dtype), returns.to(self.old.dtype) / VALUE_SCALE

    def learn(self) -> None:
        advantages, returns = self.targets()
        for order in self.order:
            for batch in order.split(self.facts["ppo"]["batch"]):
                self.step(batch, advantages[batch], returns[batch])

    def first_gradients(self) -> dict[str, torch.Tensor]:
        """What the first step goes down, flat, for each of our arrays."""
        advantages, returns = self.targets()
        batch = self.order[0][: self.facts["ppo"]["batch"]]
        self.step(batch, advantages[batch], returns[batch])
        parts = {"policy": self.policy.parameters(), "value": self.value.parameters(), "log_std": [self.log_std]}
        return {name: torch.cat([part.grad.flatten() for part in part]) for name, part in parts.items()}

    def step(self, batch: torch.Tensor, advantages: torch.Tensor, returns: torch.Tensor) -> None:
        """One gradient step of π and V."""
        ppo = self.facts["ppo"]
        states = self.states[batch]
        means = self.policy(states) + self.proposals[batch]
        closed = self.closed[batch]
        logs = torch.log_softmax(means[:, :TYPES].masked_fill(closed, -torch.inf), dim=1).masked_fill(closed, 0.0)
        entropy = -(logs.exp() * logs).sum(dim=1).mean() + self.log_std.sum()
        chosen = logs.gather(1, self.types[batch, None])[:, 0]
        z = (self.vectors[batch] - means[:, TYPES:]) / self.log_std.exp()
        log_probability = chosen - (0.5 * z.square() + self.log_std + 0.5 * math.log(2 * math.pi)).sum(dim=1)
        ratio = (log_probability - self.old[batch]).clamp(-20, 20).exp()
        clipped = ratio.clamp(1 - ppo["clip"], 1 + ppo["clip"])
        objective = torch.minimum(ratio * advantages, clipped * advantages).mean()
        loss = -objective - ppo["entropy"] * entropy
        value_loss = (self.value(states)[:, 0] - returns).square().mean()
        for adam in (self.policy_adam, self.value_adam, self.std_adam):
            adam.zero_grad()
        (loss + value_loss).backward()
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), ppo["gradient_norm"])
        torch.nn.utils.clip_grad_norm_(self.value.parameters(), ppo["gradient_norm"])
        for adam in (self.policy_adam, self.value_adam, self.std_adam):
            adam.step()
        with torch.no_grad():
            self.log_std.clamp_(-3.5, 0.5)


def main() -> None:
    work = Work(__doc__)
    notes = []
    for name, exact in Update(work, torch.float64).first_gradients().items():
        # Adam's first moment is a tenth of it.
        ours = torch.from_numpy(work.floats(f"first_{name}")).double() / 0.1
        differs = ((ours - exact).norm() / exact.norm()).item()
        notes.append(f"the first gradient of {name} differs by {differs:.0e} from that in double precision")
        if not differs < SAME:
            raise SystemExit(f"PyTorch learns something else: {notes[-1]}")
    update, other = Update(work), Update(work)
    before = update.outputs()
    took = seconds(update.learn)
    threads = torch.get_num_threads()
    # On a busy machine threads that wait for one another can take longer than one.
    torch.set_num_threads(1)
    alone = seconds(other.learn)
    for what, then, now, again in zip(("means", "values"), before, update.outputs(), other.outputs(), strict=True):
        ours = torch.from_numpy(work.floats(what)).reshape(now.shape)
        apart, alike = (100 * ((now - found).norm() / (now - then).norm()).item() for found in (ours, again))
        notes.append(f"at the end our {what} are {apart:.2g} % of their way off, PyTorch's on 1 thread {alike:.2g} %")
    facts = work.facts
    shape = " and ".join("-".join(map(str, facts[key])) for key in ("policy_sizes", "value_sizes"))
    table(
        f"learning from {len(update.old)} tuples, {facts['ppo']['epochs']} epochs of {facts['ppo']['batch']}, {shape}",
        "s",
        [
            (f"Oncue, {facts['threads']} threads", facts["seconds"]),
            ("Oncue, 1 thread", facts["seconds_alone"]),
            (f"PyTorch {torch.__version__}, {threads} threads", took),
            (f"PyTorch {torch.__version__}, 1 thread", alone),
        ],
        notes,
    )


if __name__ == "__main__":
    main()
