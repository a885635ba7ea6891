"""A gradient step of PPO is what the published formulas say, in double precision, within what rounding does.

`examples/learning_steps` prints what our update makes of a few hundred tuples, before the first gradient step and after
each. Here the same is worked out in double precision from the formulas: generalized advantages (Schulman et al. 2016),
the clipped objective with an entropy (Schulman et al. 2017), the chain rule through layers with ReLU, the limit of the
gradient's length, and Adam (Kingma & Ba 2015). Each step begins at *our* parameters before it, so that differences
never grow: learning makes much of a rounding, one step does not.

How far single precision may lie from that is not tuned but worked out along with each number (running error analysis,
Higham 2002, section 3.3): with u = 2⁻²⁴, an operation adds u of its result, a sum of n products in any order, with
fused operations or without, (n + 1)·u/(1 - (n + 1)·u) of the sum of their magnitudes, exp and ln two units in the last
place; what was off before is carried along. Where the error could put a unit of ReLU or a ratio on the other side of
its bend, all that this could change is allowed. So the bounds hold on any machine, whatever its vectors.
"""

import itertools
import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
TYPES = 3
#: Returns are divided by this before V learns them.
VALUE_SCALE = 10.0
BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8

#: The unit of rounding, with some for products of errors.
U = 1.01 * 2.0**-24
#: exp and ln are right to two units in the last place.
FUNCTION = 4 * U
#: Below the numbers of full precision.
SMALLEST = 1e-43


def gamma(n):
    """What a sum of n products may be off by, of the sum of their magnitudes."""
    return (n + 1) * U / (1 - (n + 1) * U)


class Bounded:
    """Numbers in double precision, and how far they may be from those in single precision."""

    #: numpy leaves arrays on the left to us.
    __array_ufunc__ = None

    def __init__(self, value, error=0.0):
        self.value = np.asarray(value, dtype=float)
        self.error = np.broadcast_to(np.asarray(error, dtype=float), self.value.shape)

    @property
    def most(self):
        """The largest magnitude that it may have in single precision."""
        return np.abs(self.value) + self.error

    def __getitem__(self, at):
        return Bounded(self.value[at], self.error[at])

    def __add__(self, other):
        other = bounded(other)
        value = self.value + other.value
        error = self.error + other.error
        return Bounded(value, error + U * (np.abs(value) + error))

    def __neg__(self):
        return Bounded(-self.value, self.error)

    def __sub__(self, other):
        return self + -bounded(other)

    def __rsub__(self, other):
        return -self + other

    def __mul__(self, other):
        other = bounded(other)
        value = self.value * other.value
        error = self.error * other.most + np.abs(self.value) * other.error
        return Bounded(value, error + U * (np.abs(value) + error))

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other):
        other = bounded(other)
        least = np.abs(other.value) - other.error
        assert np.all(least > 0)
        value = self.value / other.value
        error = (self.error + np.abs(value) * other.error) / least
        return Bounded(value, error + U * (np.abs(value) + error))

    def __matmul__(self, other):
        other = bounded(other)
        error = self.error @ other.most + np.abs(self.value) @ other.error
        error = error + gamma(self.value.shape[-1]) * (self.most @ other.most)
        return Bounded(self.value @ other.value, error)

    @property
    def T(self):
        return Bounded(self.value.T, self.error.T)

    def sum(self, axis):
        count = self.value.shape[axis]
        return Bounded(self.value.sum(axis), self.error.sum(axis) + gamma(count) * self.most.sum(axis))

    def exp(self):
        value = np.exp(self.value)
        error = value * np.expm1(self.error)
        return Bounded(value, error + FUNCTION * (value + error))

    def log(self):
        least = self.value - self.error
        assert np.all(least > 0)
        value = np.log(self.value)
        error = self.error / least
        return Bounded(value, error + FUNCTION * (np.abs(value) + error))

    def sqrt(self):
        value = np.sqrt(self.value)
        # |√(x + e) - √x| is at most √e, and at most e/√x.
        error = np.minimum(np.sqrt(self.error), self.error / np.maximum(value, 1e-300))
        return Bounded(value, error + U * (value + error))

    def only_where(self, passed, unsure):
        """0 where `passed` is false; where that is `unsure`, single precision may have either."""
        value = np.where(passed, self.value, 0.0)
        return Bounded(value, np.where(unsure, self.most, np.where(passed, self.error, 0.0)))


def bounded(x):
    return x if isinstance(x, Bounded) else Bounded(x)


def rounded(constant):
    """A constant as single precision has it, or as good as."""
    return Bounded(constant, U * abs(constant))


