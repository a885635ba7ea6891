"""The learning of an update of benches/controller.rs in PyTorch, on the CPU: the same networks, tuples and batches.

Values of all states, advantages, then the epochs over batches in the order that we took them, with the same clipped
objective, gradient limits and Adam. It begins at our parameters and is to end where ours end. Adam makes much of
small differences, so how near that is in single precision is measured too: PyTorch learns once more from parameters
moved by a rounding, and our end may lie no farther from its first than twice what its second does.
"""

import itertools
import math

import numpy as np
import torch
from work import Work, seconds, table

#: Returns are divided by this before the value network learns them.
VALUE_SCALE = 10.0
TYPES = 3
#: A rounding of a parameter, relative.
ROUNDING = 1e-7


def network(sizes: list[int], parameters: np.ndarray) -> torch.nn.Sequential:
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
    return torch.nn.Sequential(*layers[:-1])


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

    def __init__(self, work: Work) -> None:
        self.work, self.facts = work, work.facts
        ppo = self.facts["ppo"]
        policy_sizes, value_sizes = self.facts["policy_sizes"], self.facts["value_sizes"]
        self.policy = network(policy_sizes, work.floats("policy"))
        self.value = network(value_sizes, work.floats("value"))
        self.log_std = torch.nn.Parameter(torch.from_numpy(work.floats("log_std")))
        self.policy_adam = torch.optim.Adam(self.policy.parameters(), lr=ppo["policy_rate"])
        self.value_adam = torch.optim.Adam(self.value.parameters(), lr=ppo["value_rate"])
        self.std_adam = torch.optim.Adam([self.log_std], lr=ppo["policy_rate"])
        size, width = policy_sizes[0], policy_sizes[-1]
        self.states = torch.from_numpy(work.floats("states").reshape(-1, size))
        self.last_states = torch.from_numpy(work.floats("last_states").reshape(-1, size))
        self.proposals = torch.from_numpy(work.floats("proposals").reshape(-1, width))
        self.vectors = torch.from_numpy(work.floats("vectors").reshape(-1, width - TYPES))
        self.old = torch.from_numpy(work.floats("log_probabilities"))
        self.types = torch.from_numpy(work.counts("types").astype(np.int64))
        self.closed = torch.from_numpy(work.counts("allowed").reshape(-1, TYPES) == 0)
        self.order = torch.from_numpy(work.counts("order").astype(np.int64)).reshape(ppo["epochs"], -1)

    def outputs(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Means and values of all states."""
        with torch.no_grad():
            return self.policy(self.states), self.value(self.states)[:, 0]

    def round_otherwise(self) -> None:
        """Moves every parameter by a rounding."""
        torch.manual_seed(1)
        with torch.no_grad():
            for parameter in [*self.policy.parameters(), *self.value.parameters()]:
                parameter *= 1 + ROUNDING * torch.randn_like(parameter)

    def learn(self) -> None:
        ppo = self.facts["ppo"]
        with torch.no_grad():
            values = self.value(self.states)[:, 0].numpy() * VALUE_SCALE
            last_values = self.value(self.last_states)[:, 0].numpy() * VALUE_SCALE
        advantages, returns = map(torch.from_numpy, advantages_of(self.work, values, last_values))
        advantages, returns = advantages.float(), returns.float() / VALUE_SCALE
        for order in self.order:
            for batch in order.split(ppo["batch"]):
                self.step(batch, advantages[batch], returns[batch])

    def step(self, batch: torch.Tensor, advantages: torch.Tensor, returns: torch.Tensor) -> None:
        """One gradient step of π and V."""
        ppo = self.facts["ppo"]
        states = self.states[batch]
        means = self.policy(states) + self.proposals[batch]
        logits = means[:, :TYPES].masked_fill(self.closed[batch], -torch.inf)
        chosen = torch.log_softmax(logits, dim=1).gather(1, self.types[batch, None])[:, 0]
        z = (self.vectors[batch] - means[:, TYPES:]) / self.log_std.exp()
        log_probability = chosen - (0.5 * z.square() + self.log_std + 0.5 * math.log(2 * math.pi)).sum(dim=1)
        ratio = (log_probability - self.old[batch]).clamp(-20, 20).exp()
        clipped = ratio.clamp(1 - ppo["clip"], 1 + ppo["clip"])
        objective = torch.minimum(ratio * advantages, clipped * advantages).mean()
        loss = -objective - ppo["entropy"] * self.log_std.sum()
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
    update = Update(work)
    before = update.outputs()
    took = seconds(update.learn)
    other = Update(work)
    other.round_otherwise()
    threads = torch.get_num_threads()
    # On a busy machine threads that wait for one another can take longer than one.
    torch.set_num_threads(1)
    alone = seconds(other.learn)
    notes = []
    for what, then, now, again in zip(("means", "values"), before, update.outputs(), other.outputs(), strict=True):
        ours = torch.from_numpy(work.floats(what)).reshape(now.shape)
        change = (ours - then).norm()
        differs, rounding = ((now - ours).norm() / change).item(), ((now - again).norm() / change).item()
        notes.append(
            f"the change of the {what} differs by {100 * differs:.2g} %, after a rounding by {100 * rounding:.2g} %"
        )
        if not differs < 2 * rounding:
            raise SystemExit(f"PyTorch learns something else: {notes[-1]}")
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
