"""The contact network: what an engine gets wrong at each contact, and nothing else.

What must be zero is zero by construction: a body that nothing can touch, or that
nothing moves towards, moves as in the engine. The residual of a body is the mean over
its contacts of what a network finds for each alone, so that two disks are enough to
train it for many. (In the paper f_dyn is a nonlinear function of the sum.)
"""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from sainet.models.contacts import ContactFeatures, Contacts, from_contact
from sainet.models.correctors.held import unroll_held
from sainet.models.correctors.network import (
    AbstractNetwork,
    Layers,
    Scales,
    like,
    silenced,
    standardise,
    unit_scales,
)
from sainet.models.features import Signs
from sainet.models.inputs import Moment
from sainet.models.integrators import RelaxingResidual

WIDTHS = (128, 64, 32)
HOLD = 8  # steps
_OUT = np.array([1, -1, -1])  # signs of a mirrored residual


class ContactNetwork(AbstractNetwork):
    """Predicts the residual of an engine for any number of bodies.

    It adds to the engine's motion and is zero until it is trained. A mirrored contact
    has the mirrored residual.
    """

    rel: Layers  # of contacts between disks
    dyn: Layers  # of contacts with the pusher
    scales: Scales
    features: ContactFeatures = eqx.field(static=True)
    time_step: float = eqx.field(static=True)  # s
    integrator: RelaxingResidual = eqx.field(static=True)
    hold: int = eqx.field(static=True)  # steps over which the residual is held

    def __init__(
        self,
        features: ContactFeatures,
        *,
        key: PRNGKeyArray,
        scales: Scales | None = None,
        hold: int = HOLD,
    ) -> None:
        """Make an untrained network.

        Args:
            features: its inputs.
            key: draws the weights.
            scales: of its inputs and outputs; None is 1.
            hold: steps over which the residual is held.
        """
        rel_key, dyn_key = jax.random.split(key)
        self.rel = silenced(Layers((features.pair_size, *WIDTHS, 3), key=rel_key))
        self.dyn = silenced(Layers((features.body_size, *WIDTHS, 3), key=dyn_key))
        self.scales = scales or unit_scales(features)
        self.features = features
        self.time_step = features.time_step
        self.integrator, self.hold = RelaxingResidual(), hold

    def held(self, hold: int) -> "ContactNetwork":
        """Return the network with another hold (steps)."""
        other = ContactNetwork(self.features, key=jax.random.key(0), hold=hold)
        parts = lambda n: (n.rel, n.dyn, n.scales)  # noqa: E731
        return eqx.tree_at(parts, other, parts(self))

    @property
    def trained(self) -> tuple[Layers, ...]:
        """Those of both kinds of contacts."""
        return self.rel, self.dyn

    @property
    def unroll(self) -> Callable[..., Array]:
        """The zero-order hold, in training and in prediction alike."""
        return partial(unroll_held, hold=self.hold)

    def acceleration(self, moment: Moment) -> Float[Array, "3 body push"]:
        """Return the residual of each body: the mean over contacts that act."""
        features, scales = self.features, self.scales
        contacts = features.with_pusher(moment)
        spread = scales.body_mean, scales.body_deviation
        total = _residual(self.dyn, contacts, spread, features.body_signs)
        acting = contacts.acts
        if moment.shape[0] > 1:
            contacts = features.between_disks(moment)
            spread = scales.pair_mean, scales.pair_deviation
            each = _residual(self.rel, contacts, spread, features.pair_signs)
            total = total + jnp.sum(each, axis=1)
            acting = acting + jnp.sum(contacts.acts, axis=0)
        total = total / jnp.maximum(acting, 1.0)[None]
        return total * like(scales.acceleration, total)


def _residual(
    layers: Layers, contacts: Contacts, spread: tuple[Array, Array], signs: Signs
) -> Float[Array, "3 *contact"]:
    """Return the residuals of contacts, in the push frame."""
    given = contacts.inputs
    mirrored = given * like(jnp.asarray(signs, given.dtype), given)
    one, other = (layers(standardise(x, *spread)) for x in (given, mirrored))
    found = 0.5 * (one + like(jnp.asarray(_OUT, one.dtype), one) * other)
    return from_contact(found, contacts.normal) * contacts.acts[None]
