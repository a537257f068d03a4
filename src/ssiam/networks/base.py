"""The base class of the Siamese networks: a piece for the template, and one for the search crop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from torch import Tensor, nn

__all__ = ["SiameseNetwork"]


class SiameseNetwork(nn.Module, ABC):
    """A network that compares search crops with a template.

    Threads: inference may run in any number at once, training in one.

    Attributes
    ----------
    template_shape, search_shape : tuple of int
        Shapes (N, 3, S, S) of the crops: float32 in 0..255, not normalized.
    kernel_names, response_names : tuple of str
        Names of the tensors that `template` and `search` return.
    """

    template_shape: tuple[int, ...] = (1, 3, 127, 127)
    search_shape: tuple[int, ...] = (1, 3, 255, 255)
    kernel_names: tuple[str, ...]
    response_names: tuple[str, ...]

    @abstractmethod
    def template(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Kernels of a template crop (N, 3, 127, 127), computed once per target."""

    @abstractmethod
    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, ...]:
        """Responses of a search crop to the kernels of a template.

        Parameters
        ----------
        crop : Tensor
            (N, 3, S, S), of `search_shape`.
        kernels : sequence of Tensor
            The output of `template`.
        sliced : bool
            Compute correlations as sums of slices, for export; see `ssiam.networks.correlation`.
        """

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, ...]:
        """Responses of a search crop to a template crop."""
        return self.search(search, self.template(template))
