"""Where this process finds what others made for pictures; it imports nothing that is large."""

from pathlib import Path


class Places:
    """A folder of materials and a picture of the surroundings; None where there are none."""

    def __init__(self) -> None:
        self.materials: Path | None = None
        self.environment: Path | None = None

    def use(self, materials: str | Path | None, environment: str | Path | None) -> None:
        """Use these from now on."""
        self.materials = None if materials is None else Path(materials)
        self.environment = None if environment is None else Path(environment)


ASSETS = Places()  # of the process, as every worker has its own
