"""The robot whose links could be built, beside the unconstrained one."""

from rich.table import Table

from impid_host.impedance.identify import RobotFit
from impid_host.impedance.physical import PhysicalRobot
from impid_host.report.fit_tables import judged_on, plus_minus


def physical_table(fit: RobotFit, robot: PhysicalRobot) -> Table:
    """Parameters of both; a physical one outside the interval is where the data ask for the impossible."""
    names, units = fit.parameters.structure.parameter_names, fit.parameters.structure.parameter_units
    estimate = fit.estimate
    free = dict(zip(estimate.names, zip(estimate.value, estimate.ci95, strict=True), strict=True))
    masses = ", ".join(f"{link[0]:.3g}" for link in robot.links)
    table = Table(
        title="Robot with inertias that a body can have",
        title_justify="left",
        caption=(
            f"links' masses: {masses} kg, one set of many that move alike; "
            f"the fitted rows' residual is {robot.worse_percent:.1f} % larger than the least"
        ),
        caption_justify="left",
    )
    table.add_column("parameter", overflow="fold")
    for heading in ("unconstrained\n(+- 95 %)", "possible"):
        table.add_column(heading, justify="right", overflow="fold")
    table.add_column("unit", overflow="fold")
    for name, unit, value in zip(names, units, robot.value, strict=True):
        own = plus_minus(*free[name]) if name in free else "open"
        table.add_row(name, own, f"{value:.4g}", unit)
    for joint, before, after in zip(fit.joints, fit.vaf, robot.vaf, strict=True):
        table.add_row(f"VAF tau{joint + 1}, {judged_on(fit)}", f"{before:.2f}", f"{after:.2f}", "%")
    return table
