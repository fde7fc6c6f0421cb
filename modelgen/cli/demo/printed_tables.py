"""Tables 1 and 2 of Pham, Poignet and Gautier (ICRA 2002), as printed.

The values themselves are the parameter sets `table_1` and `table_2` of the chain emps300.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class PrintedTable:
    """What a table prints next to the values.

    Attributes
    ----------
    number : int
        Of the table; the figure that compares its model with the bench has number + 2.
    parameter_set, sensor_set : str
        Of emps300: its values, and the sensors it was identified with.
    cutoff_rad_s : float
        omega_H, the paper's cut-off of the position filter.
    deviations : mapping of str to (float, float)
        Two standard deviations (SI), and the relative standard deviation in %.
    """

    number: int
    parameter_set: str
    sensor_set: str
    cutoff_rad_s: float
    deviations: Mapping[str, tuple[float, float]]


PRINTED_TABLES = (
    PrintedTable(
        1,
        "table_1",
        "qm_qc",
        1443.0,
        {
            "J_m": (2.98e-8, 0.1510),
            "F_vm": (1.29e-6, 1.1419),
            "F_sm": (9.47e-5, 1.3125),
            "J_c": (3.82e-8, 2.6959),
            "F_vmc": (2.54e-5, 0.5495),
            "K": (1.39e-2, 2.3424),
        },
    ),
    PrintedTable(
        2,
        "table_2",
        "qm_ac",
        1394.0,
        {
            "J_m": (7.73e-8, 0.4184),
            "F_vm": (1.77e-6, 2.2844),
            "F_sm": (1.35e-4, 1.0839),
            "J_c": (5.46e-8, 4.0356),
            "F_vmc": (3.27e-5, 3.3644),
            "K": (3.40e-2, 4.4696),
        },
    ),
)
