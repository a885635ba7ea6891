"""The tasks of benches/learning.rs in Stable-Baselines3 and gymnasium: the same task, steps and settings of PPO.

Before anything is learnt gymnasium's environment takes our steps, from the same states, and is to come to the same.
What Stable-Baselines3 does otherwise than we do is told in tests/common/control.rs; its V has π's rate, as in CleanRL.
"""

import gymnasium
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecNormalize
from work import Work, seconds, table

#: States are rounded to single precision on their way here.
SAME = 1e-4


def compare(work: Work) -> str:
    """Takes our steps in gymnasium; how much what is seen and the rewards differ, or an error."""
    facts = work.facts
    environment = gymnasium.make(facts["task"]).unwrapped
    before = work.floats("before").reshape(len(work.counts("choices")), -1)
    torques = work.floats("torques").reshape(len(before), facts["numbers"])
    worst = 0.0
    steps = zip(before, work.counts("choices"), torques, work.floats("after").reshape(len(before), -1), strict=True)
    for (state, choice, torque, after), reward in zip(steps, work.floats("rewards"), strict=True):
        environment.reset()
        environment.state = state.astype(np.float64)
        seen, theirs, *_ = environment.step(torque if len(torque) else int(choice))
        worst = max(worst, float(np.abs(seen - after).max()), abs(float(theirs) - float(reward)))
    if worst > SAME:
        raise SystemExit(f"gymnasium's {facts['task']} goes elsewhere: {worst:.2g} off after one step")
    return f"{len(before)} steps in gymnasium {gymnasium.__version__} end where ours do, within {worst:.0e}"


def learn(work: Work, seed: int) -> tuple[PPO, VecNormalize]:
    facts, ppo = work.facts, work.facts["ppo"]
    # CleanRL scales what is seen, and rewards, where the action is a vector.
    environment = VecNormalize(
        make_vec_env(facts["task"], facts["environments"], seed=seed),
        norm_obs=facts["numbers"] > 0,
        norm_reward=facts["numbers"] > 0,
        gamma=ppo["discount"],
    )
    model = PPO(
        "MlpPolicy",
        environment,
        learning_rate=lambda left: left * ppo["policy_rate"],
        n_steps=ppo["tuples"] // facts["environments"],
        batch_size=ppo["batch"],
        n_epochs=ppo["epochs"],
        gamma=ppo["discount"],
        gae_lambda=ppo["lambda"],
        clip_range=ppo["clip"],
        clip_range_vf=ppo["clip"],
        ent_coef=ppo["entropy"],
        vf_coef=0.5,
        max_grad_norm=ppo["gradient_norm"],
        policy_kwargs={"net_arch": {"pi": ppo["policy_layers"], "vf": ppo["value_layers"]}},
        device="cpu",
        seed=seed,
        stats_window_size=100,
    )
    model.learn(facts["steps"])
    return model, environment


def main() -> None:
    work = Work(__doc__)
    same = compare(work)
    found: list[tuple[PPO, VecNormalize]] = []
    took = seconds(lambda: found.append(learn(work, 1)))
    ((model, environment),) = found
    last = np.mean([episode["r"] for episode in model.ep_info_buffer or []])
    environment.training = environment.norm_reward = False
    drawn, likeliest = (
        evaluate_policy(model, environment, n_eval_episodes=100, deterministic=still)[0] for still in (False, True)
    )
    facts = work.facts
    table(
        f"{facts['task']}, {facts['steps']} steps",
        "s",
        [("Oncue, mean of three seeds", facts["seconds"]), ("Stable-Baselines3, one seed", took)],
        [
            same,
            f"last 100 episodes: {facts['last']:.1f} here, {last:.1f} there",
            f"100 fresh ones: {facts['drawn']:.1f} drawn and {facts['likeliest']:.1f} without noise here, "
            f"{drawn:.1f} and {likeliest:.1f} there",
        ],
    )


if __name__ == "__main__":
    main()
