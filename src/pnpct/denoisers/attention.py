"""Attention after CBAM: weights of the channels and of the pixels."""

from typing import Literal, TypeAlias

import torch
from jaxtyping import Float
from torch import Tensor, nn
from typing_extensions import override

Features: TypeAlias = Float[Tensor, "_ _ _ _"]
"""What a network works on inside: [batch, channels, rows, cols]."""

Attention: TypeAlias = Literal["local", "global"]
"""Where channel attention pools: in a window around each pixel, or over the whole image as in the original."""

_LEAST_HIDDEN = 4


class ConvolutionalAttention(nn.Module):
    """Channel attention, then spatial attention (CBAM).

    The original weighs the channels by their mean and maximum over the whole image. Both, and the maximum most
    of all, change with how much of the patient the image shows: a network trained on patches meets other
    weights in a full slice, one metal pixel changes every other pixel, and tiles differ from the whole. So
    the default takes the mean alone, in a window around each pixel:

        f ← f · σ(W₂ relu(W₁ mean_window f)),   then   f ← f · σ(7×7 ∗ [mean over channels, max over channels]).

    The window ends where the image ends: the mean is over the part inside.

    Args:
        channels: Channels of the features, at least 1.
        window: Side of the window in pixels of the features, odd; for "local".
        attention: "local" as above; "global" is the original: σ(M(mean over the image) + M(max over the
            image)) with M = W₂ relu(W₁ ·) for the channels.

    References:
        Woo, Park, Lee and Kweon, ECCV 2018.
    """

    def __init__(self, channels: int, *, window: int, attention: Attention = "local") -> None:
        super().__init__()
        hidden = max(_LEAST_HIDDEN, channels // 16)
        self.window, self.attention = window, attention
        self.squeeze = nn.Conv2d(channels, hidden, 1)
        self.excite = nn.Conv2d(hidden, channels, 1)
        self.spatial = nn.Conv2d(2, 1, 7, padding=3)

    @override
    def forward(self, features: Features) -> Features:
        """Return the features, each channel and pixel weighed by a number between 0 and 1."""
        features = features * torch.sigmoid(self._channel_scores(features))
        pooled = torch.cat([features.mean(dim=1, keepdim=True), features.amax(dim=1, keepdim=True)], dim=1)
        return features * torch.sigmoid(self.spatial(pooled))

    def _channel_scores(self, features: Features) -> Features:
        scores: Features
        if self.attention == "local":
            # The mean and W₁ commute; few channels are faster to average than many.
            scores = self.excite(torch.relu(_window_mean(self.squeeze(features), self.window)))
        else:
            scores = self.excite(torch.relu(self.squeeze(features.mean(dim=(2, 3), keepdim=True))))
            scores = scores + self.excite(torch.relu(self.squeeze(features.amax(dim=(2, 3), keepdim=True))))
        return scores


def _window_mean(features: Features, window: int) -> Features:
    # Products with two narrow-banded matrices: on patches ten times faster than pooling.
    over_rows, over_cols = (_means_of_neighbours(length, window, features) for length in features.shape[-2:])
    return over_rows @ features @ over_cols.mT


def _means_of_neighbours(length: int, window: int, like: Tensor) -> Float[Tensor, "length length"]:
    position = torch.arange(length, device=like.device)
    near = ((position[:, None] - position).abs() <= window // 2).to(like.dtype)
    return near / near.sum(dim=1, keepdim=True)
