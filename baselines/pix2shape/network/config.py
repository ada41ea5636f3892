"""The settings of a model and its training, as frozen dataclasses that JSON can hold."""

import json
from dataclasses import dataclass
from typing import Any

from baselines.pix2shape.network.architecture import NetworkSpec
from baselines.training.checkpoint import check_numbers
from scenegen.common.names import check_choice
from scenegen.common.records import LARGEST, check, from_json, to_json

PAPER_NETWORKS = NetworkSpec()
CONFIGS: dict[str, dict[str, Any]] = {
    "paper": {},
    "rays": {
        "networks": NetworkSpec(size=64, width=0.125, rays=True),
        "batch": 32,
        "iterations": 10_000,
        "learning_rate": 3e-3,
        "betas": (0.9, 0.99),
        "decay": True,
        "critic_steps": 1,
        "adversarial": 0.0,
        "reconstruction": 0.0,
        "code_reconstruction": 0.0,
        "matching": 1.0,
    },
    "views": {
        "networks": NetworkSpec(
            size=64, width=0.0625, camera=False, spherical=True, encoder="polar"
        ),
        "batch": 4,
        "question_batch": 64,
        "labelled_batch": 8,
        "turned": True,
        "temperature": 0.6,
        "hard_negatives": 1.0,
        "easy_negatives": 0.0,
        "iterations": 26_000,
        "learning_rate": 3e-3,
        "betas": (0.9, 0.99),
        "decay": True,
        "critic_steps": 1,
        "adversarial": 0.0,
        "reconstruction": 0.0,
        "code_reconstruction": 0.0,
        "mutual_information": 0.0,
        "questions": 0.0,
        "contrast": 1.0,
    },
}
LOSSES = (
    "adversarial", "reconstruction", "code_reconstruction", "mutual_information", "questions",
    "contrast", "depth", "matching",
)  # fmt: skip

METHOD = "pix2shape"
TAUGHT_DEPTH = f"{METHOD}-depth"
MOST_LIGHTS = 64
TINY = 1e-12  # stands for "above 0"
MOST_ITEMS = 1_000_000  # images or questions in a batch


