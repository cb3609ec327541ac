"""What counts as a contact and which z is meant: the choice that every panel shares."""

from __future__ import annotations

from dataclasses import dataclass

from granufab.fabric.coordination import ZDefinition, check_definition
from granufab.fabric.criterion import Criterion, select_contacts
from granufab.fabric.network import Network, select_network
from granufab.fabric.run_definitions import recorded_reach, run_definitions
from granufab.history import Run
from granufab.packing import Contacts, Packing

__all__ = ["Choice"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A criterion and a definition of z, as ``granufab measure`` applies them to a run.

    Attributes:
        criterion: which pairs are contacts.
        z_definition: whose contacts and grains the fabric counts.
        minimum: fewest contacts that hold a grain.
        reach: gap up to which every pair is listed [mean diameters], or None.
    """

    criterion: Criterion
    z_definition: ZDefinition
    minimum: int
    reach: float | None

    @classmethod
    def of(cls, run: Run, criterion: str | None, z_definition: str | None) -> Choice:
        """What ``granufab measure`` takes: the run's own criterion, ``z_backbone`` by default.

        Raises:
            InvalidSettings: an unknown criterion or definition.
            MissingData: the run has no frames.
        """
        definition = check_definition(z_definition or "z_backbone")
        rule, definition, minimum = run_definitions(run, criterion or None, definition)
        return cls(
            criterion=rule, z_definition=definition, minimum=minimum, reach=recorded_reach(run)
        )

    def contacts(self, packing: Packing) -> Contacts:
        """All contacts of the criterion.

        Raises:
            MissingData: the packing lacks what the criterion needs.
        """
        return select_contacts(packing, self.criterion, reach=self.reach)

    def network(self, packing: Packing) -> Network:
        """The contacts and grains that z counts.

        Raises:
            MissingData: the packing lacks what the criterion needs.
        """
        return select_network(
            packing,
            criterion=self.criterion,
            z_definition=self.z_definition,
            minimum=self.minimum,
            reach=self.reach,
        )
