"""Two numbers joined by a comma, as an option's value."""

import click


class Pair(click.ParamType[tuple[float, float]]):
    """`0.3,0.33` to (0.3, 0.33)."""

    name = "pair"

    def convert(
        self, value: str | tuple[float, float], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """Parse; a wrong value is a usage error."""
        if not isinstance(value, str):
            return value
        try:
            first, second = (float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not two numbers joined by a comma, as 0.3,0.33", param, ctx)
        return first, second


PAIR = Pair()
