"""What a model is and how it is trained, as frozen data; JSON both ways."""

import json
from dataclasses import dataclass
from typing import Any

from baselines.pix2shape.network.architecture import NetworkSpec
from scenegen.common.errors import SpecError
from scenegen.common.records import LARGEST, check, from_json, normalise, to_json

PAPER_NETWORKS = NetworkSpec()
CONFIGS: dict[str, dict[str, Any]] = {
    "paper": {},
    "compact": {
        "networks": NetworkSpec(size=64, width=0.125),
        "batch": 16,
        "iterations": 12_000,
        "learning_rate": 1e-3,
        "betas": (0.9, 0.99),
        "decay": True,
        "critic_steps": 1,
        "adversarial": 0.0,
        "code_reconstruction": 0.0,
        "absolute_differences": True,
        "consistency": 30.0,
        "questions": 0.01,
        "contrast": 10.0,
        "question_batch": 32,
    },
}


LOSSES = (
    "adversarial",
    "reconstruction",
    "code_reconstruction",
    "consistency",
    "mutual_information",
    "questions",
    "contrast",
    "depth",
)


@dataclass(frozen=True)
class ModelConfig:
    """The paper's model; the defaults are its numbers.

    Attributes:
        networks: what they look like.
        depth_middle, depth_reach: the decoder gives depths of depth_middle (1 +- depth_reach),
            scene units; known from the camera, not from depth maps.
        opacity: whether the decoder also tells which rays meet nothing.
        iterations, batch: of training, in images; Adam with `learning_rate` and `betas`.
        decay: whether the learning rate falls to nothing over the second half.
        question_batch: questions whose codes L_theta and `contrast` compare in each iteration.
        critic_steps: of the critic, for each of the others.
        absolute_differences: whether images are compared by these, not by the paper's norm.
        adversarial, reconstruction, code_reconstruction, consistency, mutual_information,
        questions, contrast, depth:
            weights of the losses; 0 switches one off. `depth` is the ablation's supervision.
        seed: of weights and of every random choice of training.
    """

    networks: NetworkSpec = PAPER_NETWORKS
    depth_middle: float = 1.5
    depth_reach: float = 0.4
    opacity: bool = False
    iterations: int = 60_000
    batch: int = 6
    question_batch: int = 2
    learning_rate: float = 1e-4
    betas: tuple[float, float] = (0.5, 0.9)
    decay: bool = False
    critic_steps: int = 5
    absolute_differences: bool = False
    adversarial: float = 1.0
    reconstruction: float = 1.0
    code_reconstruction: float = 1.0
    consistency: float = 0.0
    mutual_information: float = 1.0
    questions: float = 1.0
    contrast: float = 0.0
    depth: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        normalise(self)
        check(0 < self.depth_reach < 1, "depth reach", self.depth_reach, "between 0 and 1")
        check(self.depth_middle > 0, "depth middle", self.depth_middle, "a positive number")
        check(self.iterations >= 1, "iterations", self.iterations, "1 or more")
        check(self.batch >= 2, "batch", self.batch, "2 or more")
        least = 8 if self.contrast else 2  # a quarter of them may be labelled
        asked = self.question_batch
        needed = f"{least} or more" + (", where contrast is on" if self.contrast else "")
        check(asked >= least, "question batch", asked, needed)
        check(self.critic_steps >= 1, "critic steps", self.critic_steps, "1 or more")
        check(self.learning_rate > 0, "learning rate", self.learning_rate, "a positive number")
        in_range = len(self.betas) == 2 and all(0 <= beta < 1 for beta in self.betas)
        check(in_range, "betas", self.betas, "two numbers from 0 to below 1")
        check(self.seed >= 0, "seed", self.seed, "0 or more")
        for name in LOSSES:
            weight = getattr(self, name)
            check(0 <= weight < LARGEST, name.replace("_", " "), weight, "0 or a positive number")

    @property
    def has_critic(self) -> bool:
        """Whether anything is trained against encoder and decoder."""
        return bool(self.adversarial or self.disentangles)

    @property
    def disentangles(self) -> bool:
        """Whether mutual information is minimised: where a part of the code tells the view."""
        return bool(self.mutual_information and self.networks.z_view)

    @property
    def batches_per_iteration(self) -> int:
        """Batches that one iteration takes: one for each step of the critic, at least one."""
        return self.critic_steps if self.has_critic else 1

    @property
    def reconstructed_questions(self) -> int:
        """Questions whose images fill a batch, four each."""
        return -(-self.batch // 4)

    def to_json(self) -> str:
        """Return the configuration as one line of JSON with sorted keys."""
        return to_json(self, sort_keys=True)

    @classmethod
    def from_json(cls, text: str | bytes) -> "ModelConfig":
        """Read what `to_json` wrote. Raises SpecError on anything else."""
        return from_json(cls, text, "model configuration")


def model_config(name: str, /, **settings: Any) -> ModelConfig:
    """Return a named configuration with other settings on top.

    Args:
        settings: values as JSON has them, by name; those of the networks as "networks.width".

    Raises SpecError for names and values that are none.
    """
    if name not in CONFIGS:
        raise SpecError(f"config: found {name!r}, expected one of {', '.join(CONFIGS)}")
    record = json.loads(ModelConfig(**CONFIGS[name]).to_json())
    for setting, value in settings.items():
        group, dot, rest = setting.rpartition(".")
        place = record[group] if dot and isinstance(record.get(group), dict) else record
        place[rest if place is not record else setting] = value
    return ModelConfig.from_json(json.dumps(record, default=vars))
