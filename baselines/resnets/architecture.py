"""ResNets of any width (He et al. 2016, "Deep Residual Learning", Table 1), for small images.

The only change is that the features are averaged over whatever is left of the image, so that 64x64
and 128x128 pixels pass as 224x224 do in the original.
"""

from torch import Tensor, nn

DEPTHS = {18: (2, 2, 2, 2), 50: (3, 4, 6, 3)}  # layers -> blocks of each of the four stages
BOTTLENECKS_FROM = 50  # layers; smaller networks have blocks of two 3x3 convolutions


class ResNet(nn.Module):
    """Images, (B, 3, S, S), to features, (B, `features`)."""

    def __init__(self, depth: int = 50, width: int = 64) -> None:
        """Make the network; He's initial weights come from torch's generator.

        Args:
            depth: 18 or 50 layers.
            width: channels of the first stage, 64 in the original; each later stage has twice as
                many as the one before.
        """
        super().__init__()
        wider = 4 if depth >= BOTTLENECKS_FROM else 1
        layers: list[nn.Module] = [
            *_convolution(3, width, size=7, stride=2),
            nn.ReLU(inplace=True),
            nn.MaxPool2d(3, stride=2, padding=1),
        ]
        channels = width
        for stage, blocks in enumerate(DEPTHS[depth]):
            inner = width * 2**stage
            for block in range(blocks):
                stride = 2 if stage and not block else 1
                layers.append(_Block(channels, inner, wider, stride))
                channels = inner * wider
        self.features = channels
        self.layers = nn.Sequential(*layers)
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, images: Tensor) -> Tensor:
        """Return the features, averaged over the image."""
        return self.layers(images).mean(dim=(2, 3))


class _Block(nn.Module):
    """A residual block: two 3x3 convolutions, or 1x1, 3x3, 1x1 that widen the channels by four."""

    def __init__(self, channels: int, inner: int, wider: int, stride: int) -> None:
        super().__init__()
        if wider == 1:
            first = _convolution(channels, inner, 3, stride)
            last = _convolution(inner, inner, 3)
        else:
            middle = _convolution(inner, inner, 3, stride)
            first = [*_convolution(channels, inner, 1), nn.ReLU(inplace=True), *middle]
            last = _convolution(inner, inner * wider, 1)
        self.change = nn.Sequential(*first, nn.ReLU(inplace=True), *last)
        same = stride == 1 and channels == inner * wider
        short = [] if same else _convolution(channels, inner * wider, 1, stride)
        self.shortcut = nn.Sequential(*short)

    def forward(self, x: Tensor) -> Tensor:
        changed: Tensor = self.change(x) + self.shortcut(x)
        return changed.relu()


def _convolution(channels: int, out: int, size: int, stride: int = 1) -> list[nn.Module]:
    convolution = nn.Conv2d(channels, out, size, stride, padding=size // 2, bias=False)
    return [convolution, nn.BatchNorm2d(out)]
