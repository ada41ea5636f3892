"""Encoder, decoder, critic and statistics network, as in the paper's architecture tables.

Pix2Shape (IJCV 2020), appendix "Architecture". The tables' channels are multiplied by a width.
Where a table is incomplete or contradicts the text, docs/pix2shape.md says what is done here.
"""

import itertools
import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from baselines.training.checkpoint import check_numbers
from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.common.records import check

SIZES = (32, 64, 128, 256)  # pixels a side
ENCODERS = ("paper", "polar")
MOST = 4096  # dimensions of a code, and classes
SLOPE = 0.2  # of the leaky ReLUs below 0
ENCODER_CHANNELS = (85, 170, 340, 680, 1360)  # of 64, 32, 16, 8, 4 pixels, at 128x128
DECODER_CHANNELS = (1344, 627, 336, 168, 84)  # of 4, 8, 16, 32, 64 pixels, at 128x128
STATISTICS_CHANNELS = (256, 512)
FLAT = 0.1  # scales the decoder's last weights: first surfaces are smooth, as noise hides shading
WINDOW = 9  # pixels a side, of the mean that is taken from an image to show faint differences
CONTRAST = 8.0  # multiplies these differences
RAY_PLANES = 4  # where a ray meets floor or wall, and at which depth
CAMERA = 3  # numbers of the condition that are the camera's position