class Network:
    """Layers with ReLU between them, from flat parameters: W (out × in), then b, layer by layer."""

    def __init__(self, sizes, parameters):
        self.layers, at = [], 0
        for inputs, outputs in itertools.pairwise(sizes):
            weight = parameters[at : at + inputs * outputs].reshape(outputs, inputs)
            at += inputs * outputs
            self.layers.append((weight, parameters[at : at + outputs]))
            at += outputs

    def forward(self, x):
        self.inputs = []
        for i, (weight, bias) in enumerate(self.layers):
            if i:
                x = x.only_where(x.value > 0, np.abs(x.value) <= x.error)
            self.inputs.append(x)
            # The bias is one more product of the sum.
            ones = np.ones((*x.value.shape[:-1], 1))
            with_one = Bounded(np.hstack([x.value, ones]), np.hstack([x.error, 0 * ones]))
            x = with_one @ np.hstack([weight, bias[:, None]]).T
        return x

    def backward(self, d):
        """The gradient by the parameters, summed over rows, given that by the output."""
        parts = []
        for i in reversed(range(len(self.layers))):
            weight, x = self.layers[i][0], self.inputs[i]
            bias = d.sum(0)
            weights = d.T @ x
            parts.insert(0, (weights, bias))
            if i:
                # x is behind the ReLU: 0 where it was shut, and unsure where it may have been.
                d = (d @ weight).only_where(x.value > 0, (x.value <= x.error) & (x.error > 0))
        flat = [part for pair in parts for part in pair]
        return Bounded(*(np.concatenate([getattr(p, key).ravel() for p in flat]) for key in ("value", "error")))


