"""What turns phones into control curves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

if TYPE_CHECKING:
    from animeme.curves import CurveSet
    from animeme.dataset import Dataset, Listener
    from animeme.findings import Finding
    from animeme.phones import PhoneTrack


class Model(Protocol):
    """Turns phones into control curves; knows nothing of rigs, files or audio.

    A model whose data people edit may also have a class attribute ``reads``, the kind of document
    that holds them, and a class method ``from_file(path)`` that gives the model which plays one.
    """

    name: ClassVar[str]

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the curves that `synthesize` returns."""
        ...

    @classmethod
    def default(cls) -> Self:
        """The model as shipped, without training.

        Raises:
            InputError: this model works only when fitted.
        """
        ...

    @classmethod
    def configured(cls, options: Mapping[str, Any]) -> Self:
        """The model with these options, ready to be fitted.

        Args:
            options: name → value, or its text, as ``--set`` gives it.

        Raises:
            InputError: an option is unknown, or a value makes no sense.
        """
        ...

    def fit(self, dataset: Dataset, *, listener: Listener = ...) -> Self:
        """A new model with the same options, fitted to captured motion.

        The same dataset gives the same model, to the last bit. Where values are missing (NaN) the
        model learns from the rest.

        Raises:
            InputError: there is nothing to learn from.
        """
        ...

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Rebuild a model from an ``animeme.model`` document.

        Raises:
            ValueError: the document does not fit this model.
        """
        ...

    def to_document(self) -> dict[str, Any]:
        """JSON-safe ``animeme.model`` document that rebuilds this model bit-exactly."""
        ...

    def synthesize(self, track: PhoneTrack, *, rate_hz: float) -> CurveSet:
        """Curves over the whole track, sampled at `rate_hz` and wherever the model needs a key."""
        ...

    def remarks(self, track: PhoneTrack) -> Iterable[Finding]:
        """What a person should know about the motion of `track`: phones never seen, for one."""
        ...