@dataclass(frozen=True)
class NetworkSpec:
    """Sizes of the networks.

    Attributes:
        size: image size, pixels a side, one of SIZES.
        width: multiplies the tables' channels; 1 is the paper's.
        z_scene, z_view: dimensions of the code; z_view is 0 where the camera is told.
        camera: whether the networks are told the camera's position.
        classes: number of object classes the networks are told, one-hot; 0 for none.
        standardised: whether batch normalisation gives codes mean 0 and variance 1.
        rays: whether the networks are told the empty room. The encoder then sees, beside the
            image, its faint differences and where the ray of each pixel meets floor or walls, and
            the decoder gives relief: how far surfaces lie before these, scene units.
        spherical: whether z_scene is then scaled to the length sqrt(z_scene), so that distances
            are bounded.
        encoder: "paper", or "polar" for questions (`network/polar.py`).
    """

    size: int = 128
    width: float = 1.0
    z_scene: int = 128
    z_view: int = 0
    camera: bool = True
    classes: int = 0
    standardised: bool = False
    rays: bool = False
    spherical: bool = False
    encoder: str = "paper"

    def __post_init__(self) -> None:
        ranges: dict[str, tuple[float, float]] = {
            "width": (0.01, 4), "z_scene": (1, MOST), "z_view": (0, MOST), "classes": (0, MOST),
        }  # fmt: skip
        check_numbers(self, ranges)
        check(self.size in SIZES, "size", self.size, f"one of {', '.join(map(str, SIZES))}")
        if self.rays:
            check(self.camera, "camera", self.camera, "true, as rays are those of a known camera")
        check_choice("encoder", self.encoder, ENCODERS)
        if self.encoder == "polar" and self.condition:
            found = "'polar' with a camera or categories as input"
            raise SpecError("encoder", found, "'paper', or networks without them, as of questions")

    @property
    def z(self) -> int:
        """Dimensions of a code."""
        return self.z_scene + self.z_view

    @property
    def condition(self) -> int:
        """Length of the condition: camera position and one-hot class."""
        return CAMERA * self.camera + self.classes

    @property
    def planes(self) -> int:
        """Channels of what the encoder sees beside an image and its condition."""
        return (3 + RAY_PLANES) * self.rays

    def channels(self, table: tuple[int, ...]) -> list[int]:
        """Return a table's channels for this size and width, in the table's order.

        Images of 256 pixels get one more layer, of half the channels, at the large end; smaller
        ones than 128 leave the largest layers out.
        """
        falling = table[0] > table[-1]
        rising = sorted(table)
        layers = self.size.bit_length() - 3  # strides of two from size to 4 pixels
        while len(rising) < layers:
            rising.insert(0, max(1, rising[0] // 2))
        rising = rising[len(rising) - layers :]
        wide = [max(4, round(self.width * channels)) for channels in rising]
        return wide[::-1] if falling else wide


def contrast(image: Tensor) -> Tensor:
    """Return how an image differs from its mean over a window: (B, C, S, S) -> (B, C, S, S)."""
    border = functional.pad(image, (WINDOW // 2,) * 4, mode="replicate")
    return CONTRAST * (image - functional.avg_pool2d(border, WINDOW, 1))


class ConditionalNorm(nn.Module):
    """Batch normalisation whose scale and shift are learned functions of a condition.

    As in Dumoulin et al. (2016) and Perez et al. (2017), which the paper cites. Without a condition
    it is an ordinary batch normalisation.
    """

    def __init__(self, channels: int, condition: int, hidden: int = 64) -> None:
        super().__init__()
        self.norm = nn.BatchNorm2d(channels, affine=condition == 0)
        self.affine: nn.Module | None = None
        if condition:
            last = nn.Linear(hidden, 2 * channels)
            nn.init.zeros_(last.weight)
            nn.init.zeros_(last.bias)
            self.affine = nn.Sequential(nn.Linear(condition, hidden), nn.LeakyReLU(SLOPE), last)

    def forward(self, values: Tensor, condition: Tensor) -> Tensor:
        """Normalise (B, C, H, W) under a condition (B, D)."""
        values = self.norm(values)
        if self.affine is None:
            return values
        scale, shift = self.affine(condition)[..., None, None].chunk(2, dim=1)
        return values * (1 + scale) + shift


def _planes(condition: Tensor, like: Tensor) -> Tensor:
    """Repeat a condition (B, D) over the pixels of an image batch."""
    return condition[..., None, None].expand(-1, -1, *like.shape[2:])


def _full(values: Tensor) -> Tensor:
    """Return bfloat16 as float32, as losses are differences of nearly equal numbers."""
    return values.float() if values.dtype == torch.bfloat16 else values


def finished(code: Tensor, standard: nn.Module, spec: NetworkSpec) -> Tensor:
    """Return the code, (B, z), of what an encoder's last layer gives: standardised and scaled."""
    code = standard(_full(code))
    if not spec.spherical:
        return code
    scene = math.sqrt(spec.z_scene) * functional.normalize(code[:, : spec.z_scene], dim=1)
    return torch.cat([scene, code[:, spec.z_scene :]], dim=1)


class Encoder(nn.Module):
    """Image and camera -> latent code. Table "Pix2Shape encoder architecture"."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.spec = spec
        widths = spec.channels(ENCODER_CHANNELS)
        pairs = itertools.pairwise([3 + spec.planes + spec.condition, *widths])
        self.layers = nn.ModuleList(nn.Conv2d(a, b, 4, 2, 1) for a, b in pairs)
        self.norms = nn.ModuleList(ConditionalNorm(b, spec.condition) for b in widths[:-1])
        self.last = nn.Conv2d(widths[-1], spec.z, 4)
        self.standard = nn.BatchNorm1d(spec.z, affine=False) if spec.standardised else nn.Identity()
        self.activation = nn.LeakyReLU(SLOPE)

    def forward(self, image: Tensor, condition: Tensor, rays: Tensor | None = None) -> Tensor:
        """(B, 3, S, S), (B, D), and (B, RAY_PLANES, S, S) if it is told rays -> (B, z)."""
        beside = [] if rays is None else [contrast(image), rays]
        values = torch.cat([image, *beside, _planes(condition, image)], dim=1)
        for i, layer in enumerate(self.layers):
            values = layer(values)
            if i < len(self.norms):
                values = self.norms[i](values, condition)
            values = self.activation(values)
        return finished(self.last(values).flatten(1), self.standard, self.spec)


class Decoder(nn.Module):
    """Latent code and camera -> numbers per pixel. Table "Pix2Shape decoder architecture".

    Every other normalisation is conditional, beginning with the first. The table has one number per
    pixel. Where lights are inferred, a layer of its own finds their positions in the code.
    """

    def __init__(self, spec: NetworkSpec, outputs: int = 1, lights: int = 0) -> None:
        super().__init__()
        widths = spec.channels(DECODER_CHANNELS)
        first = nn.ConvTranspose2d(spec.z + spec.condition, widths[0], 4)
        others = [nn.ConvTranspose2d(a, b, 4, 2, 1) for a, b in itertools.pairwise(widths)]
        self.layers = nn.ModuleList([first, *others])
        self.norms = nn.ModuleList(
            ConditionalNorm(b, spec.condition if i % 2 == 0 else 0) for i, b in enumerate(widths)
        )
        self.last = nn.ConvTranspose2d(widths[-1], outputs, 4, 2, 1)
        with torch.no_grad():
            self.last.weight.mul_(FLAT)
        self.activation = nn.LeakyReLU(SLOPE)
        self.lights = nn.Linear(spec.z, 3 * lights) if lights else None

    def forward(self, code: Tensor, condition: Tensor) -> Tensor:
        """(B, z), (B, D) -> (B, outputs, S, S)."""
        values = torch.cat([code, condition], dim=1)[..., None, None]
        for layer, norm in zip(self.layers, self.norms, strict=True):
            values = self.activation(norm(layer(values), condition))
        with torch.autocast(values.device.type, enabled=False):  # bfloat16 is too coarse for depth
            return self.last(_full(values))

    def light_positions(self, code: Tensor) -> Tensor:
        """Return where lights are, world frame, scene units: (B, z) -> (B, lights, 3).

        They stay above the floor and before both walls, as a room whose lights all lie behind what
        they light is dark, and nothing would bring them back. Untrained, they are near (1, 1, 1).
        """
        assert self.lights is not None, "lights are an input"
        # Adam moves all weights of a sum at once, which would throw the lights about.
        place = _full(self.lights(code)).view(len(code), -1, 3) / math.sqrt(code.shape[1])
        return functional.softplus(math.log(math.e - 1) + place)


class Critic(nn.Module):
    """Image, latent code and camera -> score. Table "Pix2Shape critic architecture"."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        widths = spec.channels(ENCODER_CHANNELS)
        before = [3 + spec.condition, *widths[:-1]]
        before[-1] += spec.z  # the code enters the last strided layer
        self.layers = nn.ModuleList(
            nn.Conv2d(a, b, 4, 2, 1) for a, b in zip(before, widths, strict=True)
        )
        self.last = nn.Conv2d(widths[-1], 1, 4)
        self.activation = nn.LeakyReLU(SLOPE)

    def forward(self, image: Tensor, code: Tensor, condition: Tensor) -> Tensor:
        """(B, 3, S, S), (B, z), (B, D) -> (B,)."""
        values = torch.cat([image, _planes(condition, image)], dim=1)
        for i, layer in enumerate(self.layers):
            if i == len(self.layers) - 1:
                values = torch.cat([values, _planes(code, values)], dim=1)
            values = self.activation(layer(values))
        return _full(self.last(values).flatten())


class Statistics(nn.Module):
    """MINE's statistics network T(z_scene, z_view). Table "statistics network architecture"."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        first, second = STATISTICS_CHANNELS
        hidden = nn.Linear(spec.z, first), nn.ELU(), nn.Linear(first, second), nn.ELU()
        self.layers = nn.Sequential(*hidden, nn.Linear(second, 1))

    def forward(self, z_scene: Tensor, z_view: Tensor) -> Tensor:
        """(B, z_scene), (B, z_view) -> (B,)."""
        return _full(self.layers(torch.cat([z_scene, z_view], dim=1)).flatten())