@dataclass(frozen=True)
class ModelConfig:
    """Settings of a model and its training. The defaults are the paper's, where it states them.

    Attributes:
        networks: sizes of the networks.
        depth_middle, depth_reach: the decoder gives depths of depth_middle * (1 +- depth_reach),
            scene units. Both follow from the camera's distance, not from depth maps.
        opacity: whether the decoder also says which rays meet a surface.
        material: whether the decoder also says what each surfel is made of, albedo and Phong's
            lobe, which training then is not told (the paper's appendix "Material, Lights, and
            Camera Properties"); rooms only.
        lights: how many lights, as many as rooms of the training file have at most, whose positions
            are read from the code and not told; 0 tells them. Their colours are told.
        iterations, batch: length of training, and images in each batch.
        question_batch: questions whose codes are compared in each iteration: labelled ones by
            L_theta or, with `contrast`, those without a label.
        labelled_batch: labelled questions that are compared besides, with `contrast`.
        turned: whether the images of compared questions are turned about the viewing axis, each by
            an angle of its own, and each question mirrored with probability 1/2.
        temperature: of `contrast`; divides mean squared differences of codes, about 2 at first.
        hard_negatives: weight in `contrast` of the pairs among a question's own answers, which
            show different shapes of as many cubes.
        easy_negatives: weight in `contrast` of the answers of other questions.
        learning_rate, betas: of Adam.
        decay: whether the learning rate falls linearly to 0 over the second half of training.
        critic_steps: steps of the critic for each step of encoder and decoder.
        absolute_differences: whether images are compared by absolute differences, not by the
            paper's norm.
        adversarial, reconstruction, code_reconstruction, mutual_information, questions, contrast,
        depth, matching:
            weights of the losses of `training/losses.py`; 0 switches one off. `questions` is the
            paper's L_theta, `depth` the supervision of its ablation, and `matching` compares with
            the relief that a search finds from several images of a scene (networks of rays only).
        seed: of the first weights and of every random choice of training.
    """

    networks: NetworkSpec = PAPER_NETWORKS
    depth_middle: float = 1.5
    depth_reach: float = 0.4
    opacity: bool = False
    material: bool = False
    lights: int = 0
    iterations: int = 60_000
    batch: int = 6
    question_batch: int = 2
    labelled_batch: int = 0
    turned: bool = False
    temperature: float = 0.2
    hard_negatives: float = 0.0
    easy_negatives: float = 1.0
    learning_rate: float = 1e-4
    betas: tuple[float, float] = (0.5, 0.9)
    decay: bool = False
    critic_steps: int = 5
    absolute_differences: bool = False
    adversarial: float = 1.0
    reconstruction: float = 1.0
    code_reconstruction: float = 1.0
    mutual_information: float = 1.0
    questions: float = 1.0
    contrast: float = 0.0
    depth: float = 0.0
    matching: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        ranges: dict[str, tuple[float, float]] = {
            "depth_reach": (TINY, 1 - TINY), "depth_middle": (TINY, LARGEST),
            "iterations": (1, LARGEST), "batch": (2, MOST_ITEMS),
            "question_batch": (2, MOST_ITEMS), "labelled_batch": (0, MOST_ITEMS),
            "temperature": (TINY, LARGEST), "hard_negatives": (0, LARGEST),
            "easy_negatives": (0, LARGEST), "critic_steps": (1, MOST_ITEMS),
            "learning_rate": (TINY, LARGEST), "lights": (0, MOST_LIGHTS), "seed": (0, 2**63),
        }  # fmt: skip
        check_numbers(self, ranges | dict.fromkeys(LOSSES, (0, LARGEST)))
        negatives = self.hard_negatives + self.easy_negatives
        expected = "one above 0, for contrast"
        check(not self.contrast or negatives > 0, "negatives", negatives, expected)
        in_range = len(self.betas) == 2 and all(0 <= beta < 1 for beta in self.betas)
        check(in_range, "betas", self.betas, "two numbers from 0 to below 1")
        if self.matching:
            check(self.networks.rays, "matching", self.matching, "0 for networks without rays")

    @property
    def method(self) -> str:
        """The name of its submissions, which tells the paper's objective from what leaves it.

        "pix2shape" has the adversarial loss, reconstructs images and codes by the paper's norm, for
        questions minimises mutual information, and has no loss that the paper lacks. Of other
        settings any may differ: sizes, iterations, the optimiser's. "pix2shape-depth" learns from
        true depth maps, "pix2shape-rays" is told the empty room, "pix2shape-views" has the polar
        encoder, and all others are "pix2shape-compact".
        """
        if self.depth:
            return TAUGHT_DEPTH
        if self.networks.encoder == "polar":
            return f"{METHOD}-views"
        if self.networks.rays:
            return f"{METHOD}-rays"
        both = self.reconstruction and self.code_reconstruction and not self.absolute_differences
        ours = (self.contrast, self.matching)
        view = self.networks.camera or self.disentangles
        others = self.networks.spherical or self.turned
        faithful = self.adversarial and both and view and not (any(ours) or others)
        return METHOD if faithful else f"{METHOD}-compact"

    @property
    def has_critic(self) -> bool:
        """Whether the critic or the statistics network is trained."""
        return bool(self.adversarial or self.disentangles)

    @property
    def uses_images(self) -> bool:
        """Whether any loss is of a batch of images, not of questions that are compared."""
        image = (self.adversarial, self.reconstruction, self.code_reconstruction)
        return bool(any((*image, self.depth, self.matching)) or self.disentangles)

    @property
    def disentangles(self) -> bool:
        """Whether mutual information is minimised, which needs a part of the code for the view."""
        return bool(self.mutual_information and self.networks.z_view)

    @property
    def batches_per_iteration(self) -> int:
        """Batches that one iteration takes: one for each of the critic's steps, or one."""
        return self.critic_steps if self.has_critic else 1

    @property
    def reconstructed_questions(self) -> int:
        """Questions whose images, four each, fill a batch."""
        return -(-self.batch // 4)

    def to_json(self) -> str:
        """Return the configuration as one line of JSON with sorted keys."""
        return to_json(self, sort_keys=True)

    @classmethod
    def from_json(cls, text: str | bytes) -> "ModelConfig":
        """Read what `to_json` wrote. Raises SpecError on anything else."""
        return from_json(cls, text, "model configuration")


def model_config(name: str, /, **settings: Any) -> ModelConfig:
    """Return a named configuration, with some settings changed.

    Args:
        name: "paper" (128 pixels, full width, all losses of the paper), "rays" (64 pixels, an
            eighth of the width; told the empty room, and trained on what matching finds in several
            images of a scene) or "views" (questions alone: the polar encoder and `contrast`).
        settings: values as in JSON by name; a setting of the networks as "networks.width".

    Raises SpecError for unknown names and impossible values.
    """
    check_choice("config", name, CONFIGS)
    record = json.loads(ModelConfig(**CONFIGS[name]).to_json())
    for setting, value in settings.items():
        group, dot, rest = setting.rpartition(".")
        place = record[group] if dot and isinstance(record.get(group), dict) else record
        place[rest if place is not record else setting] = value
    return ModelConfig.from_json(json.dumps(record, default=vars))