@pytest.fixture(scope="module")
def ours():
    cargo = shutil.which("cargo")
    if cargo is None:
        pytest.skip("the example is compiled by cargo")
    # All crates with the features that the tests have compiled them with.
    build = [cargo, "build", "--release", "--locked", "--quiet", "--workspace", "--example", "learning_steps"]
    subprocess.run(build, cwd=ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    done = subprocess.run([target / "release" / "examples" / "learning_steps"], capture_output=True, check=True)
    facts = json.loads(done.stdout)
    rows = len(facts["rewards"])
    for name in ("states", "last_states", "proposals", "vectors"):
        count = rows // facts["per_environment"] if name == "last_states" else rows
        facts[name] = np.reshape(facts[name], (count, -1))
    for name in ("log_probabilities", "rewards", "ended", "types", "allowed", "advantages", "returns"):
        facts[name] = np.array(facts[name])
    facts["moments"] = [[{k: np.array(v) for k, v in part.items()} for part in step] for step in facts["moments"]]
    return facts


def values(facts, states):
    network = Network(facts["value_sizes"], facts["moments"][0][1]["parameters"])
    return (network.forward(Bounded(states)) * VALUE_SCALE)[:, 0]


def targets(facts, ppo):
    """Standardized advantages and returns of all tuples."""
    steps = facts["per_environment"]
    here, after = values(facts, facts["states"]), values(facts, facts["last_states"])
    discount, decay = rounded(ppo["discount"]), rounded(ppo["lambda"])
    value, error = np.zeros(len(facts["rewards"])), np.zeros(len(facts["rewards"]))
    for environment in range(len(after.value)):
        following, running = after[environment], Bounded(0.0)
        for t in reversed(range(environment * steps, (environment + 1) * steps)):
            live = float(not facts["ended"][t])
            delta = Bounded(facts["rewards"][t]) + discount * following * live - here[t]
            running = delta + discount * decay * live * running
            value[t], error[t] = running.value, running.error
            following = here[t]
    advantages = Bounded(value, error)
    # Mean and deviation are taken in double precision, of numbers in single precision.
    off = np.sqrt(np.mean(error**2))
    deviation = Bounded(value.std() + 1e-6, off)
    return (advantages - Bounded(value.mean(), error.mean())) / deviation, advantages + here


def gradients(facts, ppo, step):
    """What the three Adams go down in a step, from our parameters before it and our targets."""
    rows = np.array(facts["batches"][step])
    policy, value, spread = (part["parameters"] for part in facts["moments"][step])
    states = Bounded(facts["states"][rows])
    network = Network(facts["policy_sizes"], policy)
    mean = network.forward(states) + facts["proposals"][rows]
    chosen = np.eye(TYPES)[facts["types"][rows]]
    allowed = facts["allowed"][rows]

    # Softmax of what is open, from the largest downwards.
    logits = mean[:, :TYPES]
    top = np.argmax(np.where(allowed, logits.value, -np.inf), axis=1)[:, None]
    top = Bounded(*(np.take_along_axis(part, top, 1) for part in (logits.value, logits.error)))
    powers = (logits - top).exp().only_where(allowed, np.zeros_like(allowed))
    p = powers / powers.sum(1)[:, None]
    logs = Bounded(np.where(allowed, p.value, 1.0), np.where(allowed, p.error, 0.0)).log()
    entropy = -(p * logs).sum(1)[:, None]

    inverse = 1.0 / np.exp(spread)
    inverse = Bounded(inverse, (FUNCTION + U) * inverse)
    z = (Bounded(facts["vectors"][rows]) - mean[:, TYPES:]) * inverse
    peak = -(Bounded(spread) + rounded(0.5 * np.log(2 * np.pi))).sum(0)
    log = (logs * chosen).sum(1) + peak - 0.5 * (z * z).sum(1)
    ratio = (log - facts["log_probabilities"][rows]).exp()

    advantages = facts["advantages"][rows]
    edge = np.where(advantages >= 0, 1 + ppo["clip"], 1 - ppo["clip"])
    moves = np.where(advantages >= 0, ratio.value <= edge, ratio.value >= edge)
    unsure = np.abs(ratio.value - edge) <= ratio.error + 2 * U
    d_log = (ratio * -advantages).only_where(moves, unsure)[:, None]
    beta = rounded(ppo["entropy"])
    d_types = (d_log * (chosen - p) + beta * p * (logs + entropy)).only_where(allowed, np.zeros_like(allowed))
    d_vector = d_log * z * inverse
    d_spread = (d_log * (z * z - 1.0) - beta).sum(0)
    d = Bounded(*(np.hstack([getattr(part, key) for part in (d_types, d_vector)]) for key in ("value", "error")))
    policy_gradient = network.backward(d)

    network = Network(facts["value_sizes"], value)
    found = network.forward(states)
    d = 2.0 * (found - (Bounded(facts["returns"][rows]) / VALUE_SCALE)[:, None])
    value_gradient = network.backward(d)

    share = rounded(1.0 / len(rows))
    limit = ppo["gradient_norm"]
    return [shortened(policy_gradient, share, limit), shortened(value_gradient, share, limit), d_spread * share]


def shortened(gradient, share, limit):
    """The mean over a batch, no longer than the limit."""
    length = (gradient * gradient).sum(0).sqrt() * share
    # The shorter of the two is as near as the nearer: |min(1, l/a) - min(1, l/b)| is at most |l/a - l/b|.
    factor = Bounded(limit) / length
    factor = Bounded(min(1.0, float(factor.value)), factor.error)
    return gradient * share * factor


def off(found, expected):
    """The largest difference, in what it may be."""
    return float(np.max(np.abs(found - expected.value) / np.maximum(expected.error, SMALLEST)))


def followed(facts, ppo):
    """How far our numbers are from the reference's, in what rounding allows: for each link of each step."""
    advantages, returns = targets(facts, ppo)
    found = {"advantages": off(facts["advantages"], advantages), "returns": off(facts["returns"], returns)}
    rates = [ppo["policy_rate"], ppo["value_rate"], ppo["policy_rate"]]
    for step in range(len(facts["batches"])):
        for gradient, rate, name, before, after in zip(
            gradients(facts, ppo, step),
            rates,
            ("π", "V", "spread"),
            facts["moments"][step],
            facts["moments"][step + 1],
            strict=True,
        ):
            first = Bounded(before["first"]) * rounded(BETA1) + gradient * Bounded(1 - BETA1, U)
            second = Bounded(before["second"]) * rounded(BETA2) + gradient * gradient * Bounded(1 - BETA2, U)
            # From our own moments, so that a gradient near zero makes nothing of its sign.
            t = step + 1
            corrected = rounded(rate) * Bounded(1 - BETA2**t, 2 * t * U).sqrt() / Bounded(1 - BETA1**t, 2 * t * U)
            moved = corrected * after["first"] / (Bounded(after["second"]).sqrt() + rounded(EPSILON))
            parameters = Bounded(before["parameters"]) - moved
            links = {"m": ("first", first), "v": ("second", second), "parameters": ("parameters", parameters)}
            for link, (key, expected) in links.items():
                found[f"{link} of {name}, step {t}"] = off(after[key], expected)
            size = np.linalg.norm(gradient.error) / np.linalg.norm(gradient.value)
            found[f"share of {name}, step {t}"] = size
    return found


def test_every_step_is_that_of_the_formulas(ours):
    found = followed(ours, ours["ppo"])
    shares = {name: share for name, share in found.items() if name.startswith("share")}
    worst = max(found.items() - shares.items(), key=lambda item: item[1])
    print(f"worst: {worst[0]}, {worst[1]:.2f} of what rounding allows; gradients within {max(shares.values()):.1e}")
    assert worst[1] <= 1.0, worst
    # Bounds that allow anything would find nothing.
    assert max(shares.values()) < 1e-2, shares


def test_the_example_has_what_there_is_to_get_wrong(ours):
    rows = np.array(ours["batches"][0])
    assert len(ours["batches"][1]) < len(rows)
    assert set(ours["allowed"].sum(axis=1)) == {1, 2, 3}
    assert ours["ended"].any()
    gradient_lengths = [np.linalg.norm(part["first"]) / (1 - BETA1) for part in ours["moments"][1][:2]]
    limit = ours["ppo"]["gradient_norm"]
    assert min(gradient_lengths) < 0.99 * limit
    assert max(gradient_lengths) == pytest.approx(limit, rel=1e-5)


@pytest.mark.parametrize(
    "setting", ["discount", "lambda", "clip", "entropy", "gradient_norm", "policy_rate", "value_rate"]
)
def test_a_setting_that_is_a_hundredth_off_is_noticed(ours, setting):
    other = {**ours["ppo"], setting: 0.99 * ours["ppo"][setting]}
    found = {name: by for name, by in followed(ours, other).items() if not name.startswith("share")}
    assert max(found.values()) > 1.5, found
